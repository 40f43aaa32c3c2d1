"""The energy that an implicit step minimises."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..discrete.block_matrix import BlockMatrix, add_diagonal
from ..discrete.constraints import apply_supports
from .newton import Point

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


def _size(v: np.ndarray) -> float:
    return float(np.linalg.norm(v))
