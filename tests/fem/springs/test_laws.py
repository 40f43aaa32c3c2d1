"""Laws of spring networks: balance, E and nu, stable steps, similarity, sight."""

import numpy as np
import pytest
from autophyx_tet.fem import ElementMaterial, Supports, box_mesh
from autophyx_tet.fem.errors import ConvergenceError, InputError
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.springs.body import spring_body
from autophyx_tet.fem.springs.motion import SpringMotion
from autophyx_tet.fem.springs.network import (
    Anchors,
    LineOfSight,
    SpringNetwork,
    neighbour_weights,
    sample_anchors,
)

from ..bodies import random_rotation


def with_material(mesh, E=1e5, nu=0.25, rho=1000.0):
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=rho))


def cube(cells=4, **material):
    return with_material(box_mesh((0.3, 0.3, 0.3), (cells,) * 3), **material)


def network_of(mesh, count, neighbours, **given):
    surface = LineOfSight(mesh.points, mesh.boundary.faces)
    return SpringNetwork.of(sample_anchors(mesh, count, **given), neighbours, surface)


def two_masses(m1, m2, length):
    """Two free anchors on the x axis and the spring between them."""
    anchors = Anchors(
        x=np.array([[0.0, 0, 0], [length, 0, 0]]), volume=np.ones(2), mass=np.array([m1, m2]),
        E=np.ones(2), part=np.zeros(2, int), body=np.zeros(2, int),
        fixed=np.zeros((2, 3), bool), values=np.zeros((2, 3)), spacing=length,
        layers=np.ones(1), skin=np.zeros(2),
    )  # fmt: skip
    ends = {"i": np.array([0]), "j": np.array([1]), "rank_i": np.array([0])}
    return SpringNetwork(anchors=anchors, **ends, rank_j=np.array([0]), neighbours=1)


def test_two_masses_follow_the_discrete_oscillator():
    """g(t+h) + g(t-h) = (2 - w^2 h^2) g(t) of the stretch g, w^2 = k (1/m1 + 1/m2)."""
    net, k, h = two_masses(1.0, 3.0, 0.5), 40.0, 0.07
    away = np.array([[-0.3, 0, 0], [0.1, 0, 0]])
    motion = SpringMotion(network=net, stiffness=np.array([k]), velocity=away)
    g = [0.0]
    for _ in range(20):
        motion.advance(h, steps=1)
        g.append(np.diff(motion.x[:, 0])[0] - 0.5)
    g, square = np.array(g), k * (1 + 1 / 3)
    exact = (2 - square * h**2) * g[1:-1]
    assert g[2:] + g[:-2] == pytest.approx(exact, abs=1e-12 * np.abs(g).max())


def test_a_dashpot_takes_the_motion_of_two_masses_along_it():
    """m_r g'' + c g' = 0 without a spring: the stretch speeds down by 1 - c h / m_r a step."""
    net, c, h = two_masses(1.0, 3.0, 0.5), 2.0, 0.01
    away = np.array([[-0.3, 0, 0], [0.1, 0, 0]])
    motion = SpringMotion(
        network=net, stiffness=np.array([1e-9]), dashpot=np.array([c]), velocity=away
    )
    motion.advance(10 * h, steps=10)
    speed = np.diff(motion.v[:, 0])[0]
    # The spring of 1e-9 N/m adds less than that over .1 s.
    assert speed == pytest.approx(0.4 * (1 - c * h * (1 + 1 / 3)) ** 10, rel=1e-8)


def test_springs_have_no_net_force_and_no_net_torque():
    """Whatever the displacement: sums over all anchors are rounding errors of their terms."""
    net = network_of(cube(), 300, 16)
    x0 = net.anchors.x
    turned = x0 @ random_rotation(3).T + 0.02 * np.random.default_rng(0).normal(size=x0.shape)
    motion = SpringMotion(network=net, stiffness=net.stiffness(), velocity=1e3 * (turned - x0))
    motion.advance(1e-3, steps=1)  # the springs are at rest: it arrives where it is sent
    assert motion.x == pytest.approx(turned, abs=1e-12)
    force = net.anchors.mass[:, None] * motion.a
    torque = np.cross(motion.x, force)
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * np.abs(force).sum()
    assert np.abs(torque.sum(axis=0)).max() < 1e-14 * np.abs(torque).sum()


def test_a_free_network_keeps_its_angular_momentum():
    """About the origin, by the half steps' v and the positions between them; momentum too."""
    net = network_of(cube(), 120, 12)
    m, x0 = net.anchors.mass, net.anchors.x
    v0 = np.cross([3.0, -2.0, 5.0], x0) + 0.5 * np.random.default_rng(4).normal(size=x0.shape)
    motion = SpringMotion(network=net, stiffness=net.stiffness(), velocity=v0)
    start = (m[:, None] * np.cross(x0, v0)).sum(axis=0)
    motion.advance(0.1)  # it turns by a third of a radian
    # Symplectic Euler keeps x(t) x v(t - h/2) exactly: forces are along the springs.
    end = (m[:, None] * np.cross(motion.x, motion.v)).sum(axis=0)
    assert end == pytest.approx(start, abs=1e-12 * np.abs(m[:, None] * np.cross(x0, v0)).sum())
    assert m @ motion.v == pytest.approx(m @ v0, abs=1e-12 * np.abs(m[:, None] * v0).sum())
    assert motion.steps > 20


