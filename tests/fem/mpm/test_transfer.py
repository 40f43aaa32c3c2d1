"""Transfers between particles and grid: what they conserve exactly, and free fall."""

import numpy as np
import pytest
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mpm.boundaries import Touch, Wall, grid_around
from autophyx_tet.fem.mpm.particles import Particles
from autophyx_tet.fem.mpm.solver import MpmSolver
from autophyx_tet.fem.scene.obstacles import Plane

from .bodies import block, momenta, spinning

DX = 1 / 16
DEVICES = ["cpu", *(["cuda"] if start_warp().is_cuda_available() else [])]


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


def test_a_particle_that_leaves_the_grid_flies_by_itself_and_is_counted():
    """Nothing crashes: those outside fall freely; when all are, it is a failure with advice."""
    solver = falling(step=1e-3)
    x = solver.cloud.read("x")
    x[:7, 0] -= 100.0
    solver.cloud.write("x", x)
    solver.cloud.mark()
    solver.substep.list_nodes(0.0)
    assert solver.advance(0.01)
    assert solver.outside == 7 == solver.lost.sum()
    fell = solver.state.x[:7] - x[:7]
    assert np.abs(fell - [0, 0, -9.81e-6 * 10 * 11 / 2]).max() < 1e-12
    x[:] -= 100.0
    solver.cloud.write("x", x)
    assert not solver.advance(0.01)
    assert solver.failure.kind == "left grid"
    far = block((100.0,) * 3, (100.2,) * 3, 0.1)  # none is in the room from the start
    solver = MpmSolver(far, grid_around([0.0] * 3, [1.0] * 3, 0.1))
    assert not solver.advance(0.01)
    assert solver.failure.kind == "left grid"


def test_the_grid_goes_where_the_body_goes():
    """Thrown far out of its room a turning block moves as in a room that is large enough.

    The nodes are at the same places, so that only round-off differs.
    """
    body = block((0.0,) * 3, (2 * DX,) * 3, DX, E=1e4)
    v = np.array([8.0, 0.0, 3.0]) + np.cross([0.0, 3.0, 0.0], body.x - body.x.mean(axis=0))
    body = Particles.of(body.x, body.volume, E=1e4, nu=0.3, rho=1000.0, velocity=v)
    rooms = [grid_around([0.0] * 3, [2 * DX] * 3, DX), grid_around([-0.5] * 3, [3, 1, 1], DX)]
    solvers = [MpmSolver(body, room, step=1e-3, follows=n == 0) for n, room in enumerate(rooms)]
    for solver in solvers:
        assert solver.advance(0.25)
    small, large = (solver.state for solver in solvers)
    assert small.x[:, 0].min() > rooms[0].origin[0] + DX * rooms[0].shape[0]
    assert solvers[0].outside == 0
    assert np.abs(small.x - large.x).max() < 1e-10
    assert np.abs(small.F - large.F).max() < 1e-9


def crumbs(x, v, **given):
    """Particles of 1 g in a small room, half a metre wide."""
    body = Particles.of(np.array(x), 1e-6, E=1e4, nu=0.3, rho=1000.0, velocity=v)
    return MpmSolver(body, grid_around([-0.25] * 3, [0.25] * 3, DX / 4), follows=True, **given)


def test_what_shares_no_node_flies_by_itself():
    """Two crumbs that are far apart: parabolas by steps, out of a grid that does not grow.

    Their affine velocities, which hold angular momentum, stay.
    """
    v = np.array([[3.0, 0.0, 1.0], [-2.0, 1.0, 0.0]])
    solver = crumbs([[0.2, 0, 0], [-0.2, 0, 0]], v, step=1e-3)
    C = np.random.default_rng(0).standard_normal((2, 3, 3))
    solver.cloud.write("C", C)
    room, x = solver.grid.count, solver.state.x
    assert solver.advance(0.5)
    n = 500
    way = 0.5 * v + [0, 0, -9.81e-6 * n * (n + 1) / 2]
    assert np.abs(solver.state.x - x - way).max() < 1e-12
    assert (solver.cloud.read("C") == C).all()
    assert solver.grid.count == room
    assert solver.outside == 0
    assert not solver.lost.any()


def test_a_crumb_slides_as_coulomb_says():
    """It lands as a ball, without a bounce; friction of mu takes mu times the impulse, and stops.

    After a fall of h and with v along the ground it slides (v - mu sqrt(2 g h))^2 / (2 mu g).
    """
    mu, v, h, g = 0.3, 2.0, 0.1, 9.81
    radius = (3e-6 / (4 * np.pi)) ** (1 / 3)
    ground = Wall(shape=Plane((0.0, 0.0, -h - radius), (0.0, 0.0, 1.0)), friction=mu)
    solver = crumbs([[0.0, 0.0, 0.0]], (v, 0.0, 0.0), walls=(ground,), step=1e-4)
    fall = np.sqrt(2 * h / g)
    assert solver.advance(fall + 0.2)
    left = v - mu * np.sqrt(2 * g * h) - mu * g * 0.2
    # Steps of 0.1 ms: the impact is one step off, by 1e-3 m/s of friction and of fall
    assert solver.state.v[0] == pytest.approx([left, 0, 0], abs=2e-3)
    assert solver.state.x[0, 2] == pytest.approx(-h, abs=1e-9)
    # The ground gave what the fall had, its weight since, and what braked it
    push = 1e-3 * np.array([left - v, 0, np.sqrt(2 * g * h) + 0.2 * g])
    assert solver.substep.take_impulses()[0] == pytest.approx(push, abs=3e-6)
    assert solver.advance(0.5)
    slid = (v - mu * np.sqrt(2 * g * h)) ** 2 / (2 * mu * g)
    assert solver.state.x[0, 0] == pytest.approx(v * fall + slid, rel=2e-3)
    assert (solver.state.v == 0).all()


