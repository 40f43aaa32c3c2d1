"""Static laws that meshes converge to, and bounds that hold for any field of E."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.material import ElementMaterial, lame_parameters
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.loads import Traction, pressure
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import nodal_stress, solve_static
from hypothesis import given, settings
from hypothesis import strategies as st

from .bodies import (
    faces_at,
    mapped,
    octant_ball,
    outer_faces,
    quarter_tube,
    shaken_box,
    symmetry_planes,
    with_uniform,
)

seeds = st.integers(0, 2**31)


def confined_modulus(mesh, order=1):
    """Stress over strain of a unit cube squeezed along z, its sides on rollers, top kept flat."""
    x = make_space(mesh, order).nodes
    held = Supports.none(len(x))
    for axis in (0, 1):
        held = held.with_fixed(np.isclose(x[:, axis], 0) | np.isclose(x[:, axis], 1), axis)
    held = held.with_fixed(np.isclose(x[:, 2], 0), 2)
    held = held.with_fixed(np.isclose(x[:, 2], 1), 2, -1e-3)
    return 2 * solve_static(mesh, held, order=order).energy / 1e-6


def squeezed_modulus(mesh):
    """Stress over strain of a unit cube between two rough-free plates: sides free."""
    x = mesh.points
    held = symmetry_planes(x).with_fixed(np.isclose(x[:, 2], 1), 2, 1e-3)
    return 2 * solve_static(mesh, held).energy / 1e-6


def test_layers_in_series():
    """Confined layers of equal thickness: 1/M* = sum phi_i / M_i, exactly."""
    mesh = box_mesh((1, 1, 1), (2, 2, 4))
    layer = np.minimum((mesh.centroids[:, 2] * 4).astype(int), 3)
    E, nu = np.array([1.0, 30.0, 2e3, 5.0])[layer], np.array([0.1, 0.3, 0.45, 0.0])[layer]
    mesh = mesh.with_material(ElementMaterial(E, nu, np.ones_like(E)))
    lam, mu = lame_parameters(E, nu)
    assert confined_modulus(mesh) == pytest.approx(1 / (mesh.volumes @ (1 / (lam + 2 * mu))), 1e-9)


def test_columns_in_parallel():
    """Columns with one nu: E* = sum phi_i E_i, exactly."""
    mesh = box_mesh((1, 1, 1), (4, 2, 2))
    E = np.array([1.0, 30.0, 2e3, 5.0])[np.minimum((mesh.centroids[:, 0] * 4).astype(int), 3)]
    mesh = mesh.with_material(ElementMaterial(E, np.full_like(E, 0.3), np.ones_like(E)))
    assert squeezed_modulus(mesh) == pytest.approx(mesh.volumes @ E, rel=1e-9)


@settings(max_examples=15, deadline=None)
@given(seeds, st.floats(0, 0.45), st.floats(0, 3))
def test_voigt_and_reuss_bounds(seed, nu, decades):
    """Any E per tet with one nu: 1 / sum(phi/E) <= E* <= sum phi E."""
    mesh = box_mesh((1, 1, 1), (2, 2, 2))
    E = 10 ** np.random.default_rng(seed).uniform(0, decades, len(mesh.tets))
    mesh = mesh.with_material(ElementMaterial(E, np.full_like(E, nu), np.ones_like(E)))
    upper, lower = mesh.volumes @ E, 1 / (mesh.volumes @ (1 / E))
    assert lower * (1 - 1e-9) <= squeezed_modulus(mesh) <= upper * (1 + 1e-9)


def _isotropic(E, nu):
    """Stiffness matrix (n, 6, 6) of Hooke's law in Mandel's notation."""
    lam, mu = lame_parameters(E, nu)
    C = np.zeros((len(E), 6, 6))
    C[:, :3, :3] = lam[:, None, None]
    return C + 2 * mu[:, None, None] * np.eye(6)


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_energy_between_averaged_tensors(seed):
    """Any E and nu: e : <S>^-1 : e / 2 <= W / V <= e : <C> : e / 2 under linear boundary values.

    The upper bound holds for prescribed u = e x; the lower one by the dual principle.
    """
    rng = np.random.default_rng(seed)
    mesh = box_mesh((1, 1, 1), (2, 2, 2))
    E, nu = 10 ** rng.uniform(0, 2, len(mesh.tets)), rng.uniform(0, 0.49, len(mesh.tets))
    mesh = mesh.with_material(ElementMaterial(E, nu, np.ones_like(E)))
    e = rng.normal(size=(3, 3))
    e = (e + e.T) / 2
    edge = (np.isclose(mesh.points, 0) | np.isclose(mesh.points, 1)).any(axis=1)
    held = Supports.clamp(len(mesh.points), edge, (mesh.points @ e)[edge])
    twice = 2 * solve_static(mesh, held).energy
    C = _isotropic(E, nu)
    v = np.concatenate([np.diag(e), np.sqrt(2) * np.array([e[1, 2], e[0, 2], e[0, 1]])])
    upper = v @ np.einsum("t,tij->ij", mesh.volumes, C) @ v
    lower = v @ np.linalg.inv(np.einsum("t,tij->ij", mesh.volumes, np.linalg.inv(C))) @ v
    assert lower * (1 - 1e-9) <= twice <= upper * (1 + 1e-9)


def test_two_slabs_break_the_scalar_bound():
    """E = 1 everywhere, nu = 0 and .49 in two bonded slabs: E* = 1.068, above the mean E of 1.

    Long bonded slabs contract alike along their plane, so each is stressed across the load.
    """
    mesh = box_mesh((1, 40, 1), (2, 1, 1))
    nu = np.where(mesh.centroids[:, 0] < 0.5, 0.0, 0.49)
    mesh = mesh.with_material(ElementMaterial(np.ones_like(nu), nu, np.ones_like(nu)))
    x = mesh.points
    held = symmetry_planes(x).with_fixed(np.isclose(x[:, 2], 1), 2, 1e-3)
    assert 2 * solve_static(mesh, held).energy / 1e-6 / 40 == pytest.approx(1.068, abs=5e-4)


@settings(max_examples=8, deadline=None)
@given(seeds, st.floats(0.1, 100))
def test_scaling(seed, c):
    """Moduli times c divide the sag by c; densities times c multiply it by c."""
    rng = np.random.default_rng(seed)
    mesh = shaken_box(cells=(2, 2, 2))
    n = len(mesh.tets)
    E, nu, rho = 10 ** rng.uniform(3, 6, n), rng.uniform(0, 0.45, n), rng.uniform(1, 9, n)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)

    def fall(E, rho):
        body = mesh.with_material(ElementMaterial(E, nu, rho))
        return solve_static(body, held, gravity_vector=(0, 0, -9.81)).displacement

    u = fall(E, rho)
    assert fall(c * E, rho) == pytest.approx(u / c, rel=1e-8, abs=1e-14)
    assert fall(E, c * rho) == pytest.approx(u * c, rel=1e-8, abs=1e-14)


def test_lame_cylinder():
    """Tube under inner pressure, plane strain:
    u_r(r) = (1 + nu) a^2 p / (E (b^2 - a^2)) ((1 - 2 nu) r + b^2 / r)."""
    a, b, E, nu, p = 1.0, 2.0, 1e5, 0.3, 1e3
    mesh = with_uniform(quarter_tube(a, b, 0.2, (6, 12, 1)), E=E, nu=nu)
    held = symmetry_planes(mesh.points).with_fixed(slice(None), 2)
    load = pressure(mesh, outer_faces(mesh, a, (0, 1)), p)
    result = solve_static(mesh, held, traction=load, order=2)
    r = np.linalg.norm(mesh.points[:, :2], axis=1)
    u = np.linalg.norm(result.displacement[:, :2], axis=1)
    exact = (1 + nu) * a**2 * p / (E * (b**2 - a**2)) * ((1 - 2 * nu) * r + b**2 / r)
    assert u == pytest.approx(exact, rel=0.01)


@pytest.mark.slow
def test_lame_sphere():
    """Hollow sphere under inner pressure, extrapolated over three meshes (facets: O(h^2)):
    u_r = p a^3 / (E (b^3 - a^3)) ((1 - 2 nu) r + (1 + nu) b^3 / 2 r^2)."""
    a, b, E, nu, p = 1.0, 2.0, 1e5, 0.3, 1e3
    exact = p * a**3 / (E * (b**3 - a**3)) * ((1 - 2 * nu) * b + (1 + nu) * b / 2)

    def outer_motion(cells):
        ball = octant_ball(b, cells)
        keep = np.linalg.norm(ball.points[ball.tets], axis=2).min(axis=1) > a - 1e-9
        mesh = with_uniform(_compact(ball, keep), E=E, nu=nu)
        load = pressure(mesh, outer_faces(mesh, a), p)
        result = solve_static(mesh, symmetry_planes(mesh.points), traction=load, order=2)
        u = np.linalg.norm(result.displacement, axis=1)
        return u[np.isclose(np.linalg.norm(mesh.points, axis=1), b)].mean()

    u = np.array([outer_motion(n) for n in (4, 6, 8)])
    fine = (64 * u[2] - 36 * u[1]) / 28
    assert fine == pytest.approx(exact, rel=0.01)
    assert (36 * u[1] - 16 * u[0]) / 20 == pytest.approx(fine, rel=0.01)


def _compact(mesh, keep):
    used, index = np.unique(mesh.tets[keep], return_inverse=True)
    return TetMesh.oriented(mesh.points[used], index.reshape(-1, 4))


@pytest.mark.slow
def test_coated_sphere():
    """Hashin's coated sphere (Ki = 50, Km = 10, Gm = 4, phi = .3): K* = 14.246153846."""
    cells = 9
    inner = 6  # the interface lies on a layer of cells, moved to the radius of phi = .3
    ball = octant_ball(1.0, cells)
    r = np.linalg.norm(ball.points, axis=1)
    target = np.interp(r, [0, inner / cells, 1], [0, 0.3 ** (1 / 3), 1])
    mesh = mapped(ball, lambda x: x * (target / np.where(r > 0, r, 1))[:, None])
    core = (np.linalg.norm(mesh.points[mesh.tets], axis=2) <= 0.3 ** (1 / 3) + 1e-9).all(axis=1)
    K, G = np.where(core, 50.0, 10.0), np.where(core, 20.0, 4.0)
    E, nu = 9 * K * G / (3 * K + G), (3 * K - 2 * G) / (2 * (3 * K + G))
    mesh = mesh.with_material(ElementMaterial(E, nu, np.ones_like(E)))
    load = pressure(mesh, outer_faces(mesh, 1.0), 1.0)
    result = solve_static(mesh, symmetry_planes(mesh.points), traction=load, order=2)
    u = result.displacement[np.isclose(np.linalg.norm(mesh.points, axis=1), 1.0)]
    assert 1 / (3 * np.linalg.norm(u, axis=1).mean()) == pytest.approx(14.246153846, rel=0.01)


