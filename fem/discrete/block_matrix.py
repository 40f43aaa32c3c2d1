"""Square sparse matrices of 3 x 3 blocks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device import Recorder, start_warp


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """Square sparse matrix of 3 x 3 blocks [N/m] on a device: CSR of blocks."""

    rows: Any
    columns: Any
    values: Any

    @property
    def nodes(self) -> int:
        """Number of block rows."""
        return self.rows.shape[0] - 1

    def product(self, x: Any, out: Any) -> Any:
        """Launch command that writes A x to ``out``, both warp arrays of vec3d (nodes,)."""
        from . import kernels_matrix as k

        wp, device, pattern = start_warp(), out.device, [self.rows, self.columns]
        if not device.is_cuda:
            return Recorder(self.nodes, device)(k.multiply, [*pattern, self.values, x, out])
        flat = [v.view(wp.float64).flatten() for v in (self.values, x, out)]
        return Recorder(3 * self.nodes, device)(k.multiply_scalars, [*pattern, *flat])

    def multiply(self, x: Any, out: Any) -> None:
        """Write A x to ``out``, both warp arrays of vec3d (nodes,)."""
        self.product(x, out).launch()

    def times(self, x: np.ndarray) -> np.ndarray:
        """Product A x of shape (nodes, 3) for ``x`` (nodes, 3)."""
        wp = start_warp()
        given = wp.array(x, dtype=wp.vec3d, device=self.values.device)
        out = wp.empty_like(given)
        self.multiply(given, out)
        return out.numpy()

    def to(self, device: str) -> BlockMatrix:
        """Return the same matrix on ``device``: itself, if it is there."""
        if str(self.values.device) == device:
            return self
        arrays = (self.rows, self.columns, self.values)
        return BlockMatrix(*(array.to(device) for array in arrays))

    def to_scipy(self) -> Any:
        """Return the same matrix as ``scipy.sparse.bsr_array``."""
        from scipy.sparse import bsr_array

        arrays = (self.values.numpy(), self.columns.numpy(), self.rows.numpy())
        return bsr_array(arrays, shape=(3 * self.nodes, 3 * self.nodes))


def add_blocks(matrix: BlockMatrix, i: np.ndarray, j: np.ndarray, blocks: np.ndarray) -> None:
    """Add 3 x 3 ``blocks`` (n, 3, 3) [N/m] of nodes ``i`` and ``j`` (n,) that share a tet."""
    from . import kernels_matrix as k

    wp = start_warp()
    device = matrix.values.device
    pairs = [wp.array(ids, dtype=wp.int32, device=device) for ids in (i, j)]
    added = wp.array(blocks, dtype=wp.mat33d, device=device)
    inputs = [matrix.rows, matrix.columns, *pairs, added, matrix.values]
    wp.launch(k.add_pairs, len(blocks), inputs=inputs, device=device)


def add_diagonal(matrix: BlockMatrix, added: Any) -> None:
    """Add 3 x 3 blocks (nodes, 3, 3) [N/m], or their diagonals (nodes, 3), in place.

    Diagonals may be an array of vec3d that is on the device already.
    """
    from . import kernels_matrix as k

    wp = start_warp()
    device, given, alone = matrix.values.device, added, True
    if isinstance(added, np.ndarray):
        alone = added.ndim == 2
        given = wp.array(added, dtype=wp.vec3d if alone else wp.mat33d, device=device)
    inputs = [matrix.rows, matrix.columns, given, matrix.values]
    kernel = k.add_diagonal_numbers if alone else k.add_diagonal
    wp.launch(kernel, matrix.nodes, inputs=inputs, device=device)


class GrownPattern:
    """Pattern of a matrix with room for blocks of nodes that share no tet.

    Pairs once given room keep it, so that the pattern is the same array from one matrix to the
    next while no new ones come.
    """

    def __init__(self) -> None:
        self._base: Any = None
        self._pairs = np.zeros(0, dtype=np.int64)
        self._grown: tuple[Any, Any, np.ndarray] | None = None  # rows, columns, slots of the old

    def room(self, matrix: BlockMatrix, i: np.ndarray, j: np.ndarray) -> BlockMatrix:
        """``matrix``, or a copy where the pairs of nodes ``i`` and ``j`` (n,) have a place."""
        pairs = np.unique(np.asarray(i, dtype=np.int64) * matrix.nodes + j)
        if matrix.columns is not self._base:
            self._base, self._pairs = matrix.columns, pairs
            self._grow(matrix)
        elif not np.isin(pairs, self._pairs).all():
            self._pairs = np.union1d(self._pairs, pairs)
            self._grow(matrix)
        if self._grown is None:
            return matrix
        rows, columns, slots = self._grown
        values = np.zeros((columns.shape[0], 3, 3))
        values[slots] = matrix.values.numpy()
        dtype, device = start_warp().mat33d, matrix.values.device
        return BlockMatrix(rows, columns, start_warp().array(values, dtype=dtype, device=device))

    def _grow(self, matrix: BlockMatrix) -> None:
        wp, count, device = start_warp(), matrix.nodes, matrix.values.device
        rows, columns = matrix.rows.numpy(), matrix.columns.numpy()
        known = np.repeat(np.arange(count, dtype=np.int64), np.diff(rows)) * count + columns
        at = np.minimum(np.searchsorted(known, self._pairs), len(known) - 1)
        new = self._pairs[known[at] != self._pairs]
        if not new.size:
            self._grown = None
            return
        keys = np.insert(known, np.searchsorted(known, new), new)
        start = rows + np.searchsorted(new, np.arange(count + 1, dtype=np.int64) * count)
        slots = np.arange(len(known)) + np.searchsorted(new, known)
        arrays = (wp.array(a, dtype=wp.int32, device=device) for a in (start, keys % count))
        self._grown = (*arrays, slots)
