"""Rayleigh damping: of the velocity by the mass, and of the rate of strain by the stiffness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..discrete.assembly import Discretisation
from ..discrete.block_matrix import BlockMatrix, add_diagonal
from ..discrete.elastic import Response
from ..errors import InputError
from ..scene.material import ElementMaterial, LameParameters
from .viscosity import Viscosity


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping C = ``mass`` M + ``stiffness`` K [1/s, s]; none by default.

    K resists the rate of strain of the body as it lies, so that it brakes no turn; M brakes all.
    """

    mass: float = 0.0
    stiffness: float = 0.0


class Rayleigh:
    """Damping forces of a body of nodal ``mass`` [kg] (nodes,)."""

    def __init__(
        self,
        grid: Discretisation,
        material: ElementMaterial,
        mass: Float[np.ndarray, "nodes"],
        damping: Damping,
    ) -> None:
        if damping.stiffness and material.tensor is not None:
            raise InputError("damping in proportion to stiffness knows no grain: wanted mass alone")
        self.alpha, self.beta = damping.mass, damping.stiffness
        self.mass = damping.mass * mass[:, None]
        viscous = LameParameters(*(damping.stiffness * m for m in material.lame))
        self.viscosity = Viscosity(grid, viscous) if damping.stiffness else None

    def force(self, u: np.ndarray, v: np.ndarray) -> Float[np.ndarray, "nodes 3"]:
        """Damping force [N] at the displacement ``u`` [m] and velocity ``v`` [m/s]."""
        return self.mass * v + (self.viscosity.force(u, v) if self.viscosity else 0.0)

    def step(self, u: np.ndarray, start: np.ndarray, dt: float) -> Response:
        """Half the energy [J] lost in a step of ``dt`` [s] from ``start`` to ``u``, its force."""
        push = self.mass * (u - start) / dt
        energy = 0.5 * float(((u - start) * push).sum())
        if not self.viscosity:
            return Response(energy, push)
        more, force = self.viscosity.step(u, start, dt)
        return Response(energy + more, push + force)

    def stresses(
        self, u: np.ndarray, start: np.ndarray, v: np.ndarray | None, dt: float
    ) -> list[Callable[[LameParameters], np.ndarray]]:
        """Viscous stresses (tets, points, 3, 3) of given moduli: of ``step``, of ``force`` at v."""
        if not self.viscosity:
            return []
        stress, beta = self.viscosity.stress, self.beta
        of_step = lambda lame: beta / dt * stress(u, start, lame, rate=False)  # noqa: E731
        if v is None:
            return [of_step]
        return [of_step, lambda lame: beta * stress(start, v, lame, rate=True)]

    def add_to(
        self, matrix: BlockMatrix, u: np.ndarray, start: np.ndarray, dt: float, *, projected: bool
    ) -> None:
        """Add the derivative of the force of ``step`` to ``matrix``."""
        if self.viscosity:
            self.viscosity.add_tangent(matrix, u, start, dt, projected=projected)
        add_diagonal(matrix, self.mass[:, :, None] / dt * np.eye(3))
