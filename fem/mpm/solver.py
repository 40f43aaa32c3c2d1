"""Explicit steps of particles through the grid, looked over between chunks of them.

``MpmSolver.advance`` is the loop; ``Substep`` records the launches of one step, ``Cloud`` keeps the
particles on the device.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..device import checked_device, start_warp
from ..elements.elastic import energy_and_piola
from ..errors import InputError
from ..laws.law import Law
from ..material import LameParameters, lame_parameters
from ..note import Note
from .boundaries import BackgroundGrid, Wall
from .kernels_grid import (
    COUNT,
    INVERTED,
    MOVED,
    NOT_FINITE,
    OUTSIDE,
    SPEED,
    SPREAD,
    WAVE,
    grid_kernels,
    survey_kernel,
)
from .kernels_transfer import move_kernel, push_kernel, scatter_kernel, types_of
from .materials import GAMMA, Form, MaterialClass
from .particles import Particles, ParticleState, without_cracks
from .rigid import BODIES_CHANGING, REST, RigidBodies
from .time_step import COURANT, Failure, FailureKind, largest_modulus, stable_step

# Substeps between two looks at the particles.
CHUNK = 50
# Particles may drift this far [spacings] between two listings of nodes: the lists reach one.
DRIFT, RELIST = 0.9, 0.5
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
    ) -> None:
        self._free = ~particles.held
        if not self._free.any():
            raise InputError("solver.every_particle")
        self._particles = particles
        moving, fixed = particles, None
        if not self._free.all():
            moving, fixed = particles.only(self._free), particles.only(~self._free)
        self.cloud = Cloud(moving, grid, checked_device(device))
        self.grid, self.lagrangian = grid, lagrangian
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
    def state(self) -> ParticleState:
        """The particles now; the opening of cracks is no deformation of theirs."""
        cloud, free, particles = self.cloud, self._free, self._particles
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
    def elastic_energy(self) -> float:
        """Elastic energy [J] of the particles; torn ones are left out: theirs is not known."""
        cloud, total = self.cloud, 0.0
        H, k, q = cloud.read("H"), cloud.read("k"), cloud.read("q")
        lam, mu = lame_parameters(cloud.particles.E, cloud.particles.nu)
        for span in cloud.spans:
            if span.rigid:
                continue
            rows = cloud.rows(span)
            density = elastic_density(
                span.kind, H[rows], lam[rows], mu[rows], k[rows, 0], form=span.form
            )
            if span.form == Form.TEARING:
                density = np.where(q[rows] > 1, 0.0, density)
            total += float(cloud.particles.volume[rows] @ density)
        return total

    def push(self, acceleration: Float[np.ndarray, "n 3"]) -> None:
        """Accelerate the particles [m/s^2] by outer forces from now on."""
        self.cloud.set_push(acceleration[self._free])
        self.substep.record(self.time)

    def advance(self, duration: float, *, tell: Callable[[float], None] | None = None) -> bool:
        """Follow the particles for ``duration`` [s]; False where that failed: see ``failure``.

        ``tell`` hears the time [s] after every chunk of substeps.
        """
        cloud, substep, spacing = self.cloud, self.substep, self.grid.spacing
        end, short = self.time + duration, 1.0
        while self.failure is None and self.time < end - 1e-12 * max(end, duration):
            survey = cloud.survey()
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
                if survey[MOVED] > RELIST:
                    cloud.sort()
                    substep.list_nodes(self.time)
                    survey[MOVED] = 0.0
                room = DRIFT - survey[MOVED]
                drift = stable_step(0.0, fastest, spacing, pull=pull, courant=room)
                count = max(1, int(min(drift / dt, count)))
            steps = max(1, int(min(count, CHUNK) * short))
            substep.set_step(dt, self.damping)
            if substep.moving:
                substep.record(self.time)
            if self.lagrangian:
                substep.run(steps)
            else:
                arrays = [getattr(cloud.struct, name) for name in CHANGING]
                if substep.rigid is not None:
                    arrays += [getattr(substep.rigid.struct, name) for name in BODIES_CHANGING]
                before = [start_warp().clone(array) for array in arrays]
                substep.run(steps)
                after = cloud.survey()
                if not after[MOVED] <= 1.0:  # nodes were missed: once more, in fewer steps
                    for array, kept in zip(arrays, before, strict=True):
                        start_warp().copy(array, kept)
                    if steps == 1 and after[NOT_FINITE]:
                        self._fail("not finite", Note("solver.values_overflowed"))
                    elif steps == 1:
                        self._fail("velocity", Note("solver.moved_cell"))
                    short = short / 2
                    continue
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


def elastic_density(
    kind: MaterialClass,
    H: Float[np.ndarray, "n 3 3"],
    lam: Float[np.ndarray, "n"],
    mu: Float[np.ndarray, "n"],
    bulk: Float[np.ndarray, "n"],
    *,
    form: Form = Form.PLAIN,
) -> Float[np.ndarray, "n"]:
    """Elastic energy per volume at rest [J/m^3] of a class, of H = F - I of its elastic part.

    ``bulk`` is K [Pa] of a fluid. Damage of jelly and hardening of snow are left out.
    """
    if kind == MaterialClass.STATIONARY:
        return np.zeros(len(H))
    if kind == MaterialClass.JELLY and form != Form.COROTATED:
        return energy_and_piola(Law.NEO_HOOKEAN, H, LameParameters(lam, mu))[0]
    F = H + np.eye(3)
    J = np.linalg.det(F)
    if kind == MaterialClass.FLUID:
        return bulk / GAMMA * (J ** (1 - GAMMA) / (GAMMA - 1) + J - GAMMA / (GAMMA - 1))
    stretches = np.linalg.svd(F, compute_uv=False)
    if form == Form.COROTATED:
        return mu * ((stretches - 1) ** 2).sum(axis=1) + lam / 2 * (J - 1) ** 2
    strain = stretches - 1 if kind == MaterialClass.SNOW else np.log(stretches)
    return mu * (strain**2).sum(axis=1) + lam / 2 * strain.sum(axis=1) ** 2


# What two threads launch at once: the next stage waits for both.
Stage = tuple[list[Any], list[Any]]


class Substep:
    """The launches of one substep: particles to grid, grid, boundaries, grid to particles.

    ``list_nodes`` again when the particles were sorted; ``record`` when boundaries moved. Nodes
    that ``fixed`` particles weigh on stand still. Two ``threads``, on a CPU alone: warp's kernels
    run at once, each on a grid of its own.
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
        self._gravity = types.vec3(*map(float, gravity_vector))
        self._clock = wp.zeros(2, dtype=types.real, device=self.device)
        sizes = [grid.count, grid.count if self.threads == 2 else 0]
        self._grids = [wp.zeros(n, dtype=types.vec4, device=self.device) for n in sizes]
        self._impulse = wp.zeros(len(walls) + 1, dtype=types.vec3, device=self.device)
        self._worker = ThreadPoolExecutor(1) if self.threads == 2 else None
        self.rigid: RigidBodies | None = None
        if cloud.particles.rigid.max() >= 0:
            self.rigid = RigidBodies(cloud.particles, grid.spacing, cloud.real, self.device)
        size = grid.count if self.rigid is not None else 0
        self._kick = wp.zeros(size, dtype=types.vec4, device=self.device)
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
        self._stages: list[Stage] = []
        self._graph: Any = None

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
        self._clock.assign(np.array([dt, np.exp(-damping * dt)], dtype=self._clock.numpy().dtype))

    def take_impulses(self) -> Float[np.ndarray, "holders 3"]:
        """Momentum [N s] that every wall, and then what is stationary, gave since asked last."""
        impulses = self._impulse.numpy().astype(np.float64).copy()
        self._impulse.zero_()
        if self.rigid is not None:  # what rigid bodies got more is divided as the rest is
            size = np.linalg.norm(impulses[:-1], axis=1)
            fraction = size / max(size.sum(), 1e-300)
            impulses[:-1] += fraction[:, None] * self.rigid.take_push()
        return impulses

    def list_nodes(self, time: float) -> None:
        """List the nodes near the particles, and record the launches at ``time`` [s]."""
        cloud = self.cloud
        x, drift = (cloud.particles.x, 0) if self.lagrangian else (cloud.read("x"), 1)
        self.nodes = cloud.grid.near(x, drift=drift)
        self._nodes = start_warp().array(self.nodes.astype(np.int32), dtype=int, device=self.device)
        for grid in (*self._grids, self._kick):
            grid.zero_()
        self.record(time)

    def record(self, time: float) -> None:
        """Record the launches, with the boundaries where they are at ``time`` [s]."""
        self._graph, self._stages = None, []
        if not len(self.nodes):  # every particle has left the grid
            return
        wp, cloud, rigid = start_warp(), self.cloud, self.rigid
        real, types, struct, clock = cloud.real, cloud.types, cloud.struct, self._clock
        kernels, main = grid_kernels(real), self._grids[0]
        nodes, count = self._nodes, len(self.nodes)

        def add(
            stage: Stage, kernel: Any, first: int, size: int, *inputs: Any, grids: bool = False
        ) -> None:
            """Record launches on ``size`` things from ``first`` on, halved between two threads.

            With ``grids`` each thread adds to its own; warp records no launch of nothing.
            """
            half = (size + 1) // 2 if self.threads == 2 else size
            for thread, a, n in ((0, first, half), (1, first + half, size - half)):
                own = [self._grids[thread]] if grids else []
                if n:
                    launch(stage, kernel, n, a, *inputs, *own, thread=thread)

        def launch(stage: Stage, kernel: Any, n: int, *inputs: Any, thread: int = 0) -> None:
            command = wp.launch(kernel, n, list(inputs), device=self.device, record_cmd=True)
            stage[thread].append(command)

        def numbers(values: np.ndarray) -> Any:
            return wp.array(values.astype(np.int32), dtype=int, device=self.device)

        clear, scatter, advance, hold, move, settle = stages = [([], []) for _ in range(6)]
        for thread in range(self.threads):
            launch(clear, kernels.clear, count, 0, nodes, self._grids[thread], thread=thread)
        if len(struct.push):
            launch(clear, push_kernel(real), len(cloud), 0, struct, clock)
        if rigid is not None:
            launch(clear, kernels.clear, count, 0, nodes, self._kick)

        for span in cloud.spans:
            kernel = scatter_kernel(span.kind, real, lagrangian=self.lagrangian, form=span.form)
            add(scatter, kernel, span.first, span.count, struct, cloud.frame, clock, grids=True)

        add(advance, kernels.advance, 0, count, nodes, *self._grids, self._gravity, clock)

        touching = 0.0 if rigid is None else rigid.touching
        for slot, wall in enumerate(self.walls):
            inside, *fields = wall.at(cloud.grid, self.nodes, 0.0 if self.lagrangian else time)
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

    On 'cpu' they are of float64, on 'cuda' of float32.
    """

    def __init__(self, particles: Particles, grid: BackgroundGrid, device: str) -> None:
        wp = start_warp()
        self.particles, self.grid, self.device = particles, grid, device
        self.real = wp.float64 if device == "cpu" else wp.float32
        self.types = types_of(self.real)
        forms = np.array([int(s.form) for s in particles.substances])[particles.substance]
        forms = np.where(particles.rigid < 0, forms, Form.PLAIN)
        self._classes = len(Form) * particles.kinds + forms
        order = self.order = self._sorted(particles.x)
        keys, first, count = np.unique(self._classes[order], return_index=True, return_counts=True)
        self.spans = tuple(
            ClassSpan(MaterialClass(int(kind)), Form(int(form)), int(a), int(n))
            for kind, form, a, n in zip(*np.divmod(keys, len(Form)), first, count, strict=True)
        )
        lam, mu = lame_parameters(particles.E, particles.nu)
        states = np.array([s.state for s in particles.substances])[particles.substance]
        real, vec3, mat33 = self.real, self.types.vec3, self.types.mat33
        struct = self.struct = self.types.Cloud()
        values = {
            "x": (particles.x, vec3),
            "rest": (particles.x, vec3),
            "v": (particles.velocity, vec3),
            "k": (particles.numbers(grid.spacing), vec3),
            "m": (particles.mass, real),
            "volume": (particles.volume, real),
            "mu": (mu, real),
            "lam": (lam, real),
            "q": (states, real),
            "body": (particles.rigid.astype(np.int32), int),
        }
        for name, (array, dtype) in values.items():
            sorted_ = np.ascontiguousarray(array[order])
            setattr(struct, name, wp.array(sorted_, dtype=dtype, device=device))
        struct.push = wp.zeros(0, dtype=vec3, device=device)
        for name in ("C", "H", "total"):
            setattr(struct, name, wp.zeros(len(self), dtype=mat33, device=device))
        self.strongest_push = 0.0  # m/s^2
        frame = self.types.Frame()
        frame.origin = vec3(*map(float, grid.origin))
        frame.spacing = grid.spacing
        frame.nx, frame.ny, frame.nz = grid.shape
        self.frame = frame
        self.listed = wp.clone(self.struct.x)
        self._survey = wp.zeros(COUNT, dtype=self.real, device=device)

    def __len__(self) -> int:
        return len(self.order)

    def rows(self, span: ClassSpan) -> Int[np.ndarray, "some"]:
        """The particles of a span."""
        return self.order[span.first : span.first + span.count]

    def _sorted(self, x: np.ndarray) -> Int[np.ndarray, "n"]:
        """Order by class, and by the first node within it."""
        nodes = np.clip(self.grid.first_nodes(x), 0, np.array(self.grid.shape) - 3)
        return np.argsort(self._classes * self.grid.count + self.grid.flat(nodes), kind="stable")

    def sort(self) -> None:
        """Put the particles into the order of the grid again, every array in its place."""
        again = self._sorted(self.read("x"))
        inner = np.empty(len(again), dtype=np.int64)
        inner[self.order] = np.arange(len(again))
        moved = inner[again]
        for name in (*CHANGING, "rest", "m", "volume", "mu", "lam", "k", "body"):
            array = getattr(self.struct, name)
            array.assign(array.numpy()[moved])
        if len(self.struct.push):
            self.struct.push.assign(self.struct.push.numpy()[moved])
        self.order = again
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
        self.strongest_push = float(np.linalg.norm(self.struct.push.numpy(), axis=1).max(initial=0))

    def survey(self) -> Float[np.ndarray, "entries"]:
        """Look over the particles: see the entries of ``kernels_grid``."""
        wp = start_warp()
        self._survey.zero_()
        for span in self.spans:
            inputs = [span.first, self.struct, self.frame, self.listed, self._survey]
            kernel = survey_kernel(span.kind, self.real, span.form)
            wp.launch(kernel, span.count, inputs, device=self.device)
        return self._survey.numpy().astype(np.float64)
