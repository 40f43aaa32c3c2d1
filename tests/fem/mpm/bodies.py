"""Blocks of particles, and what they have of momentum and energy."""

import numpy as np
from autophyx_tet.fem.mpm.boundaries import BackgroundGrid, grid_around
from autophyx_tet.fem.mpm.particles import Particles, block_places
from autophyx_tet.fem.mpm.solver import MpmSolver


def block(low, high, dx, *, E=1e5, nu=0.3, rho=1000.0, along=2, **given):
    """Particles in a box on a lattice of ``along`` a cell and axis."""
    x = block_places(low, high, dx, along=along)
    return Particles.of(x, (dx / along) ** 3, E=E, nu=nu, rho=rho, **given)


def spinning(spin, dx=1 / 16, shift=(0.2, 0.0, 0.0)):
    """A jelly block of four cells, turning at ``spin`` [rad/s], and its solver without gravity."""
    body = block((0.0,) * 3, (4 * dx,) * 3, dx)
    v = np.cross(spin, body.x - body.x.mean(axis=0)) + shift
    body = Particles.of(
        body.x, body.volume, E=body.E, nu=body.nu, rho=body.rho, velocity=v
    )  # fmt: skip
    room = grid_around([-4 * dx] * 3, [12 * dx] * 3, dx)
    solver = MpmSolver(body, room, gravity_vector=(0, 0, 0))
    solver.cloud.write("C", np.broadcast_to(cross_matrix(spin), (len(body.x), 3, 3)))
    return solver


def cross_matrix(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def momenta(solver: MpmSolver):
    """Momentum, angular momentum with the affine part about the origin, and kinetic energy."""
    x, v, C = (solver.cloud.read(name) for name in ("x", "v", "C"))
    m, D = solver.cloud.particles.mass, solver.grid.spacing**2 / 4
    axial = np.stack(
        [C[:, 2, 1] - C[:, 1, 2], C[:, 0, 2] - C[:, 2, 0], C[:, 1, 0] - C[:, 0, 1]], axis=1
    )
    turning = (m[:, None] * (np.cross(x, v) + D * axial)).sum(axis=0)
    kinetic = 0.5 * (m * ((v**2).sum(axis=1) + D * (C**2).sum(axis=(1, 2)))).sum()
    return (m[:, None] * v).sum(axis=0), turning, kinetic


def slab(shape, dx, low=(0.0, 0.0, 0.0)):
    return BackgroundGrid(np.asarray(low, dtype=float), dx, shape)