def test_cantilever():
    """Timoshenko: tip = P L^3 / 3EI + P L / (k G A), k = 10 (1 + nu) / (12 + 11 nu)."""
    L, h, E, nu, P = 2.0, 0.2, 1e6, 0.3, 1.0
    mesh = with_uniform(box_mesh((L, h, h), (20, 2, 2)), E=E, nu=nu)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    load = Traction(faces_at(mesh, 0, L), np.array([0, 0, -P / h**2]))
    result = solve_static(mesh, held, traction=load, order=2)
    G, k = E / (2 * (1 + nu)), 10 * (1 + nu) / (12 + 11 * nu)
    exact = P * L**3 / (3 * E * h**4 / 12) + P * L / (k * G * h**2)
    assert -result.displacement[mesh.points[:, 0] == L, 2].mean() == pytest.approx(exact, rel=0.02)


def cook(n, depth):
    """Cook's membrane, 48 x 44 x 16: clamped left, sheared right, plane strain."""
    box = box_mesh((1, 1, depth), (n, n, 1))
    x = box.points
    low, high = 44 * x[:, 0], 44 + 16 * x[:, 0]
    place = np.stack([48 * x[:, 0], low + (high - low) * x[:, 1], x[:, 2]], axis=1)
    return TetMesh.oriented(place, box.tets)


