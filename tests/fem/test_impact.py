"""Balls that fall, rest and bounce, and the steps that do not converge at once."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import ConvergenceError
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.obstacles import Plane, Sphere
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve import dynamics
from autophyx_tet.fem.solve.dynamics import Damping, Dynamics
from autophyx_tet.fem.solve.schemes import Scheme

from .bodies import ball, lifted, mapped, shaken_box, with_uniform

RUBBER = {"E": 1e6, "nu": 0.45, "rho": 1100.0}
STEEL = {"E": 2e11, "nu": 0.3, "rho": 7850.0}
G = (0.0, 0.0, -9.81)


@pytest.mark.parametrize("material", [RUBBER, STEEL], ids=["rubber", "steel"])
@pytest.mark.slow
def test_ball_falls_and_rests(material):
    """Never in the ground; energy never grows (implicit Euler, no friction); at rest F = m g."""
    mesh = lifted(ball(0.05, 3, **material), 5e-3)
    body = Dynamics(mesh, gravity_vector=G, obstacles=[Plane()], tolerance=1e-8)
    states = body.run(1e-3, 50)
    assert min(s.gap for s in states) > 0
    energy = np.array([s.energy for s in states])
    assert (np.diff(energy) < 1e-8 * np.ptp(energy)).all()
    assert np.ptp(energy) > 0.1 * mesh.mass * 9.81 * 5e-3  # it did meet the ground
    for _ in range(15):
        state = body.step(0.1)
    weight = mesh.mass * 9.81
    assert state.contact_force.sum(axis=0) == pytest.approx([0, 0, weight], abs=1e-6 * weight)
    assert state.gap > 0


@pytest.mark.slow
def test_a_rod_that_drops_presses_as_its_wave_does():
    """While the wave runs up a rod of nu = 0 the ground feels rho c v, whatever its weight.

    The force within 1 % in the middle of the plateau; the largest pressure of a point within 10 %,
    as that of a block that stands: thirds of split squares are no shares of equal areas.
    """
    rod = lifted(with_uniform(box_mesh((0.2, 0.2, 1.0), (2, 2, 12)), E=1e7, nu=0.0, rho=1e3), 2e-3)
    body = Dynamics(rod, velocity=(0, 0, -0.5), obstacles=[Plane()], order=1, self_contact=False)
    state = body.run(1e-3, 8)[-1]  # 4 ms on the ground; the wave is back after 20
    wave = 1e3 * np.sqrt(1e7 / 1e3) * 0.5
    assert state.contact_force[:, 2].sum() / 0.04 == pytest.approx(wave, rel=0.01)
    assert state.pressures.obstacles[0] == pytest.approx(wave, rel=0.1)


def rebound(dt, speed=1.0):
    """Speed of a rubber ball after it met the ground at ``speed``."""
    mesh = lifted(ball(0.05, 3, **RUBBER), 2e-4)
    body = Dynamics(mesh, velocity=(0, 0, -speed), obstacles=[Plane()], scheme=Scheme.BDF2)
    touched = False
    while True:
        state = body.step(dt)
        pressed = state.contact_force[:, 2].sum() > 0
        if touched and not pressed and state.v[:, 2].mean() > 0:
            return float(body.mass @ state.v[:, 2] / body.mass.sum())
        touched |= pressed


@pytest.mark.slow
def test_rebound_converges():
    """The rebound speed changes less with every halving of the step, and stays below 1.

    A ball of 5^3 cells leaves with .905, .942, .950, .951 of its speed (BDF2, 0.8 to 0.1 ms).
    """
    speeds = np.array([rebound(4e-4 / 2**k) for k in range(4)])
    change = np.abs(np.diff(speeds))
    assert (change[1:] < 0.75 * change[:-1]).all()
    assert ((speeds > 0.5) & (speeds < 1)).all()


def test_failed_step_is_halved(monkeypatch):
    """A step whose Newton fails is made of two halves, and ends at the same time."""
    options = {"velocity": (0.1, 0, 0), "gravity_vector": G}
    whole, halves = (Dynamics(shaken_box(E=1e4, rho=1e3), **options) for _ in range(2))
    halves.run(5e-3, 2)
    real, failures = dynamics.minimise, iter([True])

    def fails_once(*args, **kwargs):
        if next(failures, False):
            raise ConvergenceError("not yet")
        return real(*args, **kwargs)

    monkeypatch.setattr(dynamics, "minimise", fails_once)
    state = whole.step(1e-2)
    assert state.time == pytest.approx(1e-2)
    assert state.u == pytest.approx(halves.state.u, abs=1e-12)


def test_step_that_never_converges_is_told(monkeypatch):
    def fails(*args, **kwargs):
        raise ConvergenceError("Newton ended with residual 3 N")

    monkeypatch.setattr(dynamics, "minimise", fails)
    with pytest.raises(ConvergenceError, match="residual 3 N"):
        Dynamics(shaken_box(), gravity_vector=G).step(1e-2)


@pytest.mark.slow
def test_stiffness_damping():
    """Rayleigh's beta takes the energy of a mode as exp(-beta omega^2 t): a rod with nu = 0."""
    L, E, rho, beta = 1.0, 1e6, 1e3, 5e-3
    mesh = with_uniform(box_mesh((L, 0.1, 0.1), (10, 1, 1)), E=E, nu=0.0, rho=rho)
    v = np.zeros_like(mesh.points)
    v[:, 0] = 1e-3 * np.sin(np.pi * mesh.points[:, 0] / 2 / L)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    omega = np.pi / 2 / L * np.sqrt(E / rho)
    body = Dynamics(
        mesh, velocity=v, supports=held, law=Law.LINEAR, scheme=Scheme.BDF2,
        damping=Damping(stiffness=beta), tolerance=1e-6,
    )  # fmt: skip
    period = 2 * np.pi / omega
    states = body.run(period / 200, 200)
    lost = np.log(states[0].energy / states[-1].energy)
    assert lost == pytest.approx(beta * omega**2 * period, rel=0.05)


