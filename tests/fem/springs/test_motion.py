"""Networks in motion: against elements and closed forms, on the ground, and fits to motions."""

import dataclasses

import numpy as np
import pytest
from autophyx_tet.fem import ElementMaterial, Scene, Supports, box_mesh
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.scene.obstacles import Plane, Sphere
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.schemes import Scheme
from autophyx_tet.fem.springs.body import SpringMethod, spring_body
from autophyx_tet.fem.springs.fit import (
    fit_both_ends,
    fit_to_motion,
    scale_to_frequency,
    spring_warnings,
)
from autophyx_tet.fem.springs.motion import network_frequencies
from autophyx_tet.fem.springs.network import SOFTEST, STIFFEST, eta_for_ratio, stiffened


def post(nu=0.25, E=1e5, cells=(2, 2, 8), **given):
    """A post of .2 x .2 x 1 m, clamped at its foot."""
    mesh = box_mesh((0.2, 0.2, 1.0), cells)
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=500.0))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    return Scene(mesh=mesh, supports=held, **given)


def falling(**given):
    """A cube of .2 m that starts .02 m above the ground."""
    mesh = box_mesh((0.2, 0.2, 0.2), (3, 3, 3))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=2e5, nu=0.25, rho=500.0))
    ground = Plane((0, 0, -0.02))
    given = {"duration": 0.2, "frames": 20, "gravity_vector": (0, 0, -9.81)} | given
    return Scene(mesh=mesh, obstacles=(ground,), **given)


@pytest.mark.slow
def test_the_first_frequencies_are_those_of_quadratic_tets():
    """A post of nu = 1/4, six anchors thick: two bending modes and the twist, without a fit."""
    scene = post(cells=(4, 4, 20))
    net = spring_body(scene, 4096, 32).network
    exact = natural_modes(scene.mesh, 3, supports=scene.supports).frequencies
    found = network_frequencies(net, net.stiffness(), 3)
    assert found == pytest.approx(exact, rel=0.03)  # surfaces of a network are too soft or hard


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "cells", "nu", "wanted"),
    [
        ((1.0, 0.12, 0.12), (24, 4, 4), 0.25, (0.915, 1.015)),
        ((1.0, 0.12, 0.12), (24, 4, 4), 0.35, (0.896, 1.010)),
        ((0.4, 0.3, 0.06), (12, 9, 3), 0.25, (0.742, 0.943)),
        ((0.4, 0.3, 0.06), (12, 9, 3), 0.45, (0.598, 0.891)),
    ],
)
def test_the_first_frequencies_are_those_of_the_docs(size, cells, nu, wanted):
    """Of docs/springs.md: bar and slab over linear and quadratic tets, by the default network."""
    mesh = box_mesh(size, cells)
    slab = size[0] < 1
    E = np.where(mesh.centroids[:, 0] < 0.5, 5e4 if slab else 1e6, 1e5)
    rho = np.full_like(E, 500.0 if slab else 1000.0)
    mesh = mesh.with_material(ElementMaterial(E, np.full_like(E, nu), rho))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    net = spring_body(Scene(mesh=mesh, supports=held)).network
    tones = [natural_modes(mesh, 1, supports=held, order=k).frequencies[0] for k in (1, 2)]
    found = network_frequencies(net, net.stiffness())[0] / np.array(tones)
    assert found == pytest.approx(wanted, abs=1e-3)  # the digits that are quoted


def test_a_hanging_post_swings_about_its_stretch():
    """Weight put on at once: u at the end is between 0 and rho g L^2 / E, that is twice the sag."""
    scene = post(E=1e5, duration=0.5, frames=50, gravity_vector=(0, 0, 0.981))
    answer = SpringMethod(anchors=600, neighbours=16).solve(scene)
    top = scene.mesh.points[:, 2] == 1
    u = answer.displacements[:, top, 2].mean(axis=1)
    still = 500 * 0.981 / (2 * 1e5)
    period = 4 * np.sqrt(500 / 1e5)
    whole = round(period / 0.01)
    assert u[1 : whole + 1].mean() == pytest.approx(still, rel=0.12)
    # About five anchors across: a network of a slender body is too stiff along it.
    assert u.max() == pytest.approx(2 * still, rel=0.12)


