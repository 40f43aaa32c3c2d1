"""Laws of damping: what vibrates dies away as it should, what turns as a whole goes on."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise, stiffness
from autophyx_tet.fem.elements.forces import lumped_mass
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import Damping, Dynamics, Rayleigh
from autophyx_tet.fem.solve.schemes import Scheme
from scipy.linalg import eigh

from .bodies import random_rotation, shaken_box, with_uniform

ORDERS = pytest.mark.parametrize("order", [1, 2])


def rayleigh(order, mass=0.0, stiffness=1.0):
    """Damping of a body of an E and nu of its own for every tet, its grid and material."""
    mesh, rng = shaken_box(cells=(2, 1, 1)), np.random.default_rng(3)
    n = len(mesh.tets)
    material = ElementMaterial(rng.uniform(1, 2, n), rng.uniform(0.1, 0.4, n), np.ones(n))
    grid = discretise(mesh, order)
    nodal = rng.uniform(1, 2, len(grid.space.nodes))
    return Rayleigh(grid, material, nodal, Damping(mass, stiffness)), grid, material


@ORDERS
def test_rigid_motion_is_not_braked(order):
    """From any shape a turn of any size and a shift cost nothing; nor does a spin."""
    damping, grid, _ = rayleigh(order)
    rng, x = np.random.default_rng(0), grid.space.nodes
    start = 0.3 * rng.normal(size=x.shape)
    turn = random_rotation(1)
    end = (x + start) @ turn.T + rng.normal(size=3) - x
    energy, force = damping.step(end, start, 0.1)
    assert abs(energy) < 1e-20
    assert np.abs(force).max() < 1e-12
    spin = np.cross([0.3, -2.0, 1.0], x + start) + rng.normal(size=3)
    assert np.abs(damping.force(start, spin)).max() < 1e-12


@ORDERS
def test_small_motions_see_the_stiffness_at_rest(order):
    """At rest C v = alpha M v + beta K v, also in a step as small as round-off allows."""
    damping, grid, material = rayleigh(order, mass=0.7, stiffness=0.3)
    v = np.random.default_rng(0).normal(size=grid.space.nodes.shape)
    K = stiffness(grid, *material.lame)
    expected = damping.mass * v + 0.3 * K.times(v)
    rest = np.zeros_like(v)
    np.testing.assert_allclose(damping.force(rest, v), expected, atol=1e-12)
    tiny = damping.step(1e-6 * v, rest, 1e-6).force
    np.testing.assert_allclose(tiny, expected, atol=1e-4)  # Green's strain: 1e-6 of the motion


@ORDERS
def test_force_and_tangent_are_derivatives(order):
    """Of the energy of a step and of its force, by central differences, far from rest."""
    damping, grid, _ = rayleigh(order, mass=0.7)
    rng = np.random.default_rng(0)
    start, u, d = 0.2 * rng.normal(size=(3, *grid.space.nodes.shape))
    h, dt = 1e-5, 0.1
    sides = [damping.step(u + s * h * d, start, dt) for s in (1, -1)]
    slope = (sides[0].energy - sides[1].energy) / (2 * h)
    assert (damping.step(u, start, dt).force * d).sum() == pytest.approx(slope, rel=1e-7)
    matrix = stiffness(grid, *np.zeros((2, len(grid.space.elements))))
    damping.add_to(matrix, u, start, dt, projected=False)
    change = (sides[0].force - sides[1].force) / (2 * h)
    np.testing.assert_allclose(matrix.times(d), change, atol=1e-6 * np.abs(change).max())


def test_projected_tangent_has_no_negative_part():
    damping, grid, _ = rayleigh(1)
    rng = np.random.default_rng(0)
    start, u = 0.3 * rng.normal(size=(2, *grid.space.nodes.shape))
    least = []
    for projected in (False, True):
        matrix = stiffness(grid, *np.zeros((2, len(grid.space.elements))))
        damping.add_to(matrix, u, start, 0.1, projected=projected)
        values = np.linalg.eigvalsh(matrix.to_scipy().toarray())
        least.append(values[0] / values[-1])
    assert least[0] < -1e-3 < -1e-12 < least[1]


def slowest(mesh, free) -> tuple[float, np.ndarray]:
    """Circular frequency [1/s] and shape of the slowest vibration with lumped masses."""
    grid = discretise(mesh, 1)
    K = stiffness(grid, *mesh.material.lame).to_scipy().toarray()
    mass = np.repeat(lumped_mass(mesh, grid.space), 3)
    free = np.flatnonzero(free)
    square, x = eigh(K[np.ix_(free, free)], np.diag(mass[free]))
    first = np.flatnonzero(square > 1e-6 * square[-1])[0]
    shape = np.zeros(mesh.points.size)
    shape[free] = x[:, first]
    return float(np.sqrt(square[first])), shape.reshape(-1, 3)


@pytest.mark.long
def test_a_free_cube_keeps_its_spin():
    """Ten turns with 5 % of damping at its slowest vibration take < 1e-3 of the spin.

    They begin after one more, in which the cube comes to bulge: until then the trapezoidal rule
    itself keeps spin to 5e-3 only, damped or not.
    """
    mesh = with_uniform(box_mesh((1, 1, 1), (1, 1, 1), lo=(-0.5,) * 3), E=1e6, nu=0.3, rho=1e3)
    omega, _ = slowest(mesh, np.ones(mesh.points.size))
    spin = omega / 20
    # Most of the lumped mass lies on the diagonal (1, 1, 1): across it the turn is steady.
    axis, first, second = np.array([[1, -1, 0], [1, 1, 0], [0, 0, 2**0.5]]) / 2**0.5
    v = np.cross(spin * axis, mesh.points)
    damping = Damping(stiffness=2 * 0.05 / omega)
    scheme = Scheme.TRAPEZOIDAL  # implicit Euler would brake the turn itself
    body = Dynamics(mesh, velocity=v, order=1, scheme=scheme, damping=damping, tolerance=1e-7)
    states = body.run(2 * np.pi / spin / 60, 11 * 60)[60:]
    mass = body.mass[:, None]
    about = [(mass * np.cross(mesh.points + s.u, s.v)).sum(axis=0) @ axis for s in states]
    assert np.abs(np.array(about) / about[0] - 1).max() < 1e-3
    corner = [mesh.points[0] + s.u[0] for s in states]
    turned = np.unwrap([np.arctan2(x @ first, x @ second) for x in corner])
    assert abs(turned[-1] - turned[0]) == pytest.approx(20 * np.pi, rel=0.02)


@pytest.mark.slow
def test_a_bar_dies_away_as_its_damping_says():
    """A mode of damping ratio zeta swings as exp(-zeta omega t) within 1 %, neo-Hookean."""
    mesh = with_uniform(box_mesh((1, 0.1, 0.1), (5, 1, 1)), E=1e6, nu=0.3, rho=1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    omega, shape = slowest(mesh, ~held.fixed.ravel())
    zeta, period, turns = 0.03, 2 * np.pi / omega, 2
    body = Dynamics(
        mesh, supports=held, velocity=1e-4 * shape, order=1,
        scheme=Scheme.TRAPEZOIDAL, damping=Damping(stiffness=2 * zeta / omega), tolerance=1e-5,
    )  # fmt: skip
    states = body.run(period / 40, 40 * turns)
    # After whole periods all energy is that of motion again, as at the start.
    ratio = np.sqrt(states[-1].energy / states[0].energy)
    assert np.log(ratio) == pytest.approx(-zeta * omega * turns * period, rel=0.01)
