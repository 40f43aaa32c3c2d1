"""Time integration: where inertia alone carries a body, and what its motion is after a step."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..elements.assembly import (
    BlockMatrix,
    add_diagonal,
    apply_supports,
    drop_rows,
    free_components,
)
from ..elements.space import Space
from ..linalg.krylov import DeviceVector, length, whole_blocks
from ..mesh import TetMesh, material_of
from .nonlinear import Point, minimise
from .result import Motion

# Most accelerations that a forecast continues.
DEGREE = 5
# A step that changes the velocity by what carries more than this share of the energy before it has
# an impact in it that it does not follow.
LEAP = 0.25


class Scheme(Enum):
    """Time integration: first order and damping, second order and damping little, conserving."""

    IMPLICIT_EULER = "implicit Euler"
    BDF2 = "BDF2"
    TRAPEZOIDAL = "trapezoidal"


class Kinematics(NamedTuple):
    """Displacement [m], velocity [m/s] and acceleration [m/s^2], each (nodes, 3).

    Arrays, or vectors of a device.
    """

    u: Any
    v: Any
    a: Any


class Step(NamedTuple):
    """An implicit step of ``dt`` [s]: M ``factor`` (u - ``target``) balances the forces at u."""

    scheme: Scheme
    dt: float
    factor: float
    target: Any
    now: Kinematics
    before: Kinematics | None

    @staticmethod
    def of(scheme: Scheme, dt: float, now: Kinematics, before: Kinematics | None) -> Step:
        """Step from ``now``; BDF2 has its second order from the state one ``dt`` ``before``."""
        if scheme is Scheme.BDF2 and before is not None:
            target = (4 * now.u - before.u) / 3 + 2 * dt / 9 * (4 * now.v - before.v)
            return Step(scheme, dt, 9 / (4 * dt**2), target, now, before)
        if scheme is Scheme.TRAPEZOIDAL:
            target = now.u + dt * now.v + dt**2 / 4 * now.a
            return Step(scheme, dt, 4 / dt**2, target, now, before)
        return Step(Scheme.IMPLICIT_EULER, dt, 1 / dt**2, now.u + dt * now.v, now, None)

    @property
    def restarted(self) -> Step:
        """The same step without a past."""
        return Step.of(self.scheme, self.dt, self.now, None)

    def leaps(self, u: np.ndarray, mass: np.ndarray | float, energy: float) -> bool:
        """Whether the step to ``u`` changes the velocity at once, for a body of ``energy`` [J].

        ``mass`` [kg] is that of the rows of ``u``. Past states then lead away from where the body
        goes: BDF2 would read the stop of a falling body as a speed upwards.
        """
        change = self.ended(u).v - self.now.v
        return 0.5 * float((mass * change**2).sum()) > LEAP * energy

    def ended(self, u: Any) -> Kinematics:
        """Motion at the end of the step, where the displacement is ``u``."""
        now, before, dt = self.now, self.before, self.dt
        a = self.factor * (u - self.target)
        if self.scheme is Scheme.TRAPEZOIDAL:
            return Kinematics(u, now.v + dt / 2 * (now.a + a), a)
        if before is None:
            return Kinematics(u, (u - now.u) / dt, a)
        return Kinematics(u, (3 * u - 4 * now.u + before.u) / (2 * dt), a)


class Forecast:
    """Acceleration of the next step from those of the last ones, a polynomial in time.

    The sum of the first n backward differences continues n values; what it misses the next one by
    is the n-th difference. As many are summed as would have foreseen the last value best.
    """

    def __init__(self) -> None:
        self.differences: list[np.ndarray] = []
        self.terms = 0

    def add(self, a: np.ndarray) -> None:
        """Take in the acceleration of a step."""
        new = [a]
        for old in self.differences[:DEGREE]:
            new.append(new[-1] - old)
        self.differences = new
        sizes = [length(difference) for difference in new]
        self.terms = sizes.index(min(sizes))

    def next(self) -> np.ndarray | float:
        """Acceleration to expect [m/s^2]; zero without a past."""
        return sum(self.differences[: self.terms], 0.0)


# Forces of inertia and elasticity are known to this fraction of what |u| would make of them.
ROUND_OFF = 2e-15
# Forces balanced to this share: near enough for the Hessian of friction itself. A chair that falls
# and slides took a quarter more steps of Newton with a hundredth, and a fifth more with one.
NEAR = 0.2


class Incremental:
    """Incremental potential: c/2 |u - target|_M^2 + W(u) - f . u + barrier + friction + damping."""

    def __init__(
        self, body: Any, factor: float, target: np.ndarray, dt: float, start: np.ndarray
    ) -> None:
        self.of, self.target, self.dt, self.start = body, target, dt, start
        self.inertia = factor * body.mass[:, None]
        self.near: np.ndarray | None = None  # where friction's own Hessian is to be trusted
        known = ROUND_OFF * np.linalg.norm((self.inertia + body.rigidity) * target)
        self.least = max(body.noise, float(known) / body.tolerance)
        self.loaded, self.sprung = length(body.load), bool(body.held.springs.any())

    def evaluate(self, u: np.ndarray) -> Point:
        """Energy, infinite on contact; gradient; size of the external and inertial force."""
        of, away = self.of, u - self.target
        barrier = of.contact.value(u)
        if not np.isfinite(barrier):
            return Point(np.inf, np.full_like(u, np.inf), 0.0)
        elastic, push = of.response(u), self.inertia * away
        gradient, sizes = elastic.force + push, [self.loaded, length(push)]
        energy = elastic.energy + barrier + 0.5 * float(np.vdot(push, away))
        energy -= float(np.vdot(of.load, u))
        gradient -= of.load
        if self.sprung:
            springs = of.held.springs * u
            energy, gradient = energy + 0.5 * float(np.vdot(springs, u)), gradient + springs
        if of.contact.acts:
            contact = np.zeros_like(u)
            of.contact.add_gradient(u, contact)
            gradient += contact
            sizes.append(length(contact))
        if of.damping:
            braked = of.damping.step(u, self.start, self.dt)
            energy, gradient = energy + braked.energy, gradient + braked.force
        gradient[of.held.fixed] = 0.0
        point = Point(energy, gradient, max(*sizes, self.least))
        self.near = u if point.residual <= NEAR * point.scale else None
        return point

    def hessian(self, u: np.ndarray, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        of = self.of
        matrix = of.body.tangent(u, projected=projected)
        if of.damping:
            of.damping.add_to(matrix, u, self.start, self.dt, projected=projected)
        add_diagonal(matrix, self.inertia + of.held.springs)
        matrix = of.contact.with_hessian(u, matrix, sharp=self.near is u and not projected)
        apply_supports(matrix, of.held.fixed)
        return matrix

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Share of ``step`` that keeps the body out of the obstacles."""
        return self.of.contact.longest_step(u, step)


