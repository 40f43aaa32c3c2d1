"""Linear systems that change little from one to the next: the preconditioner is kept."""

from __future__ import annotations

from typing import Any

import numpy as np

from .blocks import BlockMatrix
from .device import start_warp
from .multigrid import Recorder, Scaled, TwoLevel, coarsen, largest_eigenvalue, scale
from .solver import ConjugateGradients

# Unknowns up to which the preconditioner is a direct factor.
DIRECT = 4_000
# The preconditioner is made anew when CG takes so many more iterations than right after it was.
STALE = 4
# Relative residuals of a linear system: never looser, so that Newton converges fast, nor tighter
# than fp64 allows.
LOOSEST, TIGHTEST = 1e-2, 1e-11


class Factor:
    """Sparse LU of a scaled matrix as the preconditioner z = M r, on the CPU."""

    def __init__(self, scaled: Scaled, r: Any, z: Any) -> None:
        from scipy.sparse.linalg import splu

        matrix = scaled.matrix.to_scipy().tocsc()
        options = {"SymmetricMode": True}
        self.lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        self.r, self.z = r, z

    def apply(self) -> None:
        """Compute z from r."""
        self.z.numpy()[:] = self.lu.solve(self.r.numpy().reshape(-1)).reshape(-1, 3)


class RepeatedSolver:
    """Solves A x = b to the accuracy that Newton needs, keeping what is expensive.

    Parameters
    ----------
    points
        Node positions [m], shape (nodes, 3).
    fixed
        Prescribed components, shape (nodes, 3).
    """

    def __init__(self, points: np.ndarray, fixed: np.ndarray) -> None:
        self.points, self.fixed = points, fixed
        self._kept: tuple[Scaled, Any, Any, Any] | None = None
        self._usual = 0

    def __call__(self, matrix: BlockMatrix, b: np.ndarray, goal: float) -> np.ndarray:
        """Return x with |b - A x| <= ``goal`` [N], within the limits; NaN if A is not positive."""
        share = 0.3 * goal / max(float(np.linalg.norm(b)), 1e-300)
        target = float(np.clip(share, TIGHTEST, LOOSEST) * np.linalg.norm(b))
        if self._kept is not None:
            x, iterations = self._iterate(matrix, b, target, self._usual + STALE)
            if x is not None:
                return x
            self._kept = None
            if iterations == 0:  # not positive: another preconditioner will not help
                return np.full_like(b, np.nan)
        return self._fresh(matrix, b, target)

    def _fresh(self, matrix: BlockMatrix, b: np.ndarray, target: float) -> np.ndarray:
        wp = start_warp()
        system = scale(BlockMatrix(matrix.rows, matrix.columns, wp.clone(matrix.values)))
        if not np.isfinite(system.lower.numpy()).all():
            return np.full_like(b, np.nan)
        r = wp.zeros(matrix.nodes, dtype=wp.vec3d, device=matrix.values.device)
        z = wp.zeros_like(r)
        if b.size <= DIRECT and not r.device.is_cuda:  # a graph cannot call a host's factor
            preconditioner = Factor(system, r, z)
        else:
            largest = largest_eigenvalue(system.matrix.to_scipy())
            coarse = coarsen(system, self.points, self.fixed, largest)
            preconditioner = TwoLevel(system, coarse, largest, r, z)
        self._kept = (system, preconditioner, r, z)
        x, self._usual = self._iterate(matrix, b, target, None)
        return np.full_like(b, np.nan) if x is None else x

    def _iterate(
        self, matrix: BlockMatrix, b: np.ndarray, target: float, limit: int | None
    ) -> tuple[np.ndarray | None, int]:
        from . import kernels_solver as k

        wp = start_warp()
        assert self._kept is not None
        kept, preconditioner, r, z = self._kept
        launch = Recorder(wp, matrix.nodes, r.device)
        pattern = [matrix.rows, matrix.columns]
        launch(k.scale_blocks, [*pattern, kept.inverse, matrix.values]).launch()
        system = Scaled(matrix, kept.lower, kept.inverse)
        r.assign(b)
        launch(k.block_multiply, [kept.inverse, r, False, r]).launch()
        x = wp.zeros_like(r)
        cg = ConjugateGradients(system, preconditioner, x, r, z)
        iterations = cg.run(target, limit)
        if not cg.reached:
            launch(k.scale_blocks, [*pattern, kept.lower, matrix.values]).launch()  # as it was
            return None, 0 if cg.indefinite else iterations
        launch(k.block_multiply, [kept.inverse, x, True, x]).launch()
        return x.numpy().copy(), iterations
