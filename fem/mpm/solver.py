"""Explicit steps of particles through the grid, looked over between chunks of them.

``MpmSolver.advance`` is the loop; ``Substep`` records the launches of one step, ``Cloud`` keeps the
particles on the device.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..device import checked_device, start_warp
from ..errors import InputError
from ..material import lame_parameters
from ..note import Note
from .boundaries import BackgroundGrid, FixedPlaces, Wall
from .kernels_grid import (
    COUNT,
    HIGH,
    INVERTED,
    LEAST,
    LOOKERS,
    LOW,
    MOVED,
    NOT_FINITE,
    OUTSIDE,
    SPEED,
    SPREAD,
    WAVE,
    energy_kernel,
    fly_kernel,
    grid_kernels,
    order_kernels,
    survey_kernel,
)
from .kernels_transfer import APART, move_kernel, push_kernel, scatter_kernel, types_of
from .materials import Form, MaterialClass
from .particles import Particles, ParticleState, without_cracks
from .rigid import BODIES_CHANGING, REST, RigidBodies
from .time_step import COURANT, Failure, FailureKind, largest_modulus, stable_step

# Substeps between two looks at the particles.
CHUNK = 50
# Lists of nodes serve particles that drift so far [spacings]: nodes cost a GPU little, and it has
# no work while they are listed. Of that so much is left by a chunk, and before they are sorted.
REACH, REACH_GPU = 1, 2
DRIFT, RELIST = 0.1, 0.5
# Launches serve lists of nodes that are shorter than theirs, down to the square of this fraction.
SPARE = 0.75
# Fraction of the particles that may turn inside out before it is called a failure.
MOST_INVERTED = 0.01


class MpmSolver:
    """Explicit MLS-MPM: quadratic B-splines, APIC, symplectic Euler.

    particles, grid: What moves, and the grid.
    walls: Boundaries: what holds, grips or stops it.
    gravity_vector: Acceleration of gravity [m/s^2], shape (3,).
    damping: Rate [1/s] at which velocities fade.
    lagrangian: Whether weights are those at rest (total Lagrangian): for jelly that is held and
        blown upon; it neither meets obstacles nor tears, but crossing cells costs it no memory.
    device, threads: 'cpu' (float64) with one or two threads, or 'cuda' (float32).
    courant: Fraction of a spacing that the fastest wave crosses in a step.
    step: Step [s] wanted instead of the longest stable one; one that is too long is a failure.
    follows: Whether the grid goes where the particles go.
    """

    def __init__(
        self,
        particles: Particles,
        grid: BackgroundGrid,
        *,
        walls: Sequence[Wall] = (),
        gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, -9.81),
        damping: float = 0.0,
        lagrangian: bool = False,
        device: str = "cpu",
        threads: int = 1,
        courant: float = COURANT,
        step: float | None = None,
        follows: bool = False,
    ) -> None:
        self.free = ~particles.held
        if not self.free.any():
            raise InputError("solver.every_particle")
        self._particles = particles
        moving, fixed = particles, None
        if not self.free.all():
            moving, fixed = particles.only(self.free), particles.only(~self.free)
        self.cloud = Cloud(moving, grid, checked_device(device), walls)
        self.lagrangian, self.follows = lagrangian, follows and not lagrangian
        self.damping, self.courant, self.step = damping, courant, step
        if lagrangian and any(
            span.kind != MaterialClass.JELLY or span.form == Form.TEARING
            for span in self.cloud.spans
        ):
            raise InputError("solver.weights_rest")
        speeds = [float(np.linalg.norm(wall.shape.velocity)) for wall in walls]
        self._boundary_speed = max(speeds, default=0.0)
        self.time, self.substeps, self.outside = 0.0, 0, 0
        self.failure: Failure | None = None
        self.substep = Substep(
            self.cloud, walls, gravity_vector, fixed=fixed, lagrangian=lagrangian, threads=threads
        )
        self.substep.list_nodes(self.time)

    @property
    def grid(self) -> BackgroundGrid:
        """The grid, where it is now."""
        return self.cloud.grid

    @property
    def state(self) -> ParticleState:
        """The particles now; the opening of cracks is no deformation of theirs."""
        cloud, free, particles = self.cloud, self.free, self._particles
        H = cloud.read("H")
        for span in cloud.spans:
            if span.carries:
                H[cloud.rows(span)] = cloud.read("total")[cloud.rows(span)]
        x, v = particles.x.copy(), np.zeros_like(particles.x)
        F, q = np.tile(np.eye(3), (len(x), 1, 1)), np.zeros(len(x))
        x[free], v[free], q[free] = cloud.read("x"), cloud.read("v"), cloud.read("q")
        F[free] += H
        if any(span.form == Form.TEARING for span in cloud.spans):
            tears = np.array([s.tears for s in particles.substances])[particles.substance]
            torn = tears & free & (particles.rigid < 0)
            F[torn] = without_cracks(F[torn], q[torn], cloud.read("k")[torn[free], 1])
        return ParticleState(self.time, x, v, F, q)

    @property
    def lost(self) -> Bool[np.ndarray, "n"]:
        """Particles that left the grid as parts of a body: from there on each is by itself."""
        out = np.zeros(len(self.free), dtype=bool)
        if not self.lagrangian:
            away = ~self.grid.holds(self.cloud.read("x"))
            out[self.free] = away & (self.cloud.read("alone") != APART)
        return out

    @property
    def elastic_energy(self) -> float:
        """Elastic energy [J] of the particles; torn ones are left out: theirs is not known."""
        wp, cloud = start_warp(), self.cloud
        total = wp.zeros(1, dtype=wp.float64, device=cloud.device)
        for span in cloud.spans:
            if not span.rigid:
                kernel = energy_kernel(span.kind, cloud.real, span.form)
                threads = min(span.count, LOOKERS)
                inputs = [*span[2:], threads, cloud.struct, total]
                wp.launch(kernel, threads, inputs, device=cloud.device)
        return float(total.numpy()[0])

    def push(self, acceleration: Float[np.ndarray, "n 3"]) -> None:
        """Accelerate the particles [m/s^2] by outer forces from now on."""
        self.cloud.set_push(acceleration[self.free])
        self.substep.record(self.time)

    def coast(self, duration: float) -> None:
        """Move all particles as one for ``duration`` [s], freely: they rest in each other so far.

        This is exact where nothing is touched, and takes no step.
        """
        cloud, substep, g = self.cloud, self.substep, self.substep.gravity
        v = cloud.read("v")
        cloud.write("x", cloud.read("x") + duration * v + duration**2 / 2 * g)
        cloud.write("v", v + duration * g)
        self.time += duration
        if self.follows:
            substep.follow(cloud.survey())
        cloud.sort()
        substep.list_nodes(self.time)

    def advance(self, duration: float, *, tell: Callable[[float], None] | None = None) -> bool:
        """Follow the particles for ``duration`` [s]; False where that failed: see ``failure``.

        ``tell`` hears the time [s] after every chunk of substeps.
        """
        cloud, substep, spacing = self.cloud, self.substep, self.grid.spacing
        end, short, survey = self.time + duration, 1.0, cloud.survey()
        while self.failure is None and self.time < end - 1e-12 * max(end, duration):
            self.outside = int(survey[OUTSIDE])
            if survey[NOT_FINITE]:
                self._fail("not finite", Note("solver.values_overflowed"))
            elif survey[INVERTED] > MOST_INVERTED * len(cloud):
                self._fail("inverted", Note("solver.turned_inside"))
            elif self.outside == len(cloud):
                self._fail("left grid", Note("solver.nothing_left"))
            if self.failure is not None:
                break
            fastest, pull = max(float(survey[SPEED]), self._boundary_speed), substep.pull
            longest = stable_step(
                survey[WAVE], fastest, spacing,
                pull=pull, spread=survey[SPREAD], courant=self.courant,
            )  # fmt: skip
            if self.step is not None:
                if self.step > longest * (1 + 1e-9):
                    advice = Note("solver.steps_wanted", step=self.step, longest=longest)
                    self._fail("cfl", advice)
                    break
                longest = self.step
            left = end - self.time
            count = max(1, int(np.ceil(left / longest * (1 - 1e-12))))
            dt = left / count
            if not self.lagrangian:  # no further than the listed nodes reach
                if survey[MOVED] > cloud.drift - RELIST:
                    if self.follows:
                        substep.follow(survey)
                    cloud.sort()
                    substep.list_nodes(self.time)
                    survey[MOVED] = 0.0
                room = cloud.drift - DRIFT - survey[MOVED]
                drift = stable_step(0.0, fastest, spacing, pull=pull, courant=room)
                count = max(1, int(min(drift / dt, count)))
            steps = max(1, int(min(count, CHUNK) * short))
            substep.set_step(dt, self.damping)
            if substep.moving:
                substep.record(self.time)
            arrays = []
            if not self.lagrangian:
                arrays = [getattr(cloud.struct, name) for name in CHANGING]
                if substep.rigid is not None:
                    arrays += [getattr(substep.rigid.struct, name) for name in BODIES_CHANGING]
            before = [start_warp().clone(array) for array in arrays]
            substep.run(steps)
            after = cloud.survey()
            if arrays and not after[MOVED] <= cloud.drift:  # nodes missed: again, in fewer steps
                for array, kept in zip(arrays, before, strict=True):
                    start_warp().copy(array, kept)
                substep.clear()
                if steps == 1 and after[NOT_FINITE]:
                    self._fail("not finite", Note("solver.values_overflowed"))
                elif steps == 1:
                    self._fail("velocity", Note("solver.moved_cell"))
                short = short / 2
                continue
            survey = after
            self.time += steps * dt
            self.substeps += steps
            short = min(1.0, 2 * short)
            if tell is not None:
                tell(self.time)
        return self.failure is None

    def _fail(self, kind: FailureKind, advice: str) -> None:
        """Put a failure on record, with the part of the worst particle."""
        now, particles = self.state, self._particles
        if kind == "not finite":
            badness = ~np.isfinite(now.x + now.v + now.F.sum(axis=2)).all(axis=1)
        elif kind == "inverted":
            badness = -np.linalg.det(now.F)
        elif kind == "velocity":
            badness = (now.v**2).sum(axis=1)
        else:
            badness = particles.wave_speed
        worst = int(np.argmax(badness))
        dt, most = self.substep.step if self.step is None else self.step, np.inf
        if dt > 0:
            nu, rho = particles.nu[worst], particles.rho[worst]
            most = float(largest_modulus(nu, rho, self.grid.spacing, dt, courant=self.courant))
        self.failure = Failure(
            kind=kind,
            time=self.time,
            part=particles.parts[particles.part[worst]],
            E=float(particles.E[worst]),
            E_max=most,
            advice=advice,
        )


# What two threads launch at once: the next stage waits for both.
Stage = tuple[list[Any], list[Any]]


class Substep:
    """The launches of one substep: particles to grid, grid, boundaries, grid to particles.

    ``list_nodes`` again when the particles were sorted; ``record`` when boundaries moved. Nodes
    that ``fixed`` particles weigh on stand still. Particles that share no node with others need
    none: they fall, and land on walls, by themselves. Two ``threads``, on a CPU alone: warp's
    kernels run at once, each on a grid of its own.
    """

    def __init__(
        self,
        cloud: Cloud,
        walls: Sequence[Wall],
        gravity_vector: Sequence[float] | np.ndarray,
        *,
        fixed: Particles | None,
        lagrangian: bool,
        threads: int,
    ) -> None:
        wp, types, grid = start_warp(), cloud.types, cloud.grid
        self.cloud, self.walls, self.lagrangian = cloud, tuple(walls), lagrangian
        self.device = cloud.device
        self.threads = threads if self.device == "cpu" else 1
        self.gravity = np.asarray(gravity_vector, dtype=np.float64)
        self._gravity = types.vec3(*map(float, gravity_vector))
        self._clock = wp.zeros(2, dtype=types.real, device=self.device)
        self._impulse = wp.zeros(len(walls) + 1, dtype=types.vec3, device=self.device)
        self._worker = ThreadPoolExecutor(1) if self.threads == 2 else None
        self.rigid: RigidBodies | None = None
        if cloud.particles.rigid.max() >= 0:
            self.rigid = RigidBodies(cloud.particles, grid.spacing, cloud.real, self.device)
        self._still: np.ndarray = np.zeros(0, dtype=np.int64)
        self._make_room()
        mass = np.zeros(grid.count)  # of what stands still, by the same weights
        if fixed is not None:
            still, real = Cloud(fixed, grid, self.device), types.real
            spread = scatter_kernel(
                MaterialClass.STATIONARY, real, lagrangian=False, form=Form.PLAIN
            )
            inputs = [0, still.struct, still.frame, self._clock, self._grids[0]]
            wp.launch(spread, len(still), inputs, device=self.device)
            mass = self._grids[0].numpy()[:, 3]
        self._still = np.flatnonzero(mass)
        self._still_mass = mass[self._still]
        self._make_room()
        self._stages: list[Stage] = []
        self._graph: Any = None
        # The listed nodes: room for some more, and how many they are
        self.nodes = wp.zeros(0, dtype=int, device=self.device)
        # How many nodes are listed, and how many particles fly by themselves
        self.count = wp.zeros(2, dtype=int, device=self.device)
        self._alone: np.ndarray = np.zeros(0, dtype=np.int64)
        self._planes: list[tuple[np.ndarray, np.ndarray]] = []  # normals, heights: of every wall
        self._radius = np.cbrt(3 / (4 * np.pi) * cloud.particles.volume)

    @property
    def pull(self) -> float:
        """Acceleration [m/s^2] by gravity and outer forces, at most."""
        return float(np.linalg.norm(self._gravity)) + self.cloud.strongest_push

    @property
    def moving(self) -> bool:
        """Whether boundaries are elsewhere later."""
        return any(wall.moves for wall in self.walls)

    @property
    def step(self) -> float:
        """Step [s] of the last chunk."""
        return float(self._clock.numpy()[0])

    def set_step(self, dt: float, damping: float) -> None:
        """Take steps of ``dt`` [s] in which velocities fade at the rate ``damping`` [1/s]."""
        self._clock.assign([dt, float(np.exp(-damping * dt))])

    def take_impulses(self) -> Float[np.ndarray, "holders 3"]:
        """Momentum [N s] that every wall, and then what is stationary, gave since asked last."""
        impulses = self._impulse.numpy().astype(np.float64).copy()
        self._impulse.zero_()
        if self.rigid is not None:  # what rigid bodies got more is divided as the rest is
            size = np.linalg.norm(impulses[:-1], axis=1)
            fraction = size / max(size.sum(), 1e-300)
            impulses[:-1] += fraction[:, None] * self.rigid.take_push()
        return impulses

    def follow(self, survey: Float[np.ndarray, "entries"]) -> None:
        """Move the grid to where a survey saw the particles, if they come near to its border."""
        cloud, old = self.cloud, self.cloud.grid
        bounds = np.stack([-survey[LOW : LOW + 3], survey[HIGH : HIGH + 3]])
        # All may fly by themselves
        grid = old.around(bounds, self._still) if (bounds[0] <= bounds[1]).all() else None
        if grid is None:
            return
        shift = np.rint((old.origin - grid.origin) / grid.spacing).astype(np.int64)
        still = np.stack(np.unravel_index(self._still, old.shape), axis=1)
        self._still = np.asarray(np.ravel_multi_index((still + shift).T, grid.shape))
        cloud.set_grid(grid)
        self.nodes = start_warp().zeros(0, dtype=int, device=self.device)
        self._make_room()

    def _make_room(self) -> None:
        """Nodes of the grid with nothing on them, no wall asked about them.

        On a CPU they take memory only where something comes.
        """
        wp, vec4, count = start_warp(), self.cloud.types.vec4, self.cloud.grid.count

        def zeros(wanted: bool, dtype: Any, *width: int) -> Any:
            size = count if wanted else 0
            if self.device != "cpu":
                return wp.zeros(size, dtype=dtype, device=self.device)
            lazy = np.zeros((size, *width), dtype=np.float64 if width else np.int32)
            return wp.array(lazy, dtype=dtype, device="cpu", copy=False)

        self._grids = [zeros(wanted, vec4, 4) for wanted in (True, self.threads == 2)]
        self._kick = zeros(self.rigid is not None, vec4, 4)
        # By listing: nodes that are listed, cells that have particles; what stands still has some
        self._stamp, self._marks, self._cells = 0, zeros(True, int), zeros(True, int)
        if len(self._still):
            cells = self._cells.numpy()
            cells[self._still] = np.iinfo(np.int32).max
            self._cells.assign(cells)
        none = (np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
        # Of every wall: which nodes it was asked about, and those in it as ``Wall.at`` tells
        self._met: list[tuple[np.ndarray, ...]] = [none for _ in self.walls]
        self._asked = [np.zeros(count, dtype=bool) for _ in self.walls]

    def clear(self) -> None:
        """Leave nothing on the nodes: listed ones are cleared by every step, others by none."""
        for grid in (*self._grids, self._kick):
            grid.zero_()

    def list_nodes(self, time: float) -> None:
        """List the nodes near the particles; record the launches at ``time`` [s] if need be.

        They stay while the list has room and walls hold the same nodes.
        """
        wp, cloud, kernels = start_warp(), self.cloud, order_kernels(self.cloud.real)
        x, drift = (cloud.struct.rest, 0) if self.lagrangian else (cloud.struct.x, cloud.drift)
        for grid in (*self._grids, self._kick):  # others than those listed have nothing
            if len(self.nodes) and len(grid):
                inputs = [0, self.nodes, self.count, grid]
                clear = grid_kernels(cloud.real).clear
                wp.launch(clear, len(self.nodes), inputs, device=self.device)
        self.count.zero_()
        before, self._stamp = len(self._alone), self._stamp + 1
        if not self.lagrangian:
            inputs = [cloud.struct, cloud.frame, self._stamp, self._cells]
            wp.launch(kernels.occupy, len(cloud), inputs, device=self.device)
            inputs = [cloud.struct, cloud.frame, drift, self._stamp, self._cells, self.count]
            wp.launch(kernels.part, len(cloud), inputs, device=self.device)
        places = [x, cloud.struct.alone, cloud.frame, drift]
        lists = [self._stamp, self._marks, self.nodes, self.count]
        wp.launch(kernels.reach, len(cloud), [*places, *lists], device=self.device)
        count, alone = self.count.numpy().tolist()
        fits = 0 < SPARE**2 * len(self.nodes) <= count <= len(self.nodes)
        if not fits:
            self._stamp += 1
            self.nodes = wp.zeros(int(count / SPARE), dtype=int, device=self.device)
            lists = [self._stamp, self._marks, self.nodes, wp.zeros_like(self.count)]
            wp.launch(kernels.reach, len(cloud), [*places, *lists], device=self.device)
        self._alone = np.flatnonzero(cloud.struct.alone.numpy()) if alone else self._alone[:0]
        if self._meet_walls(time, count) or not fits or alone or before:
            self._record()

    def _meet_walls(self, time: float, count: int) -> bool:
        """Find the ``count`` listed nodes in walls at ``time`` [s]; whether others are than before.

        What stands is asked once about a node. Of what flies by itself: find planes of the walls.
        """
        if len(self._alone):
            x = self.cloud.struct.x.numpy()[self._alone].astype(np.float64)
            radius = self._radius[self.cloud.order[self._alone]]
            near = [wall.distance(x, time) for wall in self.walls]
            self._planes = [(n, (n * x).sum(axis=1) - gap + radius) for gap, n in near]
        listed, changed = np.zeros(0, dtype=np.int32), False
        if self.walls and count:
            listed = self.nodes[:count].numpy()
        for slot, (wall, asked) in enumerate(zip(self.walls, self._asked, strict=True)):
            if wall.moves and not self.lagrangian:
                self._met[slot], changed = wall.at(self.cloud.grid, listed, time), True
            elif len(new := listed[~asked[listed]]):
                asked[new] = True
                found = wall.at(self.cloud.grid, new, 0.0)
                changed |= len(found[0]) > 0
                pairs = zip(self._met[slot], found, strict=True)
                self._met[slot] = tuple(np.concatenate(pair) for pair in pairs)
        return changed

    def record(self, time: float) -> None:
        """Record the launches, with the boundaries where they are at ``time`` [s]."""
        self._meet_walls(time, int(self.count.numpy()[0]))
        self._record()

    def _record(self) -> None:
        self._graph, self._stages = None, []
        wp, cloud, rigid = start_warp(), self.cloud, self.rigid
        real, types, struct, clock = cloud.real, cloud.types, cloud.struct, self._clock
        kernels, main = grid_kernels(real), self._grids[0]
        nodes, count = (self.nodes, self.count), len(self.nodes)

        def add(
            stage: Stage, kernel: Any, first: int, size: int, *inputs: Any, grids: bool = False
        ) -> None:
            """Record launches on ``size`` things from ``first`` on, halved between two threads.

            With ``grids`` each thread adds to its own.
            """
            half = (size + 1) // 2 if self.threads == 2 else size
            for thread, a, n in ((0, first, half), (1, first + half, size - half)):
                own = [self._grids[thread]] if grids else []
                launch(stage, kernel, n, a, *inputs, *own, thread=thread)

        def launch(stage: Stage, kernel: Any, n: int, *inputs: Any, thread: int = 0) -> None:
            if n:
                command = wp.launch(kernel, n, list(inputs), device=self.device, record_cmd=True)
                stage[thread].append(command)

        def numbers(values: np.ndarray) -> Any:
            return wp.array(values.astype(np.int32), dtype=int, device=self.device)

        clear, scatter, advance, hold, move, settle = stages = [([], []) for _ in range(6)]
        for thread in range(self.threads):
            launch(clear, kernels.clear, count, 0, *nodes, self._grids[thread], thread=thread)
        if len(struct.push):
            launch(clear, push_kernel(real), len(cloud), 0, struct, clock)
        if rigid is not None:
            launch(clear, kernels.clear, count, 0, *nodes, self._kick)

        for span in cloud.spans:
            kernel = scatter_kernel(span.kind, real, lagrangian=self.lagrangian, form=span.form)
            add(scatter, kernel, span.first, span.count, struct, cloud.frame, clock, grids=True)

        add(advance, kernels.advance, 0, count, *nodes, *self._grids, self._gravity, clock)

        touching = 0.0 if rigid is None else rigid.touching
        for slot, (wall, (inside, *fields)) in enumerate(zip(self.walls, self._met, strict=True)):
            if len(inside):
                normals, velocities = (
                    wp.array(field, dtype=types.vec3, device=self.device) for field in fields
                )
                launch(
                    hold, kernels.wall, len(inside), numbers(inside), normals, velocities,
                    int(wall.touch), wall.friction, touching, slot, main, self._impulse, self._kick,
                )  # fmt: skip
        if len(self._still):
            mass = wp.array(self._still_mass, dtype=real, device=self.device)
            still, slot = numbers(self._still), len(self.walls)
            launch(hold, kernels.hold, len(still), still, mass, slot, main, self._impulse)

        for span in cloud.spans:
            if not span.rigid:
                kernel = move_kernel(real, lagrangian=self.lagrangian, carries=span.carries)
                add(move, kernel, span.first, span.count, struct, cloud.frame, clock, main)

        if len(self._alone):
            size = (len(self.walls), len(self._alone))
            normals, heights = np.zeros((*size, 3)), np.zeros(size)
            for slot, (normal, height) in enumerate(self._planes):
                normals[slot], heights[slot] = normal, height
            speeds = np.reshape([wall.shape.velocity for wall in self.walls], (-1, 3))
            launch(
                move, fly_kernel(real), len(self._alone), 0, numbers(self._alone), struct,
                self._gravity, clock, wp.array(normals, dtype=types.vec3, device=self.device),
                wp.array(heights, dtype=real, device=self.device),
                wp.array(speeds, dtype=types.vec3, device=self.device),
                numbers(np.array([wall.touch for wall in self.walls])),
                wp.array([wall.friction for wall in self.walls], dtype=real, device=self.device),
                self._impulse,
            )  # fmt: skip

        if rigid is not None:  # sum the momenta of rigid bodies, settle, move their particles
            spans = [span for span in cloud.spans if span.rigid]
            for a, n in ((span.first, span.count) for span in spans):
                summed = (struct, cloud.frame, main, self._kick, rigid.struct)
                launch(settle, rigid.kernels.gather, n, a, *summed)
            rest = real(0.0 if self.moving else REST)
            launch(settle, rigid.kernels.settle, rigid.count, rigid.struct, clock, rest)
            for span in spans:
                launch(settle, rigid.kernels.carry, span.count, span.first, struct, rigid.struct)

        self._stages = [stage for stage in stages if any(stage)]
        if self.device != "cpu":
            with wp.ScopedCapture(device=self.device) as capture:
                for here, _ in self._stages:
                    _launch_all(here)
            self._graph = capture.graph

    def run(self, steps: int) -> None:
        """Take ``steps`` steps."""
        if self._graph is not None:
            for _ in range(steps):
                start_warp().capture_launch(self._graph)
            return
        for _ in range(steps):
            for here, there in self._stages:
                waiting = (
                    self._worker.submit(_launch_all, there) if there and self._worker else None
                )
                _launch_all(here)
                if waiting is not None:
                    waiting.result()


def _launch_all(launches: list[Any]) -> None:
    for launch in launches:
        launch.launch()


# How many times too large stress is beside held nodes. Of a rest that is even, two particles a cell
# have strains as .75 to .25 there and bear it together: .75 / (.75^2 + .25^2) is 1.2 of it. A bar
# that starts to hang bears half as much again as its wave has.
BESIDE_HELD = 1.5
# Arrays that change with time: what a chunk starts from.
CHANGING = ("x", "v", "C", "H", "total", "q")


class ClassSpan(NamedTuple):
    """Particles ``first`` to ``first + count`` in the device's order: of one class.

    ``form`` is that of jelly, ``carries`` whether their total deformation is followed beside the
    elastic one.
    """

    kind: MaterialClass
    form: Form
    first: int
    count: int

    @property
    def rigid(self) -> bool:
        """Whether these are rigid bodies."""
        return self.kind == MaterialClass.STATIONARY

    @property
    def carries(self) -> bool:
        """Whether the elastic deformation is not the whole, and the whole is not forgotten."""
        return self.kind in (MaterialClass.METAL, MaterialClass.VISPLAS, MaterialClass.SNOW)


class Cloud:
    """Moving particles on a device, in the order of their class and then of the ``grid``.

    On 'cpu' they are of float64, on 'cuda' of float32. What tears is as much stronger beside nodes
    that ``walls`` of supports hold as its stress is told too large there.
    """

    def __init__(
        self, particles: Particles, grid: BackgroundGrid, device: str, walls: Sequence[Wall] = ()
    ) -> None:
        wp = start_warp()
        self.particles, self.device = particles, device
        self.real = wp.float64 if device == "cpu" else wp.float32
        self.drift = REACH if device == "cpu" else REACH_GPU
        self.types = types_of(self.real)
        self.set_grid(grid)
        forms = np.array([int(s.form) for s in particles.substances])[particles.substance]
        forms = np.where(particles.rigid < 0, forms, Form.PLAIN)
        self._classes = len(Form) * particles.kinds + forms
        order = np.argsort(self._classes, kind="stable")
        keys, first, count = np.unique(self._classes[order], return_index=True, return_counts=True)
        self.spans = tuple(
            ClassSpan(MaterialClass(int(kind)), Form(int(form)), int(a), int(n))
            for kind, form, a, n in zip(*np.divmod(keys, len(Form)), first, count, strict=True)
        )
        lam, mu = lame_parameters(particles.E, particles.nu)
        states = np.array([s.state for s in particles.substances])[particles.substance]
        real, vec3, mat33 = self.real, self.types.vec3, self.types.mat33
        struct = self.struct = self.types.Cloud()
        numbers = particles.numbers(grid.spacing)
        supports = [wall for wall in walls if isinstance(wall.shape, FixedPlaces)]
        tears = np.flatnonzero((forms == Form.TEARING) & grid.holds(particles.x))
        if supports and len(tears):
            lowest = grid.first_nodes(particles.x[tears])[:, None]
            around = lowest + np.stack(list(np.ndindex(3, 3, 3)))
            nodes = np.ravel_multi_index(tuple(np.moveaxis(around, 2, 0)), grid.shape)
            held = [wall.at(grid, np.unique(nodes), 0.0)[0] for wall in supports]
            beside = np.isin(nodes, np.concatenate(held)).any(axis=1)
            numbers[tears[beside], 0] *= BESIDE_HELD
        values = {
            "x": (particles.x, vec3),
            "rest": (particles.x, vec3),
            "v": (particles.velocity, vec3),
            "k": (numbers, vec3),
            "m": (particles.mass, real),
            "volume": (particles.volume, real),
            "mu": (mu, real),
            "lam": (lam, real),
            "q": (states, real),
            "body": (particles.rigid.astype(np.int32), int),
            "alone": (np.zeros(len(self), dtype=np.int32), int),
        }
        for name, (array, dtype) in values.items():
            sorted_ = np.ascontiguousarray(array[order])
            setattr(struct, name, wp.array(sorted_, dtype=dtype, device=device))
        struct.push = wp.zeros(0, dtype=vec3, device=device)
        for name in ("C", "H", "total"):
            setattr(struct, name, wp.zeros(len(self), dtype=mat33, device=device))
        self.strongest_push = 0.0  # m/s^2
        self.listed = wp.clone(self.struct.x)
        start = np.zeros(COUNT)
        start[[*range(HIGH, HIGH + 3), *range(LOW, LOW + 3)]] = LEAST
        self._start = wp.array(start, dtype=real, device=device)
        self._survey = wp.clone(self._start)
        self._order = wp.array(order.astype(np.int32), dtype=int, device=device)
        self._host_order: np.ndarray | None = None
        # What sorting needs beside the particles: a copy, cells and rows twice, for radix sort
        self._old, self._old_order = self.types.Cloud(), wp.empty_like(self._order)
        for name in self.types.Cloud.vars:
            setattr(self._old, name, wp.empty_like(getattr(struct, name)))
        self._keys, self._rows = (
            wp.empty(2 * len(self), dtype=int, device=device) for _ in range(2)
        )
        self._same = wp.array(np.arange(len(self)), dtype=int, device=device)
        self.sort()

    def __len__(self) -> int:
        return len(self.particles.x)

    def set_grid(self, grid: BackgroundGrid) -> None:
        """Take another grid of the same spacing."""
        self.grid, self.frame = grid, self.types.Frame()
        self.frame.origin = self.types.vec3(*map(float, grid.origin))
        self.frame.spacing = grid.spacing
        self.frame.nx, self.frame.ny, self.frame.nz = grid.shape

    def rows(self, span: ClassSpan) -> Int[np.ndarray, "some"]:
        """The particles of a span."""
        return self.order[span.first : span.first + span.count]

    @property
    def order(self) -> Int[np.ndarray, "n"]:
        """The particles as the device has them."""
        known = self._host_order
        if known is None:
            known = self._host_order = self._order.numpy().astype(np.int64)
        return known

    def sort(self) -> None:
        """Put the particles into the order of the grid, span by span, every array in its place."""
        wp, kernels = start_warp(), order_kernels(self.real)
        for number, span in enumerate(self.spans):
            inputs = [span.first, number, self.struct, self.frame, self._keys, self._rows]
            wp.launch(kernels.key, span.count, inputs, device=self.device)
        wp.utils.radix_sort_pairs(self._keys, self._rows, len(self))
        here, there = (self.struct, self._order), (self._old, self._old_order)
        for inputs in ([self._rows, *here, *there], [self._same, *there, *here]):
            wp.launch(kernels.reorder, len(self), inputs, device=self.device)
        self._host_order = None
        self.mark()

    def mark(self) -> None:
        """Keep the places that nodes are listed for."""
        start_warp().copy(self.listed, self.struct.x)

    def read(self, name: str) -> np.ndarray:
        """Array ``name`` in the order of the particles, float64."""
        array = getattr(self.struct, name).numpy()
        out = np.empty(array.shape, dtype=np.float64)
        out[self.order] = array
        return out

    def write(self, name: str, values: np.ndarray) -> None:
        """Set the array ``name``, given in the order of the particles."""
        getattr(self.struct, name).assign(np.ascontiguousarray(values[self.order]))

    def set_push(self, values: Float[np.ndarray, "n 3"]) -> None:
        """Accelerations [m/s^2] of the particles by outer forces, from now on."""
        ordered, vec3 = np.ascontiguousarray(values[self.order]), self.types.vec3
        self.struct.push = start_warp().array(ordered, dtype=vec3, device=self.device)
        self._old.push = start_warp().empty_like(self.struct.push)
        self.strongest_push = float(np.linalg.norm(self.struct.push.numpy(), axis=1).max(initial=0))

    def survey(self) -> Float[np.ndarray, "entries"]:
        """Look over the particles: see the entries of ``kernels_grid``."""
        wp = start_warp()
        wp.copy(self._survey, self._start)
        for span in self.spans:
            threads = min(span.count, LOOKERS)
            inputs = [*span[2:], threads, self.struct, self.frame, self.listed, self._survey]
            kernel = survey_kernel(span.kind, self.real, span.form)
            wp.launch(kernel, threads, inputs, device=self.device)
        return self._survey.numpy().astype(np.float64)