def elastic_constants(net, stiffness, volume):
    """(E, nu) of the isotropic mean of a network, by the energy of its affine strains."""
    q = stiffness * net.length**2 / volume
    n = net.direction
    voigt = np.stack([*(n**2).T, n[:, 0] * n[:, 1], n[:, 1] * n[:, 2], n[:, 2] * n[:, 0]], axis=1)
    C = voigt.T @ (q[:, None] * voigt)
    along, across = np.trace(C[:3, :3]) / 3, (C[0, 1] + C[1, 2] + C[0, 2]) / 3
    return (along - across) * (along + 2 * across) / (along + across), across / (along + across)


@pytest.mark.parametrize("eta", [-20.0, 0.0, 5.0, 20.0])
def test_a_cube_has_the_modulus_that_it_was_made_of(eta):
    """E within 5 %, nu within .02 of Cauchy's 1/4, at every eta, without a fit."""
    mesh = cube(E=2e5)
    net = network_of(mesh, 1000, 32)
    E, nu = elastic_constants(net, net.stiffness(eta), mesh.volume)
    assert pytest.approx(2e5, rel=0.05) == E
    assert nu == pytest.approx(0.25, abs=0.02)


def test_a_network_of_given_constants_softens_as_eta_rises():
    net = network_of(cube(), 300, 48)
    k = net.calibrated(20.0)
    E = [net.stiffness(eta, k=k) @ net.length**2 for eta in (-20, -3, 0, 1, 3, 8, 20)]
    assert (np.diff(E) <= 0).all()
    assert E[0] > 2 * E[-1]
    soft = neighbour_weights(20.0, 48)
    assert (soft[:17] == 1).all()  # rank 16 is i = 0
    assert (soft[25:] == 0).all()  # 20^i > 2 from i = .232, rank 23.4
    assert neighbour_weights(-20.0, 48).sum() == 48


def test_the_mass_of_every_part_is_that_of_its_tets():
    """Places hold the volume of every part; a part smaller than a place keeps its own."""
    mesh = box_mesh((1.0, 1.0, 1.0), (3, 3, 3))
    region = (mesh.centroids[:, 0] > 0.5).astype(int)
    region[0] = 2
    rho = np.array([1000.0, 50.0, 8000.0])[region]
    flat = np.full(len(region), 0.3)
    material = ElementMaterial(1e5 + 0 * flat, flat, rho)
    mesh = TetMesh(mesh.points, mesh.tets, region, ("a", "b", "crumb"), material)
    found = sample_anchors(mesh, 200)
    for part in range(3):
        own = mesh.region == part
        mass = float(rho[own] @ mesh.volumes[own])
        assert found.mass[found.part == part].sum() == pytest.approx(mass, rel=1e-9)