class DeviceIncremental:
    """The same potential without contact and damping: vectors stay on the device.

    ``constants`` are those of ``DeviceSteps``, ``elastic`` is the elastic energy [J] where it was
    evaluated last; ``diagonal`` the inertia and springs [N/m], an array of vec3d.
    """

    def __init__(
        self, body: Any, constants: tuple, factor: float, target: Any, diagonal: Any
    ) -> None:
        self.of, self.constants, self.factor = body, constants, factor
        self.target, self.diagonal, self.elastic = target, diagonal, 0.0
        self.loaded = length(body.load)

    def evaluate(self, u: DeviceVector) -> Point:
        """Energy, gradient, and size of the external and inertial force."""
        from ..elements import kernels_field as k

        wp, (mass, rigidity, *fixed) = start_warp(), self.constants
        energy, force = self.of.body.responses(u)
        gradient = wp.empty_like(force)
        sums = wp.zeros(5, dtype=wp.float64, device=force.device)
        inertia = [self.target, wp.float64(self.factor), mass, rigidity]
        inputs = [u.array, *inertia, force, *fixed, gradient, sums]
        wp.launch(k.incremental, whole_blocks(len(force)), inputs=inputs, device=force.device)
        wp.utils.array_sum(energy, out=sums[4:])
        rest, push, left, target, self.elastic = sums.numpy().tolist()
        least = max(self.of.noise, ROUND_OFF * np.sqrt(target) / self.of.tolerance)
        scale = max(self.loaded, float(np.sqrt(push)), least)
        unbalanced = DeviceVector(gradient, size=float(np.sqrt(left)))
        return Point(self.elastic + rest, unbalanced, scale)

    def hessian(self, u: DeviceVector, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        matrix = self.of.body.tangent(u, projected=projected)
        add_diagonal(matrix, self.diagonal)
        drop_rows(matrix, self.constants[-1])
        return matrix

    def longest_step(self, u: DeviceVector, step: DeviceVector) -> float:
        """All of it: nothing is in the way."""
        return 1.0


class DeviceSteps:
    """Steps of a body in motion without contact and damping: its past stays on the device too."""

    def __init__(self, body: Any, device: str) -> None:
        wp = start_warp()
        self.of, self.device = body, device
        # Mass [kg], rigidity [N/m], load [N], springs [N/m] and free components of every node
        self.constants = (
            wp.array(body.mass, dtype=wp.float64, device=device),
            wp.array(body.rigidity.ravel(), dtype=wp.float64, device=device),
            DeviceVector.of(body.load, device).array,
            DeviceVector.of(body.held.springs, device).array,
            free_components(body.held.fixed, device),
        )
        shape = (DEGREE + 1, len(body.mass))
        self._differences = wp.zeros(shape, dtype=wp.vec3d, device=device)
        self._ended: Motion | None = None  # whose motion ``_now`` is
        self._now: Any = None
        self._diagonal: tuple[float, Any] = (np.nan, None)
        self._forget(np.nan)

    def _forget(self, dt: float) -> None:
        """Start anew: the past has other steps, or none."""
        self._before: Kinematics | None = None
        self._dt = dt
        self._count, self._terms = 0, 0  # differences of accelerations, those of the forecast

    def advance(self, dt: float) -> Motion:
        """The state after a step of ``dt`` [s] from that of the body."""
        from ..elements import kernels_field as k

        body = self.of
        if dt != self._dt or body.state is not self._ended:
            self._forget(dt)
            arrays = (body.state.u, body.state.v, body.state.a)
            self._now = Kinematics(*(DeviceVector.of(x, self.device) for x in arrays))
        step = Step.of(body.scheme, dt, self._now, self._before)
        wp, (mass, _, load, springs, free) = start_warp(), self.constants
        # Target with what is fixed in its place, and where the forecast leads
        old, nodes = step.now.u.array, len(mass)
        aim, start = wp.empty_like(old), wp.empty_like(old)
        ahead = [self._differences, self._terms, wp.float64(1 / step.factor)]
        inputs = [old, step.target.array, free, *ahead, aim, start]
        wp.launch(k.foresee, nodes, inputs=inputs, device=self.device)
        if self._diagonal[0] != step.factor:  # inertia of a step and springs [N/m]
            diagonal = step.factor * body.mass[:, None] + body.held.springs
            self._diagonal = (step.factor, DeviceVector.of(diagonal, self.device).array)
        there = DeviceIncremental(body, self.constants, step.factor, aim, self._diagonal[1])
        options = {"solve": body.solver, "tolerance": body.tolerance}
        minimum = minimise(there, DeviceVector(start), **options)
        # The motion that the step ended with, and its part in the next forecast
        u, v, a = step.ended(minimum.u)
        self._count = min(self._count + 1, DEGREE + 1)
        motion = wp.empty((3, nodes), dtype=wp.vec3d, device=self.device)
        sums = wp.zeros(3 + self._count, dtype=wp.float64, device=self.device)
        inputs = [u.array, v.raw, wp.float64(v.factor), a.raw, wp.float64(a.factor), free, mass]
        inputs += [load, springs, self._count, motion, self._differences, sums]
        wp.launch(k.end_of_step, whole_blocks(nodes), inputs=inputs, device=self.device)
        kinetic, sprung, lifted, *squares = sums.numpy().tolist()
        self._terms = int(np.argmin(squares))
        self._before, rows = self._now, motion.numpy()
        self._now = Kinematics(*(DeviceVector(motion[row]) for row in range(3)))
        ended = replace(  # what the state says of contact stays: there is none
            body.state,
            time=body.state.time + dt,
            **dict(zip(("u", "v", "a"), rows, strict=True)),
            kinetic=kinetic,
            elastic=there.elastic + sprung,
            potential=lifted,
            iterations=minimum.iterations,
        )
        self._ended = ended
        return ended


def nodal_rigidity(mesh: TetMesh, space: Space) -> Float[np.ndarray, "nodes 1"]:
    """Stiffness [N/m] of the tets around every node, in the mean: E times their size."""
    k = material_of(mesh).E * np.cbrt(mesh.volumes)
    nodes, size = space.elements.ravel(), space.elements.shape[1]
    total = np.bincount(nodes, np.repeat(k, size), len(space.nodes))
    return (total / np.maximum(np.bincount(nodes, minlength=len(space.nodes)), 1))[:, None]
