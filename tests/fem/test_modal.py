"""Natural frequencies against beam, rod and plate theory."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.linalg import cholesky as factor
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.statics import solve_static

from .bodies import lifted, merged, shaken_box, with_uniform


def test_cantilever_frequencies():
    """f_n = (b_n L)^2 / (2 pi L^2) sqrt(E I / rho A), b_n L = 1.87510, 4.69409, 7.85476."""
    L, h, E, rho = 1.0, 0.03, 1e9, 1e3
    mesh = with_uniform(box_mesh((L, h, h), (24, 1, 1)), E=E, nu=0.0, rho=rho)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    modes = natural_modes(mesh, 8, supports=held)
    beam = np.array([1.87510, 4.69409, 7.85476]) ** 2 / (2 * np.pi * L**2)
    beam *= np.sqrt(E * h**2 / 12 / rho)
    for exact in beam:  # the section is square: every bending mode comes twice
        near = np.abs(modes.frequencies / exact - 1) < 0.02
        assert near.sum() == 2


def test_rod_frequencies():
    """Axial modes of a fixed-free rod, nu = 0: f = (2 n - 1) / 4 L sqrt(E / rho)."""
    L, E, rho = 1.0, 1e6, 1e3
    mesh = with_uniform(box_mesh((L, 0.2, 0.2), (10, 1, 1)), E=E, nu=0.0, rho=rho)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0).with_fixed(slice(None), (1, 2))
    modes = natural_modes(mesh, 4, supports=held)
    exact = (2 * np.arange(1, 5) - 1) / (4 * L) * np.sqrt(E / rho)
    assert modes.frequencies == pytest.approx(exact, rel=0.02)


def test_free_body():
    """Free in space: no mode is rigid, shapes are orthogonal in mass and hold no momentum."""
    mesh = shaken_box(E=1e6, rho=1e3)
    modes = natural_modes(mesh, 6)
    slowest = np.sqrt(1e6 / 1e3) / 2
    assert (modes.frequencies > 0.2 * slowest).all()
    assert modes.residual < 1e-6


def test_frequency_scaling():
    """Frequencies scale with sqrt(E / rho) / L."""
    one = shaken_box((1, 1, 1), E=1e6, rho=1e3)
    two = type(one)(one.points * 0.1, one.tets, one.region)
    two = with_uniform(two, E=4e8, nu=0.3, rho=1e3)
    f, g = (natural_modes(m, 4, order=1).frequencies for m in (one, two))
    assert g == pytest.approx(f * np.sqrt(400) / 0.1, rel=1e-6)


def test_free_beam_frequencies():
    """Free-free beam: b_n L = 4.73004, 7.85320, 10.99561; every bending mode comes twice."""
    L, h, E, rho = 1.0, 0.02, 1e9, 1e3
    mesh = with_uniform(box_mesh((L, h, h), (24, 1, 1)), E=E, nu=0.0, rho=rho)
    found = natural_modes(mesh, 6).frequencies
    beam = np.array([4.73004, 7.85320, 10.99561]) ** 2 / (2 * np.pi * L**2)
    beam *= np.sqrt(E * h**2 / 12 / rho)
    assert found == pytest.approx(np.repeat(beam, 2), rel=0.02)


def test_thick_plate():
    """NAFEMS FV52: a plate 10 x 10 x 1 m on its lower edges, seven frequencies [Hz]."""
    mesh = with_uniform(box_mesh((10, 10, 1), (8, 8, 1)), E=200e9, nu=0.3, rho=8000)
    x = mesh.points
    edge = (np.isclose(x[:, :2], 0) | np.isclose(x[:, :2], 10)).any(axis=1) & (x[:, 2] == 0)
    held = Supports.none(len(x)).with_fixed(edge, 2)
    frequencies = natural_modes(mesh, 11, supports=held).frequencies
    elastic = frequencies[frequencies > 1.0]  # three rigid motions in the plane are free
    # The bending references are thick-plate theory; solids on their lower edges are 2 % softer.
    plate = [45.897, 109.44, 109.44, 167.89, 193.59, 206.19, 206.19]
    assert elastic[:7] == pytest.approx(plate, rel=0.025)
    assert elastic[4:7] == pytest.approx(plate[4:], rel=1e-3)  # these stretch, and do not bend


def test_too_many_modes():
    with pytest.raises(InputError, match="fewer modes"):
        natural_modes(shaken_box(cells=(1, 1, 1)), 500)


def test_iterative_solver_agrees(monkeypatch):
    """LOBPCG with the V-cycle finds the frequencies of the direct solver, free and held."""
    mesh = shaken_box(cells=(4, 4, 4), E=1e6, rho=1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    direct = [natural_modes(mesh, 4, supports=s, order=1).frequencies for s in (held, None)]
    monkeypatch.setattr("autophyx_tet.fem.solve.modal.MOST_ENTRIES", 0)
    again = [natural_modes(mesh, 4, supports=s, order=1).frequencies for s in (held, None)]
    for one, two in zip(direct, again, strict=True):
        assert two == pytest.approx(one, rel=1e-4)


def test_free_pieces_have_no_zeros():
    """Two cubes apart in space: twelve rigid motions are left out, every frequency comes twice."""
    one = shaken_box(cells=(2, 2, 2), E=1e6, rho=1e3)
    two = with_uniform(merged(one, lifted(one, 3.0)), E=1e6, nu=0.3, rho=1e3)
    alone, both = natural_modes(one, 3).frequencies, natural_modes(two, 6).frequencies
    assert both == pytest.approx(np.repeat(alone, 2), rel=1e-6)


def test_modes_of_a_standing_body_use_the_factor_of_its_statics(monkeypatch):
    """One matrix, one factor: statics makes it, the modes find it."""
    monkeypatch.setattr(factor, "_RECENT", [])
    mesh = with_uniform(box_mesh((1, 0.1, 0.1), (8, 1, 1)), E=1e6, nu=0.3, rho=1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    solve_static(mesh, held, gravity_vector=(0, 0, -1), order=2)
    (known,) = factor._RECENT
    natural_modes(mesh, 3, supports=held)
    assert factor._RECENT == [known]


def test_free_modes_of_two_pieces():
    """Two free cubes side by side ring as one does, every vibration twice: no zero among them."""
    cube = shaken_box(cells=(2, 2, 2), E=1e6, rho=1e3)
    both = merged(cube, type(cube)(cube.points + np.array([3.0, 0, 0]), cube.tets, cube.region))
    both = with_uniform(both, E=1e6, nu=0.3, rho=1e3)
    alone = natural_modes(cube, 3).frequencies
    assert natural_modes(both, 6).frequencies == pytest.approx(np.repeat(alone, 2), rel=1e-6)
