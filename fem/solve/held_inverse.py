"""A held stiffness and its inverse for many loads: a factor where one is affordable, else CG."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import find_factor, known_factor
from ..discrete.block_matrix import BlockMatrix
from ..discrete.space import Space
from ..linalg.solver import MOST_ENTRIES, rough_inverse
from ..scene.supports import Supports

# Operations of a factor above which it is not made for this alone: half a minute of a core.
MOST_OPERATIONS = 1e12


class HeldInverse(NamedTuple):
    """``stiffness`` [N/m] with supports, and what ``solve`` finds for forces (nodes, 3) [N].

    Those must be zero where it is held. ``exact``: by a factor, to round-off.
    """

    stiffness: BlockMatrix
    solve: Callable[[np.ndarray], np.ndarray]
    exact: bool


def held_inverse(
    stiffness: BlockMatrix, space: Space, held: Supports, *, rough: float = 0.0
) -> HeldInverse | None:
    """Inverse of a ``stiffness`` with the supports ``held`` (of nodes of ``space``), on the CPU.

    Where no factor is affordable by CG to the relative residual ``rough``; None if that is zero.
    """
    matrix = stiffness.to("cpu")
    plan = planned_elimination(matrix, space.edges)
    if plan.entries <= MOST_ENTRIES:
        if plan.operations <= MOST_OPERATIONS:
            return HeldInverse(matrix, known_factor(matrix, plan).solve, True)
        if (factor := find_factor(matrix, plan)) is not None:
            return HeldInverse(matrix, factor.solve, True)
    if not rough:
        return None
    known = {"points": space.nodes, "fixed": held.fixed, "edges": space.edges}
    return HeldInverse(matrix, rough_inverse(matrix, tolerance=rough, **known), False)
