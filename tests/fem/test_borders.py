"""What is given wrongly is named in one line, and what is changed afterwards changes nothing."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import AutophyxError, ConvergenceError, InputError, UsageError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scenarios import drop, hang, poke, sag, squeeze, wind
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import DynamicMethod, Dynamics
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.nonlinear import solve_nonlinear
from autophyx_tet.fem.solve.statics import solve_static

from .bodies import faces_at, shaken_box, with_uniform

DOWN = (0.0, 0.0, -9.81)


@pytest.fixture
def bar():
    return shaken_box((1, 0.2, 0.2), (4, 1, 1), E=1e6, nu=0.3, rho=1000, amount=0)


@pytest.fixture
def held(bar):
    return Supports.clamp(len(bar.points), bar.points[:, 0] == 0)


def test_arrays_of_a_mesh_are_its_own():
    """Points changed in place make a new answer of a new mesh, and none of the old one."""
    points = box_mesh((1, 0.2, 0.2), (4, 1, 1)).points.copy()
    tets = box_mesh((1, 0.2, 0.2), (4, 1, 1)).tets
    answers = []
    for _ in range(2):
        mesh = with_uniform(TetMesh.oriented(points, tets), E=1e6, nu=0.3, rho=1000)
        clamp = Supports.clamp(len(points), points[:, 0] == 0)
        solve = lambda m=mesh, c=clamp: solve_static(m, c, gravity_vector=DOWN)  # noqa: E731
        answers.append(np.abs(solve().displacement).max())
        points[:, 0] *= 0.5
        assert np.abs(solve().displacement).max() == answers[-1]
    assert answers[1] < 0.2 * answers[0]  # half as long: a sixteenth in bending
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0] = 0.0


def test_a_frozen_array_is_not_copied_again(bar):
    """Materials come and go on the same tets: what is known of these is kept."""
    assert bar.with_material(None).points is bar.points


def test_force_of_every_plate():
    """Two plates press alike against each other: together they do nothing, each presses."""
    mesh = shaken_box((0.1,) * 3, (2, 2, 2), E=1e5, nu=0.0, rho=1000, amount=0)
    last = squeeze(mesh, share=0.05, friction=0.0, frames=10).frames[-1]
    left, right = last.obstacle_force[:, 0]
    assert left == pytest.approx(1e5 * 0.01 * 0.05, rel=0.1)  # E A strain; the plates start apart
    assert right == pytest.approx(-left, rel=1e-2)  # at rest but for the tolerance of a step
    assert last.obstacle_force.sum(axis=0) == pytest.approx(last.contact_force.sum(axis=0))


def test_wrong_arrays_are_named(bar, held):
    """A scalar is no vector, and rows stand for points or nodes."""
    wrong = [
        ("gravity_vector 9.81", {"gravity_vector": np.array(9.81)}),
        ("gravity_vector", {"gravity_vector": (0, 0, np.nan)}),
        (r"forces of shape \(3, 3\)", {"forces": np.ones((3, 3))}),
        (r"forces of shape \(20,\)", {"forces": np.ones(len(bar.points))}),
        ("at 0", {"forces": np.full((len(bar.points), 3), np.inf)}),
    ]
    for match, options in wrong:
        for solve in (solve_static, solve_nonlinear):
            with pytest.raises(InputError, match=match):
                solve(bar, held, **options)
        with pytest.raises(InputError, match=match):
            Dynamics(bar, supports=held, **options)
    with pytest.raises(InputError, match="traction 3"):
        solve_static(bar, held, traction=Traction(faces_at(bar, 0, 1.0), np.array(3.0)))
    with pytest.raises(InputError, match=r"velocity of shape \(2, 3\)"):
        Dynamics(bar, velocity=np.ones((2, 3)))
    with pytest.raises(InputError, match="velocity"):
        Dynamics(bar, velocity=np.array(1.0))


def test_wrong_numbers_are_named(bar, held):
    wrong = [
        ("poke at", lambda: poke(bar, at=(0, 0, np.nan))),
        ("poke direction", lambda: poke(bar, direction=(0, 0, 0))),
        ("poke force", lambda: poke(bar, force=np.nan)),
        ("wind speed", lambda: wind(bar, speed=-1.0)),
        ("supports 'bass'", lambda: sag(bar, supports="bass")),
        ("gravity -9.81", lambda: sag(bar, gravity=-9.81)),
        ("gravity nan", lambda: hang(bar, gravity=np.nan)),
        ("gravity 0", lambda: drop(bar, gravity=0.0)),
        ("friction -1", lambda: drop(bar, friction=-1.0)),
        ("dt -0.01", lambda: Dynamics(bar, supports=held).step(-0.01)),
        ("dt nan", lambda: Dynamics(bar, supports=held).step(np.nan)),
        ("steps 0", lambda: Dynamics(bar, supports=held).run(0.01, 0)),
        ("duration 0", lambda: DynamicMethod().solve(Scene(mesh=bar, duration=0.0))),
        ("frames 0", lambda: DynamicMethod().solve(Scene(mesh=bar, frames=0))),
        ("modes 0", lambda: natural_modes(bar, 0)),
    ]
    for match, call in wrong:
        with pytest.raises(AutophyxError, match=match):
            call()
    with pytest.raises(UsageError, match="nothing acts on the body"):
        sag(bar, gravity=0.0)


def test_one_held_point_is_no_support(bar):
    """It turns about the point: said at once, whatever the law."""
    one = Supports.clamp(len(bar.points), [0])
    for solve in (solve_static, solve_nonlinear):
        with pytest.raises(ConvergenceError, match="move freely"):
            solve(bar, one, gravity_vector=DOWN)


@pytest.mark.parametrize("thickness", [1e-3, 1e-4])
def test_a_slab_is_right_or_refused(thickness):
    """A cantilever of aspect 1,000 sinks as rho g L^4 / (8 E t^2 / 12); at 10,000 fp64 is out."""
    mesh = with_uniform(box_mesh((1, 1, thickness), (20, 1, 1)), E=2e11, nu=0.0, rho=7800)
    clamp = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    beam = 7800 * 9.81 / (8 * 2e11 * thickness**2 / 12)
    if thickness < 5e-4:
        with pytest.raises(ConvergenceError, match="too thin for its length"):
            solve_static(mesh, clamp, gravity_vector=DOWN, order=2)
        return
    sunk = solve_static(mesh, clamp, gravity_vector=DOWN, order=2).displacement[:, 2].min()
    assert -sunk == pytest.approx(beam, rel=0.01)  # one cell across, and the slab's own width


def test_one_default_order(bar, held):
    """Quadratic elements while they are affordable, in Python as on the command line."""
    assert solve_static(bar, held, gravity_vector=DOWN).order == 2
    assert solve_nonlinear(bar, held, gravity_vector=DOWN).order == 2
    for scenario in (sag, hang, wind, poke):
        assert scenario(bar).static.order == 2
