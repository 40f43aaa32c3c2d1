"""Linear systems that change little from one to the next: the preconditioner is kept."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import CholeskyFactor, NotPositive
from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix
from .krylov import ConjugateGradients, DeviceVector, length
from .solver import MOST_ENTRIES, iterations_worth
from .two_level import Scaled, TwoLevel, scale

# Unknowns up to which the preconditioner is a direct factor without anything being estimated.
DIRECT = 4_000
# Degree of the smoother: inertia makes the matrix better than that of statics, and a lower degree
# costs less in all than the few iterations that it adds.
DEGREE = 2
# The preconditioner is made anew when CG takes so many more iterations than right after it was.
STALE = 4
# Iterations after which a system counts as not solvable: Newton then tries another Hessian.
LIMIT = 600
# Relative residuals of a linear system: never looser, so that Newton converges fast, nor tighter
# than fp64 allows.
LOOSEST, TIGHTEST = 1e-2, 1e-11


class FactorCycle:
    """Factor of a scaled matrix as the preconditioner z = M r, on the CPU."""

    def __init__(self, scaled: Scaled) -> None:
        wp = start_warp()
        matrix = scaled.matrix
        self.factor = CholeskyFactor(matrix, planned_elimination(matrix))
        self.r, self.z = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device="cpu") for _ in range(2))

    def apply(self) -> None:
        """Compute ``z`` from ``r``."""
        self.z.numpy()[:] = self.factor.solve(self.r.numpy())


class _Kept(NamedTuple):
    """What is expensive: scaling and preconditioner of ``system``, CG of the ``current`` matrix."""

    system: Scaled
    current: BlockMatrix
    cg: ConjugateGradients
    r: Any


class RepeatedSolver:
    """Solves A x = b to the accuracy that Newton needs, keeping what is expensive.

    Parameters
    ----------
    points
        Node positions [m], shape (nodes, 3).
    fixed
        Prescribed components, shape (nodes, 3).

    Attributes
    ----------
    factors
        Whether the preconditioner is a factor, as two levels were seen to take longer.
    """

    def __init__(self, points: np.ndarray, fixed: np.ndarray) -> None:
        self.points, self.fixed = points, fixed
        self._kept: _Kept | None = None
        self._usual = 0
        self.factors = False

    def __call__(self, matrix: BlockMatrix, b: Any, goal: float) -> Any:
        """Return x with |b - A x| <= ``goal`` [N], within the limits; NaN if A is not positive.

        Both are arrays (nodes, 3), or vectors on the device of the matrix.
        """
        size = length(b)
        share = 0.3 * goal / max(size, 1e-300)
        target = float(np.clip(share, TIGHTEST, LOOSEST) * size)
        if self._kept is not None and self._kept.current.columns is not matrix.columns:
            self._kept = _around(matrix, self._kept.system, self._kept.cg.preconditioner)
        if self._kept is not None:
            x, iterations = self._iterate(self._kept, matrix, b, target, self._usual + STALE)
            if x is not None:
                return x
            self._kept = None
            if iterations == 0:  # not positive: another preconditioner will not help
                return np.nan * b
        return self._anew(matrix, b, target)

    def _anew(self, matrix: BlockMatrix, b: Any, target: float) -> Any:
        """Solve with a fresh preconditioner: two levels until they take as long as a factor."""
        worth = _factor_worth(matrix)
        self.factors |= worth == 0
        for limit in (LIMIT,) if self.factors else (min(worth, LIMIT), LIMIT):
            self._kept = self._fresh(matrix)
            if self._kept is None:
                break
            x, self._usual = self._iterate(self._kept, matrix, b, target, limit)
            if x is not None:
                return x
            if self._usual == 0 or worth > LIMIT:
                break
            self.factors = True
        return np.nan * b

    def _fresh(self, matrix: BlockMatrix) -> _Kept | None:
        """Preconditioner of ``matrix``; none if it is seen not to be positive."""
        wp = start_warp()
        system = scale(BlockMatrix(matrix.rows, matrix.columns, wp.clone(matrix.values)))
        if np.isnan(system.largest):
            return None
        if not self.factors:
            return _around(matrix, system, TwoLevel(system, self.points, self.fixed, DEGREE))
        try:
            return _around(matrix, system, FactorCycle(system))
        except NotPositive:
            return None

    @staticmethod
    def _iterate(
        kept: _Kept, matrix: BlockMatrix, b: Any, target: float, limit: int
    ) -> tuple[Any, int]:
        from . import kernels_solver as k

        wp = start_warp()
        system, current, cg, r = kept
        launch = Recorder(matrix.nodes, r.device)
        wp.copy(current.values, matrix.values)
        pattern = [matrix.rows, matrix.columns]
        launch(k.scale_blocks, [*pattern, system.inverse, current.values]).launch()
        size = length(b) or 1.0  # the V-cycle may be in single precision, whose range is small
        if isinstance(b, DeviceVector):
            b.write(r, 1 / size)
        else:
            r.assign(b / size)
        launch(k.block_multiply, [system.inverse, r, False, r]).launch()
        cg.start(target / size, limit)
        x = wp.empty_like(cg.x)
        launch(k.block_multiply, [system.inverse, cg.x, True, x]).launch()
        iterations = cg.finish()
        if not cg.reached:
            return None, 0 if cg.indefinite else iterations
        found = DeviceVector(x) if isinstance(b, DeviceVector) else x.numpy()
        return size * found, iterations


def _factor_worth(matrix: BlockMatrix) -> int:
    """Iterations of the two levels that a factor is worth; above ``LIMIT`` where none is made.

    Steps of a body of good tets take some ten, slats of concrete took more than 600.
    """
    if matrix.values.device.is_cuda:  # a graph of a GPU could not call it
        return LIMIT + 1
    if 3 * matrix.nodes <= DIRECT:
        return 0
    plan = planned_elimination(matrix)
    return min(iterations_worth(plan, matrix), LIMIT) if plan.entries <= MOST_ENTRIES else LIMIT + 1


def _around(matrix: BlockMatrix, system: Scaled, cycle: Any) -> _Kept:
    """CG with the preconditioner ``cycle`` of ``system`` for matrices of the pattern of ``matrix``.

    It has a matrix of its own, whose values are those of every new system in turn.
    """
    wp = start_warp()
    current = BlockMatrix(matrix.rows, matrix.columns, wp.empty_like(matrix.values))
    cg = ConjugateGradients(current, system.lower, cycle, cycle.r, cycle.z)
    return _Kept(system, current, cg, cycle.r)
