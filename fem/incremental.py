"""The energy that an implicit step minimises."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .blocks import BlockMatrix, add_diagonal, apply_supports


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping C = ``mass`` M + ``stiffness`` K [1/s, s]; none by default."""

    mass: float = 0.0
    stiffness: float = 0.0


class Incremental:
    """Incremental potential: c/2 |u - target|_M^2 + W(u) - f . u + barrier + friction + damping."""

    def __init__(self, body: Any, factor: float, target: np.ndarray, dt: float) -> None:
        self.of, self.target, self.dt = body, target, dt
        self.inertia = factor * body.mass[:, None]
        self.start = body.state.u

    def value(self, u: np.ndarray) -> float:
        """Energy [J]; infinite on contact."""
        of = self.of
        barrier = of.contact.value(u)
        if not np.isfinite(barrier):
            return np.inf
        motion = 0.5 * float((self.inertia * (u - self.target) ** 2).sum())
        springs = 0.5 * float((of.held.springs * u**2).sum())
        elastic = of.body.energy(of._array(u))
        total = motion + elastic + springs - float((of.load * u).sum()) + barrier
        return total + (of.damping.value(u - self.start, self.dt) if of.damping else 0.0)

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Gradient [N]."""
        of = self.of
        g = self.inertia * (u - self.target) + of._internal(u) + of.held.springs * u - of.load
        of.contact.add_gradient(u, g)
        if of.damping:
            g += of.damping.force(u - self.start, self.dt)
        g[of.held.fixed] = 0.0
        return g

    def hessian(self, u: np.ndarray, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        of = self.of
        matrix = of.body.tangent(of._array(u), projected=projected)
        if of.damping:
            of.damping.add_to(matrix, self.dt)
        blocks = (self.inertia + of.held.springs)[:, :, None] * np.eye(3)
        of.contact.add_hessian(u, blocks)
        add_diagonal(matrix, blocks)
        apply_supports(matrix, of.held.fixed)
        return matrix

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Share of ``step`` that keeps the body out of the obstacles."""
        return self.of.contact.longest_step(u, step)

    def scale(self) -> float:
        """Size of the external and inertial force [N] that a residual is compared with."""
        of = self.of
        inertia = np.linalg.norm(self.inertia * (self.target - self.start))
        contact = np.linalg.norm(of.state.contact_force)
        return float(max(np.linalg.norm(of.load), inertia, contact, of.noise))


class Rayleigh:
    """Damping energy |u - start|_C^2 / 2 dt with C = alpha M + beta K at rest."""

    def __init__(self, of: Any, damping: Damping) -> None:
        self.mass = damping.mass * of.mass[:, None]
        zero = of._array(np.zeros((len(of.mass), 3)))
        self.beta, self.stiffness = damping.stiffness, of.body.tangent(zero)

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
