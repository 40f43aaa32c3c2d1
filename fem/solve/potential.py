"""The energy that an implicit step minimises."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..discrete.block_matrix import BlockMatrix, add_diagonal
from ..discrete.constraints import apply_supports
from ..errors import InputError
from ..scene.components import free_motions
from ..scene.mesh import TetMesh
from ..scene.supports import Supports
from .newton import Point

# Forces of inertia and elasticity are known to this share of what |u| would make of them.
ROUND_OFF = 2e-15
# Forces balanced to this share: near enough for the Hessian of friction itself.
NEAR = 1e-2


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping C = ``mass`` M + ``stiffness`` K [1/s, s]; none by default.

    K is that of the body at rest: it brakes a turn, so that bodies free to turn are refused it.
    """

    mass: float = 0.0
    stiffness: float = 0.0


class Incremental:
    """Incremental potential: c/2 |u - target|_M^2 + W(u) - f . u + barrier + friction + damping."""

    def __init__(self, body: Any, factor: float, target: np.ndarray, dt: float) -> None:
        self.of, self.target, self.dt = body, target, dt
        self.inertia = factor * body.mass[:, None]
        self.start = body.state.u
        self.near: np.ndarray | None = None  # where friction's own Hessian is to be trusted
        known = ROUND_OFF * np.linalg.norm((self.inertia + body.rigidity) * target)
        self.least = max(body.noise, float(known) / body.tolerance)

    def evaluate(self, u: np.ndarray) -> Point:
        """Energy, infinite on contact; gradient; size of the external and inertial force."""
        of, away = self.of, u - self.target
        barrier = of.contact.value(u)
        if not np.isfinite(barrier):
            return Point(np.inf, np.full_like(u, np.inf), 0.0)
        elastic, push, springs = of.response(u), self.inertia * away, of.held.springs * u
        contact = np.zeros_like(u)
        of.contact.add_gradient(u, contact)
        energy = elastic.energy - float((of.load * u).sum()) + barrier
        energy += 0.5 * float((push * away).sum() + (springs * u).sum())
        gradient = elastic.force + push + springs + contact - of.load
        if of.damping:
            energy += of.damping.value(u - self.start, self.dt)
            gradient += of.damping.force(u - self.start, self.dt)
        gradient[of.held.fixed] = 0.0
        scale = max(float(np.linalg.norm(f)) for f in (of.load, push, contact))
        found = Point(energy, gradient, max(scale, self.least))
        self.near = u if found.residual <= NEAR * found.scale else None
        return found

    def hessian(self, u: np.ndarray, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        of = self.of
        matrix = of.body.tangent(u, projected=projected)
        if of.damping:
            of.damping.add_to(matrix, self.dt)
        blocks = (self.inertia + of.held.springs)[:, :, None] * np.eye(3)
        of.contact.add_hessian(u, blocks, sharp=self.near is u and not projected)
        add_diagonal(matrix, blocks)
        apply_supports(matrix, of.held.fixed)
        return matrix

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Share of ``step`` that keeps the body out of the obstacles."""
        return self.of.contact.longest_step(u, step)


def check_cannot_turn(mesh: TetMesh, held: Supports) -> None:
    """Raise ``InputError`` where a piece may move freely: K at rest brakes its turns."""
    stopped = (held.fixed | (held.springs > 0))[: len(mesh.points)]
    if free_motions(mesh, stopped).components.size:
        raise InputError(
            "stiffness damping brakes the turns of a body that can move freely: wanted supports, "
            "Damping(mass=...), or none"
        )


class Rayleigh:
    """Damping energy |u - start|_C^2 / 2 dt with C = alpha M + beta K at rest."""

    def __init__(self, of: Any, damping: Damping) -> None:
        self.alpha = damping.mass
        self.mass = damping.mass * of.mass[:, None]
        self.beta = damping.stiffness
        self.stiffness = of.body.tangent(np.zeros((len(of.mass), 3)))

    def force(self, move: np.ndarray, dt: float) -> np.ndarray:
        """Damping force C move / dt [N]."""
        return (self.mass * move + self.beta * self.stiffness.times(move)) / dt

    def value(self, move: np.ndarray, dt: float) -> float:
        """Half the energy lost in a step [J]."""
        return 0.5 * float((move * self.force(move, dt)).sum())

    def add_to(self, matrix: BlockMatrix, dt: float) -> None:
        """Add C / dt to ``matrix``."""
        matrix.add(self.stiffness, self.beta / dt)
        add_diagonal(matrix, self.mass[:, :, None] / dt * np.eye(3))
