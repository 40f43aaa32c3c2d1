"""Newton's method on the coordinates, and the rest of a reduced body under a dead load."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ..solve.newton import Minimum, Point, minimise
from .elasticity import ReducedElasticity

# Unbalanced force of a rest, over the load.
TOLERANCE = 1e-9


def solve_dense(matrix: np.ndarray, b: np.ndarray, goal: float = 0.0) -> np.ndarray:
    """Solve A x = b by Cholesky; not a number where A is not positive. ``goal`` is met anyway."""
    from scipy.linalg.lapack import dposv  # type: ignore  (by f2py)

    _, x, failed = dposv(matrix, b, lower=1)
    return np.full_like(b, np.nan) if failed else x


class DeadLoad:
    """Total potential W(q) - f . q of a reduced body under the forces f (dofs,) [N/sqrt(kg)]."""

    def __init__(self, elasticity: ReducedElasticity, load: np.ndarray) -> None:
        self.elasticity, self.load = elasticity, load
        self.scale = float(np.linalg.norm(load)) or 1.0

    def evaluate(self, q: np.ndarray) -> Point:
        """Energy, gradient, and the size of the load."""
        energy, force = self.elasticity.response(q)
        return Point(energy - float(self.load @ q), force - self.load, self.scale)

    def hessian(self, q: np.ndarray, *, projected: bool) -> np.ndarray:
        """Second derivative (dofs, dofs) [1/s^2]."""
        return self.elasticity.tangent(q, projected=projected)

    def longest_step(self, q: np.ndarray, step: np.ndarray) -> float:
        """Any: nothing is in the way."""
        return np.inf


def reduced_rest(
    elasticity: ReducedElasticity,
    load: Float[np.ndarray, "dofs"],
    *,
    start: Float[np.ndarray, "dofs"] | None = None,
    tolerance: float = TOLERANCE,
) -> Minimum:
    """Coordinates [m sqrt(kg)] at rest under the dead ``load`` [N/sqrt(kg)].

    Raises
    ------
    ConvergenceError
        If Newton's method does not find it.
    """
    first = np.zeros_like(load) if start is None else start
    return minimise(DeadLoad(elasticity, load), first, solve=solve_dense, tolerance=tolerance)


def reduced_frequencies(elasticity: ReducedElasticity) -> Float[np.ndarray, "dofs"]:
    """Natural frequencies [Hz] of the coordinates about rest, the lowest first."""
    square = np.linalg.eigvalsh(elasticity.tangent(np.zeros(elasticity.model.dofs)))
    return np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)
