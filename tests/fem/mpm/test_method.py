"""The method of the scene: tets become particles, mesh points follow them."""

import dataclasses

import numpy as np
import pytest
from autophyx_tet.fem import SCENARIOS, ElementMaterial, Scene, Supports, box_mesh, wind
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.fem.mpm.boundaries import flight_time
from autophyx_tet.fem.mpm.materials import MaterialClass, Substance
from autophyx_tet.fem.mpm.method import PRESETS, MpmMethod
from autophyx_tet.fem.mpm.particles import Followers, ParticleState, sample_tets, without_cracks
from autophyx_tet.fem.mpm.time_step import MpmError
from autophyx_tet.fem.scenarios import Drop
from autophyx_tet.toolkit.verdict.checks import keeps_energy

from ..bodies import random_rotation, shaken_box


def post(E=2e5, nu=0.3, cells=(2, 2, 8)):
    """A post of 0.2 x 0.2 x 1 m."""
    mesh = box_mesh((0.2, 0.2, 1.0), cells)
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=500.0))


def test_particles_fill_the_tets_with_their_mass():
    """Volumes add up to the body's, every particle lies in its tet, the lattice is regular."""
    mesh = shaken_box(cells=(3, 3, 3))
    found = sample_tets(mesh, 0.25)
    assert len(found.x) == 8**3
    assert found.volume.sum() == pytest.approx(mesh.volume, rel=1e-12)
    steps = (found.x - found.x.min(axis=0)) / 0.125
    assert np.abs(steps - np.round(steps)).max() < 1e-9
    corners = mesh.points[mesh.tets[found.tet]]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    three = np.linalg.solve(edges, (found.x - corners[:, 0])[:, :, None])[:, :, 0]
    assert three.min() > -1e-6
    assert three.sum(axis=1).max() < 1 + 1e-6


def test_a_part_smaller_than_the_grid_keeps_its_mass_and_is_named():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2))
    tiny = box_mesh((0.01, 0.01, 0.01), (1, 1, 1), lo=(1.503, 0.503, 0.503))
    points = np.concatenate([mesh.points, tiny.points])
    tets = np.concatenate([mesh.tets, tiny.tets + len(mesh.points)])
    region = np.repeat([0, 1], [len(mesh.tets), len(tiny.tets)])
    both = TetMesh(points, tets, region, ("cube", "crumb"))
    found = sample_tets(both, 0.2)
    assert found.thin == ("crumb",)
    crumb = region[found.tet] == 1
    assert found.volume[crumb].sum() == pytest.approx(1e-6, rel=1e-9)


@pytest.mark.slow
def test_a_body_falls_freely_until_it_is_near_to_the_ground():
    """g t^2 / 2 to single precision, without a step; what follows is as without the flight."""
    cube = box_mesh((0.1, 0.1, 0.1), (2, 2, 2))
    cube = cube.with_material(ElementMaterial.uniform(48, E=2e4, nu=0.3, rho=1000.0))
    scene = dataclasses.replace(Drop(0.3).scene(cube), duration=0.3, frames=30)
    run = MpmMethod(grid=8).solve(scene)
    # Three cells of 12.5 mm are left of the 300 mm
    flight = np.sqrt(2 * (0.3 - 3 * 0.0125) / 9.81)
    for frame in range(int(flight / 0.01)):
        fell = run.displacements[frame] + [0, 0, 9.81 / 2 * (0.01 * frame) ** 2]
        assert np.abs(fell).max() < 1e-7  # positions are kept in single precision
    pull = np.array([0, 0, -9.81])
    t = flight_time(cube.points, scene.obstacles, np.zeros(3), pull, 1.0, room=0.1)
    assert t == pytest.approx(np.sqrt(2 * 0.2 / 9.81), abs=2e-3)  # LEAST_FLIGHT of it, twice
    assert t <= np.sqrt(2 * 0.2 / 9.81) * (1 + 1e-12)
    slow = MpmMethod(grid=8, damping=1e-12).solve(scene)  # damped bodies are stepped all the way
    assert run.particles.substeps < 0.5 * slow.particles.substeps
    apart = run.displacements[-1] - slow.displacements[-1]
    assert np.abs(apart).max() < 0.02 * np.abs(slow.displacements[-1]).max()


def test_points_follow_an_affine_motion_exactly():
    """X' = A x + b of all particles moves every point so."""
    rng = np.random.default_rng(0)
    rest, points = rng.random((200, 3)), rng.random((50, 3)) * 1.2 - 0.1
    A, b = random_rotation(1) @ np.diag([1.1, 0.9, 1.3]), np.array([1.0, 2.0, 3.0])
    follow = Followers.of(
        points, rest, labels=np.repeat([0, 7], 25), parts=np.repeat([0, 1], 100)
    )  # the part 7 has no particles: its points follow any
    state = ParticleState(0.0, rest @ A.T + b, rest, np.tile(A, (200, 1, 1)), np.zeros(200))
    assert np.allclose(follow.positions(state), points @ A.T + b, atol=1e-12)
    assert np.allclose(follow.weights_in(state).sum(axis=1), 1, atol=1e-12)
    assert (follow.near[:25] < 100).all()