def test_energy_is_kept():
    """No dashpots: kinetic, elastic and potential energy drift less than 1 % of the exchanged."""
    scene = post(duration=1.0, frames=20, gravity_vector=(0.5, 0, 0))
    frames = SpringMethod(anchors=300, neighbours=16).solve(scene).frames
    total = np.array([f.energy for f in frames])
    exchanged = max(abs(f.potential) for f in frames)
    # Symplectic Euler keeps a shadow of the energy that is off by the square of the step.
    assert np.abs(total).max() < 0.005 * exchanged


def test_dashpots_take_energy():
    scene = post(duration=1.0, frames=10, velocity=(0.2, 0, 0))
    free, damped = (
        SpringMethod(anchors=200, neighbours=16, dashpot=d).solve(scene).frames[-1].energy
        for d in (0.0, 2e-3)
    )
    assert 0 < damped < 0.9 * free


def test_a_fall_is_free_until_it_meets_the_ground():
    """Height by g t^2 / 2 first; then the ground's impulse is what the momentum changes by."""
    scene = falling()
    answer = SpringMethod(anchors=200, neighbours=16).solve(scene)
    t = np.array([f.time for f in answer.frames])
    u = answer.displacements[:, :, 2]
    before = 0.5 * 9.81 * t**2 < 0.019
    # Symplectic Euler falls g t h / 2 further; no point knows of the others yet.
    assert u[before].mean(axis=1) == pytest.approx(-0.5 * 9.81 * t[before] ** 2, abs=2e-4)
    weight = scene.mesh.mass * 9.81
    speed = np.array([f.v[:, 2].mean() for f in answer.frames])
    given = np.concatenate([[0], np.cumsum(answer.obstacle_forces[1:, 0, 2])]) * answer.dt
    assert given[-1] > weight * 0.05
    body = spring_body(scene, 200, 16)
    motion = body.motion(body.network.stiffness())
    motion.advance(0.2)
    momentum = body.network.anchors.mass @ motion.v[:, 2]
    total = body.loads.force[:, 2].sum() * 0.2 + motion.take_impulses()[:, 0, 2].sum()
    assert momentum == pytest.approx(total, abs=1e-10 * weight)
    assert speed.min() < -0.5
    assert answer.smallest_gap > -0.1 * 0.2 * 0.1


def test_a_plane_that_squeezes_gives_what_the_springs_hold():
    """From rest, without weight: the work of its force is kinetic, elastic and contact energy."""
    cube = dataclasses.replace(falling(), gravity_vector=(0, 0, 0), duration=0.3, frames=30)
    lid = Plane((0, 0, 0.201), normal=(0, 0, -1), velocity=(0, 0, -0.1))
    scene = dataclasses.replace(cube, obstacles=(Plane((0, 0, -1e-3)), lid))
    answer = SpringMethod(anchors=200, neighbours=16).solve(scene)
    work = -0.1 * answer.obstacle_forces[1:, 1, 2].sum() * answer.dt
    last = answer.frames[-1]
    assert work > 10  # J, from nothing
    assert last.kinetic + last.elastic + last.barrier == pytest.approx(work, rel=0.02)


def test_friction_stops_what_slides():
    """Speed v0 with friction f on the ground: it slides v0^2 / 2 f g and stops."""
    scene = falling(duration=0.4, frames=8, velocity=(0.5, 0, 0), friction=0.4)
    scene = dataclasses.replace(scene, obstacles=(Plane((0, 0, -2e-4)),))
    last = SpringMethod(anchors=200, neighbours=16, dashpot=2e-3).solve(scene).frames[-1]
    slid = 0.5**2 / (2 * 0.4 * 9.81)
    assert last.u[:, 0].mean() == pytest.approx(slid, rel=0.15)  # it lands and rocks first
    assert abs(last.v[:, 0].mean()) < 0.02


