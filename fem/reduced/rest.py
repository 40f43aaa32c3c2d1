"""Newton's method on the coordinates, and the rest of a reduced body under a dead load."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from ..errors import ConvergenceError
from ..linalg.krylov import length
from ..solve.newton import Minimum, Point, minimise
from .elasticity import ReducedElasticity

# Unbalanced force of a rest, over the load.
TOLERANCE = 1e-9
# Squares of frequencies below this share of the largest are rigid motions.
RIGID = 1e-9
# An inverse Hessian serves while every move brings the gradient below this share of the last.
CONTRACTION = 0.5


@functools.cache
def _dense() -> Any:
    """BLAS and LAPACK: an import in a step takes as long as what it calls."""
    import scipy.linalg

    return scipy.linalg


def solve_dense(matrix: np.ndarray, b: np.ndarray, goal: float = 0.0) -> np.ndarray:
    """Solve A x = b by Cholesky; not a number where A is not positive. ``goal`` is met anyway."""
    _, x, failed = _dense().lapack.dposv(matrix, b, lower=1)
    return np.full_like(b, np.nan) if failed else x


class KeptInverse:
    """Inverse of a Hessian (dofs, dofs) that serves from step to step, and learns from the moves.

    Its lower triangle alone is kept. Between two gradients it is corrected by their secant
    (Broyden, Fletcher, Goldfarb & Shanno: Nocedal & Wright 2006, eq. 6.17); where that goes slowly,
    a new one is made.
    """

    def __init__(self) -> None:
        self.inverse: np.ndarray | None = None
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self._load, self._first = np.zeros(()), True

    def begin(self, load: np.ndarray | None = None) -> None:
        """Go on to another function of nearly the same Hessian.

        ``load``: it is the last one but for the term -load . q; none: it is any.
        """
        self._first = True
        if load is None or self._load.shape != load.shape:
            self._last = None
        elif self._last is not None:
            self._last = self._last[0], self._last[1] + self._load - load
        self._load = np.zeros(()) if load is None else load

    def renew(self, matrix: np.ndarray) -> None:
        """Take the inverse of ``matrix``; none where that is not positive."""
        lapack = _dense().lapack
        factor, failed = lapack.dpotrf(matrix.T, lower=1, clean=0)
        self.inverse = None if failed else lapack.dpotri(factor, lower=1, overwrite_c=1)[0]

    def at(
        self,
        q: np.ndarray,
        gradient: np.ndarray,
        matrix: Callable[[], np.ndarray],
        projected: bool = False,
    ) -> KeptInverse:
        """Get ready for ``q``, where the function has its ``gradient``; ``matrix`` makes a new one.

        One of a ``projected`` matrix is for this place alone.
        """
        if projected:
            self.inverse = self._last = None
            found = KeptInverse()
            found.renew(matrix())
            return found
        last, self._last, first, self._first = self._last, (q, gradient), self._first, False
        far = np.inf if first or last is None else CONTRACTION * length(last[1])
        slow = not length(gradient) < far
        if self.inverse is None or slow:
            self.renew(matrix())
        elif last is not None:
            self.learn(q - last[0], gradient - last[1])
        return self

    def learn(self, move: np.ndarray, change: np.ndarray) -> None:
        """Take in that a ``move`` changed the gradient by ``change``, unless it bends down."""
        blas = _dense().blas
        slope = float(move @ change)
        if self.inverse is not None and slope > 0:
            made = blas.dsymv(1 / slope, self.inverse, change, lower=1)
            made -= (1 + float(change @ made)) / (2 * slope) * move
            blas.dsyr2(-1.0, made, move, lower=1, a=self.inverse, overwrite_a=1)

    def solve(self, b: np.ndarray, goal: float = 0.0) -> np.ndarray:
        """Inverse times ``b``; not a number where the Hessian is not positive."""
        if self.inverse is None:
            return np.full_like(b, np.nan)
        return _dense().blas.dsymv(1.0, self.inverse, b, lower=1)


class DeadLoad:
    """Total potential W(q) - f . q of a reduced body under the forces f (dofs,) [N/sqrt(kg)]."""

    def __init__(
        self, elasticity: ReducedElasticity, load: np.ndarray, kept: KeptInverse | None = None
    ) -> None:
        self.elasticity, self.load = elasticity, load
        self.scale = float(np.linalg.norm(load)) or 1.0
        self._gradient, self._kept = np.zeros_like(load), kept or KeptInverse()
        self._kept.begin()

    def evaluate(self, q: np.ndarray) -> Point:
        """Energy, gradient, and the size of the load."""
        energy, force = self.elasticity.response(q)
        self._gradient = force - self.load
        return Point(energy - float(self.load @ q), self._gradient, self.scale)

    def hessian(self, q: np.ndarray, *, projected: bool) -> KeptInverse:
        """Inverse of the second derivative (dofs, dofs) [s^2] at ``q``, the last one evaluated."""
        return self._kept.at(
            q, self._gradient, lambda: self.elasticity.tangent(q, projected=projected), projected
        )

    def longest_step(self, q: np.ndarray, step: np.ndarray) -> float:
        """Any: nothing is in the way."""
        return np.inf


def reduced_rest(
    elasticity: ReducedElasticity,
    load: Float[np.ndarray, "dofs"],
    *,
    start: Float[np.ndarray, "dofs"] | None = None,
    kept: KeptInverse | None = None,
    tolerance: float = TOLERANCE,
) -> Minimum:
    """Coordinates [m sqrt(kg)] at rest under the dead ``load`` [N/sqrt(kg)].

    ``kept`` is the inverse Hessian of a body that is nearly this one, for instance of few cells.

    Raises
    ------
    ConvergenceError
        If Newton's method does not find it.
    """
    first = np.zeros_like(load) if start is None else start
    potential = DeadLoad(elasticity, load, kept)
    return minimise(potential, first, solve=KeptInverse.solve, tolerance=tolerance)


def held_rest(
    elasticity: ReducedElasticity,
    load: Float[np.ndarray, "dofs"],
    *,
    start: Float[np.ndarray, "dofs"] | None = None,
    kept: KeptInverse | None = None,
) -> np.ndarray | None:
    """``reduced_rest``'s coordinates; None where nothing loads or holds it, or none is found."""
    if not load.any():
        return None
    if kept is None:
        stiffness = elasticity.tangent(np.zeros(len(load)))
        if np.linalg.eigvalsh(stiffness)[0] < RIGID * np.abs(stiffness).max():
            return None
    try:
        return reduced_rest(elasticity, load, start=start, kept=kept).u
    except ConvergenceError:
        return None


def lowest_frequency(stiffness: Float[np.ndarray, "dofs dofs"]) -> float:
    """Lowest frequency [Hz] that is no rigid motion, of the ``stiffness`` [1/s^2] about rest."""
    square = np.linalg.eigvalsh(stiffness)
    return float(np.sqrt(square[square > RIGID * square[-1]][0])) / (2 * np.pi)


def reduced_frequencies(elasticity: ReducedElasticity) -> Float[np.ndarray, "dofs"]:
    """Natural frequencies [Hz] of the coordinates about rest, the lowest first."""
    square = np.linalg.eigvalsh(elasticity.tangent(np.zeros(elasticity.model.dofs)))
    return np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)
