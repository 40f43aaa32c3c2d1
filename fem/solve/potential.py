"""The energy that an implicit step minimises, on the host or on a device."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..discrete.block_matrix import BlockMatrix, add_diagonal
from ..discrete.constraints import apply_supports, drop_rows, free_components
from ..discrete.space import Space
from ..linalg.krylov import DeviceVector, whole_blocks
from ..scene.mesh import TetMesh, material_of
from .newton import LinearSolve, Minimum, Point, minimise

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
    """What of a body stays the same from step to step, on its device: arrays of vec3d (nodes,)."""

    load: Any
    springs: Any
    free: Any

    @classmethod
    def of(cls, body: Any, device: str) -> DeviceConstants:
        """Load [N], springs [N/m] and free components of a body in motion."""
        load, springs = (DeviceVector.of(v, device).array for v in (body.load, body.held.springs))
        return cls(load, springs, free_components(body.held.fixed, device))


class DeviceIncremental:
    """The same potential without contact and damping: vectors stay on the device.

    ``elastic`` is the elastic energy [J] where it was evaluated last.
    """

    def __init__(self, plain: Incremental, known: DeviceConstants) -> None:
        wp, device = start_warp(), str(known.free.device)
        self.plain, self.known, self.elastic = plain, known, 0.0
        self.target = DeviceVector.of(plain.target, device)
        self.inertia = wp.array(plain.inertia[:, 0], dtype=wp.float64, device=device)
        diagonal = plain.inertia + plain.of.held.springs
        self.diagonal = DeviceVector.of(diagonal, device).array

    def evaluate(self, u: DeviceVector) -> Point:
        """Energy, gradient, and size of the external and inertial force."""
        from ..linalg import kernels_krylov as k

        wp, known = start_warp(), self.known
        energy, force = self.plain.of.body.responses(u)
        gradient = wp.empty_like(force)
        sums = wp.zeros(3, dtype=wp.float64, device=force.device)
        given = [u.array, self.target.array, self.inertia, force, *known, gradient, sums]
        wp.launch(k.incremental, whole_blocks(len(force)), inputs=given, device=force.device)
        self.elastic = float(wp.utils.array_sum(energy))
        rest, push, _ = sums.numpy().tolist()
        scale = max(self.plain.loaded, float(np.sqrt(push)), self.plain.least)
        return Point(self.elastic + rest, DeviceVector(gradient), scale)

    def hessian(self, u: DeviceVector, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        matrix = self.plain.of.body.tangent(u, projected=projected)
        add_diagonal(matrix, self.diagonal)
        drop_rows(matrix, self.known.free)
        return matrix

    def longest_step(self, u: DeviceVector, step: DeviceVector) -> float:
        """All of it: nothing is in the way."""
        return 1.0

    def minimum(self, u: np.ndarray, *, solve: LinearSolve, tolerance: float) -> Minimum:
        """What ``minimise`` finds from ``u`` [m] (nodes, 3), back as an array."""
        start = DeviceVector.of(u, str(self.known.free.device))
        found = minimise(self, start, solve=solve, tolerance=tolerance)
        return found._replace(u=found.u.numpy())


def nodal_rigidity(mesh: TetMesh, space: Space) -> Float[np.ndarray, "nodes 1"]:
    """Stiffness [N/m] of the tets around every node, in the mean: E times their size."""
    k = material_of(mesh).E * np.cbrt(mesh.volumes)
    nodes, size = space.elements.ravel(), space.elements.shape[1]
    total = np.bincount(nodes, np.repeat(k, size), len(space.nodes))
    return (total / np.maximum(np.bincount(nodes, minlength=len(space.nodes)), 1))[:, None]


def _size(v: np.ndarray) -> float:
    return float(np.linalg.norm(v))
