"""Krylov methods on a device: conjugate gradients, the largest eigenvalue by Lanczos."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix

# Threads of a block: inner products are summed within one before they meet in memory.
BLOCK = 256
# The largest eigenvalue comes from a few Lanczos steps, which stay a little below it.
LANCZOS_STEPS = 12
LANCZOS_MARGIN = 1.08


# Where slices begin and their columns, of the last patterns, by the identity of these.
_SLICED: list[tuple[Any, Any, Any]] = []
_KEPT = 4


class SlicedMatrix:
    """Copy of a ``matrix`` as a GPU reads it best: sliced ELLPACK (Monakov et al. 2010) of scalars.

    ``arrays`` (where slices begin, columns, numbers of ``dtype``) are what kernels take;
    ``refresh`` copies the numbers, at first and when those of the matrix have changed.
    """

    def __init__(self, matrix: BlockMatrix, dtype: Any) -> None:
        from . import kernels_krylov as k

        wp, device = start_warp(), matrix.values.device
        base, columns = _sliced_pattern(matrix)
        values = wp.empty(9 * len(columns), dtype=dtype, device=device)
        self.arrays = (base, columns, values)
        given = [matrix.rows, base, matrix.values.view(wp.float64).flatten(), values]
        self.command = Recorder(3 * matrix.nodes, device)(k.slice_values, given)

    def refresh(self) -> None:
        """Take the numbers that the matrix has now."""
        self.command.launch()


def _sliced_pattern(matrix: BlockMatrix) -> tuple[Any, Any]:
    """Where the slices of the pattern of ``matrix`` begin, and its columns in their order."""
    from . import kernels_krylov as k

    for known, base, columns in _SLICED:
        if known is matrix.columns:
            return base, columns
    wp, device, size = start_warp(), matrix.values.device, int(k.SLICE)
    lengths = np.diff(matrix.rows.numpy())
    widths = np.maximum.reduceat(lengths, np.arange(0, len(lengths), size))
    starts = np.concatenate([[0], np.cumsum(widths)])
    base = wp.array(starts, dtype=wp.int32, device=device)
    columns = wp.zeros(size * int(starts[-1]), dtype=wp.int32, device=device)
    given = [matrix.rows, matrix.columns, base, columns]
    Recorder(matrix.nodes, device)(k.slice_columns, given).launch()
    _SLICED.insert(0, (matrix.columns, base, columns))
    del _SLICED[_KEPT:]
    return base, columns


def whole_blocks(size: int) -> int:
    """Number of threads of the blocks that ``size`` of them fill."""
    return -(-size // BLOCK) * BLOCK


class Inner:
    """Inner product of two arrays of vec3d, added to a scalar that stays on the device.

    On the CPU numpy's is several times faster than a kernel's.
    """

    def __init__(self, a: Any, b: Any, out: Any, slot: int) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        x, y = (v.view(wp.float64).flatten() for v in (a, b))
        self.slot, self.on_device = slot, a.device.is_cuda
        if self.on_device:
            size = whole_blocks(x.shape[0])
            self.command = Recorder(size, a.device)(k.inner, [x, y, slot, out])
        else:
            self.left, self.right, self.total = x.numpy(), y.numpy(), out.numpy()

    def launch(self, slot: int | None = None) -> None:
        """Add the product to the scalar ``slot``, by default the one given at construction."""
        where = self.slot if slot is None else slot
        if not self.on_device:
            self.total[where] += self.left @ self.right
            return
        if slot is not None:
            self.command.set_param_at_index(2, slot)
        self.command.launch()


def norm(v: Any) -> float:
    """Euclidean length of an array of vec3d, without BLAS on the CPU, whose threads wait long."""
    if not v.device.is_cuda:
        return float(np.sqrt(np.square(v.numpy()).sum()))
    square = start_warp().zeros(1, dtype=start_warp().float64, device=v.device)
    Inner(v, v, square, 0).launch()
    return float(np.sqrt(square.numpy()[0]))


class ConjugateGradients:
    """Preconditioned CG for ``matrix``; vectors and scalars live on the device.

    ``preconditioner.apply()`` computes z from r. ``run`` starts at x = 0 with the right-hand side
    in ``r``, and may be called again after these, or the values of the matrix, have changed: on a
    GPU the whole loop is one graph. ``lower`` holds the blocks that scale a residual back.
    """

    def __init__(
        self, matrix: BlockMatrix, lower: Any, preconditioner: Any, r: Any, z: Any
    ) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        self.preconditioner, self.device = preconditioner, r.device
        self.scalars = wp.zeros(6, dtype=wp.float64, device=r.device)
        self.state = wp.zeros(4, dtype=wp.int32, device=r.device)
        self.x, self.p, q = (wp.zeros_like(r) for _ in range(3))
        self.z, self.graph, self.sliced = z, None, None
        launch = Recorder(matrix.nodes, r.device)
        self.direction = launch(k.cg_direction, [z, self.scalars, self.p])
        self.close = launch(k.cg_close, [self.scalars, self.state], size=1)
        self.first, self.next = (Inner(r, z, self.scalars, slot) for slot in (0, 2))
        known = (matrix, lower, q, r)
        self.forward = self._fused(*known) if r.device.is_cuda else self._plain(*known)

    def _plain(self, matrix: BlockMatrix, lower: Any, q: Any, r: Any) -> list[Any]:
        """Along the direction p: q = A p, curvature, new x and r, size of r unscaled."""
        from . import kernels_krylov as k

        unscaled = start_warp().zeros_like(r)
        advance = [self.p, q, lower, self.scalars, self.x, r, unscaled]
        return [
            matrix.product(self.p, q),
            Inner(self.p, q, self.scalars, 1),
            Recorder(matrix.nodes, self.device)(k.cg_advance, advance),
            Inner(unscaled, unscaled, self.scalars, 3),
        ]

    def _fused(self, matrix: BlockMatrix, lower: Any, q: Any, r: Any) -> list[Any]:
        """The same in two launches of whole blocks of threads."""
        from . import kernels_krylov as k

        wp = start_warp()
        self.sliced = SlicedMatrix(matrix, wp.float64)
        launch = Recorder(0, self.device)
        flat = [v.view(wp.float64).flatten() for v in (self.p, q)]
        product = [*self.sliced.arrays, *flat, self.scalars]
        advance = [self.p, q, lower, self.scalars, self.x, r]
        return [
            launch(k.multiply_and_measure, product, size=whole_blocks(3 * matrix.nodes)),
            launch(k.advance_and_measure, advance, size=whole_blocks(matrix.nodes)),
        ]

    def step(self) -> None:
        """One iteration, from a direction p to the next."""
        for command in self.forward:
            command.launch()
        self.preconditioner.apply()
        self.next.launch()
        self.direction.launch()
        self.close.launch()

    def _loop(self) -> None:
        wp = start_warp()
        self.preconditioner.apply()
        wp.copy(self.p, self.z)
        self.first.launch()
        wp.capture_while(self.state[:1], self.step)

    def run(self, target: float, limit: int) -> int:
        """Iterate until the unscaled residual is below ``target``; return the iterations."""
        wp = start_warp()
        self.x.zero_()
        self.scalars.assign(np.array([0, 0, 0, 0, target**2, 0]))
        self.state.assign(np.array([1, 0, limit, 0], dtype=np.int32))
        if self.sliced is not None:
            self.sliced.refresh()
            if self.graph is None:
                with wp.ScopedCapture(device=self.device) as capture:
                    self._loop()
                self.graph = capture.graph
            wp.capture_launch(self.graph)
        else:
            self._loop()
        _, iterations, _, indefinite = self.state.numpy()
        self.indefinite = bool(indefinite)
        self.reached = not indefinite and bool(self.scalars.numpy()[5] <= target**2)
        return int(iterations)


class LargestEigenvalue:
    """Largest eigenvalue of a symmetric ``matrix`` by Lanczos, with a margin; NaN if it has one.

    Asked again it answers for the values that the matrix has then: on a GPU by one graph.
    """

    def __init__(self, matrix: BlockMatrix) -> None:
        from . import kernels_krylov as k

        wp, device = start_warp(), matrix.values.device
        self.steps, self.device = min(LANCZOS_STEPS, 3 * matrix.nodes), device
        v, old, w = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(3))
        # Entry k of `along` is v A v of step k, of `square` the squared length of w before it.
        self.along, self.square = (
            wp.zeros(self.steps + 1, dtype=wp.float64, device=device) for _ in range(2)
        )
        launch = Recorder(matrix.nodes, device)
        self.start = launch(k.lanczos_start, [w])
        self.direction = launch(k.lanczos_direction, [w, self.square, 0, v, old])
        self.multiply = matrix.product(v, w)
        self.residual = launch(k.lanczos_residual, [v, old, self.along, self.square, 0, w])
        self.length, self.curvature = Inner(w, w, self.square, 0), Inner(w, v, self.along, 0)
        self.vectors, self.graph = (v, old, w), None

    def __call__(self) -> float:
        """Return the eigenvalue."""
        wp = start_warp()
        if not self.device.is_cuda:
            self._iterate()
        else:
            if self.graph is None:
                with wp.ScopedCapture(device=self.device) as capture:
                    self._iterate()
                self.graph = capture.graph
            wp.capture_launch(self.graph)
        along, square = self.along.numpy(), self.square.numpy()
        off = np.sqrt(square[1 : self.steps])
        # A vector that vanished ended the search: what came after it is no number.
        good = int(np.argmin(off > 1e-12)) if (off <= 1e-12).any() else len(off)
        T = np.diag(along[: good + 1]) + np.diag(off[:good], 1) + np.diag(off[:good], -1)
        return LANCZOS_MARGIN * float(np.linalg.eigvalsh(T)[-1]) if np.isfinite(T).all() else np.nan

    def _iterate(self) -> None:
        for cleared in (self.along, self.square, *self.vectors):
            cleared.zero_()
        self.start.launch()
        for step in range(self.steps):
            self.direction.set_param_at_index(2, step)
            self.residual.set_param_at_index(4, step)
            self.length.launch(step)
            self.direction.launch()
            self.multiply.launch()
            self.curvature.launch(step)
            self.residual.launch()
