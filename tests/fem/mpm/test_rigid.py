"""Stiff matter: rigid bodies keep their momenta and shape, stationary ones hold, caps are told."""

import dataclasses

import numpy as np
import pytest
from autophyx_tet.fem.mpm.boundaries import Touch, Wall, grid_around
from autophyx_tet.fem.mpm.materials import MaterialClass, Substance
from autophyx_tet.fem.mpm.particles import Particles, block_places
from autophyx_tet.fem.mpm.rigid import Stiff, treated
from autophyx_tet.fem.mpm.solver import MpmSolver
from autophyx_tet.fem.mpm.time_step import largest_modulus
from autophyx_tet.fem.scene.obstacles import Box, Plane

from .bodies import block, momenta

DX = 1 / 16


def steel(cells):
    """A rigid block of so many cells."""
    body = block((0, 0, 0), tuple(n * DX for n in cells), DX, E=2e11, rho=7800.0)
    return dataclasses.replace(body, rigid=np.zeros(len(body.x), dtype=np.int64))


def distances(x):
    return np.linalg.norm(x[::17, None] - x[None, ::13], axis=2)


@pytest.mark.slow
def test_a_free_rigid_body_keeps_its_momenta_and_its_shape():
    """Tumbling about no principal axis, over a third of a turn: all to round-off."""
    body = steel((2, 3, 5))
    spin = np.array([3.0, 2.0, 4.0])
    v = np.cross(spin, body.x - body.x.mean(axis=0)) + np.array([0.3, 0.0, 0.1])
    body = dataclasses.replace(body, velocity=v)
    room = grid_around([-0.4] * 3, [0.8] * 3, DX)
    solver = MpmSolver(body, room, gravity_vector=(0, 0, 0), step=5e-4)
    assert solver.advance(5e-4)  # C of a rigid motion is there from the first step on
    p, turning, _ = momenta(solver)
    shape = distances(solver.state.x)
    assert solver.advance(0.4)
    after, turning_after, _ = momenta(solver)
    assert np.abs(after - p).max() < 1e-12 * np.linalg.norm(p)
    assert np.abs(turning_after - turning).max() < 1e-11 * np.linalg.norm(turning)  # 800 steps
    assert np.abs(distances(solver.state.x) - shape).max() < 1e-12
    F = solver.state.F
    assert np.abs(F @ F.transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
    assert np.abs(F - np.eye(3)).max() > 0.5  # it did turn


@pytest.mark.slow
def test_a_dropped_rigid_body_comes_to_rest_on_the_ground():
    """The ground bears its weight, and it stands within a cell of where it must."""
    body = steel((5, 4, 3))
    room = grid_around([-0.3, -0.3, -0.3], [0.6, 0.6, 0.5], DX, planes={2: -0.2})
    ground = Wall(shape=Plane((0, 0, -0.2)), friction=0.5)
    solver = MpmSolver(body, room, walls=(ground,), step=5e-4)
    assert solver.advance(0.8)
    solver.substep.take_impulses()
    assert solver.advance(0.2)
    push = solver.substep.take_impulses()[0] / 0.2
    assert push[2] == pytest.approx(body.mass.sum() * 9.81, rel=1e-3)  # it rocks
    assert np.abs(solver.state.v).max() < 2 * 9.81 * 5e-4  # what gravity adds in a step
    assert abs(solver.state.x[:, 2].min() + 0.2) < DX


@pytest.mark.slow
def test_what_stands_on_stationary_matter_is_held_by_it():
    """A jelly block on a stationary one sags as a clamped one, and leaves it its weight."""
    low = block((0, 0, -2 * DX), (4 * DX, 4 * DX, 0), DX)
    high = block((0, 0, 0), (4 * DX, 4 * DX, 6 * DX), DX, E=1e6, nu=0.0)
    x = np.concatenate([low.x, high.x])
    body = Particles.of(x, low.volume[0], E=1e6, nu=0.0, rho=1000.0)
    still = Substance(kind=MaterialClass.STATIONARY)
    kinds = np.repeat([1, 0], [len(low.x), len(high.x)])
    body = dataclasses.replace(body, substance=kinds, substances=(Substance(), still))
    solver = MpmSolver(body, grid_around([-0.1] * 3, [0.4] * 3, DX), damping=20.0)
    assert solver.advance(1.0)
    moved = solver.state.x - x
    assert (moved[kinds == 1] == 0).all()
    height = 6 * DX
    # The clamp lies within half a cell of the face between them: 8 % of the height.
    found = moved[kinds == 0, 2].min() / (-1000 * 9.81 * height**2 / 2 / 1e6)
    assert 0.8 < found < 1.1
    free = kinds == 0
    weight = (body.mass[free] * 9.81).sum()
    solver.substep.take_impulses()
    assert solver.advance(0.1)
    push = solver.substep.take_impulses()[-1, 2] / 0.1
    assert push == pytest.approx(weight, rel=0.02)  # 1.6 %: the rest of the swing


def test_stiff_matter_is_found_and_treated_before_running():
    """At twice E_max: held bodies stand still, free ones are rigid; a cap is told, with its sag."""
    most = float(largest_modulus(0.3, 1000.0, DX, 1 / 40_000))
    places = [block_places((x, 0, 0), (x + 2 * DX, 2 * DX, 2 * DX), DX) for x in (0.0, 1.0, 2.0)]
    E = np.repeat([2 * most, 2 * most, 0.5 * most], 64)
    body = Particles.of(np.concatenate(places), (DX / 2) ** 3, E=E, nu=0.3, rho=1000.0)
    held = body.x[:, 0] < DX
    found = treated(body, DX, held=held)
    assert (found.stationary, found.rigid, found.bodies, found.capped) == (64, 64, 1, 0)
    assert found.particles.held[:64].all()
    assert (found.particles.rigid[64:128] == 0).all()
    assert (found.particles.rigid[128:] == -1).all()
    assert "1 rigid body" in found.notes[0]
    still = treated(body, DX, held=held, stiff=Stiff.STATIONARY)
    assert (still.stationary, still.rigid) == (128, 0)
    soft = treated(body, DX, held=held, stiff=Stiff.CAP)
    assert soft.capped == 128
    assert np.allclose(soft.particles.E[:128], most)
    assert "softened" in soft.notes[0]
    assert treated(body, DX, held=held, budget=80_000).rigid == 0


def test_published_settings_have_their_limit():
    """PhysGaussian's 2 m over 50 cells, steps of 1e-4 s, rho 200, nu 0.4: 1.5e7 Pa at C = 1."""
    found = largest_modulus(0.4, 200.0, 2.0 / 50, 1e-4, courant=1.0)
    assert found == pytest.approx(200 * 400**2 * (1.4 * 0.2) / 0.6, rel=1e-12)
    assert 1.45e7 < found < 1.55e7


@pytest.mark.slow
def test_grips_take_along_what_they_hold():
    """A sticky box that moves carries its particles."""
    body = block((0, 0, 0), (4 * DX,) * 3, DX, E=1e5)
    room = grid_around([-0.3] * 3, [0.6] * 3, DX)
    grip = Box((0.125,) * 3, (0.4,) * 3, velocity=(0.5, 0.0, 0.0))
    still = {"gravity_vector": (0, 0, 0)}
    solver = MpmSolver(body, room, walls=(Wall(shape=grip, touch=Touch.STICKY),), **still)
    assert solver.advance(0.2)
    assert np.allclose(solver.state.v, [0.5, 0, 0], atol=1e-9)


def test_a_rigid_body_gains_nothing_from_the_ground():
    """A bar that lies on the ground and turns about a place near an end, which the ground stops.

    What goes away is nothing that the ground stops: by it, bodies were thrown up at an impact.
    """
    body = steel((8, 2, 1))
    velocity = np.cross([0.0, -3.0, 0.0], body.x - [1.5 * DX, 0.0, 0.0])
    body = dataclasses.replace(body, velocity=velocity)
    ground = Wall(shape=Plane(), friction=0.3)
    solver = MpmSolver(body, grid_around([-0.5] * 3, [1.0] * 3, DX), walls=(ground,), follows=True)

    def energy() -> float:
        state = solver.state
        kinetic = 0.5 * body.mass @ (state.v**2).sum(axis=1)
        return float(kinetic + 9.81 * body.mass @ (state.x - body.x)[:, 2])

    start, most = energy(), -np.inf
    for _ in range(20):
        assert solver.advance(0.01), solver.failure
        most = max(most, energy())
    assert most < start
