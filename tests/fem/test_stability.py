"""Buckling: the load factor of columns against Euler and Greenhill, and its verdict."""

import numpy as np
import pytest
from autophyx_tet.fem import verdicts
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.scenarios.hang import hang
from autophyx_tet.fem.scenarios.sag import sag
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.loads import pressure
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.stability import find_load_factor
from autophyx_tet.fem.solve.statics import solve_static

from .bodies import faces_at, random_rotation, with_uniform

E, RHO, H = 1e7, 1000.0, 0.05


def column(cells=(1, 1, 20), nu=0.3):
    return with_uniform(box_mesh((H, H, 1), cells), E=E, nu=nu, rho=RHO)


def test_own_weight():
    """A clamped column stands 7.837 E I / L^3 of weight a length (Greenhill 1881)."""
    result = sag(column())
    exact = 7.837 * E * H**4 / 12 / (9.81 * RHO * H * H)
    assert result.load_factor.value == pytest.approx(exact, rel=0.03)
    assert verdicts.buckling(result.load_factor).passed
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
    assert not found["holds shape"].passed
    assert not found["buckling"].passed
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


def test_prescribed_displacements_are_no_load():
    mesh = column()
    moved = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    moved = moved.with_fixed(mesh.points[:, 2] == 1, 2, -1e-3)
    with pytest.raises(InputError, match="loads only"):
        find_load_factor(solve_static(mesh, moved), moved)
