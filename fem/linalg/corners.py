"""Coarse level of quadratic tets: linear functions of their corners, their matrix factored."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import CholeskyFactor
from ..device import Recorder, start_warp
from ..discrete.assembly import Pattern
from ..discrete.block_matrix import BlockMatrix
from ..discrete.constraints import apply_supports

# Patterns of the corners of the last spaces, by the identity of their edges.
_RECENT: list[tuple[np.ndarray, Pattern]] = []
_KEPT = 2


def corner_pattern(edges: np.ndarray, nodes: int) -> Pattern:
    """Pattern of the linear functions below a quadratic space of ``nodes`` with ``edges``."""
    from scipy.sparse import coo_array

    for known, pattern in _RECENT:
        if known is edges:
            return pattern
    wp, corners = start_warp(), nodes - len(edges)
    own = np.arange(corners)
    i, j = np.concatenate([edges, edges[:, ::-1], np.stack([own, own], axis=1)]).T
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(corners,) * 2).tocsr()
    graph.sort_indices()
    rows = wp.array(graph.indptr, dtype=wp.int32, device="cpu")
    columns = wp.array(graph.indices, dtype=wp.int32, device="cpu")
    pattern = Pattern(rows, columns, None)
    _RECENT.insert(0, (edges, pattern))
    del _RECENT[_KEPT:]
    return pattern


class CornerLevel:
    """Adds P (P^T A P)^-1 P^T r to z; P interpolates linearly between corners. On the CPU.

    A p-multigrid: the smoother has only the middles of the edges to care for, however thin the body
    or flat its tets. A is ``matrix``, scaled by the blocks ``lower``; ``fixed`` (nodes, 3) stay 0.

    Raises
    ------
    NotPositive
        If P^T A P is singular: the body is not held.
    """

    def __init__(
        self,
        matrix: BlockMatrix,
        lower: Any,
        edges: np.ndarray,
        fixed: np.ndarray,
        r: Any,
        z: Any,
    ) -> None:
        from . import kernels_solver as k

        wp = start_warp()
        corners = matrix.nodes - len(edges)
        own = np.arange(corners)
        ends = np.concatenate([np.stack([own, own], axis=1), edges])
        ends = wp.array(ends, dtype=wp.vec2i, device="cpu")
        free = wp.array(~fixed, dtype=wp.vec3d, device="cpu")
        transfer = wp.empty(matrix.nodes, dtype=wp.mat33d, device="cpu")
        launch = Recorder(matrix.nodes, "cpu")
        launch(k.corner_transfers, [lower, free, transfer]).launch()
        pattern = corner_pattern(edges, matrix.nodes)
        values = wp.zeros(len(pattern.columns), dtype=wp.mat33d, device="cpu")
        below = BlockMatrix(pattern.rows, pattern.columns, values)
        arrays = [matrix.rows, matrix.columns, matrix.values, ends, transfer]
        launch(k.corner_matrix, [*arrays, below.rows, below.columns, values]).launch()
        apply_supports(below, np.zeros((corners, 3), dtype=bool))  # empty rows get their 1
        self.factor = CholeskyFactor(below, planned_elimination(pattern))
        self.given, self.found = (wp.zeros(corners, dtype=wp.vec3d, device="cpu") for _ in range(2))
        self.restrict = launch(k.restrict_to_corners, [ends, transfer, r, self.given])
        self.prolong = launch(k.prolong_from_corners, [ends, transfer, self.found, z])

    def apply(self) -> None:
        """Correct z by what the linear functions can of r."""
        self.given.zero_()
        self.restrict.launch()
        self.found.numpy()[:] = self.factor.solve(self.given.numpy())
        self.prolong.launch()
