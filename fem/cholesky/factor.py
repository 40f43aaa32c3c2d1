"""Sparse Cholesky factor of a block matrix: dense fronts, LAPACK inside them."""

from __future__ import annotations

from hashlib import sha256
from typing import Any

import numpy as np
from jaxtyping import Float

from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix
from ..errors import ConvergenceError
from .elimination import Elimination


class NotPositive(ConvergenceError):
    """A pivot is not positive: the matrix is not, or it is singular."""


class CholeskyFactor:
    """L with P A P^T = L L^T, by the multifrontal method (Duff & Reid 1983).

    Every supernode adds its children's updates to its columns, factors them and leaves an update
    to its parent: nearly all arithmetic is in three routines of LAPACK and BLAS.

    Parameters
    ----------
    matrix
        Symmetric positive, on the CPU.
    plan
        Elimination of its pattern.

    Raises
    ------
    NotPositive
        If a pivot is not positive.
    """

    def __init__(self, matrix: BlockMatrix, plan: Elimination) -> None:
        from . import kernels_elimination as k

        wp = start_warp()
        self.plan = plan
        # By numpy: what is never written costs nothing, and large pages hold it.
        numbers = wp.array(np.zeros(plan.entries), dtype=wp.float64, device="cpu", copy=False)
        inputs = [matrix.rows, matrix.columns, matrix.values, plan.position, plan.owner]
        inputs += [plan.first, plan.start, plan.rows, plan.panel, numbers]
        wp.launch(k.place_matrix, matrix.nodes, inputs=inputs, device="cpu")
        self._numbers = numbers  # the panels are views of it
        self._diagonal = self._diagonal_entries()
        self._before = numbers.numpy()[self._diagonal]
        self._panels = self._views(numbers.numpy())
        self._factor(numbers)
        if not np.isfinite(numbers.numpy()[self._diagonal]).all():  # LAPACK lets NaN pass
            raise NotPositive("the matrix has entries that are no numbers")

    def _diagonal_entries(self) -> np.ndarray:
        """Offsets of the diagonal of the factor."""
        first = 3 * self.plan.first.numpy()
        width, panel = np.diff(first), self.plan.panel.numpy()[:-1]
        along = np.arange(first[-1]) - np.repeat(first[:-1], width)
        return np.repeat(panel, width) + along * np.repeat(width + 1, width)

    def _views(self, numbers: np.ndarray) -> list[tuple[Any, Any, int, int, Any]]:
        """Of every supernode: square and lower part, columns from ... to, rows; of scalars."""
        plan = self.plan
        first, start, panel = (3 * plan.first.numpy(), plan.start.numpy(), plan.panel.numpy())
        rows = (3 * plan.rows.numpy()[:, None] + np.arange(3)).ravel()
        panels = []
        for t in range(len(first) - 1):
            k, low, high = first[t + 1] - first[t], 3 * start[t], 3 * start[t + 1]
            middle = panel[t] + k * k
            square = numbers[panel[t] : middle].reshape(k, k).T
            lower = numbers[middle : panel[t + 1]].reshape(k, high - low).T
            panels.append((square, lower, int(first[t]), int(first[t + 1]), rows[low:high]))
        return panels

    def _factor(self, numbers: Any) -> None:
        from scipy.linalg.blas import dsyrk, dtrsm  # type: ignore  (by f2py)
        from scipy.linalg.lapack import dpotrf  # type: ignore  (by f2py)

        from . import kernels_elimination as k

        wp, plan = start_warp(), self.plan
        stack = wp.empty(plan.stack, dtype=wp.float64, device="cpu")
        inputs = [0, plan.first, plan.start, plan.local, plan.child_start, plan.children]
        inputs += [plan.panel, plan.update, stack, numbers]
        gather = Recorder(1, "cpu")(k.extend_add, inputs)
        updates, place = stack.numpy(), plan.update.numpy()
        for t, (square, lower, *_) in enumerate(self._panels):
            gather.set_param_at_index(0, t)
            gather.launch()
            _, failed = dpotrf(square, lower=1, clean=0, overwrite_a=1)
            if failed:
                raise NotPositive(f"pivot {failed} of supernode {t} is not positive")
            r = len(lower)
            if r:
                dtrsm(1.0, square, lower, side=1, lower=1, trans_a=1, overwrite_b=1)
                own = updates[place[t] : place[t] + r * r].reshape(r, r).T
                dsyrk(-1.0, lower, beta=1.0, c=own, lower=1, overwrite_c=1)

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot, as a share of its diagonal entry in A."""
        pivots = self._numbers.numpy()[self._diagonal] ** 2
        return float((pivots / self._before).min())

    def solve(self, b: Float[np.ndarray, "nodes 3 *vectors"]) -> Float[np.ndarray, "..."]:
        """Solve A x = b for one or more right-hand sides, shape (nodes, 3) or (nodes, 3, n)."""
        from scipy.linalg.blas import dtrsm  # type: ignore  (by f2py)

        order = self.plan.order.numpy()
        if b.ndim == 2:
            out = np.empty_like(b)
            out[order] = self._solve_one(b[order].reshape(-1)).reshape(b.shape)
            return out
        x = b[order].reshape(3 * len(order), -1)
        for square, lower, low, high, rows in self._panels:
            own = x[low:high].T
            dtrsm(1.0, square, own, side=1, lower=1, trans_a=1, overwrite_b=1)
            if len(rows):
                x[rows] -= lower @ x[low:high]
        for square, lower, low, high, rows in reversed(self._panels):
            own = x[low:high]
            if len(rows):
                own -= lower.T @ x[rows]
            dtrsm(1.0, square, own.T, side=1, lower=1, overwrite_b=1)
        out = np.empty_like(b)
        out[order] = x.reshape(b.shape)
        return out

    def _solve_one(self, x: Float[np.ndarray, "unknowns"]) -> Float[np.ndarray, "unknowns"]:
        """``solve`` for one right-hand side in the order of elimination, in place."""
        from scipy.linalg.blas import dtrsv  # type: ignore  (by f2py)

        for square, lower, low, high, rows in self._panels:
            own = x[low:high]
            dtrsv(square, own, lower=1, overwrite_x=1)
            if len(rows):
                x[rows] -= lower @ own
        for square, lower, low, high, rows in reversed(self._panels):
            own = x[low:high]
            if len(rows):
                own -= lower.T @ x[rows]
            dtrsv(square, own, lower=1, trans=1, overwrite_x=1)
        return x


# Factors of the last matrices, by digests of their values: statics and modes share one.
_RECENT: list[tuple[bytes, CholeskyFactor]] = []
_KEPT = 2
KEPT_ENTRIES = 100_000_000  # 800 MB: beyond, only the last is kept


def find_factor(matrix: BlockMatrix, plan: Elimination) -> CholeskyFactor | None:
    """Factor of ``matrix`` if one of the last ones is of the very same values."""
    return _found(_digest(matrix), plan)


def known_factor(matrix: BlockMatrix, plan: Elimination) -> CholeskyFactor:
    """Factor of ``matrix``, made only if the last ones were not of the very same values."""
    digest = _digest(matrix)
    if (known := _found(digest, plan)) is not None:
        return known
    del _RECENT[_KEPT - 1 :]  # room for the new one is made before it is
    while _RECENT and plan.entries + sum(f.plan.entries for _, f in _RECENT) > KEPT_ENTRIES:
        _RECENT.pop()
    factor = CholeskyFactor(matrix, plan)
    _RECENT.insert(0, (digest, factor))
    return factor


def _found(digest: bytes, plan: Elimination) -> CholeskyFactor | None:
    return next((f for kept, f in _RECENT if f.plan is plan and kept == digest), None)


def _digest(matrix: BlockMatrix) -> bytes:
    return sha256(np.ascontiguousarray(matrix.values.numpy()).data).digest()
