import numpy as np
import pytest
import warp as wp
from autophyx_tet.fem import LAWS, ElasticLaw, drop, solve_nonlinear
from autophyx_tet.fem.laws.law import Law

from .bodies import shaken_box, symmetry_planes
from .derivatives import check_derivatives

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


@wp.func
def stress_of(E: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    """Second Piola stress of Green's strain."""
    return lam * wp.trace(E) * wp.identity(n=3, dtype=wp.float64) + wp.float64(2.0) * mu * E


@wp.func
def energy_and_stress(H: wp.mat33d, lam: wp.float64, mu: wp.float64):
    """St Venant & Kirchhoff: W = lam/2 (tr E)^2 + mu |E|^2, E = (H + H^T + H^T H) / 2."""
    E = wp.float64(0.5) * (H + wp.transpose(H) + wp.transpose(H) * H)
    S = stress_of(E, lam, mu)
    F = H + wp.identity(n=3, dtype=wp.float64)
    return wp.float64(0.5) * wp.ddot(S, E), F * S


@wp.func
def stress_change(H: wp.mat33d, dH: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    half = wp.float64(0.5)
    F = H + wp.identity(n=3, dtype=wp.float64)
    E = half * (H + wp.transpose(H) + wp.transpose(H) * H)
    dE = half * (wp.transpose(dH) * F + wp.transpose(F) * dH)
    return dH * stress_of(E, lam, mu) + F * stress_of(dE, lam, mu)


@pytest.fixture(scope="module")
def law():
    toy = ElasticLaw(
        title="St Venant-Kirchhoff",
        energy_and_stress=energy_and_stress,
        stress_change=stress_change,
    )
    LAWS.register("toy", toy)
    yield "toy"
    LAWS.unregister("toy")


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_its_derivatives(law, order):
    """Energy, force and tangent fit together, on linear and quadratic tets."""
    for seed in range(3):
        check_derivatives(law, order, seed)


@pytest.mark.parametrize("order", [1, 2])
def test_its_bar(law, order):
    """Stretched by l with free sides: S = E e with e = (l^2 - 1) / 2, so that P11 = l E e.

    The sides strain by -nu e: Hooke's law between S and Green's strain.
    """
    E, nu, stretch = 1e5, 0.3, 1.3
    mesh = shaken_box((1, 1, 1), (2, 2, 2), E=E, nu=nu)
    right = mesh.points[:, 0] == 1
    held = symmetry_planes(mesh.points).with_fixed(right, 0, stretch - 1)
    result = solve_nonlinear(mesh, held, law=law, order=order)
    green = (stretch**2 - 1) / 2
    assert result.law == "toy"
    assert result.strain[:, 0, 0] == pytest.approx(np.full(len(mesh.tets), green), rel=1e-7)
    assert result.strain[:, 1, 1] == pytest.approx(np.full(len(mesh.tets), -nu * green), rel=1e-6)
    side = result.space.nodes[:, 0] == 1
    assert result.reaction[side, 0].sum() == pytest.approx(stretch * E * green, rel=1e-7)


@pytest.mark.slow
def test_it_moves(law):
    """A scenario takes it by its name."""
    mesh = shaken_box((0.1,) * 3, (1, 1, 1), E=1e6, nu=0.4, rho=1000)
    result = drop(mesh, height=0.02, frames=10, law=law)
    assert result.smallest_gap > 0
    assert result.displacements[-1, :, 2].mean() < -0.01


def test_it_is_one_of_them(law):
    """The registry lists it after those of the package."""
    assert LAWS.names == (*(name.value for name in Law), "toy")
    with pytest.raises(TypeError, match="no second derivative"):
        ElasticLaw(title="half", energy_and_stress=energy_and_stress)
