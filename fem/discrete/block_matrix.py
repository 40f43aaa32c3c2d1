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


def add_diagonal(matrix: BlockMatrix, blocks: np.ndarray) -> None:
    """Add 3 x 3 ``blocks`` (nodes, 3, 3) [N/m] to the diagonal, in place."""
    from . import kernels_matrix as k

    wp = start_warp()
    device = matrix.values.device
    added = wp.array(blocks, dtype=wp.mat33d, device=device)
    inputs = [matrix.rows, matrix.columns, added, matrix.values]
    wp.launch(k.add_diagonal, matrix.nodes, inputs=inputs, device=device)