def test_what_springs_do_not_know_is_said():
    """Nu, thickness; other obstacles than planes, and runs of ten minutes, are refused."""
    scene = post(nu=0.45, duration=0.01, frames=1)
    notes = SpringMethod(anchors=100, neighbours=12).solve(scene).notes
    assert any("0.45" in note for note in notes)
    assert any("anchors thick" in note for note in notes)
    rod = box_mesh((0.02, 0.02, 1.0), (1, 1, 50))
    rod = rod.with_material(ElementMaterial.uniform(len(rod.tets), E=1e5, nu=0.25, rho=500.0))
    row = Scene(mesh=rod, supports=Supports.clamp(len(rod.points), rod.points[:, 2] == 0))
    assert any("turn freely" in note for note in spring_body(row, 10, 4).notes)  # beads on a row
    ball = dataclasses.replace(scene, obstacles=(Sphere((0, 0, 3), 0.1),))
    with pytest.raises(UsageError, match="planes alone"):
        SpringMethod(anchors=100, neighbours=12).solve(ball)
    for given in ({"law": "linear"}, {"order": 2}):
        with pytest.raises(UsageError, match="leave law and order out"):
            SpringMethod(anchors=100, neighbours=12).solve(scene, **given)
    with pytest.raises(UsageError, match="on the CPU"):
        SpringMethod(anchors=100, neighbours=12).solve(scene, device="cuda")
    with pytest.raises(UsageError, match="minutes"):
        SpringMethod(anchors=2000).solve(post(E=2e14, duration=10.0))


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "surface"), [(1.7, 0.0), (0.8, 1.0)])
def test_a_twin_gives_its_scale_and_profile_back(scale, surface):
    """A motion of the network itself, stiffer, or softer and hardest at the surface: to 1e-4."""
    body = spring_body(post(duration=0.3, frames=10, velocity=(0.3, 0, 0)), 150, 12)
    motion = body.motion(scale * body.network.stiffness(surface=surface))
    steps, wanted = 3 * motion.steps_for(0.03), [body.displacement(motion.x)]
    for _ in range(10):
        motion.advance(0.03, steps=steps)
        wanted.append(body.displacement(motion.x))
    plan, done = [], []
    told = {"announce": plan.append, "progress": lambda frame, _: done.append(frame)}
    fit = fit_to_motion(body, np.array(wanted), 0.03, steps=steps, **told)
    assert ["about 12 motions" in words for words in plan] == [True]
    assert done == list(range(1, 10 * fit.runs + 1))
    assert fit.scale == pytest.approx(scale, rel=1e-4)
    assert fit.surface == pytest.approx(surface, abs=1e-4)
    assert fit.error < 1e-4
    assert fit.calibrated_error > 0.03
    assert not spring_warnings(fit)
    assert "at its limit" in spring_warnings(dataclasses.replace(fit, surface=-4.0))[0]
    assert "85% off" in spring_warnings(dataclasses.replace(fit, error=0.85))[0]


def test_a_profile_keeps_the_mean():
    """Of log k by volume, whatever the profile; the skin is 0 inside and 1 at the surface."""
    net = spring_body(post(), 300, 16).network
    volume, skin = net.anchors.volume, net.anchors.skin
    full = volume > 0
    even, steep = (np.log(net.constants(0.0, s)[full]) for s in (0.0, 1.5))
    assert volume[full] @ (steep - even) == pytest.approx(0, abs=1e-12 * volume.sum())
    x, y, z = np.abs(net.anchors.x - [0.1, 0.1, 0.5]).T
    off, long = np.maximum(x, y), z < 0.3
    assert skin[long & (off < 0.02)].max() < 0.15 < 0.4 < skin[long & (off > 0.08)].min()


@pytest.mark.slow
def test_a_slab_is_followed_by_scale_and_profile():
    """A thin slab of nu 1/4 let go with a push, by quadratic tets in fine steps: had 2.6 %."""
    mesh = box_mesh((0.4, 0.3, 0.06), (8, 6, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=5e4, nu=0.25, rho=500.0))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    push = np.where(held.fixed, 0.0, [0, 0, 0.5])
    known = {"supports": held, "gravity_vector": (0, 0, -1.47)}
    full = Dynamics(mesh, velocity=push, order=2, scheme=Scheme.BDF2, self_contact=False, **known)
    u = [full.step(1 / 240).u[: len(mesh.points)] for _ in range(60)]
    frames = np.array([0 * mesh.points, *u[3::4]])
    scene = Scene(mesh=mesh, velocity=push, duration=0.25, frames=15, **known)
    fit = fit_to_motion(spring_body(scene, 600, 32), frames, 1 / 60)
    assert fit.error < 0.035 < 0.065 < fit.calibrated_error


