"""Buckling: the load factor of columns against Euler and Greenhill, and its verdict."""

import numpy as np
import pytest
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scenarios import hang, sag
from autophyx_tet.fem.scene.loads import pressure
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.buckling import find_load_factor
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.toolkit.verdict import checks as verdicts

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
    found = {check.name: check for check in verdicts.static_checks(result)}
    assert found["holds shape"].outcome == "failed"
    assert found["buckling"].outcome == "failed"
    assert "buckles" in found["holds shape"].sentence


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
def test_a_column_that_is_pressed_by_a_move():
    """Euler: one clamped at both ends buckles as its end has moved by 4 pi^2 I / A L."""
    mesh, by = column(), -1e-3
    moved = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    for axis, value in enumerate((0, 0, by)):
        moved = moved.with_fixed(mesh.points[:, 2] == 1, axis, value)
    result = StaticMethod().solve(Scene(mesh=mesh, supports=moved), law="linear")
    assert result.load_factor.value == pytest.approx(4 * np.pi**2 * H**2 / 12 / -by, rel=0.05)
    found = {check.name: check for check in verdicts.static_checks(result)}
    assert found["discretisation"].outcome == "not made"  # the largest displacement is the move
    assert found["holds shape"].outcome == "doubtful"


def stem(cells):
    """3.75 times past the weight that buckles it, and nothing else is wrong with it."""
    L, a, modulus = 1.0, 0.01, 1e9
    rho = 3.75 * 7.837 * modulus * a**2 / 12 / L**3 / 9.81
    return with_uniform(box_mesh((a, a, L), cells), E=modulus, nu=0.3, rho=rho)


@pytest.mark.blockers
@pytest.mark.long
def test_a_fine_stem_is_checked_too():
    """42,240 tets, 190,000 unknowns: quadratic elements, and buckling."""
    result = sag(stem((8, 8, 110)))
    assert result.static.order == 2
    assert result.load_factor.value == pytest.approx(1 / 3.75, rel=0.1)
    assert verdicts.holds_shape(result).outcome == "failed"


@pytest.mark.blockers
@pytest.mark.parametrize("why", ["order", "unknowns", "factor"])
def test_buckling_that_was_not_checked_is_told(monkeypatch, why):
    """Its line says why, and nothing that it could change is called good beside it."""
    if why == "unknowns":
        monkeypatch.setattr("autophyx_tet.fem.elements.space.LARGEST_P2", 0)
    if why == "factor":
        monkeypatch.setattr("autophyx_tet.fem.solve.modal.MOST_ENTRIES", 0)
        monkeypatch.setattr("autophyx_tet.fem.solve.buckling.MOST_TETS", 0)
    result = sag(stem((1, 1, 30)), order=1 if why == "order" else None)
    found = {check.name: check for check in verdicts.static_checks(result)}
    assert found["buckling"].outcome == "not made"
    reason = "too many" if why == "factor" else "linear elements"
    assert reason in found["buckling"].sentence
    assert found["holds shape"].outcome == "doubtful"
    if why == "unknowns":
        assert found["discretisation"].outcome == "not made"
    marks = {v.name: v.mark for v in found.values()}
    assert marks["buckling"] == "unmade"
    assert marks["holds shape"] == "note"
