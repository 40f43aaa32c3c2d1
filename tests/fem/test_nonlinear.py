"""Equilibrium under large deformation: closed forms, recovery from inversion."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise
from autophyx_tet.fem.elements.elastic import displacement_gradients
from autophyx_tet.fem.elements.space import EDGES
from autophyx_tet.fem.errors import ConvergenceError
from autophyx_tet.fem.laws.law import LAWS
from autophyx_tet.fem.material import lame_parameters
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scenarios import sag
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.obstacles import Plane
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.nonlinear import solve_nonlinear
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.toolkit.verdict.checks import holds_shape

from .bodies import faces_at, shaken_box, symmetry_planes, with_uniform

FINITE = pytest.mark.parametrize("law", [name for name in LAWS if LAWS[name].finite])
ORDERS = pytest.mark.parametrize("order", [1, 2])


def test_uniaxial_stress():
    """Neo-Hookean bar with free sides, E = 1e5, nu = .4: P11 in closed form, by Newton."""
    mesh = shaken_box((1, 1, 1), (2, 2, 2), E=1e5, nu=0.4)
    lam, mu = lame_parameters(1e5, 0.4)
    for stretch, stress in (
        (0.5, -96428.571), (0.9, -10969.038), (1.5, 36640.2116), (2.0, 61607.1429),
    ):  # fmt: skip
        held = symmetry_planes(mesh.points).with_fixed(mesh.points[:, 0] == 1, 0, stretch - 1)
        result = solve_nonlinear(mesh, held, order=1)
        side2 = (1 + mu / (lam + mu) - mu / ((lam + mu) * stretch)) / stretch
        assert mu * (stretch - side2 / stretch) == pytest.approx(stress, rel=1e-7), stretch
        pull = result.reaction[mesh.points[:, 0] == 1, 0].sum()
        assert pull == pytest.approx(stress, rel=1e-7), stretch
        cauchy = result.stress[:, 0, 0] * side2
        assert cauchy == pytest.approx(np.full(len(mesh.tets), stress), 1e-6), stretch


@FINITE
def test_inverted_start_recovers(law):
    """From a start turned inside out Newton finds the rest state again."""
    mesh = shaken_box(cells=(2, 2, 2), E=1e4, nu=0.4)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    start = np.zeros_like(mesh.points)
    start[:, 2] = -1.6 * mesh.points[:, 2]  # z -> -0.6 z
    options = {"law": law, "order": 1, "start": start}
    result = solve_nonlinear(mesh, held, **options, gravity_vector=(0, 0, -1e-6))
    assert np.abs(result.displacement).max() < 1e-6


@FINITE
@ORDERS
def test_small_load_equals_linear(law, order):
    """Under a small load all laws move alike."""
    mesh = with_uniform(box_mesh((1, 0.2, 0.2), (6, 2, 2)), E=1e6, nu=0.3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    load = Traction(faces_at(mesh, 0, 1), np.array([0, 0, -1.0]))
    one = solve_static(mesh, held, traction=load, order=order)
    two = solve_nonlinear(mesh, held, traction=load, order=order, law=law)
    scale = np.abs(one.displacement).max()
    assert two.displacement == pytest.approx(one.displacement, abs=1e-3 * scale)


def test_elastica():
    """A slender cantilever under P L^2 / EI = 2: tip sinks 0.4935 L and comes in by 0.1606 L.

    Bisshopp & Drucker (1945); nu = 0 for beam theory.
    """
    L, h, E = 1.0, 0.05, 1e8
    mesh = with_uniform(box_mesh((L, h, h), (40, 1, 2)), E=E, nu=0.0)
    P = 2 * E * h**4 / 12 / L**2
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    load = Traction(faces_at(mesh, 0, L), np.array([0, 0, -P / h**2]))
    result = solve_nonlinear(mesh, held, traction=load, order=2)
    tip = result.displacement[mesh.points[:, 0] == L].mean(axis=0)
    assert tip == pytest.approx([-0.1606 * L, 0, -0.4935 * L], abs=0.02 * L)


def _volume_ratios(result):
    """J at ten places of every tet: corners, middles of edges."""
    where = np.concatenate([np.eye(4), (np.eye(4)[EDGES[:, 0]] + np.eye(4)[EDGES[:, 1]]) / 2])
    grid = discretise(result.mesh, result.order)
    H = displacement_gradients(grid, result.node_displacement, where)
    return np.linalg.det(np.eye(3) + H)


def soft_column(E, cells):
    return shaken_box((0.2, 0.2, 1.0), cells, E=E, nu=0.3, rho=1000, amount=0)


@pytest.mark.slow
def test_a_soft_column_lies_on_the_ground():
    """E = 2e4 Pa stands a twentieth of its weight: it bends over and lies, above the ground.

    Clamp and ground carry its weight together, and no tet is inside out.
    """
    mesh = soft_column(2e4, (2, 2, 8))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    ground = Plane((0.0, 0.0, -1e-3))
    options = {"gravity_vector": (0, 0, -9.81), "order": 1, "obstacles": [ground]}
    result = solve_nonlinear(mesh, held, **options)
    lies = mesh.points + result.displacement
    assert lies[:, 2].min() > -1e-3
    assert lies[:, 2].max() < 0.3
    assert np.ptp(lies[:, :2], axis=0).max() > 0.5
    assert _volume_ratios(result).min() > 0
    assert result.residual < 1e-8
    assert result.reaction[:, 2].sum() < 0.9 * mesh.mass * 9.81


@pytest.mark.slow
def test_quadratic_elements_of_a_collapse_are_never_inside_out():
    """The column of quadratic tets lies whole above the ground, or no rest is told."""
    result = sag(soft_column(2e4, (2, 2, 8)), order=2)
    if result.trusted:
        assert _volume_ratios(result.static).min() > 0
        assert (soft_column(2e4, (2, 2, 8)).points + result.displacement)[:, 2].min() > -1e-2
    else:  # what relaxation ends in is refused, and the linear answer is not called a rest
        assert result.static.law == "linear"
        assert any("no rest was found" in said for said in result.warnings)
        assert "was not found" in holds_shape(result).sentence


def test_what_is_inside_out_is_no_answer():
    """A start turned inside out under a force that holds it there is refused, with the count."""
    mesh = soft_column(1e4, (1, 1, 2))
    low, high = mesh.points[:, 2] == 0, mesh.points[:, 2] == 1
    held = Supports.clamp(len(mesh.points), low).with_fixed(high, (0, 1, 2), np.array([0, 0, -1.2]))
    with pytest.raises(ConvergenceError, match="inside out"):
        solve_nonlinear(mesh, held, order=1)


def test_a_collapse_is_not_called_a_rest(monkeypatch):
    """Where Newton stops and relaxation would take too long, that is said, not "no rest exists"."""
    monkeypatch.setattr("autophyx_tet.fem.solve.equilibrium.RELAXED", 0)
    result = sag(soft_column(3e4, (2, 2, 8)), order=1)
    assert any("no rest was found" in w for w in result.warnings)
    assert not any("exists" in w for w in result.warnings)
    assert not result.trusted
    assert "was not found" in holds_shape(result).sentence
