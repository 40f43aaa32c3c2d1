"""The minimum of a nodal energy: Newton's method with backtracking, and dynamic relaxation."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ..discrete.block_matrix import add_diagonal
from ..discrete.constraints import apply_supports
from ..errors import ConvergenceError
from ..linalg.krylov import inner_product, length

logger = logging.getLogger(__name__)

MAX_ITERATIONS = 100
# The step is halved until the energy falls by this share of the slope (Armijo).
SUFFICIENT = 1e-4
HALVINGS = 30
# An energy is known to this share of its terms: below it, a step is judged by its residual.
ENERGY_NOISE = 1e-12
# Steps of dynamic relaxation.
RELAXATIONS = 400
# A step that went all its way is followed by one of so many times its time; one that the tangent
# forbids is tried again in a shorter one.
LONGER, SHORTER = 2.0, 0.5
# A step cut below this share was too long, though its direction was right.
CUT = 0.3


class Point(NamedTuple):
    """What an objective is at a place.

    ``energy`` [J], infinite where the place is not allowed; ``gradient`` [N] (nodes, 3), zero at
    prescribed components; ``scale``, the size of the forces [N] that the gradient is a balance of.
    """

    energy: float
    gradient: Any
    scale: float

    @property
    def residual(self) -> float:
        """Size of the unbalanced force [N]."""
        return length(self.gradient)


@runtime_checkable
class Objective(Protocol):
    """An energy of nodal displacements (nodes, 3), or of other coordinates.

    Both are arrays, or a ``DeviceVector`` that never leaves its device.
    Its Hessian is of the kind that the linear solver takes.
    """

    def evaluate(self, u: Any, /) -> Point:
        """Energy, gradient and scale."""
        ...

    def hessian(self, u: Any, /, *, projected: bool) -> Any:
        """Hessian [N/m] with prescribed rows dropped; ``projected``: positive semi-definite."""
        ...

    def longest_step(self, u: Any, step: Any, /) -> float:
        """Largest share of ``step`` that stays allowed."""
        ...


# Solves H step = b so that |b - H step| is well below the goal [N] of Newton.
LinearSolve = Callable[[Any, Any, float], Any]


class Minimum(NamedTuple):
    """Where Newton ended: ``u`` (nodes, 3) [m], ``residual`` |gradient| [N], ``iterations``."""

    u: Any
    residual: float
    iterations: int


def minimise(
    objective: Objective,
    u: Any,
    *,
    solve: LinearSolve,
    tolerance: float,
    limit: int = MAX_ITERATIONS,
) -> Minimum:
    """Minimise ``objective`` from ``u`` until |gradient| <= ``tolerance`` times its scale.

    The exact Hessian is used where it gives a descent direction, the projected one elsewhere.
    """
    here = objective.evaluate(u)
    projected = False
    for iteration in range(limit):
        size, goal = here.residual, tolerance * here.scale
        if size <= goal:
            return Minimum(u, size, iteration)
        step = solve(objective.hessian(u, projected=projected), -here.gradient, goal)
        moved = backtrack(objective, u, step, here)
        if moved is not None:
            (u, here), projected = moved, False
            logger.debug("Newton %d: residual %.3e N", iteration, size)
        elif projected:
            raise ConvergenceError(f"Newton's line search failed at residual {size:.3g} N")
        else:
            projected = True
    raise ConvergenceError(
        f"Newton ended with residual {here.residual:.3g} N after {limit} iterations: wanted "
        f"<= {tolerance * here.scale:.3g} N; use a smaller load or time step"
    )


def backtrack(objective: Objective, u: Any, step: Any, here: Point) -> tuple[Any, Point] | None:
    """First of the halved ``step`` that lowers the energy; none if it does not descend."""
    slope = inner_product(here.gradient, step)  # no number where the step has one that is none
    if not (np.isfinite(slope) and slope < 0):
        return None
    share = min(1.0, objective.longest_step(u, step))
    for _ in range(HALVINGS):
        trial = u + share * step
        there = objective.evaluate(trial)
        change = there.energy - here.energy
        unclear = abs(change) <= ENERGY_NOISE * max(abs(here.energy), -slope)
        if change <= SUFFICIENT * share * slope or (unclear and there.residual < here.residual):
            return trial, there
        share /= 2
    return None


def relax(
    objective: Objective,
    u: Float[np.ndarray, "nodes 3"],
    *,
    mass: Float[np.ndarray, "nodes"],
    fixed: np.ndarray,
    dt: float,
    solve: LinearSolve,
    tolerance: float,
) -> Minimum:
    """Minimise ``objective`` from ``u`` [m] by dynamic relaxation of ``mass`` [kg].

    Each is one Newton step of (H + M / dt^2) x = -g, first in ``dt`` [s], in longer ones as it goes
    well: the energy only falls, so that a body that buckles comes to lie where it can
    (pseudo-transient continuation, Kelley & Keyes 1998). ``fixed`` (nodes, 3) stay.

    Raises
    ------
    ConvergenceError
        If it does not come to rest.
    """
    here = objective.evaluate(u)
    for step in range(RELAXATIONS):
        goal = tolerance * here.scale
        if here.residual <= goal:
            return Minimum(u, here.residual, step)
        matrix = objective.hessian(u, projected=False)
        add_diagonal(matrix, (mass / dt**2)[:, None, None] * np.eye(3))
        apply_supports(matrix, fixed)
        move = solve(matrix, -here.gradient, goal)
        moved = backtrack(objective, u, move, here)
        if moved is None:
            dt *= SHORTER
            continue
        share = float(np.linalg.norm(moved[0] - u) / (np.linalg.norm(move) or 1.0))
        u, here = moved
        dt *= SHORTER if share < CUT else LONGER if share > 1 - CUT else 1.0
        logger.debug("relaxation %d: dt %.2g s, residual %.3g N", step, dt, here.residual)
    raise ConvergenceError(
        f"it did not come to rest in {RELAXATIONS} steps: the forces still differ by "
        f"{here.residual / here.scale:.2g} of the load"
    )