@pytest.mark.slow
def test_hertz():
    """A rigid ball pressed d deep into a half-space: F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5.

    A quarter of a block 30 contact radii deep, whose base a point force F would move by
    F (1 + nu)(3 - 2 nu) / (2 pi E depth) (Boussinesq): that is part of d. So is the gap of contact.
    """
    E, nu, R, a = 1e6, 0.3, 1.0, 0.2
    z = [0.0, *np.arange(1, 5) * 0.4 * a]
    while z[-1] < 30 * a:
        z.append(z[-1] + 2 * (z[-1] - z[-2]))
    n, z = len(z) - 1, np.array(z)
    grade = lambda x: np.interp(x, np.arange(n + 1), z) * [1, 1, -1]  # noqa: E731
    mesh = with_uniform(mapped(box_mesh((n, n, n), (n, n, n)), grade), E=E, nu=nu, rho=1.0)
    x, d, thickness = mesh.points, a**2 / R, 6e-4
    held = Supports.none(len(x)).with_fixed(x[:, 0] == 0, 0).with_fixed(x[:, 1] == 0, 1)
    for axis in range(3):
        held = held.with_fixed(x[:, 2] == -z[-1], axis)
    indenter = Sphere((0, 0, R + thickness), R, (0, 0, -(d + thickness) / 2))
    body = Dynamics(
        mesh, supports=held, obstacles=[indenter], thickness=thickness, law=Law.LINEAR, order=2
    )
    state = body.run(1.0, 2)[-1]
    force = -4 * state.contact_force[:, 2].sum()
    deep = d + state.gap + force * (1 + nu) * (3 - 2 * nu) / (2 * np.pi * E * z[-1])
    assert force == pytest.approx(4 / 3 * E / (1 - nu**2) * np.sqrt(R) * deep**1.5, rel=0.05)
