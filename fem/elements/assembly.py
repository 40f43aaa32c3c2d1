"""A mesh on a device: its space and matrix pattern; matrices assembled on it, supported."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ..device import Recent, Recorder, start_warp
from ..errors import InputError
from ..laws.law import LAWS, Law
from ..material import ElementMaterial
from ..mesh import TetMesh
from ..scene.supports import Supports
from .space import Space, element_points, extend_linear, make_space


class Pattern(NamedTuple):
    """Which node couples with which, in block rows; device arrays of warp.

    ``rows`` (nodes + 1) and ``columns`` (blocks) as in CSR with sorted columns, ``slots``
    (tets, k * k) the position of every pair of an element's nodes in ``columns``.
    """

    rows: Any
    columns: Any
    slots: Any


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The space of a mesh, its ``tets`` as kernels take them and its pattern, on one device."""

    space: Space
    device: str
    tets: Any
    pattern: Pattern
    # lam and mu, and rho, of one material, and of one more
    _constants: Recent[Any] = field(default_factory=lambda: Recent(4), repr=False)

    def constants(self, *values: Float[np.ndarray, "tets"]) -> list:
        """Arrays on the device of numbers that are only read; of a material's they are kept.

        What may be written to is copied anew, for nobody would tell.
        """
        if (kept := self._constants.get(*values)) is not None:
            return kept
        made = [self.array(numbers) for numbers in values]
        if any(numbers.flags.writeable for numbers in values):
            return made
        return self._constants.keep(made, *values)

    def array(self, values: Any) -> Any:
        """Array on the device of numbers (n,) or vectors (n, 3); one that is there as it is."""
        if not isinstance(values, np.ndarray):
            return values.array
        wp = start_warp()
        dtype = wp.vec3d if values.ndim == 2 else wp.float64
        return wp.array(values, dtype=dtype, device=self.device)


# Discretisations of the last meshes: materials come and go on the same tets, while a solve of each
# order on two meshes is all that alternates in practice.
_RECENT: Recent[Discretisation] = Recent(4)


def discretise(mesh: TetMesh, order: int, device: str = "cpu") -> Discretisation:
    """Space, pattern and device arrays of ``mesh``, kept for the next call with the same tets."""
    key = (mesh.points, mesh.tets, order, device)
    if (kept := _RECENT.get(*key)) is not None:
        return kept
    from ..laws.kernels_tensor import Tets

    wp, space, tets = start_warp(), make_space(mesh, order), Tets()
    tets.points = wp.array(space.nodes, dtype=wp.vec3d, device=device)
    tets.elements = wp.array(space.elements, dtype=wp.int32, device=device)
    tets.quadrature = wp.array(element_points(order), dtype=wp.vec4d, device=device)
    return _RECENT.keep(Discretisation(space, device, tets, make_pattern(space, device)), *key)


def make_pattern(space: Space, device: str = "cpu") -> Pattern:
    """Pattern of the stiffness of ``space``; made on the CPU, then moved to ``device``."""
    from scipy.sparse import csr_array

    from . import kernels_field as k

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


def linear_stiffness(grid: Discretisation, material: ElementMaterial) -> BlockMatrix:
    """Stiffness matrix [N/m] of linear elasticity, along the grain where there is one."""
    if material.tensor is None:
        return stiffness(grid, *material.lame)
    from . import kernels_elastic as k

    wp = start_warp()
    device, pattern = grid.device, grid.pattern
    values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=device)
    tensors = wp.array(material.tensor, dtype=k.mat66d, device=device)
    inputs = [grid.tets, None, None, tensors, False, 1.0, None, None, False, pattern.slots, values]
    wp.launch(k.tensor_tangent, len(material.tensor), inputs=inputs, device=device)
    return BlockMatrix(pattern.rows, pattern.columns, values)


