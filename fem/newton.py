"""Newton's method with backtracking for the minimum of a nodal energy."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from .blocks import BlockMatrix
from .errors import ConvergenceError

logger = logging.getLogger(__name__)

MAX_ITERATIONS = 100
# The step is halved until the energy falls by this share of the slope (Armijo).
SUFFICIENT = 1e-4
HALVINGS = 30
# An energy is known to this share of its terms: below it, a step is judged by its residual.
ENERGY_NOISE = 1e-12


@runtime_checkable
class Objective(Protocol):
    """An energy of nodal displacements (nodes, 3): its value, gradient and Hessian."""

    def value(self, u: np.ndarray) -> float:
        """Energy [J]; infinite where ``u`` is not allowed."""
        ...

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Gradient [N], zero at prescribed components."""
        ...

    def hessian(self, u: np.ndarray, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped; ``projected``: positive semi-definite."""
        ...

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Largest share of ``step`` that stays allowed."""
        ...


# Solves H step = b so that |b - H step| is well below the goal [N] of Newton.
LinearSolve = Callable[[BlockMatrix, np.ndarray, float], np.ndarray]


class Minimum(NamedTuple):
    """Where Newton ended: ``u`` (nodes, 3) [m], ``residual`` |gradient| [N], ``iterations``."""

    u: np.ndarray
    residual: float
    iterations: int


def minimise(
    objective: Objective,
    u: np.ndarray,
    *,
    solve: LinearSolve,
    target: float,
    limit: int = MAX_ITERATIONS,
) -> Minimum:
    """Minimise ``objective`` from ``u`` until its gradient is below ``target`` [N].

    The exact Hessian is used where it gives a descent direction, the projected one elsewhere.
    """
    g, value = objective.gradient(u), objective.value(u)
    size = float(np.linalg.norm(g))
    projected = False
    for iteration in range(limit):
        if size <= target:
            return Minimum(u, size, iteration)
        step = solve(objective.hessian(u, projected=projected), -g, target)
        slope = float((g * step).sum())
        if not (np.isfinite(step).all() and slope < 0):
            if projected:
                raise ConvergenceError(
                    f"Newton found no descent direction at residual {size:.3g} N"
                )
            projected = True
            continue
        moved = _backtrack(objective, u, step, slope, size, value)
        if moved is None:
            if projected:
                raise ConvergenceError(f"Newton's line search failed at residual {size:.3g} N")
            projected = True
            continue
        u, g, value = moved
        projected = False
        size = float(np.linalg.norm(g))
        logger.debug("Newton %d: residual %.3e N", iteration, size)
    raise ConvergenceError(
        f"Newton ended with residual {size:.3g} N after {limit} iterations: wanted "
        f"<= {target:.3g} N; use a smaller load or time step"
    )


def _backtrack(
    objective: Objective, u: np.ndarray, step: np.ndarray, slope: float, size: float, here: float
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """First of the halved steps that lowers the energy; gradient and energy there."""
    share = min(1.0, objective.longest_step(u, step))
    for _ in range(HALVINGS):
        trial = u + share * step
        there = objective.value(trial)
        if there <= here + SUFFICIENT * share * slope:
            return trial, objective.gradient(trial), there
        if abs(there - here) <= ENERGY_NOISE * max(abs(here), -slope):
            g = objective.gradient(trial)
            if np.linalg.norm(g) < size:
                return trial, g, there
        share /= 2
    return None
