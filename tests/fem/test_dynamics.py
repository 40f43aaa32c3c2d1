"""Laws of motion: free fall, momentum, energy, frequencies, contact, friction, impact."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise
from autophyx_tet.fem.elements.forces import consistent_mass, lumped_mass
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.obstacles import Box, Capsule, Plane, Sphere, gripper
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import Damping, Dynamics
from autophyx_tet.fem.solve.schemes import Scheme
from hypothesis import given, settings
from hypothesis import strategies as st

from .bodies import lifted, shaken_box, with_uniform

SCHEMES = pytest.mark.parametrize("scheme", list(Scheme))
G = (0.0, 0.0, -9.81)


@pytest.mark.parametrize("order", [1, 2])
def test_free_fall(order):
    """Implicit Euler: z_n = z_0 - g h^2 n (n + 1) / 2, exactly."""
    body = Dynamics(shaken_box(E=1e6, rho=1e3), gravity_vector=G, order=order, tolerance=1e-11)
    h = 0.01
    for n, state in enumerate(body.run(h, 8)):
        assert state.u[:, 2] == pytest.approx(-9.81 * h * h * n * (n + 1) / 2, abs=1e-13)


@SCHEMES
def test_momentum_is_conserved(scheme):
    """A free body that wobbles keeps its momentum to round-off."""
    mesh = shaken_box(E=1e4, rho=1e3)
    rng = np.random.default_rng(0)
    v = rng.normal(size=mesh.points.shape)
    body = Dynamics(mesh, velocity=v, scheme=scheme, tolerance=1e-13)
    mass = body.mass[:, None]
    start, size = (mass * v).sum(axis=0), np.abs(mass * v).sum()
    for state in body.run(1e-3, 10):
        assert np.abs((mass * state.v).sum(axis=0) - start).max() < 1e-12 * size


@pytest.mark.slow
def test_energy_of_the_schemes():
    """A ringing rod: trapezoidal keeps its energy, implicit Euler never gains any."""
    mesh = with_uniform(box_mesh((1, 0.1, 0.1), (8, 1, 1)), E=1e6, nu=0.3, rho=1e3)
    v = np.zeros_like(mesh.points)
    v[:, 0] = mesh.points[:, 0] * 1e-2
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    energy = {}
    for scheme in Scheme:
        body = Dynamics(
            mesh, velocity=v, supports=held, scheme=scheme, law=Law.LINEAR, tolerance=1e-10
        )
        energy[scheme] = np.array([s.energy for s in body.run(2e-3, 60)])
    first = energy[Scheme.TRAPEZOIDAL][0]
    assert energy[Scheme.TRAPEZOIDAL] == pytest.approx(np.full(61, first), rel=1e-6)
    assert (np.diff(energy[Scheme.IMPLICIT_EULER]) <= 1e-12 * first).all()
    assert energy[Scheme.IMPLICIT_EULER][-1] < energy[Scheme.BDF2][-1] < first


@pytest.mark.slow
@pytest.mark.parametrize("scheme", [Scheme.TRAPEZOIDAL, Scheme.BDF2])
def test_rod_rings_at_its_frequency(scheme):
    """A fixed-free rod with nu = 0 swings with the period 4 L / c, c = sqrt(E / rho)."""
    L, E, rho = 1.0, 1e6, 1e3
    mesh = with_uniform(box_mesh((L, 0.1, 0.1), (20, 1, 1)), E=E, nu=0.0, rho=rho)
    v = np.zeros_like(mesh.points)
    v[:, 0] = 1e-3 * np.sin(np.pi * mesh.points[:, 0] / 2 / L)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    period = 4 * L / np.sqrt(E / rho)
    body = Dynamics(mesh, velocity=v, supports=held, scheme=scheme, law=Law.LINEAR, tolerance=1e-8)
    tip = np.array([s.u[mesh.points[:, 0] == L, 0].mean() for s in body.run(period / 100, 100)])
    zero = np.flatnonzero((tip[:-1] > 0) & (tip[1:] <= 0))[0]
    crossing = zero + tip[zero] / (tip[zero] - tip[zero + 1])
    assert crossing == pytest.approx(50, rel=0.02)


@pytest.mark.parametrize("order", [1, 2])
def test_masses(order):
    """Lumped and consistent masses sum to m and have the same centre of mass."""
    mesh = shaken_box(rho=3.0, size=(1, 2, 0.5))
    grid = discretise(mesh, order)
    space = grid.space
    lumped, consistent = lumped_mass(mesh, space), consistent_mass(mesh, grid)
    one = np.ones(len(space.nodes))
    assert lumped.sum() == pytest.approx(mesh.mass, rel=1e-12)
    assert one @ consistent @ one == pytest.approx(mesh.mass, rel=1e-12)
    assert (lumped > 0).all()
    exact = (mesh.volumes[:, None] * mesh.centroids).sum(axis=0) * 3.0
    assert one @ consistent @ space.nodes == pytest.approx(exact, rel=1e-12)


def settle(body, dt, steps):
    for _ in range(steps):
        state = body.step(dt)
    return state


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_rest_on_the_ground(order):
    """At rest the contact forces sum to m g, and nothing is below the ground."""
    mesh = lifted(shaken_box((1, 1, 1), (2, 2, 2), E=1e5, nu=0.3, rho=1e3), 0.01)
    body = Dynamics(mesh, gravity_vector=G, obstacles=[Plane()], order=order, tolerance=1e-10)
    for _ in range(40):
        state = body.step(0.1)
        assert state.gap > 0
    weight = mesh.mass * 9.81
    assert state.contact_force.sum(axis=0) == pytest.approx([0, 0, weight], abs=1e-6 * weight)


@pytest.mark.slow
@pytest.mark.parametrize("modulus", [1e5, 2e11])
def test_drop_loses_energy_only(modulus):
    """Dropped rubber and steel: always above the ground, energy never grows."""
    mesh = lifted(shaken_box((0.1,) * 3, (2, 2, 2), E=modulus, nu=0.3, rho=1e3), 0.02)
    body = Dynamics(mesh, gravity_vector=G, obstacles=[Plane()], tolerance=1e-6)
    states = body.run(2e-3, 60)
    assert min(s.gap for s in states) > 0
    energy = np.array([s.energy for s in states])
    assert (np.diff(energy) < 1e-9 * np.ptp(energy)).all()
    assert np.abs(states[-1].u).max() < 0.2


@pytest.mark.slow
@pytest.mark.parametrize(("slope", "slides"), [(0.25, False), (0.35, True)])
def test_incline(slope, slides):
    """A block on an incline slides if and only if tan(theta) > mu = 0.3."""
    mesh = lifted(shaken_box((0.2, 0.2, 0.1), (2, 2, 1), E=1e6, nu=0.3, rho=1e3), 2e-4)
    angle = np.arctan(slope)
    gravity = 9.81 * np.array([np.sin(angle), 0, -np.cos(angle)])
    body = Dynamics(mesh, gravity_vector=gravity, obstacles=[Plane()], friction=0.3)
    state = settle(body, 0.01, 60)
    moved, speed = state.u[:, 0].mean(), state.v[:, 0].mean()
    free = 0.5 * 9.81 * (np.sin(angle) - 0.3 * np.cos(angle)) * 0.6**2
    if slides:
        assert moved == pytest.approx(free, rel=0.1)
    else:
        assert abs(speed) < 1e-3
        assert abs(moved) < 1e-3


@pytest.mark.slow
def test_rod_impact():
    """A rod meets a wall at v: it leaves after 2 L / c, pressed with rho c v meanwhile."""
    L, E, rho, v = 1.0, 1e6, 1e3, 0.1
    mesh = with_uniform(
        box_mesh((L, 0.05, 0.05), (50, 1, 1), lo=(0.0015, 0, 0)), E=E, nu=0, rho=rho
    )
    c = np.sqrt(E / rho)
    dt = L / c / 200
    body = Dynamics(
        mesh, velocity=(-v, 0, 0), obstacles=[Plane(normal=(1, 0, 0))], scheme=Scheme.BDF2
    )
    force = np.array([s.contact_force[:, 0].sum() for s in body.run(dt, 600)])
    touching = np.flatnonzero(force > 0.05 * force.max())
    assert (touching[-1] - touching[0]) * dt == pytest.approx(2 * L / c, rel=0.05)
    pressed = force[touching[0] + 60 : touching[0] + 340].mean() / 0.05**2
    assert pressed == pytest.approx(rho * c * v, rel=0.05)


def test_stiff_and_soft_together():
    """1e6 beside 2e11 Pa under gravity neither explodes nor vanishes."""
    mesh = shaken_box((1, 0.2, 0.2), (10, 2, 2), E=1e6, rho=1e3)
    E = np.where(mesh.centroids[:, 2] > 0.1, 2e11, 1e6)
    mesh = mesh.with_material(type(mesh.material)(E, mesh.material.nu, mesh.material.rho))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    state = settle(Dynamics(mesh, supports=held, gravity_vector=G), 0.01, 10)
    assert 0 < np.abs(state.u).max() < 0.01


@pytest.mark.slow
def test_damping_slows_a_swing():
    """Rayleigh damping alpha takes energy as exp(-alpha t) from a rigid motion."""
    mesh = shaken_box(E=1e6, rho=1e3)
    body = Dynamics(mesh, velocity=(1, 0, 0), damping=Damping(mass=2.0), tolerance=1e-9)
    state = settle(body, 2.5e-3, 200)
    assert state.v[:, 0] == pytest.approx(np.full(len(mesh.points), np.exp(-1.0)), rel=5e-3)


@pytest.mark.slow
def test_gripper_squeezes():
    """Plates that close by 10 % press a block with about E times that strain."""
    mesh = lifted(shaken_box((0.1,) * 3, (3, 3, 3), E=1e5, nu=0.0, rho=1e3, amount=0), 0.0)
    plates = gripper((-2e-4, 0, 0), (0.1 + 2e-4, 0, 0), 0, speed=0.05)
    body = Dynamics(mesh, obstacles=plates)
    state = settle(body, 5e-3, 20)
    assert state.gap > 0
    right = state.contact_force[state.contact_force[:, 0] < 0, 0].sum()
    assert -right == pytest.approx(1e5 * 0.1 * 0.1**2, rel=0.1)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31))
def test_obstacle_distances(seed):
    """The gradient of a distance is a unit vector, and points to where it grows."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-3, 3, (20, 3))
    shapes = [
        Plane((0, 0, 0.2), (0.3, 0, 1)),
        Sphere((0.1, 0.2, 0), 0.5),
        Capsule((-1, 0, 0), (1, 0.5, 0), 0.3),
        Box((0, 0, 0.1), (0.5, 0.7, 0.2)),
    ]
    for shape in shapes:
        d = shape.distance(x)
        away = d.gap > 1e-3
        assert np.linalg.norm(d.normal[away], axis=1) == pytest.approx(1.0)
        h = 1e-6
        moved = shape.distance(x + h * d.normal)
        assert (moved.gap - d.gap)[away] == pytest.approx(h, rel=1e-3)