def stiffness(grid: Discretisation, lam: np.ndarray, mu: np.ndarray) -> BlockMatrix:
    """Stiffness matrix [N/m] of linear elasticity with Lame parameters (tets,) [Pa]."""
    wp = start_warp()
    from .kernels_elastic import elastic_kernels

    device, pattern = grid.device, grid.pattern
    kernels = elastic_kernels(LAWS[Law.LINEAR])
    values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=device)
    kernel, rows = (
        (kernels.stiffness_p1, 1) if grid.space.order == 1 else (kernels.stiffness_p2, 10)
    )
    inputs = [grid.tets, *grid.constants(lam, mu), pattern.slots, values]
    wp.launch(kernel, rows * len(lam), inputs=inputs, device=device)
    return BlockMatrix(pattern.rows, pattern.columns, values)


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
        from . import kernels_field as k

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
        vector = wp.array(x, dtype=wp.vec3d, device=self.values.device)
        out = wp.empty_like(vector)
        self.multiply(vector, out)
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
    from . import kernels_field as k

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
    from . import kernels_field as k

    wp, device = start_warp(), matrix.values.device
    if isinstance(added, np.ndarray):
        if added.ndim == 3:
            own = np.arange(matrix.nodes)
            return add_blocks(matrix, own, own, added)
        added = wp.array(added, dtype=wp.vec3d, device=device)
    inputs = [matrix.rows, matrix.columns, added, matrix.values]
    wp.launch(k.add_diagonal, matrix.nodes, inputs=inputs, device=device)


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


def node_supports(supports: Supports, space: Space) -> Supports:
    """Continue ``supports`` to all nodes of ``space``.

    The middle of an edge is held with both its ends, on the surface and by one place: what lies
    across the body between two held faces is free.
    """
    if len(supports.fixed) == len(space.nodes):
        return supports
    if len(supports.fixed) != space.points:
        raise InputError(
            "assembly.supports_points",
            count=len(supports.fixed),
            points=space.points,
            count_2=len(space.nodes),
            order=space.order,
        )
    (a, b), outer = space.edges.T, space.outer_edges[:, None]
    places = [np.concatenate([place, place[a] & place[b] & outer]) for place in supports.places]
    fixed = np.concatenate([supports.fixed, np.zeros((len(a), 3), dtype=bool)])
    for place in places:
        fixed |= place
    values = np.zeros(fixed.shape)
    if supports.values.any():
        values = extend_linear(space, supports.values)
    return Supports(
        fixed,
        values,
        np.concatenate([supports.springs, np.zeros((len(a), 3))]),
        supports.assumed,
        tuple(places),
    )


def free_components(fixed: Bool[np.ndarray, "nodes 3"], device: Any) -> Any:
    """Array of vec3d on a device: 1 where a component is free, 0 where it is ``fixed``."""
    from . import kernels_field as k

    wp = start_warp()
    if not wp.get_device(device).is_cuda:
        return wp.array(~fixed, dtype=wp.vec3d, device=device)
    flags = wp.array(fixed.ravel().view(np.uint8), dtype=wp.uint8, device=device)  # an eighth
    free = wp.empty(len(fixed), dtype=wp.vec3d, device=device)
    numbers = free.view(wp.float64).flatten()
    wp.launch(k.lift_fixed, len(flags), inputs=[flags, numbers], device=device)
    return free


def apply_supports(
    matrix: BlockMatrix, fixed: np.ndarray, springs: np.ndarray | None = None
) -> None:
    """Add ``springs`` [N/m] (nodes, 3) and drop the ``fixed`` (nodes, 3) rows, in place."""
    device = matrix.values.device
    if springs is not None and springs.any():
        add_diagonal(matrix, springs)
    drop_rows(matrix, free_components(fixed, device))


def drop_rows(matrix: BlockMatrix, free: Any) -> None:
    """Drop the rows and columns that are not ``free``, in place: ``free_components`` says which."""
    from . import kernels_field as k

    wp, device = start_warp(), matrix.values.device
    inputs = [matrix.rows, matrix.columns, free, matrix.values]
    wp.launch(k.fix_rows, matrix.nodes, inputs=inputs, device=device)


def reduced_load(
    matrix: BlockMatrix, load: np.ndarray, held: Supports, prescribed: np.ndarray
) -> np.ndarray:
    """Right-hand side (nodes, 3) once prescribed components are dropped from ``matrix``, in place.

    Prescribed unknowns of the reduced system are zero: they are known, and put back afterwards.
    """
    rhs = load - (matrix.times(prescribed) if prescribed.any() else 0.0)
    rhs[held.fixed] = 0.0
    apply_supports(matrix, held.fixed, held.springs)
    return rhs
