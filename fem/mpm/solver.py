"""Explicit steps of particles through the grid, looked over between chunks of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..device import checked_device, start_warp
from ..errors import InputError
from ..material import lame_parameters
from .boundaries import BackgroundGrid, Wall, still_nodes
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
from .materials import FLOWING, Form, MaterialClass, elastic_density
from .particles import Particles, ParticleState, without_cracks
from .rigid import REST, RigidBodies
from .time_step import COURANT, MOST_STRAIN, Failure, FailureKind, largest_modulus, longest_step

# Substeps between two looks at the particles.
CHUNK = 50
# Particles may drift this far [spacings] between two listings of nodes: the lists reach one.
DRIFT, RELIST = 0.9, 0.5
# Share of the particles that may turn inside out before it is called a failure.
MOST_INVERTED = 0.01


class MpmSolver:
    """Explicit MLS-MPM: quadratic B-splines, APIC, symplectic Euler.

    Parameters
    ----------
    particles, lattice
        What moves, and the grid.
    walls
        What holds, grips or stops it.
    gravity_vector
        Acceleration of gravity [m/s^2], shape (3,).
    damping
        Rate [1/s] at which velocities fade.
    lagrangian
        Whether weights are those at rest (total Lagrangian): for jelly that is held and blown upon;
        it neither meets obstacles nor tears, but crossing cells costs it no memory.
    device, threads
        'cpu' (float64) with one or two threads, or 'cuda' (float32).
    courant
        Share of a spacing that the fastest wave crosses in a step.
    step
        Step [s] wanted instead of the longest stable one; one that is too long is a failure.
    """

    def __init__(
        self,
        particles: Particles,
        lattice: BackgroundGrid,
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
        self._held = particles.held
        if self._held.all():
            raise InputError("every particle is stationary: nothing would move")
        self._given = particles
        moving = particles.only(~self._held) if self._held.any() else particles
        self.cloud = Cloud(moving, lattice, checked_device(device))
        self.lattice, self.lagrangian = lattice, lagrangian
        self.damping, self.courant, self.step = damping, courant, step
        if lagrangian and any(
            span.kind != MaterialClass.JELLY or span.form == Form.TEARING
            for span in self.cloud.spans
        ):
            raise InputError("weights at rest are for jelly that does not tear: lagrangian=False")
        self._walls = max((float(np.linalg.norm(w.shape.velocity)) for w in walls), default=0.0)
        self.time, self.substeps, self.outside = 0.0, 0, 0
        self.failure: Failure | None = None
        held = particles.only(self._held) if self._held.any() else None
        self.substep = Substep(
            self.cloud, walls, gravity_vector, held=held, lagrangian=lagrangian, threads=threads
        )
        self._list()

    @property
    def state(self) -> ParticleState:
        """The particles now; the opening of cracks is no deformation of theirs."""
        cloud, free = self.cloud, ~self._held
        H = cloud.read("H")
        for span in cloud.spans:
            if span.carries:
                own = cloud.order[span.first : span.first + span.count]
                H[own] = cloud.read("total")[own]
        given = self._given
        x, v = given.x.copy(), np.zeros_like(given.x)
        F, q = np.tile(np.eye(3), (len(x), 1, 1)), np.zeros(len(x))
        x[free], v[free], q[free] = cloud.read("x"), cloud.read("v"), cloud.read("q")
        F[free] += H
        if any(span.form == Form.TEARING for span in cloud.spans):
            tears = np.isin(given.substance, [i for i, s in enumerate(given.substances) if s.tears])
            own = tears & free & (given.rigid < 0)
            softening = cloud.read("k")[own[free], 1]
            F[own] = without_cracks(F[own], q[own], softening)
        return ParticleState(self.time, x, v, F, q)

    @property
    def elastic_energy(self) -> float:
        """Elastic energy [J] of the particles; torn ones are left out: theirs is not known."""
        cloud, total = self.cloud, 0.0
        volume = cloud.particles.volume
        H, numbers = cloud.read("H"), cloud.read("k")
        lam, mu = lame_parameters(cloud.particles.E, cloud.particles.nu)
        for span in cloud.spans:
            if span.rigid:
                continue
            own = cloud.order[span.first : span.first + span.count]
            given = (H[own], lam[own], mu[own], numbers[own, 0])
            found = elastic_density(span.kind, *given, form=span.form)
            if span.form == Form.TEARING:
                found = np.where(cloud.read("q")[own] > 1, 0.0, found)
            total += float(volume[own] @ found)
        return total

    def push(self, acceleration: Float[np.ndarray, "n 3"]) -> None:
        """Accelerate the particles [m/s^2] by outer forces from now on."""
        self.cloud.set_push(acceleration[~self._held])
        self.substep.record(self.time)

    def advance(self, duration: float, *, tell: Callable[[float], None] | None = None) -> bool:
        """Follow the particles for ``duration`` [s]; False where that failed: see ``failure``.

        ``tell`` hears the time [s] after every chunk of substeps.
        """
        end, short = self.time + duration, 1.0
        while self.failure is None and self.time < end - 1e-12 * max(end, duration):
            found = self.cloud.survey()
            self.outside = int(found[OUTSIDE])
            dt, steps = self._chunk(found, end - self.time, short)
            if self.failure is not None:
                break
            if not self._follow(dt, steps):
                if steps == 1:
                    self._fail("velocity", "it moved a cell in one step: take shorter steps")
                short = short / 2
                continue
            short = min(1.0, 2 * short)
            if tell is not None:
                tell(self.time)
        return self.failure is None

    def _follow(self, dt: float, steps: int) -> bool:
        """Take ``steps`` steps of ``dt`` [s]; False, and all as before, where nodes were missed."""
        self.substep.set_step(dt, self.damping)
        if self.substep.moving:
            self.substep.record(self.time)
        if self.lagrangian:
            self.substep.run(steps)
        else:
            self.cloud.keep()
            if self.substep.rigid is not None:
                self.substep.rigid.keep()
            self.substep.run(steps)
            if not self.cloud.survey()[MOVED] <= 1.0:
                bad = self.cloud.survey()[NOT_FINITE] > 0
                self.cloud.restore()
                if self.substep.rigid is not None:
                    self.substep.rigid.restore()
                if bad and steps == 1:
                    self._fail("not finite", "values overflowed: take shorter steps")
                return False
        self.time += steps * dt
        self.substeps += steps
        return True

    def _chunk(
        self, found: Float[np.ndarray, "entries"], left: float, short: float
    ) -> tuple[float, int]:
        """Step [s] and number of steps of the next chunk; sets ``failure`` where there is none."""
        spacing = self.lattice.spacing
        if found[NOT_FINITE]:
            self._fail("not finite", "values overflowed: take shorter steps")
        if found[INVERTED] > MOST_INVERTED * len(self.cloud):
            self._fail("inverted", "it is turned inside out: a finer grid, or a smaller load")
        if self.outside == len(self.cloud):
            self._fail("left grid", "nothing is left in the grid: make its room larger")
        if self.failure is not None:
            return 0.0, 0
        pull, fastest = self.substep.pull, max(float(found[SPEED]), self._walls)
        longest = longest_step(
            float(found[WAVE]), fastest, spacing, pull=pull, courant=self.courant
        )
        longest = min(longest, MOST_STRAIN / max(found[SPREAD], 1e-300))
        if self.step is not None:
            if self.step > longest * (1 + 1e-9):
                self._fail("cfl", f"steps of {self.step:.3g} s: wanted at most {longest:.3g} s")
            longest = self.step
        count = max(1, int(np.ceil(left / longest * (1 - 1e-12))))
        dt = left / count
        if not self.lagrangian:
            if found[MOVED] > RELIST:
                self.cloud.sort()
                self._list()
                found[MOVED] = 0.0
            room = DRIFT - found[MOVED]
            drifts = longest_step(0.0, fastest, spacing, pull=pull, courant=room)
            count = min(count, max(1, int(min(drifts / dt, count))))
        return dt, max(1, int(min(count, CHUNK) * short))

    def _fail(self, kind: FailureKind, advice: str) -> None:
        """Put a failure on record, with the part of the particle that it is about."""
        given, worst = self._given, self._worst(kind)
        dt = self.substep.step if self.step is None else self.step
        most = np.inf
        if dt > 0:
            nu, rho, spacing = given.nu[worst], given.rho[worst], self.lattice.spacing
            most = float(largest_modulus(nu, rho, spacing, dt, courant=self.courant))
        self.failure = self.failure or Failure(
            kind=kind,
            time=self.time,
            part=given.parts[given.part[worst]],
            E=float(given.E[worst]),
            E_max=most,
            advice=advice,
        )

    def _worst(self, kind: FailureKind) -> int:
        """Particle that a failure is about: lost, inside out, or of the fastest waves."""
        now = self.state
        if kind == "not finite":
            lost = ~np.isfinite(now.x + now.v + now.F.sum(axis=2)).all(axis=1)
            return int(np.argmax(lost))
        if kind == "inverted":
            return int(np.argmin(np.linalg.det(now.F)))
        if kind == "velocity":
            return int(np.argmax((now.v**2).sum(axis=1)))
        return int(np.argmax(self._given.wave_speed))

    def _list(self) -> None:
        self.substep.list_nodes()
        self.substep.record(self.time)


# The launches of one substep, recorded: stages, and in each of them what every thread does.

# What one thread launches, for both threads.
Stage = list[list[Any]]


class Substep:
    """Particles to grid, grid, walls, grid to particles.

    ``list_nodes`` and ``record`` again when the particles were sorted; ``record`` when walls moved.

    Parameters
    ----------
    cloud
        The particles.
    walls
        What holds or stops nodes, in this order.
    gravity_vector
        Acceleration of gravity [m/s^2], shape (3,).
    held
        Stationary particles: nodes that they weigh on stand still.
    lagrangian
        Whether weights are those at rest.
    threads
        One, or two on a CPU: warp's kernels run at once, each thread on a grid of its own.
    """

    def __init__(
        self,
        cloud: Cloud,
        walls: Sequence[Wall],
        gravity_vector: Sequence[float] | np.ndarray,
        *,
        held: Particles | None,
        lagrangian: bool,
        threads: int,
    ) -> None:
        wp, types, lattice = start_warp(), cloud.types, cloud.lattice
        self.cloud, self.walls, self.lagrangian = cloud, tuple(walls), lagrangian
        self.device = cloud.device
        self.threads = threads if self.device == "cpu" else 1
        self._gravity = types.vec3(*map(float, gravity_vector))
        self._clock = wp.zeros(2, dtype=types.real, device=self.device)
        sizes = [lattice.count, lattice.count if self.threads == 2 else 0]
        self._grids = [wp.zeros(n, dtype=types.vec4, device=self.device) for n in sizes]
        self._impulse = wp.zeros(len(walls) + 1, dtype=types.vec3, device=self.device)
        self._worker = ThreadPoolExecutor(1) if self.threads == 2 else None
        self.rigid: RigidBodies | None = None
        if cloud.particles.rigid.max() >= 0:
            given = cloud.particles, lattice.spacing, cloud.real, self.device
            self.rigid = RigidBodies(*given)
        size = lattice.count if self.rigid is not None else 0
        self._kick = wp.zeros(size, dtype=types.vec4, device=self.device)
        self._still = still_nodes(held, lattice)
        self._stages: list[Stage] = []
        self._graph: Any = None

    @property
    def pull(self) -> float:
        """Acceleration [m/s^2] by gravity and outer forces, at most."""
        return float(np.linalg.norm(self._gravity)) + self.cloud.strongest_push

    @property
    def moving(self) -> bool:
        """Whether walls are elsewhere later."""
        return any(w.moves or w.start > 0 or w.end < np.inf for w in self.walls)

    @property
    def step(self) -> float:
        """Step [s] of the last chunk."""
        return float(self._clock.numpy()[0])

    def set_step(self, dt: float, damping: float) -> None:
        """Take steps of ``dt`` [s] in which velocities fade at the rate ``damping`` [1/s]."""
        self._clock.assign(np.array([dt, np.exp(-damping * dt)], dtype=self._clock.numpy().dtype))

    def take_impulses(self) -> Float[np.ndarray, "holders 3"]:
        """Momentum [N s] that every wall, and then what is stationary, gave since asked last."""
        found = self._impulse.numpy().astype(np.float64).copy()
        self._impulse.zero_()
        if self.rigid is not None:  # what rigid bodies got more is shared as the rest is
            size = np.linalg.norm(found[:-1], axis=1)
            share = size / max(size.sum(), 1e-300)
            found[:-1] += share[:, None] * self.rigid.take_push()
        return found

    def list_nodes(self) -> None:
        """List the nodes near the particles."""
        drift = 0 if self.lagrangian else 1
        x = self.cloud.particles.x if self.lagrangian else self.cloud.read("x")
        self.nodes = self.cloud.lattice.near(x, drift=drift)
        given = self.nodes.astype(np.int32)
        self._nodes = start_warp().array(given, dtype=int, device=self.device)
        for grid in (*self._grids, self._kick):
            grid.zero_()

    def record(self, time: float) -> None:
        """Record the launches, with the walls where they are at ``time`` [s]."""
        self._graph, self._stages = None, []
        if not len(self.nodes):  # every particle has left the grid
            return
        stages = [self._clears(), self._scatters(), self._advances()]
        stages += [self._holds(0.0 if self.lagrangian else time), self._moves()]
        stages += self._settles()
        self._stages = [stage for stage in stages if any(stage)]
        if self.device != "cpu":
            wp = start_warp()
            with wp.ScopedCapture(device=self.device) as capture:
                for stage in self._stages:
                    for launch in stage[0]:
                        launch.launch()
            self._graph = capture.graph

    def _launch(self, kernel: Any, count: int, inputs: list[Any]) -> Any:
        """Recorded launch of ``count`` > 0: warp records none of nothing."""
        return start_warp().launch(kernel, count, inputs, device=self.device, record_cmd=True)

    def _halves(self, first: int, count: int) -> list[tuple[int, int, int]]:
        """Thread, first and count of what each thread takes."""
        half = (count + 1) // 2 if self.threads == 2 else count
        given = [(0, first, half), (1, first + half, count - half)]
        return [share for share in given if share[2]]

    def _clears(self) -> Stage:
        kernel, stage = grid_kernels(self.cloud.real).clear, [[], []]
        for thread in range(self.threads):
            given = [0, self._nodes, self._grids[thread]]
            stage[thread].append(self._launch(kernel, len(self.nodes), given))
        cloud = self.cloud
        if len(cloud.struct.push):
            given = [0, cloud.struct, self._clock]
            stage[0].append(self._launch(push_kernel(cloud.real), len(cloud), given))
        if self.rigid is not None:
            given = [0, self._nodes, self._kick]
            stage[0].append(self._launch(kernel, len(self.nodes), given))
        return stage

    def _scatters(self) -> Stage:
        cloud, stage = self.cloud, [[], []]
        for span in cloud.spans:
            kernel = scatter_kernel(
                span.kind, cloud.real, lagrangian=self.lagrangian, form=span.form
            )
            for thread, first, count in self._halves(span.first, span.count):
                given = [first, cloud.struct, cloud.frame, self._clock, self._grids[thread]]
                stage[thread].append(self._launch(kernel, count, given))
        return stage

    def _advances(self) -> Stage:
        kernel, stage = grid_kernels(self.cloud.real).advance, [[], []]
        for thread, first, count in self._halves(0, len(self.nodes)):
            given = [first, self._nodes, *self._grids, self._gravity, self._clock]
            stage[thread].append(self._launch(kernel, count, given))
        return stage

    def _holds(self, time: float) -> Stage:
        wp, types, stage = start_warp(), self.cloud.types, [[], []]
        kernel = grid_kernels(self.cloud.real).wall
        for slot, wall in enumerate(self.walls):
            found = wall.at(self.cloud.lattice, self.nodes, time)
            if len(found.nodes):
                arrays = [
                    wp.array(found.nodes.astype(np.int32), dtype=int, device=self.device),
                    wp.array(found.normals, dtype=types.vec3, device=self.device),
                    wp.array(found.velocities, dtype=types.vec3, device=self.device),
                ]
                touching = 0.0 if self.rigid is None else self.rigid.touching
                given = [*arrays, int(wall.touch), wall.friction, touching, slot, self._grids[0]]
                given = [*given, self._impulse, self._kick]
                stage[0].append(self._launch(kernel, len(found.nodes), given))
        still = self._still
        if len(still.nodes):
            arrays = [
                wp.array(still.nodes.astype(np.int32), dtype=int, device=self.device),
                wp.array(still.mass, dtype=types.real, device=self.device),
            ]
            given = [*arrays, len(self.walls), self._grids[0], self._impulse]
            hold = grid_kernels(self.cloud.real).hold
            stage[0].append(self._launch(hold, len(still.nodes), given))
        return stage

    def _moves(self) -> Stage:
        cloud, stage = self.cloud, [[], []]
        for span in cloud.spans:
            if span.rigid:
                continue
            kernel = move_kernel(cloud.real, lagrangian=self.lagrangian, carries=span.carries)
            for thread, first, count in self._halves(span.first, span.count):
                given = [first, cloud.struct, cloud.frame, self._clock, self._grids[0]]
                stage[thread].append(self._launch(kernel, count, given))
        return stage

    def _settles(self) -> list[Stage]:
        """Rigid bodies: sum their momenta, settle, move their particles."""
        cloud, bodies = self.cloud, self.rigid
        if bodies is None:
            return []
        gathers, carries = [], []
        for span in cloud.spans:
            if span.rigid:
                given = [span.first, cloud.struct]
                summed = [*given, cloud.frame, self._grids[0], self._kick, bodies.struct]
                gathers.append(self._launch(bodies.kernels.gather, span.count, summed))
                moved = [*given, bodies.struct]
                carries.append(self._launch(bodies.kernels.carry, span.count, moved))
        settle = [bodies.struct, self._clock, cloud.real(0.0 if self.moving else REST)]
        settles = [self._launch(bodies.kernels.settle, bodies.count, settle)]
        return [[[*gathers, *settles, *carries], []]]

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


# Particles on the device: sorted by class and place, copied, looked over and read back.

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
        """Whether the elastic deformation is not the whole."""
        plastic = self.kind in (MaterialClass.METAL, MaterialClass.VISPLAS, MaterialClass.SNOW)
        return plastic and self.kind not in FLOWING


class Cloud:
    """Moving particles on a device, in the order of their class and then of the grid.

    Parameters
    ----------
    particles
        What moves: no stationary ones.
    lattice
        The grid.
    device
        'cpu' (float64) or 'cuda' (float32).
    """

    def __init__(self, particles: Particles, lattice: BackgroundGrid, device: str) -> None:
        wp = start_warp()
        self.particles, self.lattice, self.device = particles, lattice, device
        self.real = wp.float64 if device == "cpu" else wp.float32
        self.types = types_of(self.real)
        self.order: Int[np.ndarray, "n"] = self._sorted(particles.x)
        keys, first, count = np.unique(
            self._keys()[self.order], return_index=True, return_counts=True
        )
        self.spans = tuple(
            ClassSpan(MaterialClass(int(kind)), Form(int(form)), int(a), int(n))
            for kind, form, a, n in zip(*np.divmod(keys, len(Form)), first, count, strict=True)
        )
        self.struct = self._upload()
        self.strongest_push = 0.0  # m/s^2
        frame = self.types.Frame()
        frame.origin = self.types.vec3(*map(float, self.lattice.origin))
        frame.spacing = self.lattice.spacing
        frame.nx, frame.ny, frame.nz = self.lattice.shape
        self.frame = frame
        self.listed = wp.clone(self.struct.x)
        self._found = wp.zeros(COUNT, dtype=self.real, device=device)
        self._kept: dict[str, Any] = {}

    def __len__(self) -> int:
        return len(self.order)

    def _keys(self) -> np.ndarray:
        forms = np.array([int(s.form) for s in self.particles.substances])
        forms = np.where(self.particles.rigid < 0, forms[self.particles.substance], Form.PLAIN)
        return len(Form) * self.particles.kinds + forms

    def _sorted(self, x: np.ndarray) -> np.ndarray:
        """Order by class, and by the first node within it."""
        nodes = np.clip(self.lattice.first_nodes(x), 0, np.array(self.lattice.shape) - 3)
        key = self._keys() * self.lattice.count + self.lattice.flat(nodes)
        return np.argsort(key, kind="stable")

    def _upload(self) -> Any:
        wp, types, given, order = start_warp(), self.types, self.particles, self.order
        lam, mu = lame_parameters(given.E, given.nu)
        states = np.array([s.state for s in given.substances])[given.substance]
        struct = types.Cloud()

        def put(values: np.ndarray, dtype: Any) -> Any:
            return wp.array(np.ascontiguousarray(values[order]), dtype=dtype, device=self.device)

        struct.x, struct.rest = put(given.x, types.vec3), put(given.x, types.vec3)
        struct.v, struct.k = (
            put(given.velocity, types.vec3),
            put(given.numbers(self.lattice.spacing), types.vec3),
        )
        scalars = {"m": given.mass, "volume": given.volume, "mu": mu, "lam": lam, "q": states}
        for name, values in scalars.items():
            setattr(struct, name, put(values, self.real))
        struct.body = wp.array(given.rigid[order].astype(np.int32), dtype=int, device=self.device)
        struct.push = wp.zeros(0, dtype=types.vec3, device=self.device)
        for name in ("C", "H", "total"):
            setattr(struct, name, wp.zeros(len(self), dtype=types.mat33, device=self.device))
        return struct

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
        found = getattr(self.struct, name).numpy()
        out = np.empty(found.shape, dtype=np.float64)
        out[self.order] = found
        return out

    def write(self, name: str, values: np.ndarray) -> None:
        """Set the array ``name``, given in the order of the particles."""
        getattr(self.struct, name).assign(np.ascontiguousarray(values[self.order]))

    def set_push(self, values: Float[np.ndarray, "n 3"]) -> None:
        """Accelerations [m/s^2] of the particles by outer forces, from now on."""
        given, vec3 = np.ascontiguousarray(values[self.order]), self.types.vec3
        self.struct.push = start_warp().array(given, dtype=vec3, device=self.device)
        self.strongest_push = float(np.linalg.norm(self.struct.push.numpy(), axis=1).max(initial=0))

    def keep(self) -> None:
        """Remember the state."""
        wp = start_warp()
        for name in CHANGING:
            array = getattr(self.struct, name)
            if name not in self._kept:
                self._kept[name] = wp.empty_like(array)
            wp.copy(self._kept[name], array)

    def restore(self) -> None:
        """Go back to what was remembered."""
        for name, array in self._kept.items():
            start_warp().copy(getattr(self.struct, name), array)

    def survey(self) -> Float[np.ndarray, "entries"]:
        """Look over the particles: see the entries of ``kernels.kernels_survey``."""
        wp = start_warp()
        self._found.zero_()
        for span in self.spans:
            given = [span.first, self.struct, self.frame, self.listed, self._found]
            kernel = survey_kernel(span.kind, self.real, span.form)
            wp.launch(kernel, span.count, given, device=self.device)
        return self._found.numpy().astype(np.float64)
