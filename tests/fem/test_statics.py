"""Static linear elasticity against its exact solutions."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise, stiffness
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.errors import ConvergenceError, InputError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.scene.loads import Traction, pressure
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static

from .bodies import faces_at, random_rotation, shaken_box, symmetry_planes

ORDERS = pytest.mark.parametrize("order", [1, 2])


@ORDERS
def test_patch(order):
    """u = A x on the boundary: the inside follows exactly, strain is sym A in every tet."""
    mesh = shaken_box(nu=0.4)
    A = np.random.default_rng(1).normal(size=(3, 3))
    space = make_space(mesh, order)
    edge = ((space.nodes < 1e-9) | (space.nodes > 1 - 1e-9)).any(axis=1)
    exact = space.nodes @ A.T
    held = Supports.none(len(exact)).with_fixed(edge, (0, 1, 2), exact[edge])
    result = solve_static(mesh, held, order=order)
    assert np.abs(result.node_displacement - exact).max() < 1e-12
    assert np.abs(result.strain - (A + A.T) / 2).max() < 1e-11


@ORDERS
def test_rigid_motion_needs_no_force(order):
    """K (a + W x) = 0 for every translation a and skew W."""
    mesh = shaken_box(nu=0.45)
    grid = discretise(mesh, order)
    K = stiffness(grid, *mesh.material.lame)
    W = np.array([[0, -3, 2], [3, 0, -1], [-2, 1, 0]])
    force = K.times(grid.space.nodes @ W.T + [1, 2, 3])
    assert np.abs(force).max() < 1e-12


@ORDERS
def test_uniaxial_bar(order):
    """Rollers on three planes, traction s on x = l: u = (s/E x, -nu s/E y, -nu s/E z)."""
    size = (2.0, 0.5, 0.7)
    E, nu, s = 3e6, 0.35, 5e4
    mesh = shaken_box(size, (4, 2, 2), E=E, nu=nu)
    load = Traction(faces_at(mesh, 0, size[0]), np.array([s, 0, 0]))
    result = solve_static(mesh, symmetry_planes(mesh.points), traction=load, order=order)
    exact = result.space.nodes * (s / E * np.array([1, -nu, -nu]))
    assert result.node_displacement == pytest.approx(exact, abs=1e-12)
    assert result.von_mises == pytest.approx(np.full(len(mesh.tets), s), rel=1e-8)
    assert result.energy == pytest.approx(s * s / (2 * E) * mesh.volume, rel=1e-10)
    assert result.reaction[:, 0].sum() == pytest.approx(-s * size[1] * size[2], rel=1e-10)


def hanging_bar(x, *, rho, g, E, nu, length):
    """Bar hung at z = l under its weight (Timoshenko & Goodier, art. 102)."""
    c = rho * g / E
    w = c * x[:, 2] ** 2 / 2 + nu * c * (x[:, 0] ** 2 + x[:, 1] ** 2) / 2 - c * length**2 / 2
    return np.stack([-nu * c * x[:, 2] * x[:, 0], -nu * c * x[:, 2] * x[:, 1], w], axis=1)


def _hang(order, cells):
    size, values = (0.4, 0.4, 1.0), {"E": 1e6, "nu": 0.3, "rho": 1000.0}
    mesh = shaken_box(size, cells, amount=0, **values)
    space = make_space(mesh, order)
    exact = hanging_bar(space.nodes, g=9.81, length=size[2], **values)
    top = np.isclose(space.nodes[:, 2], size[2])
    held = Supports.none(len(exact)).with_fixed(top, (0, 1, 2), exact[top])
    result = solve_static(mesh, held, gravity_vector=(0, 0, -9.81), order=order)
    return np.abs(result.node_displacement - exact).max() / np.abs(exact).max()


def test_hanging_bar():
    """w = rho g (z^2 - l^2)/2E + nu rho g (x^2 + y^2)/2E: P2 holds it, P1 errs by O(h^2)."""
    assert _hang(2, (2, 2, 4)) < 1e-10
    errors = [_hang(1, (n, n, 2 * n)) for n in (8, 12)]
    assert np.log(errors[0] / errors[1]) / np.log(12 / 8) > 1.8


def test_pressure_on_all_faces():
    """Pressure p all around a free body: e = -p / 3K I."""
    E, nu, p = 2e5, 0.3, 1e3
    mesh = shaken_box(E=E, nu=nu)
    load = pressure(mesh, mesh.boundary.faces, p)
    held = Supports.none(len(mesh.points)).with_springs(slice(None), 1e-3)  # [N/m], holds it
    result = solve_static(mesh, held, traction=load)
    assert result.strain == pytest.approx(
        np.broadcast_to(-p * (1 - 2 * nu) / E * np.eye(3), result.strain.shape), abs=1e-9
    )


@ORDERS
def test_body_force_function_equals_gravity(order):
    """A constant density through the quadrature equals rho g."""
    mesh = shaken_box(rho=7.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    one = solve_static(mesh, held, gravity_vector=(0, 0, -2.0), order=order)
    two = solve_static(mesh, held, body=lambda x: np.tile([0, 0, -14.0], (len(x), 1)), order=order)
    assert one.displacement == pytest.approx(two.displacement, rel=1e-9, abs=1e-12)


@ORDERS
def test_rotation_and_tet_order_do_not_matter(order):
    """A turned body with shuffled tets moves the same, turned."""
    mesh = shaken_box(E=1e4, nu=0.4)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    Q, mix = random_rotation(), np.random.default_rng(2).permutation(len(mesh.tets))
    turned = type(mesh)(mesh.points @ Q.T, mesh.tets[mix], mesh.region, material=mesh.material)
    g = np.array([0, 0, -9.81])
    one = solve_static(mesh, held, gravity_vector=g, order=order)
    two = solve_static(turned, held, gravity_vector=Q @ g, order=order)
    assert two.displacement == pytest.approx(one.displacement @ Q.T, abs=1e-12)
    assert two.von_mises == pytest.approx(one.von_mises[mix], rel=1e-8)


def test_free_body_is_an_error():
    """Nothing holds the body: no solution, said in one line."""
    mesh = shaken_box()
    with pytest.raises(ConvergenceError, match="nothing holds"):
        solve_static(mesh, Supports.none(len(mesh.points)), gravity_vector=(0, 0, -1))
    one = Supports.clamp(len(mesh.points), [0])
    with pytest.raises(ConvergenceError, match="move freely"):
        solve_static(mesh, one, gravity_vector=(0, 0, -1))


def test_bad_input_is_named():
    mesh = shaken_box()
    held = Supports.clamp(len(mesh.points), [0, 1, 2, 3])
    with pytest.raises(InputError, match="no material"):
        solve_static(mesh.with_material(None), held)
    with pytest.raises(InputError, match="order 3"):
        solve_static(mesh, held, order=3)
    with pytest.raises(InputError, match="gravity_vector"):
        solve_static(mesh, held, gravity_vector=(0, 0, np.nan))
    with pytest.raises(InputError, match="no device"):
        solve_static(mesh, held, device="tpu")


def test_contrast():
    """Layers in series, confined: u_top = -s h sum(phi/M) for any contrast of E."""
    for contrast in (1, 1e4, 1e8):
        top, exact = _layers_in_series(contrast)
        wanted = pytest.approx(np.full(len(top), exact), rel=1e-14 * contrast + 1e-11)
        assert top == wanted, contrast


def _layers_in_series(contrast):
    """Displacement of the top of two layers, and what it should be."""
    mesh = shaken_box((1, 1, 1), (3, 3, 4), amount=0)
    soft = mesh.centroids[:, 2] < 0.5
    E, nu, s = np.where(soft, 1e3, 1e3 * contrast), 0.3, 10.0
    mesh = mesh.with_material(ElementMaterial(E, np.full_like(E, nu), np.ones_like(E)))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    held = held.with_fixed(slice(None), (0, 1))
    load = Traction(faces_at(mesh, 2, 1.0), np.array([0, 0, -s]))
    result = solve_static(mesh, held, traction=load)
    M = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    top = result.displacement[mesh.points[:, 2] == 1, 2]
    return top, -s / 2 * (1 / M.min() + 1 / M.max())
