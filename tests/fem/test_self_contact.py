"""Laws of contact of a body with itself and of its pieces with each other."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import GrownPattern, add_blocks, discretise, stiffness
from autophyx_tet.fem.mesh import TetMesh, box_mesh, point_components
from autophyx_tet.fem.scene.obstacles import Plane, gripper
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve import self_contact
from autophyx_tet.fem.solve.dynamics import METHOD, Dynamics
from autophyx_tet.fem.solve.self_contact import SelfContact
from autophyx_tet.toolkit.verdict.checks import no_penetration
from hypothesis import given, settings
from hypothesis import strategies as st

from .bodies import lifted, merged, random_rotation, with_uniform

ORDERS = pytest.mark.parametrize("order", [1, 2])
G = (0.0, 0.0, -9.81)
RUBBER = {"E": 1e6, "nu": 0.45, "rho": 1100.0}


def stacked(*, gap=1e-3, cells=(2, 3), side=0.1, **material) -> TetMesh:
    """Cubes one above the other, of unlike meshes, the upper ones smaller."""
    boxes, z = [], gap
    for k, n in enumerate(cells):
        width = side * (1 - 0.2 * k)
        lo = ((side - width) / 2, (side - width) / 2, z)
        boxes.append(box_mesh((width, width, width), (n, n, n), lo=lo))
        z += width + gap
    return with_uniform(merged(*boxes), **(material or RUBBER))


def folded() -> TetMesh:
    """A strip folded to a U that lies on its side: two arms over each other, 0.02 m apart."""
    arm = {"size": (0.2, 0.05, 0.01), "cells": (10, 2, 1)}
    low, high = box_mesh(**arm), box_mesh(**arm, lo=(0, 0, 0.03))
    bend = box_mesh((0.01, 0.05, 0.04), (1, 2, 4), lo=(-0.01, 0, 0))
    return with_uniform(merged(low, high, bend), E=1e6, nu=0.3, rho=1000.0)


def inside(points, tets) -> np.ndarray:
    """How deep every point (n, 3) is in any of ``tets`` (m, 4, 3): least barycentric weight."""
    edges = np.linalg.inv((tets[:, 1:] - tets[:, :1]).transpose(0, 2, 1))
    weights = np.einsum("mij,nmj->nmi", edges, points[:, None] - tets[None, :, 0])
    return np.minimum(weights.min(axis=2), 1 - weights.sum(axis=2)).max(axis=1)


@pytest.mark.slow
@ORDERS
def test_stacked_bodies_carry_the_weight_above(order):
    """At rest each carries what lies on it, the floor all of it, to 1e-4."""
    mesh = stacked(cells=(2, 3, 2) if order == 1 else (1, 2))
    known = {"gravity_vector": G, "obstacles": [Plane()], "friction": 0.3}
    body = Dynamics(mesh, **known, order=order, tolerance=1e-6)
    state = body.run(0.05, 20)[-1]
    piece = point_components(mesh)[mesh.tets[:, 0]]
    weights = 9.81 * np.bincount(piece, mesh.volumes * mesh.material.rho)
    for below, above in enumerate(range(1, len(weights))):
        (force,) = [f.force for f in state.piece_forces if (f.on, f.by) == (above, below)]
        assert force == pytest.approx(
            [0, 0, weights[above:].sum()], abs=1e-4 * weights[above:].sum()
        )
    floor = state.obstacle_force[0]
    assert floor == pytest.approx([0, 0, weights.sum()], abs=1e-4 * weights.sum())
    assert state.gap > 0


@pytest.mark.slow
def test_a_collision_makes_no_energy():
    """Two cubes meet in free space: momentum to round-off, energy never grows (implicit Euler)."""
    mesh = stacked(gap=2e-3)
    v = np.zeros_like(mesh.points)
    v[mesh.points[:, 2] > 0.1025] = (0.1, 0.0, -1.0)
    body = Dynamics(mesh, velocity=v, tolerance=1e-8, order=1)
    states = body.run(2e-4, 60)
    energy = np.array([s.energy for s in states])
    assert (np.diff(energy) < 1e-8 * energy[0]).all()
    momentum = np.array([body.mass @ s.v for s in states])
    np.testing.assert_allclose(momentum, momentum[:1].repeat(61, 0), atol=1e-6 * momentum[0, 0])
    low = mesh.points[:, 2] < 0.1025
    assert (body.mass @ (states[-1].v * low[:, None]))[2] < -0.3 * abs(momentum[0, 2])  # they met


@pytest.mark.slow
def test_a_body_slides_on_another_as_far_as_friction_lets_it():
    """A cube on a held plate, thrown along it at v, stops after v^2 / (2 mu g), within 5 %."""
    mu, speed = 0.4, 0.4
    plate = box_mesh((0.3, 0.1, 0.02), (6, 2, 1), lo=(0, 0, -0.02))
    cube = box_mesh((0.05, 0.05, 0.02), (2, 2, 1), lo=(0.05, 0.025, 1e-4))
    mesh = with_uniform(merged(plate, cube), E=1e7, nu=0.3, rho=1000.0)
    upper = mesh.points[:, 2] > 0
    v = np.where(upper[:, None], (speed, 0.0, 0.0), 0.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] <= -0.02)
    body = Dynamics(mesh, velocity=v, supports=held, gravity_vector=G, friction=mu)
    state = body.run(2e-3, 80)[-1]
    slid = state.u[upper, 0].mean()
    assert slid == pytest.approx(speed**2 / (2 * mu * 9.81), rel=0.05)
    assert np.abs(state.v[upper, 0]).max() < 0.02 * speed


@pytest.mark.slow
def test_a_folded_strip_does_not_pass_through_itself():
    """Two plates press the arms of a U on each other: no point of one is ever inside the other."""
    mesh = folded()
    room = 2e-4
    plates = gripper((0, 0, -room), (0, 0, 0.04 + room), 2, 0.02)
    body = Dynamics(mesh, obstacles=plates, friction=0.3)
    upper = mesh.points[:, 2] > 0.0299
    upper &= mesh.points[:, 0] > 1e-9
    above = mesh.tets[upper[mesh.tets].all(axis=1)]
    below = mesh.tets[(mesh.points[:, 2] < 0.0101)[mesh.tets].all(axis=1)]
    pressed = 0.0
    for _ in range(11):
        state = body.step(0.05)
        x = mesh.points + state.u
        assert inside(x[upper], x[below]).max() < 0
        assert inside(x[np.unique(below)], x[above]).max() < 1e-9
        assert state.gap > 0
        pressed = max(pressed, float(np.abs(body.contact.own.push(state.u)).max()))
    assert pressed > 0.01  # the arms did meet


@pytest.mark.slow
@pytest.mark.parametrize("speed", [10.0, 300.0])
def test_thin_plates_do_not_tunnel(speed):
    """A plate that would pass through another in one step is stopped by it."""
    plate = box_mesh((0.1, 0.1, 0.002), (4, 4, 1))
    other = box_mesh((0.1, 0.1, 0.002), (3, 3, 1), lo=(0, 0, 0.01))
    mesh = with_uniform(merged(plate, other), **RUBBER)
    upper = mesh.points[:, 2] > 0.005
    v = np.where(upper[:, None], (0.0, 0.0, -speed), 0.0)
    body = Dynamics(mesh, velocity=v, order=1)
    state = body.run(0.05 / speed, 4)[-1]
    x = mesh.points + state.u
    assert x[upper, 2].mean() > x[~upper, 2].mean()
    assert state.v[~upper, 2].mean() < -0.3 * speed


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_forces_are_derivatives(friction):
    """Gradient by central differences of the energy, and equal and opposite on the two pieces."""
    mesh = stacked(gap=2e-4)
    grid = discretise(mesh, 1)
    own = SelfContact(mesh, grid.space, thickness=5e-4, friction=friction)
    rng = np.random.default_rng(0)
    u, d = 1e-5 * rng.normal(size=(2, *mesh.points.shape))
    own.begin(np.zeros_like(u), 1.0)
    own.lag_friction(u)
    energy = lambda u: own.barrier(u) + own.friction_energy(u)  # noqa: E731
    h, gradient = 1e-3, np.zeros_like(u)
    own.add_gradient(u, gradient)
    slope = (energy(u + h * d) - energy(u - h * d)) / (2 * h)
    assert (gradient * d).sum() == pytest.approx(slope, rel=1e-5)
    scale = np.abs(gradient).sum()
    assert scale > 0
    assert np.abs(gradient.sum(axis=0)).max() < 1e-12 * scale
    moment = np.cross(mesh.points + u, gradient).sum(axis=0)
    assert friction or np.abs(moment).max() < 1e-12 * scale


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 26), st.integers(0, 26)), min_size=1, max_size=12))
def test_a_matrix_grows_by_pairs(pairs):
    """The grown matrix is the old one, with room for the new blocks wherever they are."""
    mesh = with_uniform(box_mesh((1, 1, 1), (2, 2, 2)), E=1.0, nu=0.3)
    matrix = stiffness(discretise(mesh, 1), *mesh.material.lame)
    before = matrix.to_scipy().toarray()
    i, j = np.array(pairs).T
    blocks = np.random.default_rng(0).normal(size=(len(i), 3, 3))
    grown = GrownPattern().room(matrix, i, j)
    add_blocks(grown, i, j, blocks)
    grown = grown.to_scipy().toarray()
    for a, b, block in zip(i, j, blocks, strict=True):
        before[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += block
    np.testing.assert_allclose(grown, before, atol=1e-12)


def test_pieces_that_overlap_are_said_and_left():
    mesh = with_uniform(
        merged(box_mesh((1, 1, 1), (1, 1, 1)), box_mesh((1, 1, 1), (1, 1, 1), lo=(0.3, 0.4, 0.5))),
        E=1e5, nu=0.3, rho=1e3,
    )  # fmt: skip
    body = Dynamics(mesh, gravity_vector=G)
    assert any("overlap" in note for note in body.contact.notes)
    state = body.step(1e-2)  # falls freely, as one does
    np.testing.assert_allclose(state.v[:, 2], -9.81e-2, rtol=1e-6)


def test_a_thin_sheet_is_no_contact_with_itself():
    """Faces of one piece that are close at rest, across a thin wall, do not push each other."""
    mesh = with_uniform(box_mesh((1, 1, 2e-4), (8, 8, 1)), E=1e9, nu=0.3, rho=1e3)
    body = Dynamics(lifted(mesh, 1.0), gravity_vector=G)
    state = body.step(1e-2)
    # A barrier across the wall of 2e-4 m would part its sides by far more than round-off does.
    assert np.abs(state.u - state.u[0]).max() < 1e-4 * 2e-4
    assert state.barrier == 0
    (note,) = body.contact.notes
    assert "two sides of a wall" in note


def test_a_body_that_turns_keeps_what_it_knows(monkeypatch):
    """Rigid motions of any size change no distance: nothing is looked for again; bending is."""
    mesh = with_uniform(box_mesh((1, 0.2, 0.2), (6, 2, 2)), E=1e6, nu=0.3, rho=1e3)
    contact = SelfContact(mesh, discretise(mesh, 1).space, 1e-3, 0.0)
    x = mesh.points
    known = contact._find(contact._places(np.zeros_like(x)))

    def looked_for():
        raise AssertionError("it was looked for again")

    monkeypatch.setattr(self_contact, "ipc_toolkit", looked_for)
    for seed in range(5):
        u = x @ random_rotation(seed).T + 3.0 * seed - x
        assert contact._find(contact._places(u)).room == pytest.approx(known.room, rel=1e-9)
    with pytest.raises(AssertionError, match="looked for again"):
        contact._find(contact._places(np.outer(np.sin(3 * x[:, 0]), [0, 0, 1.0])))


def test_a_body_without_thin_walls_has_no_note():
    mesh = with_uniform(box_mesh((1, 1, 1e-2), (8, 8, 1)), E=1e9, nu=0.3, rho=1e3)
    assert not Dynamics(mesh, gravity_vector=G).contact.notes


def test_only_what_was_kept_apart_is_said_to_be():
    """A body that overlaps, one with thin walls and one not looked at may go into themselves."""
    cube, sheet = box_mesh((1, 1, 1), (1, 1, 1)), box_mesh((1, 1, 2e-4), (1, 1, 1))
    across = merged(cube, box_mesh((1, 1, 1), (1, 1, 1), lo=(0.3, 0.4, 0.5)))
    for mesh, looked_at, kept in (
        (cube, True, True), (cube, False, False), (sheet, True, False), (across, True, False),
    ):  # fmt: skip
        body = with_uniform(mesh, E=1e5, nu=0.3, rho=1e3)
        scene = Scene(mesh=body, self_contact=looked_at, duration=1e-2, frames=1)
        motion = METHOD.solve(scene, order=1)
        assert motion.kept_apart == kept
        assert ("or itself" in no_penetration(motion).sentence) == kept
