"""Buckling: the load factor of columns against Euler and Greenhill, and its verdict."""

import numpy as np
import pytest
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scenarios import hang, sag
from autophyx_tet.fem.scene.loads import Traction, pressure
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.fem.solve.modal import find_load_factor
from autophyx_tet.fem.solve.nonlinear import solve_nonlinear
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.toolkit.verdict import checks as verdicts
from autophyx_tet.toolkit.verdict.check import with_doubts
from scipy.optimize import brentq
from scipy.special import ellipk

from .bodies import faces_at, random_rotation, with_uniform

E, RHO, H = 1e7, 1000.0, 0.05


def column(cells=(1, 1, 20), nu=0.3):
    return with_uniform(box_mesh((H, H, 1), cells), E=E, nu=nu, rho=RHO)


def test_own_weight():
    """A clamped column stands 7.837 E I / L^3 of weight a length (Greenhill 1881)."""
    result = sag(column())
    exact = 7.837 * E * H**4 / 12 / (9.81 * RHO * H * H)
    assert result.load_factor.value == pytest.approx(exact, rel=0.03)
    assert verdicts.buckling(result.load_factor).outcome == "passed"
    upper = result.load_factor.shape[:, 2].max(), np.abs(result.load_factor.shape).max()
    assert upper[0] < 0.2 * upper[1]  # it bends to the side


def test_a_force_on_top():
    """Euler: a clamped column stands pi^2 E I / 4 L^2 at its free end."""
    mesh = column()
    clamp = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    on_top = pressure(mesh, faces_at(mesh, 2, 1.0), 1.0)
    found = find_load_factor(solve_static(mesh, clamp, traction=on_top), clamp)
    assert found.value == pytest.approx(np.pi**2 * E * H**4 / 12 / 4 / H**2, rel=0.03)


def test_past_buckling_is_said():
    """Past Greenhill's length a stem sags by nothing and still does not hold its shape."""
    mesh = with_uniform(box_mesh((0.02, 0.02, 1), (1, 1, 20)), E=E, nu=0.3, rho=RHO)
    result = sag(mesh, law="linear")
    assert result.sag_ratio < verdicts.HOLDS
    assert result.load_factor.value < 1
    found = {check.name: check for check in with_doubts(verdicts.static_checks(result))}
    assert found["holds shape"].outcome == "failed"
    assert found["buckling"].outcome == "failed"
    assert "buckles" in found["holds shape"].sentence


def test_a_factor_within_what_a_mesh_errs_by_is_in_doubt():
    """Just under Greenhill's length nothing is green; a tenth of load less is."""
    height = (7.837 * E * H**2 / 12 / (9.81 * RHO)) ** (1 / 3)
    outcomes = []
    for of_load in (1 / 1.05, 1 / 1.2):
        mesh = box_mesh((H, H, height), (1, 1, 20))
        factor = sag(with_uniform(mesh, E=E, nu=0.3, rho=RHO * of_load), law="linear").load_factor
        assert factor.value == pytest.approx(1 / of_load, rel=0.03)  # slenderness 24: shear .5 %
        outcomes.append(verdicts.buckling(factor).outcome)
    assert outcomes == ["doubtful", "passed"]


def test_what_is_drawn_does_not_buckle():
    """A hanging column is drawn everywhere: no multiple of its weight buckles it."""
    factor = hang(column()).load_factor
    assert np.isinf(factor.value)
    assert "more than 1000" in verdicts.buckling(factor).sentence


def test_the_factor_turns_with_the_body():
    """The same column in another direction has the same factor."""
    mesh, Q = column(), random_rotation()
    turned = type(mesh)(mesh.points @ Q.T, mesh.tets, mesh.region, material=mesh.material)
    clamp = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    down = np.array([0, 0, -9.81])
    one = find_load_factor(solve_static(mesh, clamp, gravity_vector=down), clamp)
    two = find_load_factor(solve_static(turned, clamp, gravity_vector=Q @ down), clamp)
    assert two.value == pytest.approx(one.value, rel=1e-5)  # the eigensolver's own tolerance


@pytest.mark.blockers
@pytest.mark.truth("buckling by a move")
def test_a_column_that_is_pressed_by_a_move():
    """Euler: one clamped at both ends buckles as its end has moved by 4 pi^2 I / A L."""
    mesh, by = column(), -1e-3
    moved = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    for axis, value in enumerate((0, 0, by)):
        moved = moved.with_fixed(mesh.points[:, 2] == 1, axis, value)
    result = StaticMethod().solve(Scene(mesh=mesh, supports=moved), law="linear")
    assert result.load_factor.value == pytest.approx(4 * np.pi**2 * H**2 / 12 / -by, rel=0.05)
    found = {check.name: check for check in with_doubts(verdicts.static_checks(result))}
    assert found["discretisation"].outcome == "passed"
    # A reaction of E A by / L where ends that are clamped stiffen it a little, estimated as that
    assert 0 < result.discretisation_error.reaction < 0.01