def test_cook():
    """Cook's membrane, E = 70, nu = 1/3, 6.25 MPa: corner 32.27 mm (CalculiX, Elmer)."""
    mesh = with_uniform(cook(16, 3.0), E=70.0, nu=1 / 3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0).with_fixed(slice(None), 2)
    load = Traction(faces_at(mesh, 0, 48), np.array([0, 6.25, 0]))
    result = solve_static(mesh, held, traction=load, order=2)
    corner = np.isclose(mesh.points[:, :2], [48, 60]).all(axis=1)
    assert result.displacement[corner, 1].mean() == pytest.approx(32.27, rel=0.01)


def elliptic_quarter(cells, thickness):
    """Quarter of a plate between x^2/2^2 + y^2 = 1 and (x/3.25)^2 + (y/2.75)^2 = 1 [m].

    ``cells`` in r, angle, z; also returns which points lie on the outer edge.
    """
    box = box_mesh((1, np.pi / 2, thickness), cells)
    r, angle, z = box.points.T
    x, y = (2 + 1.25 * r) * np.cos(angle), (1 + 1.75 * r) * np.sin(angle)
    points = np.stack([x, y, z], axis=1)
    mesh = TetMesh.oriented(np.where(np.abs(points) < 1e-12, 0.0, points), box.tets)
    outer = np.abs((x / 3.25) ** 2 + (y / 2.75) ** 2 - 1) < 1e-9
    return with_uniform(mesh, E=210e9, nu=0.3), outer


