"""Explicit steps of particles through the grid, looked over between chunks of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from ..device import checked_device
from ..errors import InputError
from ..scene.material import lame_parameters
from .background import BackgroundGrid
from .classes import Form, MaterialClass, elastic_density
from .cloud import Cloud
from .fracture import without_cracks
from .kernels.kernels_survey import INVERTED, MOVED, NOT_FINITE, OUTSIDE, SPEED, SPREAD, WAVE
from .particles import Particles, ParticleState
from .stability import COURANT, MOST_STRAIN, Failure, FailureKind, largest_modulus, longest_step
from .substep import Substep
from .walls import Wall

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
            self._keep()
            self.substep.run(steps)
            if not self.cloud.survey()[MOVED] <= 1.0:
                bad = self.cloud.survey()[NOT_FINITE] > 0
                self._restore()
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

    def _keep(self) -> None:
        self.cloud.keep()
        if self.substep.rigid is not None:
            self.substep.rigid.keep()

    def _restore(self) -> None:
        self.cloud.restore()
        if self.substep.rigid is not None:
            self.substep.rigid.restore()

    def _list(self) -> None:
        self.substep.list_nodes()
        self.substep.record(self.time)
