"""Linear solver for symmetric positive block matrices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .blocks import BlockMatrix
from .errors import ConvergenceError


class Solution(NamedTuple):
    """Solution ``x`` (nodes, 3), relative ``residual`` |b - A x| / |b|, ``iterations``.

    ``suspect`` says that the matrix looks singular.
    """

    x: np.ndarray
    residual: float
    iterations: int
    suspect: bool = False


# A pivot this small, of a matrix scaled to a unit diagonal, may be round-off of a zero: a body that
# is not held. (Slender bodies with contrasts of 1e8 reach 1e-10.)
PIVOT = 1e-11


def solve(matrix: BlockMatrix, b: np.ndarray) -> Solution:
    """Solve A x = b for ``b`` (nodes, 3) directly."""
    from scipy.sparse.linalg import splu

    A = matrix.to_scipy().tocsc()
    scale = 1 / np.sqrt(A.diagonal())
    scaled = A.multiply(scale[:, None]).multiply(scale[None, :]).tocsc()
    # A symmetric positive matrix needs no pivoting: minimum degree on the pattern, diagonal pivots.
    lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
              options={"SymmetricMode": True})  # fmt: skip
    rhs = b.reshape(-1)
    x = scale * lu.solve(scale * rhs)
    for _ in range(2):  # iterative refinement: round-off of high contrasts
        x += scale * lu.solve(scale * (rhs - A @ x))
    suspect = np.abs(lu.U.diagonal()).min() < PIVOT
    return Solution(x.reshape(-1, 3), relative_residual(A, x, rhs), 0, bool(suspect))


def relative_residual(A, x: np.ndarray, b: np.ndarray) -> float:
    """Relative residual |b - A x| / |b| in the Euclidean norm; |A x| where b is zero."""
    size = np.linalg.norm(b)
    return float(np.linalg.norm(b - A @ x) / (size if size > 0 else 1.0))


def check(A, solution: Solution, b: np.ndarray, tolerance: float) -> None:
    """Raise where the residual exceeds the ``tolerance`` and what round-off explains."""
    size = np.linalg.norm(b) or 1.0
    # Evaluating b - A x loses this much: cancellation between |A| |x| terms of a stiff body.
    floor = 64 * np.finfo(float).eps * np.linalg.norm(abs(A) @ abs(solution.x.reshape(-1))) / size
    if not (np.isfinite(solution.x).all() and solution.residual <= max(tolerance, floor)):
        raise ConvergenceError(
            f"linear solve ended with relative residual {solution.residual:.3g} after "
            f"{solution.iterations} iterations: wanted <= {tolerance:g}; check that every piece "
            "is held, that no tet is nearly flat, and that E and nu are sane"
        )