def stem(cells):
    """3.75 times past the weight that buckles it, and nothing else is wrong with it."""
    L, a, modulus = 1.0, 0.01, 1e9
    rho = 3.75 * 7.837 * modulus * a**2 / 12 / L**3 / 9.81
    return with_uniform(box_mesh((a, a, L), cells), E=modulus, nu=0.3, rho=rho)


@pytest.mark.blockers
@pytest.mark.parametrize("why", ["order", "unknowns", "factor"])
@pytest.mark.truth("a check that was not made")
def test_buckling_that_was_not_checked_is_told(monkeypatch, why):
    """Its line says why, and nothing that it could change is called good beside it."""
    if why == "unknowns":
        monkeypatch.setattr("autophyx_tet.fem.elements.space.LARGEST_P2", 0)
    if why == "factor":
        monkeypatch.setattr("autophyx_tet.fem.solve.modal.MOST_ENTRIES", 0)
        monkeypatch.setattr("autophyx_tet.fem.solve.equilibrium.MOST_ENTRIES", 0)
        monkeypatch.setattr("autophyx_tet.fem.solve.modal.MOST_TETS", 0)
    result = sag(stem((1, 1, 12)), order=1 if why == "order" else None)
    found = {check.name: check for check in with_doubts(verdicts.static_checks(result))}
    assert found["buckling"].outcome == "not made"
    reason = "too many" if why == "factor" else "linear elements"
    assert reason in found["buckling"].sentence
    # Without a factor what the load adds to the rest is seen, and it is not followed
    assert found["holds shape"].outcome == ("not made" if why == "factor" else "doubtful")
    if why == "unknowns":
        assert found["discretisation"].outcome == "not made"
    marks = {v.name: v.mark for v in found.values()}
    assert marks["buckling"] == "unmade"
    assert marks["holds shape"] != "good"


def test_a_ring_under_a_pressure_that_follows():
    """A thin ring buckles at 3 E I / R^3 of pressure a length, which stays across its faces.

    Timoshenko & Gere, Theory of Elastic Stability, section 7.2.
    """
    inner, outer, width, modulus = 0.99, 1.01, 0.02, 2e11
    flat = box_mesh((1, 1, width), (1, 96, 1))
    r, t = inner + (outer - inner) * flat.points[:, 0], 2 * np.pi * flat.points[:, 1]
    places = np.stack([r * np.cos(t), r * np.sin(t), flat.points[:, 2]], axis=1)
    _, first, same = np.unique(places.round(8), axis=0, return_index=True, return_inverse=True)
    ring = TetMesh.oriented(places[first], same.reshape(-1)[flat.tets])
    ring, x = with_uniform(ring, E=modulus, nu=0.0, rho=RHO), ring.points
    held = Supports.none(len(x)).with_fixed(np.isin(x[:, 2], (0, width)), 2)
    for way, axis in (((outer, 0), 1), ((-outer, 0), 1), ((0, outer), 0)):  # it may not turn
        nearest = np.argmin(np.linalg.norm(x - [*way, 0], axis=1))
        held = held.with_fixed(np.arange(len(x)) == nearest, axis)
    faces = ring.boundary.faces
    outside = faces[(np.hypot(x[:, 0], x[:, 1])[faces] > 1).all(axis=1)]
    bending = modulus * width * (outer - inner) ** 3 / 12
    load = pressure(ring, outside, bending / width)
    rest = solve_static(ring, held, traction=load)
    found = find_load_factor(rest, held, traction=[load]).value
    assert found == pytest.approx(3.0, rel=0.02)  # the polygon of 96 sides, the outer radius


@pytest.mark.slow
def test_a_column_goes_on_bent():
    """At 1.05 of Euler's load the end of the elastica has moved by .28 L, sideways and down.

    K(k)^2 = P / P_E (pi / 2)^2 and w = 2 k L / K, with k the sine of half the angle of the end.
    """
    mesh = with_uniform(box_mesh((H / 2, H / 2, 1), (1, 1, 20)), E=E, nu=0.0, rho=RHO)
    clamp = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    load = 1.05 * np.pi**2 * E * (H / 2) ** 4 / 12 / 4
    on_top = Traction(faces_at(mesh, 2, 1.0), np.array([0, 0, -load / (H / 2) ** 2]))
    rest = solve_nonlinear(mesh, clamp, traction=on_top)
    m = brentq(lambda m: ellipk(m) - np.sqrt(1.05) * np.pi / 2, 1e-6, 0.9)
    aside = np.linalg.norm(rest.displacement[mesh.points[:, 2] == 1, :2].mean(axis=0))
    assert rest.path.end == pytest.approx(1 / 1.05, rel=0.01)
    # .3 % in the load at which it buckles are 3 % of the way beyond it, half of that in w
    assert aside == pytest.approx(2 * np.sqrt(m) / ellipk(m), rel=0.05)