def test_frequencies_scale_with_the_root_of_stiffness():
    """The scale to a frequency is exact without a motion; free bodies skip six rigid motions."""
    net = spring_body(post(), 150, 12).network
    scale = scale_to_frequency(net, 3.0)
    assert network_frequencies(net, scale * net.stiffness())[0] == pytest.approx(3.0, rel=1e-6)
    free = spring_body(falling(), 150, 12).network
    assert network_frequencies(free, free.stiffness())[0] > 10.0
    with pytest.raises(InputError, match="wanted > 0"):
        scale_to_frequency(net, 0.0)
    with pytest.raises(InputError, match="turn freely"):
        scale_to_frequency(net, 1e6)


def eta_reach(net):
    """How many times stiffer than its softest a network gets by eta alone [1]."""
    k, square = net.calibrated(SOFTEST), net.length**2
    stiff, soft = (net.stiffness(eta, k=k) @ square for eta in (STIFFEST, SOFTEST))
    return float(stiff / soft)


def test_eta_is_found_for_a_ratio():
    """Round trip of the sum of k w l^2; out of reach, the nearer end."""
    net = spring_body(post(), 300, 64).network
    reach = eta_reach(net)
    k, square = net.calibrated(20.0), net.length**2
    for ratio in (1.5, 0.9 * reach):
        eta = eta_for_ratio(net, ratio)
        soft, hard = (net.stiffness(e, k=k) @ square for e in (20.0, eta))
        assert hard / soft == pytest.approx(ratio, rel=1e-9)
    assert eta_for_ratio(net, 2 * reach) == -20.0
    assert eta_for_ratio(net, 0.5) == 20.0


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_stiffened_springs_carry_so_many_times_more(share):
    """Sum of k w l^2 to round-off, within the reach of eta (its own k) and beyond (larger k)."""
    net = spring_body(post(), 200, 48).network
    ratio, k = 1 + share * (eta_reach(net) - 1), net.constants(SOFTEST, 0.3)
    found, square = stiffened(net, k, ratio), net.length**2
    soft = net.stiffness(SOFTEST, k=k)
    assert found @ square == pytest.approx(ratio * (soft @ square), rel=1e-12)
    own = net.stiffness(eta_for_ratio(net, ratio), k=k) @ square / (found @ square)
    assert own == pytest.approx(1.0, rel=0.02) if share < 1 else own < 0.6


@pytest.mark.slow
def test_both_ends_of_a_twin_come_back():
    """Motions of the softest network and of one twice as stiff by k: to .5 %, by longer steps."""
    body = spring_body(post(duration=0.3, frames=10, velocity=(0.3, 0, 0)), 150, 24)
    soft = 0.8 * body.network.stiffness(SOFTEST)
    paths = []
    for stiffness in (soft, 2 * soft):
        motion = body.motion(stiffness)
        steps = 3 * motion.steps_for(0.03)
        wanted = [body.displacement(motion.x)]
        for _ in range(10):
            motion.advance(0.03, steps=steps)
            wanted.append(body.displacement(motion.x))
        paths.append(np.array(wanted))
    fit = fit_both_ends(body, *paths, (0.03, 0.03))
    assert (fit.scale, fit.eta) == (pytest.approx(0.8, rel=5e-3), SOFTEST)
    assert fit.stiffer == pytest.approx(2.0, rel=5e-3)
    assert fit.error < 1e-2
    assert fit.stiff_error < 0.1  # more neighbours carry it otherwise than larger k


def test_a_fit_of_hours_is_refused_before_its_first_motion(monkeypatch):
    """And one of a network whose pieces turn freely, whatever its motion."""
    body = spring_body(post(E=1e14), 200, 16)
    moved = np.broadcast_to(1e-3 * body.scene.mesh.points, (4, *body.scene.mesh.points.shape))
    monkeypatch.setattr("autophyx_tet.fem.springs.motion.SpringMotion.advance", None)
    with pytest.raises(UsageError, match="hours; fewer --anchors"):
        fit_to_motion(body, moved, 1.0)
    with pytest.raises(InputError, match="turn freely"):
        fit_to_motion(body, moved, 1e-9, frequency=1e12)


def test_a_motion_that_does_not_fit_is_refused():
    body = spring_body(post(), 100, 12)
    with pytest.raises(InputError, match="nothing moves"):
        fit_to_motion(body, np.zeros((3, len(body.scene.mesh.points), 3)), 0.1)
    with pytest.raises(InputError, match="wanted"):
        fit_to_motion(body, np.zeros((3, 7, 3)), 0.1)
