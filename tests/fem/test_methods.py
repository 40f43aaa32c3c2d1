"""The seam of methods: a scene knows no method, and every method takes a scene."""

import subprocess
import sys

import numpy as np
import pytest
from autophyx_tet.fem import LAWS, METHODS, SCENARIOS, Scene, sag
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.obstacles import Plane
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.method import Method
from autophyx_tet.fem.solve.result import Modes, MotionResult, SagResult

from .bodies import faces_at, shaken_box

ANSWERS = {"statics": SagResult, "dynamics": MotionResult, "modal": Modes, "mpm": MotionResult,
           "spring": MotionResult, "lbs": MotionResult}  # fmt: skip


@pytest.fixture
def bar():
    """A bar clamped at its left end, drawn by 100 Pa at its right end."""
    mesh = shaken_box((1, 0.2, 0.2), (5, 1, 1), E=1e6, nu=0.0, rho=1000, amount=0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    load = Traction(faces_at(mesh, 0, 1), np.array([100.0, 0, 0]))
    return Scene(
        mesh=mesh, supports=held, tractions=(load,), duration=0.1, frames=10, modes=2, up="x"
    )


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n == "mpm" else n for n in METHODS.names]
)
def test_every_method_answers_a_scene(bar, name):
    """With one of the three kinds of result, by the laws that it names."""
    method = METHODS[name]
    assert isinstance(method, Method)
    assert set(method.laws) <= set(LAWS)
    heard = []
    # Springs have neither laws nor elements, particles no elements.
    elements = {"order": 1} if method.laws and name != "mpm" else {}
    result = method.solve(bar, **elements, progress=lambda *frame: heard.append(frame))
    assert isinstance(result, ANSWERS[name])
    if isinstance(result, MotionResult):
        assert heard == [(k, 10) for k in range(1, 11)]


def test_a_traction_means_the_same_at_rest_and_in_motion(bar):
    """u = s L / E at rest; a load put on at once swings about that, as far as twice (nu = 0)."""
    exact = 100.0 / 1e6
    still = METHODS["statics"].solve(bar)
    assert still.displacement[:, 0].max() == pytest.approx(exact, rel=1e-6)
    moving = METHODS["dynamics"].solve(bar, law="linear").displacements[:, :, 0].max(axis=1)
    assert moving[1:].mean() == pytest.approx(exact, rel=0.2)


def test_a_velocity_of_every_point_reaches_the_quadratic_nodes():
    """A free body keeps its momentum: lumped P2 masses times the velocities between the points."""
    mesh = shaken_box(E=1e4, rho=1e3)
    v = np.tile([1.0, 0.0, 0.0], (len(mesh.points), 1))
    scene = Scene(mesh=mesh, velocity=v, duration=0.01, frames=2)
    last = METHODS["dynamics"].solve(scene, order=2).frames[-1]
    assert last.v == pytest.approx(np.tile(v[0], (len(last.v), 1)), abs=1e-9)


def test_statics_refuses_what_moves(bar):
    """Not an answer without the obstacle: a sentence."""
    with pytest.raises(UsageError, match="solve by dynamics"):
        METHODS["statics"].solve(Scene(mesh=bar.mesh, obstacles=(Plane(),)))


def test_a_scenario_is_a_scene_and_a_method():
    """``sag`` is nothing but its scene given to its method."""
    mesh = shaken_box((0.1, 0.1, 0.3), (2, 2, 4), E=1e6, nu=0.3, rho=1000)
    for name in SCENARIOS:
        scenario = SCENARIOS[name]()
        assert scenario.method in METHODS
        assert scenario.scene(mesh, up="x").up == "x", name
    scene = SCENARIOS["sag"](gravity=3.0).scene(mesh)
    one, two = METHODS["statics"].solve(scene), sag(mesh, gravity=3.0)
    assert one.displacement == pytest.approx(two.displacement, abs=0)
    assert scene.gravity_vector == pytest.approx([0, 0, -3.0])


def test_the_registries_load_nothing():
    """What the command line lists for its help: names, without numpy, scipy or warp."""
    code = "import sys; from autophyx_tet.fem import LAWS, METHODS, SCENARIOS; "
    code += "print(*LAWS, *METHODS, *SCENARIOS, *({'numpy', 'scipy', 'warp'} & {*sys.modules}))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == [*LAWS, *METHODS, *SCENARIOS]