def test_start_inside_is_named():
    with pytest.raises(InputError, match="inside an obstacle"):
        Dynamics(shaken_box(), obstacles=[Plane((0, 0, 0.5))])


def test_a_thin_plate_takes_whole_steps():
    """A cantilever of aspect 1000, of steel: its first step is solved, not made of smaller ones.

    CG with the two-level cycle gave up on such a body, and halved steps follow another path.
    """
    mesh = box_mesh((1.0, 0.5, 0.001), (36, 18, 2))
    mesh = with_uniform(mesh, E=2e11, nu=0.3, rho=7800.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    body = Dynamics(mesh, supports=held, gravity_vector=[0, 0, -9.81], order=1, self_contact=False)
    body.step(1 / 60)
    assert body.last_step is not None
    assert body.last_step.dt == 1 / 60


def test_a_factor_is_made_where_two_levels_would_take_longer():
    """A thick beam's steps take ten iterations and no factor, a thin plate's take one."""
    for size, cells, thin in (
        ((1, 0.2, 0.2), (27, 8, 8), False),
        ((1, 0.5, 1e-3), (36, 18, 2), True),
    ):
        mesh = with_uniform(box_mesh(size, cells), E=1e8, nu=0.3, rho=1000.0)
        held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
        body = Dynamics(mesh, supports=held, gravity_vector=G, order=1, self_contact=False)
        body.step(1e-2)
        assert body.solver.factors is thin
