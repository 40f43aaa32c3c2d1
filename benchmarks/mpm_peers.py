"""Peers of ``mpm.py``: a cantilever at rest in each, and the speed of Taichi's explicit MPM.

The cantilever of ``tests/fem/mpm/test_bars.py``: 1 x 0.25 x 0.25 m, four cells thick, eight
particles a cell, let down by damping. A peer that is not installed raises ImportError.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

LENGTH, SIDE, CELLS = 1.0, 0.25, 4
MATTER = {"E": 1e6, "nu": 0.3, "rho": 1000.0}
# So little that the deflection is 1.2 % of the length.
GRAVITY = 0.4905
SPACING = SIDE / CELLS


def first_period() -> float:
    """Period [s] of the first bending (Euler-Bernoulli)."""
    inertia = SIDE**4 / 12
    stiffness = MATTER["E"] * inertia / (MATTER["rho"] * SIDE**2)
    return 2 * np.pi * LENGTH**2 / 1.8751**2 / np.sqrt(stiffness)


def tip(x: np.ndarray, moved: np.ndarray) -> float:
    """Deflection [m] of the end: a line through that of the particles of the last two cells."""
    near = x[:, 0] > LENGTH - 2 * SPACING
    line = np.polyfit(x[near, 0], (moved - x)[near, 2], 1)
    return float(np.polyval(line, LENGTH))


def row(name: str, deflection: float, began: float) -> dict[str, Any]:
    """A line of the table; ``began`` is of ``time.process_time``."""
    seconds = time.process_time() - began
    return {"solver": name, "tip_mm": round(1e3 * deflection, 4), "cpu_s": round(seconds, 1)}


def elements() -> dict[str, Any]:
    """Quadratic tets, large strains: the reference."""
    from autophyx_tet.fem.material import ElementMaterial
    from autophyx_tet.fem.mesh import box_mesh
    from autophyx_tet.fem.scene.supports import Supports
    from autophyx_tet.fem.solve.nonlinear import solve_nonlinear

    began = time.process_time()
    mesh = box_mesh((LENGTH, SIDE, SIDE), (16, 4, 4))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), **MATTER))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    found = solve_nonlinear(mesh, held, gravity_vector=(0, 0, -GRAVITY), order=2)
    end = mesh.points[:, 0] > LENGTH - 1e-9
    return row("fem, quadratic tets", float(found.displacement[end, 2].mean()), began)


def ours(*, lagrangian: bool) -> dict[str, Any]:
    """Ours, with weights at rest or at the place."""
    from autophyx_tet.fem.mpm.boundaries import CLAMP_OFFSET, Touch, Wall, grid_around
    from autophyx_tet.fem.mpm.particles import Particles, block_places
    from autophyx_tet.fem.mpm.solver import MpmSolver
    from autophyx_tet.fem.scene.obstacles import Plane

    x = block_places((0, 0, 0), (LENGTH, SIDE, SIDE), SPACING)
    body = Particles.of(x, (SPACING / 2) ** 3, **MATTER)
    held = CLAMP_OFFSET * SPACING
    low, high = [-SPACING, -SPACING, -0.4], [LENGTH + SPACING, SIDE + SPACING, SIDE + SPACING]
    room = grid_around(low, high, SPACING, planes={0: held})
    wall = Wall(shape=Plane((held, 0, 0), (1, 0, 0)), touch=Touch.STICKY)
    period = first_period()
    solver = MpmSolver(
        body, room, walls=(wall,), lagrangian=lagrangian, gravity_vector=(0, 0, -GRAVITY),
        damping=4 * np.pi / period,
    )  # fmt: skip
    began = time.process_time()
    assert solver.advance(1.6 * period)
    kind = "weights at rest" if lagrangian else "weights at the place"
    return row(f"this package, {kind}", tip(x, solver.state.x), began)


def newton(*, basis: str = "Q1", steps: int = 80) -> dict[str, Any]:
    """Newton's implicit MPM: the first two cells beyond the clamp are of infinite mass."""
    import newton as nt
    import warp as wp
    from autophyx_tet.fem.mpm.particles import block_places
    from newton.solvers import SolverImplicitMPM

    x = block_places((-2 * SPACING, 0, 0), (LENGTH, SIDE, SIDE), SPACING)
    builder = nt.ModelBuilder(gravity=(0.0, 0.0, -GRAVITY))
    SolverImplicitMPM.register_custom_attributes(builder)
    mass = MATTER["rho"] * (SPACING / 2) ** 3
    builder.add_particles(
        pos=x.tolist(), vel=np.zeros_like(x).tolist(), mass=[mass] * len(x),
        radius=[SPACING / 4] * len(x),
        custom_attributes={
            "mpm:young_modulus": MATTER["E"], "mpm:poisson_ratio": MATTER["nu"],
            "mpm:tensile_yield_ratio": 1.0,
            "mpm:friction": 0.0, "mpm:yield_stress": 1e15,
        },
    )  # fmt: skip
    model = builder.finalize(device="cpu")
    masses = model.particle_mass.numpy()
    masses[x[:, 0] < 0] = 0.0
    model.particle_mass.assign(masses)
    # What its documentation advises for compliant elastic matter.
    given = {"velocity_basis": basis, "carry_residual_strain": "unconverged"}
    config = SolverImplicitMPM.Config(voxel_size=SPACING, **given)
    solver = SolverImplicitMPM(model, config)
    state, other, control = model.state(), model.state(), model.control()
    dt, began, history = 4 * first_period() / steps, time.process_time(), []
    for _ in range(steps):
        solver.step(state, other, control, None, dt)
        state, other = other, state
        history.append(tip(x, state.particle_q.numpy()))
    wp.synchronize()
    mean = float(np.mean(history[steps // 2 :]))  # of two periods: it still swings
    return row(f"newton, implicit, {basis}", mean, began)


def taichi(count: int = 22_000, *, steps: int = 20, rounds: int = 7) -> dict[str, Any]:
    """The same scheme and law written for Taichi, double precision, one thread: ns a substep."""
    import taichi as ti
    from mpm import SUBSTANCES, block

    ti.init(arch=ti.cpu, default_fp=ti.f64, cpu_max_num_threads=1, log_level=ti.ERROR)
    body, room = block(count, SUBSTANCES["jelly"], speed=0.0)
    n, dx = len(body.x), room.spacing
    cell = np.floor(body.x / dx).astype(np.int64)
    order = np.lexsort(cell.T[::-1])
    corner = cell.min(axis=0) - 4  # a grid that just holds the block: every node is visited
    nodes = int(np.ptp(cell, axis=0).max()) + 10
    x, v = (ti.Vector.field(3, ti.f64, n) for _ in range(2))
    C, F = (ti.Matrix.field(3, 3, ti.f64, n) for _ in range(2))
    grid = ti.Vector.field(4, ti.f64, (nodes,) * 3)
    x.from_numpy(body.x[order] - corner * dx)
    v.from_numpy(body.velocity[order])
    F.from_numpy(np.tile(np.eye(3), (n, 1, 1)))
    mu = float(body.E[0] / (1 + body.nu[0]) / 2)
    lam = float(2 * mu * body.nu[0] / (1 - 2 * body.nu[0]))
    matter = (float(body.mass[0]), float(body.volume[0]), mu, lam)
    substep = _taichi_substep(ti, (x, v, C, F, grid), matter, dx)
    substep()
    best = np.inf
    for _ in range(rounds):
        began = time.process_time()
        for _ in range(steps):
            substep()
        ti.sync()
        best = min(best, (time.process_time() - began) / steps)
    title = "taichi, jelly, f64, a grid as small as fits"
    return {"solver": title, "ns": round(best / n * 1e9, 1)}


def _taichi_substep(ti: Any, fields: tuple, matter: tuple[float, ...], dx: float) -> Any:
    """Kernel of a substep of 1e-5 s: fields x, v, C, F of the particles, and the grid."""
    x, v, C, F, grid = fields
    mass, volume, mu, lam = matter
    dt = 1e-5

    @ti.func
    def weights(f):
        return [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1) ** 2, 0.5 * (f - 0.5) ** 2]

    @ti.kernel
    def substep():
        for I in ti.grouped(grid):  # noqa: E741
            grid[I] = ti.Vector.zero(ti.f64, 4)
        for p in x:
            base = ti.cast(x[p] / dx - 0.5, ti.i32)
            f = x[p] / dx - base
            w = weights(f)
            J = F[p].determinant()
            bulk = ((lam + mu) * (J - 1) - mu) * J
            tau = mu * F[p] @ F[p].transpose() + bulk * ti.Matrix.identity(ti.f64, 3)
            A = -dt * volume * 4 / dx**2 * tau + mass * C[p]
            for a, b, c in ti.static(ti.ndrange(3, 3, 3)):
                o = ti.Vector([a, b, c])
                share = w[a][0] * w[b][1] * w[c][2]
                m = share * (mass * v[p] + A @ ((o - f) * dx))
                grid[base + o] += ti.Vector([m[0], m[1], m[2], share * mass])
        for I in ti.grouped(grid):  # noqa: E741
            if grid[I][3] > 0:
                for d in ti.static(range(3)):
                    grid[I][d] = grid[I][d] / grid[I][3] - (9.81 * dt if d == 2 else 0.0)
        for p in x:
            base = ti.cast(x[p] / dx - 0.5, ti.i32)
            f = x[p] / dx - base
            w = weights(f)
            speed = ti.Vector.zero(ti.f64, 3)
            slope = ti.Matrix.zero(ti.f64, 3, 3)
            for a, b, c in ti.static(ti.ndrange(3, 3, 3)):
                o = ti.Vector([a, b, c])
                g = grid[base + o]
                u = w[a][0] * w[b][1] * w[c][2] * ti.Vector([g[0], g[1], g[2]])
                speed += u
                slope += 4 / dx * u.outer_product(o - f)
            v[p] = speed
            C[p] = slope
            x[p] += dt * speed
            F[p] += dt * slope @ F[p]

    return substep


def jelly(count: int = 22_000) -> dict[str, Any]:
    """A substep of ours, of the same block."""
    from mpm import measure

    return {"solver": "this package, jelly, f64", "ns": measure("jelly", count)["ns"]}


PEERS = {
    "fem": elements,
    "total": lambda: ours(lagrangian=True),
    "updated": lambda: ours(lagrangian=False),
    "newton": newton,
    "jelly": jelly,
    "taichi": taichi,
}