@pytest.mark.parametrize("wall", ["sticky", "slip", "moving"])
def test_crumbs_meet_walls_that_hold_slide_or_move(wall):
    """Held they stop where they touch, slid they keep their way along, pushed they go along."""
    known = {"sticky": Touch.STICKY, "slip": Touch.SLIP}.get(wall, Touch.SEPARATE)
    speed = (0.0, 0.0, 0.5) if wall == "moving" else (0.0, 0.0, 0.0)
    shape = Plane((0.0, 0.0, -0.1), (0.0, 0.0, 1.0), velocity=speed)
    walls = (Wall(shape=shape, touch=known),)
    solver = crumbs([[0, 0, 0.0]], (1.0, 0, -1.0), walls=walls, gravity_vector=(0, 0, 0), step=1e-4)
    assert solver.advance(0.2)
    after = {"sticky": [0, 0, 0], "slip": [1, 0, 0], "moving": [1, 0, 0.5]}[wall]
    assert solver.state.v[0] == pytest.approx(after, abs=1e-9)


def test_a_crumb_that_hits_a_block_gives_it_its_momentum():
    """By itself until it shares nodes, then through the grid: momenta stay to round-off."""
    target = block((0.0,) * 3, (4 * DX,) * 3, DX)
    x = np.concatenate([target.x, [[-0.6, 2 * DX, 1.6 * DX]]])
    v = np.zeros_like(x)
    v[-1, 0] = 4.0
    body = Particles.of(x, target.volume[0], E=1e5, nu=0.3, rho=1000.0, velocity=v)
    solver = MpmSolver(body, grid_around([-0.2] * 3, [0.5] * 3, DX), gravity_vector=(0, 0, 0),
                       follows=True)  # fmt: skip
    p, turning, _ = momenta(solver)
    assert solver.cloud.read("alone")[-1] > 0
    assert solver.advance(0.25)
    after, turning_after, _ = momenta(solver)
    assert solver.cloud.read("alone")[-1] == 0
    assert solver.state.v[:-1, 0].mean() > 0
    assert np.abs(after - p).max() < 1e-12 * np.linalg.norm(p)
    assert np.abs(turning_after - turning).max() < 1e-12 * np.linalg.norm(turning)


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


@pytest.mark.parametrize("device", DEVICES)
def test_particles_are_sorted_and_their_nodes_listed(device):
    """Of places in disorder: cells ascend, every array came along, the nodes around each are there.

    Quadratic splines have three along an axis, and some drift either way is foreseen.
    """
    rng = np.random.default_rng(0)
    body = Particles.of(rng.random((500, 3)), 1e-3, E=1 + rng.random(500), nu=0.3, rho=1000.0)
    grid = grid_around([0.0] * 3, [1.0, 1.2, 1.4], 0.1)
    solver = MpmSolver(body, grid, device=device)
    cloud, x = solver.cloud, rng.random((500, 3))
    x[:5] += 100.0  # these left the grid
    cloud.write("x", x)
    cloud.sort()
    solver.substep.list_nodes(0.0)
    seen = cloud.read("x")
    assert np.abs(seen - x).max() < 1e-5  # single precision of 100 m
    assert cloud.read("mu") == pytest.approx(body.E / 2.6, rel=1e-6)
    first = grid.first_nodes(seen)
    number = np.ravel_multi_index(np.clip(first, 0, np.array(grid.shape) - 3).T, grid.shape)
    assert (np.diff(number[cloud.order]) >= 0).all()
    reach = np.arange(-cloud.drift, 3 + cloud.drift)
    offsets = np.stack(np.meshgrid(reach, reach, reach), axis=-1).reshape(-1, 3)
    around = (first[5:, None] + offsets).reshape(-1, 3)
    around = around[((around >= 0) & (around < grid.shape)).all(axis=1)]
    count = int(solver.substep.count.numpy()[0])
    listed = solver.substep.nodes.numpy()[:count]
    assert len(np.unique(listed)) == count
    assert (np.sort(listed) == np.unique(np.ravel_multi_index(around.T, grid.shape))).all()


def test_a_wall_that_stands_is_asked_once_about_a_node():
    """A block that falls into the room of a wall: it is stopped, no node was asked about twice."""
    asked = []

    class Counted(Plane):
        def distance(self, x):
            asked.append(np.array(x))
            return super().distance(x)

    body = block((0.0,) * 3, (3 * DX,) * 3, DX, E=1e4)
    room = grid_around([0.0, 0.0, -0.5], [3 * DX] * 3, DX)
    ground = Wall(shape=Counted((0.0, 0.0, -0.3), (0.0, 0.0, 1.0)))
    solver = MpmSolver(body, room, walls=(ground,))
    assert solver.advance(0.4)  # free, it would be at -.78 m
    assert solver.state.x[:, 2].min() > -0.3 - DX
    places = np.concatenate(asked)
    assert len(np.unique(places.round(9), axis=0)) == len(places)
    assert len(asked) > 2
