"""Transfers between particles and grid: what they conserve exactly, and free fall."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mpm.boundaries import grid_around
from autophyx_tet.fem.mpm.particles import Particles
from autophyx_tet.fem.mpm.solver import MpmSolver

from .bodies import block, momenta, spinning

DX = 1 / 16


def falling(**given):
    body = block((0.0,) * 3, (3 * DX,) * 3, DX, E=1e4)
    return MpmSolver(body, grid_around([0.0, 0.0, -0.5], [3 * DX] * 3, DX), **given)


def test_a_free_block_falls_as_one():
    """After n steps of symplectic Euler every particle fell g dt^2 n (n + 1) / 2, undeformed."""
    solver = falling(step=1e-3)
    before = solver.state.x
    assert solver.advance(0.2)
    fell = solver.state.x - before
    # Round-off of sums: measured 4e-16.
    assert np.abs(fell[:, 2] + 9.81e-6 * 200 * 201 / 2).max() < 1e-12
    assert np.abs(fell[:, :2]).max() < 1e-12
    assert np.abs(solver.state.F - np.eye(3)).max() < 1e-12


def test_momentum_and_angular_momentum_stay():
    """A turning block: both are kept to round-off, with the affine part of the velocities."""
    solver = spinning((0.0, 3.0, 5.0))
    p, turning, _ = momenta(solver)
    assert solver.advance(0.02)
    after, turning_after, _ = momenta(solver)
    assert np.abs(after - p).max() < 1e-12 * np.linalg.norm(p)
    assert np.abs(turning_after - turning).max() < 1e-12 * np.linalg.norm(turning)


@pytest.mark.slow
def test_a_spinning_block_keeps_its_energy():
    """Over a full turn the kinetic energy stays within 1 %."""
    solver = spinning((0.0, 0.0, 6.0))
    energy = momenta(solver)[2]
    assert solver.advance(2 * np.pi / 6)
    assert momenta(solver)[2] == pytest.approx(energy, rel=0.01)  # what transfers dissipate


@pytest.mark.slow
def test_two_threads_answer_as_one():
    """Sums in another order: equal to round-off that grew over 50 steps."""
    one, two = falling(threads=1, step=1e-3), falling(threads=2, step=1e-3)
    for solver in (one, two):
        solver.cloud.write("v", np.random.default_rng(0).standard_normal((216, 3)) * 0.01)
        assert solver.advance(0.05)
    assert np.abs(one.state.x - two.state.x).max() < 1e-13


@pytest.mark.slow
def test_sorting_and_listing_change_nothing():
    """A block that crosses many cells comes as far as one whose order was never touched."""
    solver = spinning((0.0, 0.0, 0.0), shift=(2.0, 0.5, 0.0))
    before = solver.state.x
    assert solver.advance(0.2)
    assert np.abs(solver.state.x - before - [0.4, 0.1, 0.0]).max() < 1e-12


def test_a_particle_that_leaves_the_grid_freezes_and_is_counted():
    """Nothing crashes: those outside stand still; when all are, it is a failure with advice."""
    solver = falling(step=1e-3)
    x = solver.cloud.read("x")
    x[:7, 0] -= 100.0
    solver.cloud.write("x", x)
    solver.cloud.mark()
    assert solver.advance(0.01)
    assert solver.outside == 7
    assert (solver.state.x[:7] == x[:7]).all()
    x[:] -= 100.0
    solver.cloud.write("x", x)
    assert not solver.advance(0.01)
    assert solver.failure.kind == "left grid"
    far = block((100.0,) * 3, (100.2,) * 3, 0.1)  # none is in the room from the start
    solver = MpmSolver(far, grid_around([0.0] * 3, [1.0] * 3, 0.1))
    assert not solver.advance(0.01)
    assert solver.failure.kind == "left grid"


def test_values_that_are_not_finite_are_a_failure():
    solver = falling(step=1e-3)
    v = solver.cloud.read("v")
    v[3] = np.nan
    solver.cloud.write("v", v)
    assert not solver.advance(0.01)
    assert solver.failure.kind == "not finite"
    assert "body" in str(solver.failure)


def test_a_step_that_is_too_long_is_reported_before_running():
    """At twice the modulus that the steps allow the answer is cfl, and nothing has moved."""
    from autophyx_tet.fem.mpm.time_step import largest_modulus

    most = float(largest_modulus(0.3, 1000.0, DX, 1e-3))
    body = block((0.0,) * 3, (3 * DX,) * 3, DX, E=2 * most)
    solver = MpmSolver(body, grid_around([0.0] * 3, [3 * DX] * 3, DX), step=1e-3)
    assert not solver.advance(0.01)
    assert solver.failure.kind == "cfl"
    assert solver.failure.E_max == pytest.approx(most, rel=1e-6)  # float32 clock on a GPU
    assert solver.time == solver.substeps == 0


@pytest.mark.parametrize(
    "wrong", [{"E": np.nan}, {"nu": 0.5}, {"rho": -1.0}, {"volume": 0.0}, {"x": np.empty((0, 3))}]
)
def test_particles_that_no_body_has_are_refused(wrong):
    given = {"x": np.zeros((2, 3)), "volume": 1.0, "E": 1e5, "nu": 0.3, "rho": 1.0} | wrong
    with pytest.raises(InputError):
        Particles.of(given.pop("x"), given.pop("volume"), **given)


def test_there_is_one_rule_of_the_step():
    """What is just stiff enough for a step of ``dt`` has waves whose stable step is ``dt``."""
    from autophyx_tet.fem.material import wave_speed
    from autophyx_tet.fem.mpm.time_step import MOST_STRAIN, largest_modulus, stable_step

    nu, rho = np.array([0.3]), np.array([1000.0])
    waves = float(wave_speed(largest_modulus(nu, rho, DX, 1e-3), nu, rho)[0])
    assert stable_step(waves, 0.0, DX) == pytest.approx(1e-3, rel=1e-12)
    # From rest under an acceleration g: dt g is the speed, so that dt^2 g is what it crosses.
    assert stable_step(0.0, 0.0, DX, pull=9.81) == pytest.approx(np.sqrt(0.4 * DX / 9.81))
    assert stable_step(0.0, 0.0, DX, spread=5.0) == MOST_STRAIN / 5.0
    assert stable_step(0.0, 0.0, DX) == np.inf
