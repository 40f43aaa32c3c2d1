"""Sparse matrices of 3 x 3 blocks: pattern of a space, assembled stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..device import start_warp
from ..scene.mesh import TetMesh
from .space import TET_POINTS, Space, make_space


@dataclass(frozen=True, eq=False)
class Pattern:
    """Which node couples with which, in block rows; device arrays of warp.

    ``rows`` (nodes + 1) and ``columns`` (blocks) as in CSR with sorted columns, ``slots``
    (tets, k * k) the position of every pair of an element's nodes in ``columns``.
    """

    rows: Any
    columns: Any
    slots: Any


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The space of a mesh and its arrays on one device."""

    space: Space
    device: str
    points: Any
    elements: Any
    quadrature: Any
    pattern: Pattern


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

    def multiply(self, x: Any, out: Any) -> None:
        """Write A x to ``out``, both warp arrays of vec3d (nodes,)."""
        from . import kernels_linear as k

        arrays = [self.rows, self.columns, self.values, x]
        start_warp().launch(
            k.multiply, dim=self.nodes, inputs=arrays, outputs=[out], device=out.device
        )

    def add(self, other: BlockMatrix, factor: float) -> None:
        """Add ``factor`` times ``other``, a matrix of the same pattern, in place."""
        from . import kernels_linear as k

        size, device = self.values.shape[0], self.values.device
        inputs = [factor, other.values, self.values]
        start_warp().launch(k.add_scaled, size, inputs=inputs, device=device)

    def times(self, x: np.ndarray) -> np.ndarray:
        """Product A x of shape (nodes, 3) for ``x`` (nodes, 3)."""
        wp = start_warp()
        given = wp.array(x, dtype=wp.vec3d, device=self.values.device)
        out = wp.empty_like(given)
        self.multiply(given, out)
        return out.numpy()

    def to_scipy(self) -> Any:
        """Return the same matrix as ``scipy.sparse.bsr_array``."""
        from scipy.sparse import bsr_array

        arrays = (self.values.numpy(), self.columns.numpy(), self.rows.numpy())
        return bsr_array(arrays, shape=(3 * self.nodes, 3 * self.nodes))


# Discretisations of the last meshes, by the identity of their arrays: materials come and go on the
# same tets, while a solve of each order on two meshes is all that alternates in practice.
_RECENT: list[tuple[np.ndarray, np.ndarray, Discretisation]] = []
_KEPT = 4


def discretise(mesh: TetMesh, order: int, device: str = "cpu") -> Discretisation:
    """Space, pattern and device arrays of ``mesh``, kept for the next call with the same tets."""
    for points, tets, grid in _RECENT:
        same = points is mesh.points and tets is mesh.tets
        if same and grid.space.order == order and grid.device == device:
            return grid
    grid = _discretise(mesh, order, device)
    _RECENT.insert(0, (mesh.points, mesh.tets, grid))
    del _RECENT[_KEPT:]
    return grid


def _discretise(mesh: TetMesh, order: int, device: str) -> Discretisation:
    wp = start_warp()
    space = make_space(mesh, order)
    pattern = make_pattern(space, device)
    return Discretisation(
        space,
        device,
        wp.array(space.nodes, dtype=wp.vec3d, device=device),
        wp.array(space.elements, dtype=wp.int32, device=device),
        wp.array(TET_POINTS if order == 2 else TET_POINTS[:1], dtype=wp.vec4d, device=device),
        pattern,
    )


