"""The seven classes at one material point, against their closed forms."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mpm.boundaries import grid_around
from autophyx_tet.fem.mpm.kernels_transfer import OPEN
from autophyx_tet.fem.mpm.materials import (
    SNOW_COMPRESSION,
    MaterialClass,
    Substance,
    plane_friction,
    triaxial_friction,
)
from autophyx_tet.fem.mpm.particles import Particles
from autophyx_tet.fem.mpm.solver import MpmSolver
from scipy.linalg import expm

from ..bodies import random_rotation
from .points import EYE, deviator, driven, shear

METAL = Substance(kind=MaterialClass.METAL, yield_stress=2.5e8)
STEEL = {"E": 2e11, "nu": 0.3}


def size(tensor):
    return np.sqrt((tensor**2).sum())


@pytest.mark.slow
def test_metal_yields_on_a_plateau():
    """Simple shear past the yield: |dev tau| = sqrt(2/3) sigma_y, however long the steps are."""
    for steps in (20, 400):
        tau, _, _ = driven(METAL, lambda t: shear(0.05 * t), steps=steps, **STEEL)
        found = size(deviator(tau[-1]))
        assert found == pytest.approx(np.sqrt(2 / 3) * 2.5e8, rel=1e-9)  # return mapping is radial


@pytest.mark.slow
def test_metal_hardens_by_its_modulus():
    """Sqrt(3/2) |dev tau| = sigma_y + H a, with a the plastic strain on record."""
    hard = Substance(kind=MaterialClass.METAL, yield_stress=2.5e8, hardening=2e9)
    tau, _, a = driven(hard, lambda t: shear(0.05 * t), steps=2000, **STEEL)
    found = np.sqrt(1.5) * size(deviator(tau[-1]))
    assert found == pytest.approx(2.5e8 + 2e9 * a, rel=1e-7)  # linear in a step
    assert a > 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "exponent"), [(1.0, 1.0), (10.0, 1.0), (10.0, 0.5), (3.0, 1.7)])
def test_a_herschel_bulkley_paste_flows_at_its_stress(rate, exponent):
    """Steady shear: |dev tau| = sqrt(2/3) sigma_y + eta |D_p|^h, and |D_p| = rate / sqrt 2."""
    paste = Substance(
        kind=MaterialClass.VISPLAS, yield_stress=500.0, viscosity=10.0, exponent=exponent
    )
    tau, _, _ = driven(
        paste, lambda t: shear(rate * t), E=1e6, nu=0.3, steps=4000, time=0.4 if rate > 2 else 1.0
    )
    wanted = np.sqrt(2 / 3) * 500 + 10 * (rate / np.sqrt(2)) ** exponent
    # The Hencky strain of simple shear rotates: |D_p| of the logarithm differs by O(strain^2).
    assert size(deviator(tau[-1])) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.slow
def test_sand_slides_on_its_cone():
    """Shear under pressure: |dev tau| = 3 alpha p."""
    alpha = triaxial_friction(np.deg2rad(35))
    sand = Substance(kind=MaterialClass.SAND, friction=alpha)
    tau, _, _ = driven(sand, lambda t: 0.999 * shear(0.05 * t), E=3e7, nu=0.3, steps=400)
    pressure = -np.trace(tau[-1]) / 3
    assert pressure > 0
    assert size(deviator(tau[-1])) == pytest.approx(3 * alpha * pressure, rel=1e-9)


@pytest.mark.slow
def test_sand_bears_no_tension_and_remembers_what_it_gained():
    """A stretch is forgotten but for its volume; as much compression later bears nothing yet."""
    sand = Substance(kind=MaterialClass.SAND, friction=0.3)
    tau, H, q = driven(sand, lambda t: (1 + 1e-3 * t) * EYE, E=3e7, nu=0.3, steps=10)
    assert not tau.any()
    assert not H.any()
    assert q == pytest.approx(3 * np.log(1.001), rel=1e-12)  # sums of logarithms
    there_and_back = lambda t: (1 + 1e-3 * np.sin(np.pi * t)) * EYE  # noqa: E731
    tau, _, q = driven(sand, there_and_back, E=3e7, nu=0.3, steps=20)
    # Round-off of the last step alone: 3e7 Pa times 1e-15.
    assert np.abs(tau[-1]).max() < 1e-6 * 3e7 * 1e-3


def test_the_cone_fits_triaxial_tests_or_plane_strain():
    """In plane strain sin f = |s| / (sqrt 2 p), in triaxial compression 6 sin f / (3 - sin f)."""
    angle = np.deg2rad(31)
    assert 3 * plane_friction(angle) == pytest.approx(np.sqrt(2) * np.sin(angle), rel=1e-14)
    slope = np.sqrt(1.5) * 3 * triaxial_friction(angle)  # q / p of soil mechanics
    assert slope == pytest.approx(6 * np.sin(angle) / (3 - np.sin(angle)), rel=1e-14)


@pytest.mark.slow
def test_snow_keeps_what_its_clamp_leaves():
    """Compressed to 0.9: J_p = 0.9 / (1 - theta_c), hardened by exp(10 (1 - J_p))."""
    snow = Substance(kind=MaterialClass.SNOW)
    path = lambda t: np.diag([1 - 0.1 * t, 1.0, 1.0])  # noqa: E731
    tau, H, Jp = driven(snow, path, E=1.4e5, nu=0.2, steps=50)
    s = 1 - SNOW_COMPRESSION
    assert Jp == pytest.approx(0.9 / s, rel=1e-12)
    assert H[0, 0] == pytest.approx(-SNOW_COMPRESSION, rel=1e-12)
    mu, lam = 1.4e5 / 2.4, 1.4e5 * 0.2 / (1.2 * 0.6)
    hard = np.exp(10 * (1 - 0.9 / s))
    wanted = hard * (2 * mu * (s - 1) * s + lam * (s - 1) * s)
    assert tau[-1][0, 0] == pytest.approx(wanted, rel=1e-11)  # root by Pade


@pytest.mark.slow
def test_elastic_classes_have_their_E_and_nu():
    """A uniaxial stretch of 1e-6 with lateral strain -nu: stress E times strain, none across."""
    e, nu = 1e-6, 0.4
    path = lambda t: np.diag([1 + e * t, 1 - nu * e * t, 1 - nu * e * t])  # noqa: E731
    stiff = {"yield_stress": 1e12}
    for substance in (
        Substance(),
        Substance(kind=MaterialClass.METAL, **stiff),
        Substance(kind=MaterialClass.VISPLAS, **stiff),
        Substance(kind=MaterialClass.SNOW),
    ):
        tau, _, _ = driven(substance, path, E=1e5, nu=nu, steps=1)
        # The second order of the strain: 1e-6, a few times.
        assert tau[-1][0, 0] == pytest.approx(1e5 * e, rel=1e-5)
        assert abs(tau[-1][1, 1]) < 1e-5 * 1e5 * e


@pytest.mark.slow
def test_a_fluid_presses_by_its_equation_of_state_and_shears_by_its_viscosity():
    """P = K/7 (J^-7 - 1); in shear at a rate g, tau_xy = J eta g, whatever the strain was."""
    water = Substance(kind=MaterialClass.FLUID, bulk=2e5, viscosity=3.0)
    tau, _, _ = driven(water, lambda t: (1 - 0.01 * t) * EYE, E=1.0, nu=0.0, steps=5)
    J = 0.99**3
    wanted = -J * 2e5 / 7 * (J**-7 - 1)
    # The last step's viscous part has no deviator here.
    assert np.allclose(tau[-1], wanted * EYE, rtol=1e-12)
    tau, _, _ = driven(water, lambda t: shear(2.0 * t), E=1.0, nu=0.0, steps=50)
    assert tau[-1][0, 1] == pytest.approx(3.0 * 2.0, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(MaterialClass)[:6])
def test_classes_do_not_depend_on_the_frame(kind):
    """Tau(Q F) = Q tau(F) Q^T with the same state, elastic and past the yield."""
    substance = Substance(
        kind=kind, yield_stress=500.0, viscosity=3.0, friction=0.3, bulk=1e5, hardening=100.0
    )
    path = lambda t: np.diag([1 - 0.08 * t, 1 - 0.02 * t, 1.01]) @ shear(0.2 * t)  # noqa: E731
    turn = random_rotation(3)
    plain, _, q = driven(substance, path, E=1e5, nu=0.3, steps=30)
    turned, _, q_turned = driven(substance, path, E=1e5, nu=0.3, steps=30, turn=turn)
    assert np.allclose(turned, turn @ plain @ turn.T, rtol=1e-8, atol=1e-8 * 1e5)
    assert q_turned == pytest.approx(q, rel=1e-8, abs=1e-12)


@pytest.mark.slow
def test_jelly_is_the_law_of_the_finite_elements():
    """The Kirchhoff stress is P F^T of ``laws.neo_hookean``, large strains too."""
    import warp as wp
    from autophyx_tet.fem.elements.kernels_elastic import elastic_kernels
    from autophyx_tet.fem.laws.law import LAWS
    from autophyx_tet.fem.material import lame_parameters

    F = EYE + 0.3 * np.random.default_rng(1).standard_normal((3, 3))
    tau, _, _ = driven(Substance(), lambda t: EYE + t * (F - EYE), E=1e5, nu=0.4, steps=1)
    lam, mu = (wp.array([float(v)], dtype=wp.float64) for v in lame_parameters(1e5, 0.4))
    P, W = wp.zeros(1, dtype=wp.mat33d), wp.zeros(1, dtype=wp.float64)
    given = [wp.array((F - EYE)[None], dtype=wp.mat33d), lam, mu]
    wp.launch(elastic_kernels(LAWS["neohookean"]).stress, 1, [*given, W, P])
    # Round-off in another order of sums.
    assert np.allclose(tau[-1], P.numpy()[0] @ F.T, rtol=1e-12, atol=1e-7)
    assert energy_of(Substance(), F, E=1e5, nu=0.4) == pytest.approx(W.numpy()[0], rel=1e-12)


def energy_of(substance, F, *, E, nu):
    """Elastic energy [J] of a particle of 1 m^3, as the solver tells it."""
    body = Particles.of(np.full((1, 3), 0.5), 1.0, E=E, nu=nu, rho=1e3, substance=substance)
    solver = MpmSolver(body, grid_around([0.0] * 3, [1.0] * 3, 1.0))
    solver.cloud.write("H", (F - EYE)[None])
    return solver.elastic_energy


@pytest.mark.slow
@pytest.mark.parametrize(
    "substance",
    [
        Substance(corotated=True),
        Substance(kind=MaterialClass.METAL, yield_stress=1e9),
        Substance(kind=MaterialClass.SAND, friction=50.0),
        Substance(kind=MaterialClass.VISPLAS, yield_stress=1e9, viscosity=1.0),
        Substance(kind=MaterialClass.SNOW, hardening=0.0),
        Substance(kind=MaterialClass.FLUID, bulk=1e5),
    ],
    ids=lambda s: "corotated" if s.corotated else s.kind.name,
)
def test_stress_is_what_the_energy_grows_by(substance):
    """W(exp(h A) F) grows by h tau : A, for a matrix A, while nothing yields; pressed, for sand."""
    rng = np.random.default_rng(2)
    F = 0.99 * EYE + 0.004 * rng.standard_normal((3, 3))
    A, h = rng.standard_normal((3, 3)), 1e-6
    if substance.kind == MaterialClass.FLUID:  # it keeps J - 1 in the first entry
        F, A = np.diag([np.linalg.det(F), 1.0, 1.0]), np.diag([1.0, 0.0, 0.0])
    tau = driven(substance, lambda t: F, E=1e5, nu=0.3, steps=1)[0][-1]
    up, down = (energy_of(substance, expm(s * A) @ F, E=1e5, nu=0.3) for s in (h, -h))
    assert (up - down) / (2 * h) == pytest.approx((tau * A).sum(), rel=1e-6)


@pytest.mark.slow
def test_tearing_jelly_softens_to_its_crack():
    """Uniaxial: the peak is f_t; then sigma = f_t exp(-H_s (k - 1)), k the strain over f_t/E."""
    weak = Substance(tension=100.0, fracture_energy=1.0)
    softening = 0.5
    path = lambda t: np.diag([1 + 0.004 * t, 1.0, 1.0])  # noqa: E731
    numbers = (100.0, softening, 0.0)
    tau, _, q = driven(weak, path, E=1e5, nu=0.0, steps=400, numbers=numbers)
    strain = 0.004 * np.arange(1, 401) / 400
    k = np.maximum(strain / 1e-3, 1.0)
    wanted = np.where(strain < 1e-3, 1e5 * strain, 100 * np.exp(-softening * (k - 1)))
    # Stable neo-Hookean stress departs from E strain by its square, 0.4 %.
    assert np.abs(tau[:, 0, 0] - wanted).max() < 1.0
    assert q == pytest.approx(4.0, rel=0.01)


def test_a_crumb_that_is_stretched_for_ever_stays_a_number():
    """F = R diag(exp(400 t), 1, 1), as of a lone particle: kept R diag(4, 1, 1), no stress."""
    weak, turn = Substance(tension=100.0, fracture_energy=1.0), random_rotation(3)
    path = lambda t: np.diag([np.exp(400 * t), 1.0, 1.0])  # noqa: E731
    numbers = (100.0, 0.5, 0.0)
    tau, H, q = driven(weak, path, E=1e5, nu=0.2, steps=4000, turn=turn, numbers=numbers)
    np.testing.assert_allclose(H + EYE, turn @ np.diag([OPEN, 1.0, 1.0]), atol=1e-9)
    assert np.isfinite(tau).all()
    assert np.isfinite(q)
    assert np.abs(tau[-1]).max() < 1e-6  # of 1e5 Pa, by GONE


@pytest.mark.parametrize(
    "wrong",
    [{"yield_stress": -1.0}, {"viscosity": float("nan")}, {"exponent": 0.0}, {"tension": 1.0}],
)
def test_numbers_that_no_matter_has_are_refused(wrong):
    with pytest.raises(InputError, match="wanted"):
        Substance(**wrong)


@pytest.mark.slow
def test_corotated_jelly_is_the_derivative_of_its_energy():
    """Tau = dPsi/dF F^T of Psi = mu |F - R|^2 + lambda/2 (J - 1)^2, small and large strains."""
    from autophyx_tet.fem.material import lame_parameters
    from scipy.linalg import polar

    lam, mu = map(float, lame_parameters(1e5, 0.4))

    def energy(F):
        return mu * ((F - polar(F)[0]) ** 2).sum() + lam / 2 * (np.linalg.det(F) - 1) ** 2

    step = 1e-6
    for size in (0.02, 0.3):
        F = EYE + size * np.random.default_rng(1).standard_normal((3, 3))
        given = Substance(corotated=True)
        tau, _, _ = driven(given, lambda t, F=F: EYE + t * (F - EYE), E=1e5, nu=0.4, steps=1)
        P = np.zeros((3, 3))
        for i, j in np.ndindex(3, 3):
            d = np.zeros((3, 3))
            d[i, j] = step
            P[i, j] = (energy(F + d) - energy(F - d)) / (2 * step)
        # Central differences: round-off of the energy by the step, 1e-16 Psi / 1e-6.
        assert np.allclose(tau[-1], P @ F.T, rtol=1e-6, atol=1e-2)