def test_points_beside_a_crack_follow_their_own_side():
    """A cube of particles comes apart rigidly: every point moves as the particle beside it."""
    rest = np.stack(np.meshgrid(*3 * [np.arange(6) + 0.5]), axis=-1).reshape(-1, 3)
    points = np.random.default_rng(0).random((200, 3)) * 6
    none = {"labels": np.zeros(200, int), "parts": np.zeros(216, int)}
    follow = Followers.of(points, rest, **none)
    A, opening = random_rotation(1), np.array([2.0, 0.0, 0.0])
    side = (rest[:, 0] > 3)[:, None] * opening
    F = np.tile(A, (216, 1, 1))
    state = ParticleState(0.0, rest @ A.T + side, rest, F, np.zeros(216))
    wanted = points @ A.T + (points[:, 0] > 3)[:, None] * opening
    assert np.allclose(follow.positions(state), wanted, atol=1e-12)


def moved(scene, grid, **given):
    return MpmMethod(grid=grid, **given).solve(scene)


@pytest.mark.parametrize(
    ("method", "options"),
    [
        (MpmMethod(grid=8), {"order": 1}),
        (MpmMethod(grid=8), {"law": "linear"}),
        (PRESETS["physgaussian"], {"law": "neohookean"}),  # its jelly is corotated
    ],
)
def test_a_law_that_jelly_does_not_have_is_refused(method, options):
    """As springs do: ``law`` and ``order`` are for elements."""
    with pytest.raises(UsageError, match="leave law and order out"):
        method.solve(SCENARIOS["fall"]().scene(post()), **options)


@pytest.mark.slow
def test_a_gust_bends_a_post_twice_as_far_as_the_steady_wind():
    """A load put on at once swings to twice the deflection at rest, of quadratic tets."""
    mesh = post()
    scene = dataclasses.replace(SCENARIOS["wind"]().scene(mesh), duration=0.8, frames=40)
    answer = moved(scene, 24)
    assert answer.particles.lagrangian
    tip = np.linalg.norm(answer.displacements, axis=2).max(axis=1)
    still = wind(mesh).max_displacement
    assert tip.max() == pytest.approx(2 * still, rel=0.05)  # large deflections, 5 cells thick


@pytest.mark.slow
def test_a_post_of_one_cell_is_not_softer_than_it_is():
    """Twice the deflection at rest: its thickness holds four particles; with two it is 59 % off."""
    mesh = box_mesh((0.1, 0.1, 1.0), (2, 2, 16))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.3, rho=500.0))
    scene = dataclasses.replace(SCENARIOS["wind"](speed=4.0).scene(mesh), duration=0.8, frames=40)
    answer = moved(scene, 10)
    tip = np.linalg.norm(answer.displacements, axis=2).max(axis=1)
    assert tip.max() == pytest.approx(2 * wind(mesh, speed=4.0).max_displacement, rel=0.3)  # 28 %


@pytest.mark.slow
def test_a_dropped_block_rests_on_the_ground_with_its_weight():
    mesh = post(E=2e6)
    scene = dataclasses.replace(SCENARIOS["drop"](height=0.1).scene(mesh), duration=2.0, frames=20)
    answer = moved(scene, 16, damping=3.0)
    weight = mesh.mass * 9.81
    push = answer.obstacle_forces[-5:, 0, 2].mean()
    assert push == pytest.approx(weight, rel=0.05)  # still ringing a little
    low = (mesh.points + answer.displacements[-1])[:, 2].min() - scene.obstacles[0].point[2]
    assert 0 <= low < 1.5 / 16  # within 1.5 cells of the ground
    energy = [f.energy for f in answer.frames]
    assert energy[-1] < energy[0]
    # Frames of elements are one step each, and are told where an impact is shorter: not these.
    assert [check.name for check in keeps_energy(answer, scene)] == ["energy"]


