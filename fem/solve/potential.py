"""The energy that an implicit step minimises, on the host or on a device."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..discrete.block_matrix import BlockMatrix, add_diagonal
from ..discrete.constraints import apply_supports, drop_rows, free_components
from ..discrete.space import Space
from ..linalg.krylov import DeviceVector, whole_blocks
from ..result import Motion
from ..scene.mesh import TetMesh, material_of
from .newton import Point, minimise
from .schemes import DEGREE as FORECAST
from .schemes import Kinematics, Step

# Forces of inertia and elasticity are known to this share of what |u| would make of them.
ROUND_OFF = 2e-15
# Forces balanced to this share: near enough for the Hessian of friction itself.
NEAR = 1e-2


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
        self.loaded, self.sprung = _size(body.load), bool(body.held.springs.any())

    def evaluate(self, u: np.ndarray) -> Point:
        """Energy, infinite on contact; gradient; size of the external and inertial force."""
        of, away = self.of, u - self.target
        barrier = of.contact.value(u)
        if not np.isfinite(barrier):
            return Point(np.inf, np.full_like(u, np.inf), 0.0)
        elastic, push = of.response(u), self.inertia * away
        gradient, sizes = elastic.force + push, [self.loaded, _size(push)]
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
            sizes.append(_size(contact))
        if of.damping:
            braked = of.damping.step(u, self.start, self.dt)
            energy, gradient = energy + braked.energy, gradient + braked.force
        gradient[of.held.fixed] = 0.0
        found = Point(energy, gradient, max(*sizes, self.least))
        self.near = u if found.residual <= NEAR * found.scale else None
        return found

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


class DeviceConstants(NamedTuple):
    """What of a body stays the same from step to step, on its device: an entry a node."""

    mass: Any
    rigidity: Any
    load: Any
    springs: Any
    free: Any

    @classmethod
    def of(cls, body: Any, device: str) -> DeviceConstants:
        """Mass [kg], rigidity [N/m], load [N], springs [N/m], free components of a body."""
        wp = start_warp()
        mass, rigidity = (
            wp.array(np.ravel(v), dtype=wp.float64, device=device)
            for v in (body.mass, body.rigidity)
        )
        load, springs = (DeviceVector.of(v, device).array for v in (body.load, body.held.springs))
        return cls(mass, rigidity, load, springs, free_components(body.held.fixed, device))


class DeviceIncremental:
    """The same potential without contact and damping: vectors stay on the device.

    ``elastic`` is the elastic energy [J] where it was evaluated last; ``diagonal`` the inertia and
    springs [N/m], an array of vec3d.
    """

    def __init__(
        self, body: Any, known: DeviceConstants, factor: float, target: Any, diagonal: Any
    ) -> None:
        self.of, self.known, self.factor = body, known, factor
        self.target, self.diagonal, self.elastic = target, diagonal, 0.0
        self.loaded = _size(body.load)

    def evaluate(self, u: DeviceVector) -> Point:
        """Energy, gradient, and size of the external and inertial force."""
        from ..discrete import kernels_field as k

        wp, (mass, rigidity, *known) = start_warp(), self.known
        energy, force = self.of.body.responses(u)
        gradient = wp.empty_like(force)
        sums = wp.zeros(5, dtype=wp.float64, device=force.device)
        inertia = [self.target, wp.float64(self.factor), mass, rigidity]
        given = [u.array, *inertia, force, *known, gradient, sums]
        wp.launch(k.incremental, whole_blocks(len(force)), inputs=given, device=force.device)
        wp.utils.array_sum(energy, out=sums[4:])
        rest, push, left, target, self.elastic = sums.numpy().tolist()
        least = max(self.of.noise, ROUND_OFF * np.sqrt(target) / self.of.tolerance)
        scale = max(self.loaded, float(np.sqrt(push)), least)
        found = DeviceVector(gradient, size=float(np.sqrt(left)))
        return Point(self.elastic + rest, found, scale)

    def hessian(self, u: DeviceVector, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        matrix = self.of.body.tangent(u, projected=projected)
        add_diagonal(matrix, self.diagonal)
        drop_rows(matrix, self.known.free)
        return matrix

    def longest_step(self, u: DeviceVector, step: DeviceVector) -> float:
        """All of it: nothing is in the way."""
        return 1.0


class DeviceSteps:
    """Steps of a body in motion without contact and damping: its past stays on the device too."""

    def __init__(self, body: Any, device: str) -> None:
        wp = start_warp()
        self.of, self.device = body, device
        self.known = DeviceConstants.of(body, device)
        shape = (FORECAST + 1, len(body.mass))
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
        body = self.of
        if dt != self._dt or body.state is not self._ended:
            self._forget(dt)
            arrays = (body.state.u, body.state.v, body.state.a)
            self._now = Kinematics(*(DeviceVector.of(x, self.device) for x in arrays))
        step = Step.of(body.scheme, dt, self._now, self._before)
        aim, start = self._foreseen(step)
        there = DeviceIncremental(body, self.known, step.factor, aim, self._inertia(step.factor))
        found = minimise(there, start, solve=body.solver, tolerance=body.tolerance)
        known = (there.elastic, found.iterations)
        self._ended = self._settled(body.state.time + dt, step.ended(found.u), *known)
        return self._ended

    def _foreseen(self, step: Step) -> tuple[Any, DeviceVector]:
        """Target with what is held in its place, and where the forecast leads."""
        from ..discrete import kernels_field as k

        wp, old = start_warp(), step.now.u.array
        aim, start = wp.empty_like(old), wp.empty_like(old)
        ahead = [self._differences, self._terms, wp.float64(1 / step.factor)]
        given = [old, step.target.array, self.known.free, *ahead, aim, start]
        wp.launch(k.foresee, len(old), inputs=given, device=self.device)
        return aim, DeviceVector(start)

    def _inertia(self, factor: float) -> Any:
        """Inertia of a step and springs [N/m], an array of vec3d."""
        if self._diagonal[0] != factor:
            diagonal = factor * self.of.mass[:, None] + self.of.held.springs
            self._diagonal = (factor, DeviceVector.of(diagonal, self.device).array)
        return self._diagonal[1]

    def _settled(self, time: float, ended: Kinematics, elastic: float, iterations: int) -> Motion:
        """The motion that a step ended with, and its part in the next forecast."""
        from ..discrete import kernels_field as k

        wp, (mass, _, load, springs, free) = start_warp(), self.known
        self._count = min(self._count + 1, FORECAST + 1)
        nodes = len(mass)
        motion = wp.empty((3, nodes), dtype=wp.vec3d, device=self.device)
        sums = wp.zeros(3 + self._count, dtype=wp.float64, device=self.device)
        moved = [ended.u.array, ended.v.raw, wp.float64(ended.v.factor), ended.a.raw]
        given = [*moved, wp.float64(ended.a.factor), free, mass, load, springs, self._count]
        out = [motion, self._differences, sums]
        wp.launch(k.end_of_step, whole_blocks(nodes), inputs=[*given, *out], device=self.device)
        kinetic, sprung, lifted, *squares = sums.numpy().tolist()
        self._terms = int(np.argmin(squares))
        self._before, rows = self._now, motion.numpy()
        self._now = Kinematics(*(DeviceVector(motion[row]) for row in range(3)))
        known = dict(zip(("u", "v", "a"), rows, strict=True)) | {"iterations": iterations}
        energies = {"kinetic": kinetic, "elastic": elastic + sprung, "potential": lifted}
        # What the state says of contact stays: there is none.
        return replace(self.of.state, time=time, **known, **energies)


def nodal_rigidity(mesh: TetMesh, space: Space) -> Float[np.ndarray, "nodes 1"]:
    """Stiffness [N/m] of the tets around every node, in the mean: E times their size."""
    k = material_of(mesh).E * np.cbrt(mesh.volumes)
    nodes, size = space.elements.ravel(), space.elements.shape[1]
    total = np.bincount(nodes, np.repeat(k, size), len(space.nodes))
    return (total / np.maximum(np.bincount(nodes, minlength=len(space.nodes)), 1))[:, None]


def _size(v: np.ndarray) -> float:
    return float(np.linalg.norm(v))