def make_pattern(space: Space, device: str = "cpu") -> Pattern:
    """Pattern of the stiffness of ``space``; made on the CPU, then moved to ``device``."""
    from scipy.sparse import csr_array

    from . import kernels_pattern as k

    wp = start_warp()
    elements, count = space.elements, len(space.nodes)
    tets, size = elements.shape
    ones = np.ones(elements.size, dtype=np.int8)
    owner = csr_array((ones, elements.ravel(), np.arange(tets + 1) * size), shape=(tets, count))
    owner = owner.tocsc()  # counting sort: the elements around every node
    start = wp.array(owner.indptr, dtype=wp.int32, device="cpu")
    incident = wp.array(owner.indices, dtype=wp.int32, device="cpu")
    nodes = wp.array(elements, dtype=wp.int32, device="cpu")
    scratch = wp.empty(size * elements.size + count, dtype=wp.int32, device="cpu")
    lengths = wp.empty(count, dtype=wp.int32, device="cpu")
    wp.launch(k.sorted_rows, count, inputs=[start, incident, nodes, scratch, lengths], device="cpu")
    rows = wp.array(np.concatenate([[0], np.cumsum(lengths.numpy())]), dtype=wp.int32, device="cpu")
    columns = wp.empty(int(rows.numpy()[-1]), dtype=wp.int32, device="cpu")
    wp.launch(k.copy_rows, count, inputs=[start, size, scratch, rows, columns], device="cpu")
    slots = wp.empty((tets, size * size), dtype=wp.int32, device="cpu")
    wp.launch(k.element_slots, tets, inputs=[nodes, rows, columns, slots], device="cpu")
    return Pattern(rows.to(device), columns.to(device), slots.to(device))


def stiffness(grid: Discretisation, lam: np.ndarray, mu: np.ndarray) -> BlockMatrix:
    """Stiffness matrix [N/m] of linear elasticity with Lame parameters (tets,) [Pa]."""
    from . import kernels_linear as k

    wp = start_warp()
    device, pattern = grid.device, grid.pattern
    values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=device)
    moduli = [wp.array(m, dtype=wp.float64, device=device) for m in (lam, mu)]
    arrays = [grid.points, grid.elements, *moduli]
    if grid.space.order == 2:
        arrays.append(grid.quadrature)
    kernel = k.assemble_p1 if grid.space.order == 1 else k.assemble_p2
    wp.launch(kernel, len(lam), inputs=[*arrays, pattern.slots], outputs=[values], device=device)
    return BlockMatrix(pattern.rows, pattern.columns, values)


def add_diagonal(matrix: BlockMatrix, blocks: np.ndarray) -> None:
    """Add 3 x 3 ``blocks`` (nodes, 3, 3) [N/m] to the diagonal, in place."""
    from . import kernels_linear as k

    wp = start_warp()
    device = matrix.values.device
    added = wp.array(blocks, dtype=wp.mat33d, device=device)
    inputs = [matrix.rows, matrix.columns, added, matrix.values]
    wp.launch(k.add_diagonal, matrix.nodes, inputs=inputs, device=device)


def apply_supports(
    matrix: BlockMatrix, fixed: np.ndarray, springs: np.ndarray | None = None
) -> None:
    """Add ``springs`` [N/m] (nodes, 3) and drop the ``fixed`` (nodes, 3) rows, in place."""
    from . import kernels_linear as k

    wp = start_warp()
    device = matrix.values.device
    if springs is not None and springs.any():
        add_diagonal(matrix, springs[:, :, None] * np.eye(3))
    free = wp.array(~fixed, dtype=wp.vec3d, device=device)
    inputs = [matrix.rows, matrix.columns, free, matrix.values]
    wp.launch(k.fix_rows, matrix.nodes, inputs=inputs, device=device)


@lru_cache(maxsize=8)
def barycentric_array(device: str, key: bytes) -> Any:
    """Device array of barycentric points given as float64 bytes (points, 4)."""
    wp = start_warp()
    return wp.array(np.frombuffer(key).reshape(-1, 4), dtype=wp.vec4d, device=device)


def displacement_gradients(
    grid: Discretisation, u: np.ndarray, barycentric: np.ndarray
) -> np.ndarray:
    """Gradient du_i/dx_j, shape (tets, quadrature, 3, 3), at ``barycentric`` (quadrature, 4)."""
    from . import kernels_linear as k

    wp = start_warp()
    tets, device = len(grid.space.elements), grid.device
    where = barycentric_array(device, np.ascontiguousarray(barycentric, dtype=float).tobytes())
    out = wp.empty((tets, len(barycentric)), dtype=wp.mat33d, device=device)
    field = wp.array(u, dtype=wp.vec3d, device=device)
    arrays = [grid.points, grid.elements, where, field]
    wp.launch(k.displacement_gradient, tets, inputs=arrays, outputs=[out], device=device)
    return out.numpy()