@pytest.mark.slow
def test_supports_that_move_tear_a_weak_body_in_two():
    """The ends pulled apart by a fifth: tough jelly stretches, weak jelly opens a gap."""
    mesh = post(E=1e5, nu=0.2)
    z = mesh.points[:, 2]
    ends = Supports.clamp(len(z), z < 1e-9).with_fixed(
        z > 1 - 1e-9, (0, 1, 2), np.array([0, 0, 0.2])
    )
    scene = Scene(mesh=mesh, supports=ends, duration=1.0, frames=10)
    whole = moved(scene, 16)
    weak = Substance(tension=5e3, fracture_energy=20.0)
    torn = moved(scene, 16, substances={"body": weak})
    for answer, gap in ((whole, False), (torn, True)):
        top = answer.displacements[-1][z > 1 - 1e-9]
        assert np.abs(top - [0, 0, 0.2]).max() < 0.03
        jumps = np.diff(np.sort(answer.particles.positions[-1][:, 2]))
        assert (jumps.max() > 1.2 / 16) == gap


@pytest.mark.slow
def test_steel_is_rigid_or_still_and_failures_are_told():
    """A steel post that stands does not move; one that falls is one rigid body."""
    mesh = post(E=2e11)
    scene = SCENARIOS["wind"]().scene(mesh)
    still = moved(dataclasses.replace(scene, duration=0.1, frames=2), 12)
    assert np.abs(still.displacements).max() < 1e-12
    assert "nothing can move" in " ".join(still.particles.notes)
    falls = dataclasses.replace(SCENARIOS["drop"](height=0.05).scene(mesh), duration=0.1, frames=2)
    rigid = moved(falls, 12)
    assert rigid.particles.bodies == 1
    F = rigid.particles.gradients[-1]
    assert np.abs(F @ F.transpose(0, 2, 1) - np.eye(3)).max() < 1e-5  # float32


@pytest.mark.slow
def test_published_settings_move_a_body_as_if_it_were_a_metre_long():
    """It falls by g t^2 / 2 of that metre, a fifth of it here; E beyond the step is a failure."""
    block = box_mesh((0.2, 0.1, 0.1), (4, 2, 2))

    def fallen(E):
        matter = ElementMaterial.uniform(len(block.tets), E=E, nu=0.4, rho=200.0)
        scene = Scene(
            mesh=block.with_material(matter), gravity_vector=(0, 0, -9.81), duration=0.02, frames=1
        )
        return PRESETS["physgaussian"].solve(scene)

    answer = fallen(2e6)
    # The rate of damping is 1/s: within t/3 of it.
    assert answer.displacements[-1][:, 2] == pytest.approx(-0.2 * 9.81 * 0.02**2 / 2, rel=0.02)
    assert "as if it were 1 m long" in " ".join(answer.particles.notes)
    with pytest.raises(MpmError) as told:
        fallen(2e7)
    failure = told.value.failure
    assert (failure.kind, failure.time) == ("cfl", 0.0)
    assert failure.E == pytest.approx(2e7)
    assert failure.E_max == pytest.approx(1.5e7, rel=0.02)  # 200 (0.04 / 1e-4)^2 E / M


def test_finer_particles_do_not_make_the_grid_finer():
    """A bar of 1.6 cells swings by 23 % farther: it is named, with fine particles too."""
    bar = box_mesh((1.0, 0.05, 0.05), (10, 1, 1))
    assert sample_tets(bar, 0.05 / 1.6, bends=np.array([True])).thin == ("body",)
    assert sample_tets(bar, 0.05 / 3, bends=np.array([True])).thin == ()


@pytest.mark.slow
def test_parts_that_do_not_bend_are_not_called_thin():
    """A rod of a cell, of jelly or too stiff to bend: only the first is warned of."""
    mesh = box_mesh((1.0, 0.1, 0.1), (8, 1, 1))

    def notes(E):
        matter = ElementMaterial.uniform(len(mesh.tets), E=E, nu=0.3, rho=500.0)
        scene = Scene(mesh=mesh.with_material(matter), duration=1e-4, frames=1)
        return " ".join(moved(scene, 8).particles.notes)

    assert "bends wrongly" in notes(1e5)
    assert "rigid body" in notes(2e11)
    assert "bends wrongly" not in notes(2e11)


def test_what_the_method_does_not_know_is_refused():
    mesh = post()
    held = Supports.none(len(mesh.points)).with_springs(np.arange(4), 10.0)
    with pytest.raises(InputError, match="springs"):
        moved(Scene(mesh=mesh, supports=held), 8)
    with pytest.raises(UsageError, match="no part 'wing'"):
        moved(Scene(mesh=mesh), 8, substances={"wing": Substance(kind=MaterialClass.SNOW)})


def test_what_is_torn_has_no_stretch():
    """Of a crumb the crack took it all, and what it is pressed by stays; the rest keeps its own."""
    F = np.stack([np.diag([4.0, 0.9, 1.0]), np.diag([1.1, 1.0, 1.0])])
    found = without_cracks(F, np.array([1e9, 0.5]), np.array([1.0, 1.0]))
    np.testing.assert_allclose(found, [np.diag([1.0, 0.9, 1.0]), F[1]], atol=1e-8)