@pytest.mark.slow
def test_le1():
    """NAFEMS LE1: outward pressure of 10 MPa on the outer edge, sigma_yy at (2, 0) is 92.7 MPa."""
    found = []
    for n in (6, 12):
        mesh, outer = elliptic_quarter((n, 2 * n, 1), 0.1)
        faces, x = mesh.boundary.faces, mesh.points
        load = pressure(mesh, faces[outer[faces].all(axis=1)], -10e6)
        result = solve_static(mesh, symmetry_planes(x), traction=load, order=2)
        at = np.isclose(x[:, 0], 2) & (x[:, 1] == 0)
        found.append(nodal_stress(result)[at, 1, 1].mean())
    fine = found[1] + (found[1] - found[0]) / 3  # facets of a curved edge: O(h^2)
    assert fine == pytest.approx(92.7e6, rel=0.02)


@pytest.mark.slow
def test_le10():
    """NAFEMS LE10: thick plate under 1 MPa from above, sigma_yy at (2, 0, top) is -5.38 MPa.

    Rollers on the planes of symmetry, the outer edge held sideways, its middle line in z.
    """
    found = []
    for n in (6, 12):
        mesh, outer = elliptic_quarter((n, 2 * n, n // 3), 0.6)
        x = mesh.points
        middle = outer & np.isclose(x[:, 2], 0.3)
        held = Supports.none(len(x)).with_fixed(x[:, 0] == 0, 0).with_fixed(x[:, 1] == 0, 1)
        held = held.with_fixed(outer, (0, 1)).with_fixed(middle, 2)
        load = pressure(mesh, faces_at(mesh, 2, 0.6), 1e6)
        result = solve_static(mesh, held, traction=load, order=2)
        at = np.isclose(x, [2, 0, 0.6]).all(axis=1)
        found.append(nodal_stress(result)[at, 1, 1].mean())
    fine = found[1] + (found[1] - found[0]) / 3  # facets of a curved edge: O(h^2)
    assert fine == pytest.approx(-5.38e6, rel=0.01)


def test_unit_bulk_of_whole_cube_is_invariant_to_shuffling():
    """The order of tets changes nothing but round-off."""
    mesh = shaken_box(cells=(3, 3, 3), E=5.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    mix = np.random.default_rng(0).permutation(len(mesh.tets))
    mixed = TetMesh(mesh.points, mesh.tets[mix], mesh.region, material=mesh.material)
    one, two = (solve_static(m, held, gravity_vector=(1, 2, 3)) for m in (mesh, mixed))
    assert one.energy == pytest.approx(two.energy, rel=1e-12)
