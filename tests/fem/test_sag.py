"""The sag scenario: supports found from the geometry, loose pieces held and said."""

import numpy as np
import pytest
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scenarios import sag
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.toolkit.verdict.checks import attached

from .bodies import shaken_box, with_uniform


def _join(*meshes):
    """One mesh of several, no points shared."""
    starts = np.cumsum([0, *[len(m.points) for m in meshes]])
    points = np.concatenate([m.points for m in meshes])
    tets = np.concatenate([m.tets + s for m, s in zip(meshes, starts, strict=False)])
    material = ElementMaterial.uniform(len(tets), E=1e6, nu=0.3, rho=1000)
    return TetMesh.oriented(points, tets, material=material)


def test_column_shortens_under_its_weight():
    """A standing bar with nu = 0: top sinks rho g l^2 / 2E; the sag ratio is that over l."""
    mesh = shaken_box((0.1, 0.1, 1.0), (1, 1, 20), E=1e6, nu=0.0, rho=1000, amount=0)
    result = sag(mesh, up="z", order=2)
    assert result.sag_ratio == pytest.approx(1000 * 9.81 / 2e6, rel=1e-6)
    assert result.height == 1.0
    assert not result.warnings
    assert result.von_mises.max() == pytest.approx(1000 * 9.81 * 0.975, rel=0.03)


def test_up_axis():
    """The same column lying along another axis gives the same answer."""
    for axis, up in enumerate("xyz"):
        size, cells = [0.1] * 3, [1] * 3
        size[axis], cells[axis] = 1.0, 20
        mesh = shaken_box(tuple(size), tuple(cells), E=1e6, nu=0.0, rho=1000, amount=0)
        ratio = sag(mesh, up=up, order=2).sag_ratio
        assert ratio == pytest.approx(1000 * 9.81 / 2e6, rel=1e-6), up


def test_three_point_rest_carries_the_weight():
    """The reactions of a three-point rest are vertical and sum to m g, by the linear law."""
    mesh = shaken_box((1, 1, 0.5), (4, 4, 2), E=1e6, rho=1000)
    result = sag(mesh, supports="three-point", order=2, law=Law.LINEAR)
    assert result.supported.sum() == 3
    assert result.static.reaction.sum(axis=0) == pytest.approx([0, 0, mesh.mass * 9.81], abs=1e-5)
    assert np.abs(result.static.reaction[:, :2]).max() < 1e-5


def test_loose_pieces_are_held_and_said():
    """A box floating above another one neither flies away nor goes unmentioned."""
    low, high = box_mesh((1, 1, 1), (2, 2, 2)), box_mesh((1, 1, 1), (3, 3, 3), lo=(0, 0, 3))
    alone = sag(_join(low)).max_displacement
    result = sag(_join(low, high))
    assert len(result.warnings) == 1
    assert "50.0% of the volume" in result.warnings[0]
    assert result.max_displacement < 2 * alone
    assert result.assumed == pytest.approx(0.5)
    (verdict,) = attached(result)
    assert verdict.outcome == "failed", "that it stays where it floats is assumed, not found"
    assert "50 % of its volume" in verdict.sentence
    assert attached(sag(_join(low))) == ()


def test_hinge_is_held_and_said():
    """Two boxes that share one corner only: the upper one could swing, so it is held."""
    mesh = _join(box_mesh((1, 1, 1), (2, 2, 2)), box_mesh((1, 1, 1), (2, 2, 2), lo=(1, 1, 1)))
    corner = np.flatnonzero((mesh.points == 1).all(axis=1))
    tets = mesh.tets.copy()
    tets[tets == corner[1]] = corner[0]
    hinged = TetMesh(mesh.points, tets, mesh.region, material=mesh.material)
    result = sag(hinged)
    assert len(result.warnings) == 1
    assert result.sag_ratio < 0.1


def test_one_tet():
    """A single tet standing on a face only shortens; it solves and stays finite."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    material = ElementMaterial.uniform(1, E=1e6, nu=0.3, rho=1000)
    result = sag(TetMesh.oriented(points, [[0, 1, 2, 3]], material=material))
    assert 0 < result.sag_ratio < 0.01


def test_tet_on_its_corner():
    """Standing on one corner the support grows until it holds the body."""
    points = np.array([[0, 0, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1.2]])
    material = ElementMaterial.uniform(1, E=1e6, nu=0.3, rho=1000)
    result = sag(TetMesh.oriented(points, [[0, 1, 2, 3]], material=material))
    assert np.isfinite(result.max_displacement)


@pytest.mark.slow
def test_error_is_the_difference_of_the_orders():
    """The reported error of a P1 answer is its distance from the P2 answer, and shrinks with h."""
    errors = []
    for n in (2, 4):
        mesh = shaken_box((1.0, 0.25, 0.25), (4 * n, n, n), E=1e7, rho=1000, amount=0)
        one, two = (sag(mesh, up="x", order=order) for order in (1, 2))
        distance = abs(one.max_displacement - two.max_displacement) / two.max_displacement
        assert one.discretisation_error.kind == "P1/P2"
        assert one.discretisation_error.value == pytest.approx(distance, rel=1e-9)
        errors.append(one.discretisation_error.value)
    assert errors[1] < errors[0]


def test_what_cannot_be_estimated_is_not(monkeypatch):
    """Linear elements alone do not tell their error."""
    mesh = shaken_box((1.0, 0.2, 0.2), (20, 4, 4), E=1e7, rho=1000, amount=0)
    monkeypatch.setattr("autophyx_tet.fem.elements.space.LARGEST_P2", 0)
    error = sag(mesh, up="z").discretisation_error
    assert np.isnan(error.value)
    assert "linear elements were taken" in error.why


@pytest.mark.slow
def test_soft_body_is_repeated_nonlinearly():
    """Strains above 5 % are computed with the neo-Hookean law, and that is said."""
    # As wide as high: a column that strains as much is far beyond where it buckles by its weight.
    mesh = shaken_box((1.0, 1.0, 1.0), (3, 3, 3), E=5e4, nu=0.3, rho=1000, amount=0)
    result = sag(mesh, up="z", order=1)
    assert result.trusted
    assert result.static.law is Law.NEO_HOOKEAN
    assert any("neo-Hookean" in w for w in result.warnings)
    linear = sag(mesh, up="z", order=1, law=Law.LINEAR)
    assert linear.static.law is Law.LINEAR
    assert linear.static.max_strain > 0.05


def test_a_lying_bar_is_measured_by_its_length():
    """A cantilever that sinks by .117 of its length neither collapses nor moves 2.3 times it."""
    L, side, E, rho = 1.0, 0.05, 5e7, 1000.0
    mesh = with_uniform(box_mesh((L, side, side), (8, 1, 1)), E=E, nu=0.3, rho=rho)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    result = StaticMethod().solve(Scene(mesh=mesh, supports=held, gravity_vector=(0, 0, -9.81)))
    exact = 9.81 * rho * side**2 * L**4 / (8 * E * side**4 / 12)
    assert result.sag_ratio == pytest.approx(exact / L, rel=0.05)
    assert result.trusted
    assert not any("collapses" in warning for warning in result.warnings)