def energies(share, steps, dashpot=0.0):
    """Kinetic and elastic energy every ten steps of ``share`` of the longest, over the first.

    A network that starts with small random speeds of its anchors.
    """
    net = network_of(cube(), 60, 12)
    stiffness = net.stiffness()
    wild = 1e-9 * np.random.default_rng(0).normal(size=net.anchors.x.shape)
    given = {"network": net, "stiffness": stiffness, "dashpot": dashpot * stiffness}
    motion, found = SpringMotion(**given, velocity=wild), []
    limit = motion.longest_step
    for _ in range(steps // 10 + 1):
        moving = 0.5 * float(net.anchors.mass @ (motion.v**2).sum(axis=1))
        found.append(motion.elastic + moving)
        motion.advance(10 * share * limit, steps=10)
    return np.array(found) / found[0]


def test_the_longest_step_is_the_longest(monkeypatch):
    """At .99 of it energy stays within ten times that of the start; at 1.01 it passes that.

    The steps with dashpots keep damping: bounded there, their own limit is not sharp. What passes
    ten times what was put in ends a run.
    """
    assert energies(0.99, 2000).max() < 10
    assert energies(0.99, 2000, dashpot=0.02).max() < 10
    with pytest.raises(ConvergenceError, match="steps are unstable"):
        energies(1.01, 200)
    monkeypatch.setattr("autophyx_tet.fem.springs.motion.EXCESS", np.inf)
    grown = energies(1.01, 200)
    assert grown.max() == grown[-1] > 10


def test_the_highest_frequency_is_that_of_the_matrix():
    """Lanczos against all eigenvalues of M^-1/2 K M^-1/2."""
    net = network_of(cube(), 60, 12)
    motion = SpringMotion(network=net, stiffness=net.stiffness())
    root = np.sqrt(motion.inverse_mass.ravel())
    dense = root[:, None] * net.matrix(net.stiffness()).toarray() * root
    exact = np.sqrt(np.linalg.eigvalsh(dense)[-1])
    assert motion.longest_step == pytest.approx(2 / exact, rel=1e-3)


def test_four_times_the_stiffness_is_half_the_time():
    """k -> 4 k, h -> h / 2, speeds and dashpots twice, no gravity: the same path."""
    net = network_of(cube(), 60, 12)
    k = net.stiffness()
    v = 0.3 * np.random.default_rng(1).normal(size=net.anchors.x.shape)
    slow = SpringMotion(network=net, stiffness=k, dashpot=1e-3 * k, velocity=v)
    fast = SpringMotion(network=net, stiffness=4 * k, dashpot=2e-3 * k, velocity=2 * v)
    h = 0.2 * slow.longest_step
    slow.advance(50 * h, steps=50)
    fast.advance(25 * h, steps=50)
    assert np.abs(slow.x - net.anchors.x).max() > 1e-3
    assert fast.x == pytest.approx(slow.x, abs=1e-10)


def horseshoe():
    """Two legs of .1 x .1 x 1 m, .1 m apart, joined at the bottom."""
    mesh = box_mesh((0.3, 0.1, 1.0), (6, 2, 20))
    x, _, z = mesh.centroids.T
    tets = mesh.tets[(np.abs(x - 0.15) > 0.05) | (z < 0.1)]
    used, index = np.unique(tets, return_inverse=True)
    return with_material(TetMesh.oriented(mesh.points[used], index.reshape(tets.shape)))


def test_no_spring_leaves_the_body():
    """Legs are not joined across the gap, though their anchors are nearest neighbours."""
    mesh = horseshoe()
    net = network_of(mesh, 300, 24)
    a, b = net.anchors.x[net.i], net.anchors.x[net.j]
    across = (a[:, 0] - 0.15) * (b[:, 0] - 0.15) < 0
    assert net.bridges == 0
    assert (a[across][:, 2] < 0.25).all()
    share = np.linspace(0.01, 0.99, 25)[:, None, None]
    on_way = a + share * (b - a)
    inside = (np.abs(on_way[..., 0] - 0.15) > 0.0499) | (on_way[..., 2] < 0.1001)
    assert inside.all()


def test_what_would_fall_apart_is_bridged_and_counted():
    """Two cubes that share one point alone see nothing of each other through it."""
    one = box_mesh((1.0, 1.0, 1.0), (2, 2, 2))
    two = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), lo=(1.0, 1.0, 1.0))
    corner = len(one.points) + np.flatnonzero((two.points == 1.0).all(axis=1))[0]
    same = np.flatnonzero((one.points == 1.0).all(axis=1))[0]
    tets = np.concatenate([one.tets, two.tets + len(one.points)])
    tets[tets == corner] = same
    mesh = TetMesh.oriented(np.concatenate([one.points, two.points]), tets)
    net = network_of(with_material(mesh), 200, 16)
    assert net.bridges == 6


def test_points_follow_affine_motions_exactly_and_held_ones_stay():
    """X -> A X + b of the anchors is that of the mesh's points; supports are the mesh's own."""
    mesh = cube()
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    body = spring_body(Scene(mesh=mesh, supports=held), 300, 16)
    A = random_rotation(2) @ np.diag([1.2, 0.9, 1.1])
    at = body.network.anchors.x
    moved = body.weights @ (at @ A.T + 0.3 - at)
    assert mesh.points + moved == pytest.approx(mesh.points @ A.T + 0.3, abs=1e-12)
    assert (body.displacement(at @ A.T)[held.fixed] == 0).all()
    assert (body.network.anchors.x[body.network.anchors.fixed.any(axis=1), 2] == 0).all()


def test_thickness_counts_anchors():
    """A plate of .06 m at anchors of .0152 m: four of them; a ball's, .81 of its diameter."""
    plate = with_material(box_mesh((0.4, 0.3, 0.06), (12, 9, 3)))
    assert sample_anchors(plate, 2048).layers == pytest.approx([0.06 / 0.0152], rel=0.1)
    # Of a cube of side a, 95 % of the volume are below a depth of (1 - .05^(1/3)) a / 2.
    across = (1 - 0.05 ** (1 / 3)) * np.cbrt(1000)
    assert sample_anchors(cube(), 1000).layers == pytest.approx([across], rel=0.1)


def test_too_few_anchors_are_refused():
    with pytest.raises(InputError, match="wanted at least 8"):
        sample_anchors(cube(), 3)
    with pytest.raises(InputError, match="wanted 4 to"):
        network_of(cube(), 20, 400)
