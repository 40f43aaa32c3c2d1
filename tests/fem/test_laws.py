"""Elastic laws at a point and in elements: closed forms, derivatives, rotations, one definition."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise, stiffness
from autophyx_tet.fem.elements.elastic import ElasticBody, first_piola
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.laws.law import LAWS, Law
from autophyx_tet.fem.material import LameParameters, lame_parameters
from autophyx_tet.fem.mesh import box_mesh
from hypothesis import given, settings
from hypothesis import strategies as st

from .bodies import random_rotation, shaken_box, with_uniform
from .derivatives import check_derivatives, energy, force

FINITE = pytest.mark.parametrize("law", [name for name in LAWS if LAWS[name].finite])
EVERY = pytest.mark.parametrize("law", LAWS.names)
ORDERS = pytest.mark.parametrize("order", [1, 2])


def body_of(mesh, law, order=1):
    grid = discretise(mesh, order)
    return ElasticBody(grid, mesh.material, law), grid.space.nodes


def stress_at(law, F, E=1e5, nu=0.4):
    return first_piola(law, np.asarray(F)[None] - np.eye(3), lame_parameters(E, nu))[0]


def test_simple_shear():
    """Neo-Hookean: P12 = P21 = mu g."""
    mu = lame_parameters(1e5, 0.4).mu
    for shear in (-1.5, 0.3, 2.0):
        F = np.eye(3)
        F[0, 1] = shear
        P = stress_at(Law.NEO_HOOKEAN, F)
        assert [P[0, 1], P[1, 0]] == pytest.approx([mu * shear] * 2, rel=1e-12), shear


def test_oedometer():
    """Neo-Hookean, sides fixed: P11 = (lam + 2 mu) (l - 1)."""
    lam, mu = lame_parameters(1e5, 0.4)
    for stretch in (0.4, 0.95, 1.7):
        P = stress_at(Law.NEO_HOOKEAN, np.diag([stretch, 1.0, 1.0]))
        assert P[0, 0] == pytest.approx((lam + 2 * mu) * (stretch - 1), rel=1e-12), stretch


@EVERY
def test_small_strain_is_hooke(law):
    """P -> lam tr(e) I + 2 mu e: E and nu are honoured."""
    e = np.array([[1, 0.2, 0.3], [0.2, -0.5, 0.4], [0.3, 0.4, 0.7]]) * 1e-7
    for nu in (0.0, 0.3, 0.49):
        lam, mu = lame_parameters(1e5, nu)
        wanted = lam * np.trace(e) * np.eye(3) + 2 * mu * e
        found = stress_at(law, np.eye(3) + e, nu=nu)
        assert found == pytest.approx(wanted, abs=1e-5 * wanted.max()), nu


@EVERY
def test_stress_is_linear_in_the_moduli(law):
    """P(a lam, b mu) = a P(lam, 0) + b P(0, mu): what the gradients by E and nu rest on."""
    H = np.random.default_rng(0).normal(size=(20, 3, 3))
    lam, mu = np.random.default_rng(1).uniform(1, 2, (2, 20))
    parts = [first_piola(law, H, LameParameters(*m)) for m in np.eye(2)]
    whole = first_piola(law, H, LameParameters(lam, mu))
    wanted = lam[:, None, None] * parts[0] + mu[:, None, None] * parts[1]
    assert whole == pytest.approx(wanted, abs=1e-12 * np.abs(whole).max())


@EVERY
def test_force_is_the_stress(law):
    """The host's stress is the elements': a force on a corner of a tet is V P grad(lambda)."""
    mesh = shaken_box(cells=(1, 1, 1), E=1e5, nu=0.4)
    tet = type(mesh)(mesh.points, mesh.tets[:1], mesh.region[:1])
    body, x = body_of(with_uniform(tet, E=1e5, nu=0.4), law)
    H = np.random.default_rng(2).normal(size=(3, 3)) * 0.3
    edges = tet.points[tet.tets[0, 1:]] - tet.points[tet.tets[0, 0]]
    gradients = np.linalg.inv(edges).T
    wanted = tet.volume * gradients @ stress_at(law, np.eye(3) + H).T
    assert force(body, x @ H.T)[tet.tets[0, 1:]] == pytest.approx(wanted, rel=1e-9)


@EVERY
@ORDERS
def test_tangent_at_rest_is_the_stiffness(law, order):
    """At rest every law has the second derivative of linear elasticity, projected or not."""
    mesh = shaken_box(E=1e5, nu=0.4)
    body, x = body_of(mesh, law, order)
    K = stiffness(body.grid, *mesh.material.lame).to_scipy().toarray()
    for projected in (False, True):
        found = body.tangent(np.zeros_like(x), projected=projected).to_scipy().toarray()
        np.testing.assert_allclose(found, K, rtol=0, atol=1e-9 * np.abs(K).max())


@FINITE
@ORDERS
def test_rotation_stores_no_energy(law, order):
    """A finite rotation needs no force and stores no energy."""
    mesh = shaken_box(E=1e6, nu=0.4)
    body, x = body_of(mesh, law, order)
    u = x @ random_rotation().T - x
    assert abs(energy(body, u)) < 1e-8
    assert np.abs(force(body, u)).max() < 1e-8


@EVERY
@ORDERS
@settings(max_examples=5)
@given(seed=st.integers(0, 2**31))
def test_derivatives(law, order, seed):
    """Force and tangent are the finite differences of energy and force, away from F = I."""
    check_derivatives(law, order, seed)


@FINITE
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


def test_p2_space_of_bodies_matches():
    """The nodes of the P2 body are those of its space."""
    mesh = with_uniform(box_mesh((1, 1, 1), (2, 2, 2)), E=1.0, nu=0.3)
    assert len(body_of(mesh, Law.LINEAR, 2)[1]) == len(make_space(mesh, 2).nodes)
