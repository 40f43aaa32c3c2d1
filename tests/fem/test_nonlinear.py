"""Nonlinear laws: closed forms, derivatives, rotations, recovery from inversion."""

import numpy as np
import pytest
from autophyx_tet.fem.discrete.assembly import discretise
from autophyx_tet.fem.discrete.elastic import ElasticBody
from autophyx_tet.fem.discrete.space import make_space
from autophyx_tet.fem.discrete.strain import first_piola
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.scene.box import box_mesh
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.material import lame_parameters
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.nonlinear import solve_nonlinear
from autophyx_tet.fem.solve.statics import solve_static
from hypothesis import given, settings
from hypothesis import strategies as st

from .bodies import faces_at, random_rotation, shaken_box, symmetry_planes, with_uniform

LAWS = pytest.mark.parametrize("law", [Law.NEO_HOOKEAN, Law.COROTATED])
ORDERS = pytest.mark.parametrize("order", [1, 2])


def body_of(mesh, law, order=1):
    grid = discretise(mesh, order)
    return ElasticBody(grid, mesh.material, law), grid.space.nodes


def force(body, u):
    return body.response(u).force


def energy(body, u):
    return body.response(u).energy


def stress_at(law, F, E=1e5, nu=0.4):
    return first_piola(law, np.asarray(F)[None] - np.eye(3), lame_parameters(E, nu))[0]


@pytest.mark.parametrize(
    ("stretch", "stress"), [(0.5, -96428.571), (0.9, -10969.038), (1.5, 36640.2116),
                            (2.0, 61607.1429)]
)  # fmt: skip
def test_uniaxial_stress(stretch, stress):
    """Neo-Hookean bar with free sides, E = 1e5, nu = .4: P11 in closed form, by Newton."""
    mesh = shaken_box((1, 1, 1), (2, 2, 2), E=1e5, nu=0.4)
    held = symmetry_planes(mesh.points).with_fixed(mesh.points[:, 0] == 1, 0, stretch - 1)
    result = solve_nonlinear(mesh, held)
    lam, mu = lame_parameters(1e5, 0.4)
    side2 = (1 + mu / (lam + mu) - mu / ((lam + mu) * stretch)) / stretch
    assert mu * (stretch - side2 / stretch) == pytest.approx(stress, rel=1e-7)
    pull = result.reaction[mesh.points[:, 0] == 1, 0].sum()
    assert pull == pytest.approx(stress, rel=1e-7)
    assert result.stress[:, 0, 0] * side2 == pytest.approx(np.full(len(mesh.tets), stress), 1e-6)


@pytest.mark.parametrize("shear", [-1.5, 0.3, 2.0])
def test_simple_shear(shear):
    """Neo-Hookean: P12 = P21 = mu g."""
    F = np.eye(3)
    F[0, 1] = shear
    P = stress_at(Law.NEO_HOOKEAN, F)
    mu = lame_parameters(1e5, 0.4).mu
    assert P[0, 1] == pytest.approx(mu * shear, rel=1e-12)
    assert P[1, 0] == pytest.approx(mu * shear, rel=1e-12)


@pytest.mark.parametrize("stretch", [0.4, 0.95, 1.7])
def test_oedometer(stretch):
    """Neo-Hookean, sides fixed: P11 = (lam + 2 mu) (l - 1)."""
    lam, mu = lame_parameters(1e5, 0.4)
    P = stress_at(Law.NEO_HOOKEAN, np.diag([stretch, 1.0, 1.0]))
    assert P[0, 0] == pytest.approx((lam + 2 * mu) * (stretch - 1), rel=1e-12)


@LAWS
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_small_strain_is_hooke(law, nu):
    """P -> lam tr(e) I + 2 mu e: E and nu are honoured."""
    e = np.array([[1, 0.2, 0.3], [0.2, -0.5, 0.4], [0.3, 0.4, 0.7]]) * 1e-7
    lam, mu = lame_parameters(1e5, nu)
    wanted = lam * np.trace(e) * np.eye(3) + 2 * mu * e
    assert stress_at(law, np.eye(3) + e, nu=nu) == pytest.approx(wanted, abs=1e-5 * wanted.max())


@LAWS
@ORDERS
def test_rotation_stores_no_energy(law, order):
    """A finite rotation needs no force and stores no energy."""
    mesh = shaken_box(E=1e6, nu=0.4)
    body, x = body_of(mesh, law, order)
    u = x @ random_rotation().T - x
    assert abs(energy(body, u)) < 1e-8
    assert np.abs(force(body, u)).max() < 1e-8


@LAWS
@ORDERS
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_derivatives(law, order, seed):
    """Force and tangent are the finite differences of energy and force, away from F = I."""
    rng = np.random.default_rng(seed)
    mesh = shaken_box(cells=(1, 1, 1), nu=0.4)
    body, x = body_of(mesh, law, order)
    u = x @ (rng.normal(size=(3, 3)) * 0.2 + 0.4 * np.eye(3)) + rng.normal(size=x.shape) * 0.02
    d = rng.normal(size=x.shape)
    d /= np.linalg.norm(d)
    h = 1e-5
    slope = (energy(body, u + h * d) - energy(body, u - h * d)) / (2 * h)
    assert (force(body, u) * d).sum() == pytest.approx(slope, rel=1e-6, abs=1e-8)
    if law is Law.NEO_HOOKEAN:
        K = body.tangent(u)
        change = (force(body, u + h * d) - force(body, u - h * d)) / (2 * h)
        assert K.times(d) == pytest.approx(change, rel=1e-5, abs=1e-8)


@LAWS
def test_projected_tangent(law):
    """Positive semi-definite always; equal to the exact tangent where that is positive."""
    rng = np.random.default_rng(3)
    mesh = shaken_box(cells=(1, 1, 1), nu=0.3)
    body, x = body_of(mesh, law)
    wild = x @ rng.normal(size=(3, 3)) * 0.8
    K = body.tangent(wild, projected=True)
    assert np.linalg.eigvalsh(K.to_scipy().toarray()).min() > -1e-12
    u = 0.05 * x  # equal stretch in all directions: every mode is stiff
    K = body.tangent(u, projected=True)
    d, h = rng.normal(size=x.shape), 1e-5
    change = (force(body, u + h * d) - force(body, u - h * d)) / (2 * h)
    assert K.times(d) == pytest.approx(change, rel=1e-6, abs=1e-8)


@LAWS
def test_inverted_start_recovers(law):
    """From a start turned inside out Newton finds the rest state again."""
    mesh = shaken_box(cells=(2, 2, 2), E=1e4, nu=0.4)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    start = np.zeros_like(mesh.points)
    start[:, 2] = -1.6 * mesh.points[:, 2]  # z -> -0.6 z
    result = solve_nonlinear(mesh, held, law=law, start=start, gravity_vector=(0, 0, -1e-6))
    assert np.abs(result.displacement).max() < 1e-6


@LAWS
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


def test_p2_space_of_bodies_matches():
    """The nodes of the P2 body are those of its space."""
    mesh = shaken_box()
    assert len(body_of(mesh, Law.LINEAR, 2)[1]) == len(make_space(mesh, 2).nodes)
