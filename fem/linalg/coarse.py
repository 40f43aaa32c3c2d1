"""Coarse space of the two-level preconditioner: smoothed rigid motions of groups of nodes."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix
from ..discrete.constraints import free_components
from ..errors import ConvergenceError
from .inversion import inversion

logger = logging.getLogger(__name__)

# Boxes of the coarse space, six unknowns each. A dense factor of 1536 takes a CPU 50 ms; a GPU
# inverts the matrix, for which fewer unknowns pay.
BOXES = 256
BOXES_GPU = 128
NODES_PER_BOX = 100
# Share by which the diagonal of a coarse matrix is raised before a GPU inverts it: dependent rigid
# modes of small groups leave it singular to round-off.
RAISE = 1e-12

# Neighbours couple strongly when |A_ij| >= this share of sqrt(|A_ii| |A_jj|). Within one material
# the ratio is 0.02 and more; across an interface it falls with the square root of the contrast.
STRENGTH = 5e-3
# A strongly coupled part of a box smaller than this joins the rest of its box: a motion of so few
# nodes is the smoother's work.
SMALLEST = 4


@dataclass(frozen=True, eq=False)
class Groups:
    """Groups of nodes, arrays on a device.

    ``points`` (nodes, 3) [m] are the nodes, ``label`` (nodes,) the group of every one, ``centre``
    (groups, 3) [m] its mean, ``extent`` (groups,) [m] the largest distance from it along an axis.
    """

    points: Any
    label: Any
    centre: Any
    extent: Any


@dataclass(frozen=True, eq=False)
class Coarse:
    """Prolongation P (block CSR of 3 x 6), and the coarse matrix factored (CPU) or inverted.

    ``members`` lists P by columns on a GPU: where those of every aggregate start, entries, rows.
    """

    groups: Groups
    start: Any
    aggregates: Any
    transfer: Any
    members: tuple[Any, Any, Any] | None
    count: int
    factor: tuple | None
    inverse: Any


# Boxes of the last meshes, by the identity of their points: materials come and go on one mesh.
_RECENT: list[tuple[np.ndarray, Any, Groups]] = []
_KEPT = 4


def boxes(points: Float[np.ndarray, "n 3"], count: int) -> Int[np.ndarray, "n"]:
    """Recursive coordinate bisection: box of every point, at least ``count`` equal boxes."""
    label = np.zeros(len(points), dtype=np.int64)
    parts = 1
    while parts < count:
        order = np.argsort(label, kind="stable")
        sizes = np.bincount(label, minlength=parts)
        start = np.cumsum(sizes) - sizes
        sorted_points = points[order]
        low = np.minimum.reduceat(sorted_points, start)
        high = np.maximum.reduceat(sorted_points, start)
        along = points[np.arange(len(points)), np.argmax(high - low, axis=1)[label]]
        order = np.lexsort((along, label))
        rank = np.empty_like(label)
        rank[order] = np.arange(len(points)) - np.repeat(start, sizes)
        label = 2 * label + (rank >= sizes[label] // 2)
        parts *= 2
    return label


def split_weak(
    label: Int[np.ndarray, "n"], rows: np.ndarray, columns: np.ndarray, strength: np.ndarray
) -> Int[np.ndarray, "n"]:
    """Split every box into its strongly coupled parts.

    ``rows``, ``columns`` and ``strength`` describe the couplings of nodes. A stiff and a soft
    material in one box must not share their rigid motions.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(label)
    keep = (strength >= STRENGTH) & (label[rows] == label[columns])
    ones = np.ones(int(keep.sum()), dtype=np.int8)
    graph = coo_array((ones, (rows[keep], columns[keep])), shape=(count, count))
    part = connected_components(graph, directed=False)[1].astype(np.int64)
    size = np.bincount(part)
    # The largest part of every box takes in the box's crumbs.
    owner = np.empty(len(size), dtype=np.int64)
    owner[part] = label
    by_box = np.lexsort((-size, owner))
    first = np.unique(owner[by_box], return_index=True)[1]
    largest = np.zeros(label.max() + 1, dtype=np.int64)
    largest[owner[by_box][first]] = by_box[first]
    part = np.where(size[part] < SMALLEST, largest[label], part)
    return np.unique(part, return_inverse=True)[1]


def make_groups(points: np.ndarray, label: np.ndarray, device: Any) -> Groups:
    """Groups of the nodes at ``points`` (nodes, 3) [m] with the same ``label`` (nodes,)."""
    wp = start_warp()
    size = np.bincount(label)
    sums = [np.bincount(label, points[:, k]) for k in range(3)]
    centre = np.stack(sums, axis=1) / size[:, None]
    reach = np.abs(points - centre[label]).max(axis=1)
    start = np.cumsum(size) - size
    extent = np.maximum.reduceat(reach[np.argsort(label, kind="stable")], start)
    extent[extent == 0] = 1.0
    return Groups(
        wp.array(points, dtype=wp.vec3d, device=device),
        wp.array(label, dtype=wp.int32, device=device),
        wp.array(centre, dtype=wp.vec3d, device=device),
        wp.array(extent, dtype=wp.float64, device=device),
    )


def _boxes(points: np.ndarray, device: Any) -> Groups:
    """Boxes of about equally many nodes."""
    for known, where, groups in _RECENT:
        if known is points and where == device:
            return groups
    most = BOXES_GPU if device.is_cuda else BOXES
    count = min(most, max(1, len(points) // NODES_PER_BOX))
    groups = make_groups(points, boxes(points, count), device)
    _RECENT.insert(0, (points, device, groups))
    del _RECENT[_KEPT:]
    return groups


def _groups(A: BlockMatrix, points: np.ndarray, free: Any) -> Groups:
    """Boxes of nodes, split where the couplings of the scaled matrix ``A`` are weak."""
    from . import kernels_coarse as k

    wp = start_warp()
    device = A.values.device
    groups = _boxes(points, device)
    weak = wp.zeros(1, dtype=wp.int32, device=device)
    strength = wp.empty(len(A.columns), dtype=wp.float64, device=device)
    inputs = [A.rows, A.columns, A.values, groups.label, free, STRENGTH, strength, weak]
    Recorder(A.nodes, device)(k.couplings, inputs).launch()
    if weak.numpy()[0] == 0:
        return groups
    rows = np.repeat(np.arange(A.nodes, dtype=np.int32), np.diff(A.rows.numpy()))
    label = split_weak(groups.label.numpy(), rows, A.columns.numpy(), strength.numpy())
    return make_groups(points, label, device)


def _motions(groups: Groups, lower: Any, free: Any) -> Any:
    """Orthonormal rigid motions of every group in scaled unknowns, (nodes,) blocks of 3 x 6."""
    from . import kernels_coarse as k

    wp = start_warp()
    device, count = lower.device, len(groups.extent)
    launch = Recorder(len(free), device)
    motion = wp.empty(len(free), dtype=k.mat36d, device=device)
    gram, weight = (wp.zeros(count, dtype=k.mat66d, device=device) for _ in range(2))
    of = [groups.label, groups.centre, groups.extent]
    launch(k.rigid_motions, [groups.points, *of, lower, free, motion, gram]).launch()
    launch(k.orthonormalise, [gram, weight], size=count).launch()
    launch(k.weigh, [groups.label, weight, motion]).launch()
    return motion


def coarsen(
    A: BlockMatrix, lower: Any, points: np.ndarray, fixed: np.ndarray, largest: float
) -> Coarse:
    """Smoothed aggregation with rigid motions for the matrix ``A`` scaled by ``lower``.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes, ``largest`` is the
    largest eigenvalue of A.
    """
    from . import kernels_coarse as k

    wp = start_warp()
    device, pattern = A.values.device, [A.rows, A.columns]
    free = free_components(fixed, device)
    groups = _groups(A, points, free)
    motion = _motions(groups, lower, free)
    launch = Recorder(A.nodes, device)
    start = wp.zeros(A.nodes + 1, dtype=wp.int32, device=device)
    launch(k.count_labels, [*pattern, groups.label, start[1:]]).launch()
    wp.utils.array_scan(start, start, inclusive=True)
    total = int(start[A.nodes :].numpy()[0])
    aggregates = wp.empty(total, dtype=wp.int32, device=device)
    transfer = wp.empty(total, dtype=k.mat36d, device=device)
    count = len(groups.extent)
    made = Coarse(groups, start, aggregates, transfer, None, count, None, None)
    matrix = _galerkin(A, groups, motion, largest, made)
    if not device.is_cuda:
        return replace(made, factor=_cholesky(matrix.numpy()))
    members = _members(start, aggregates, count)
    return replace(made, members=members, inverse=inversion(len(matrix), str(device))(matrix))


def coarsen_again(
    like: Coarse,
    A: BlockMatrix,
    lower: Any,
    points: np.ndarray,
    fixed: np.ndarray,
    largest: float,
) -> bool:
    """Make the space ``like`` that of another matrix of its pattern, in the same arrays, on a GPU.

    False where its groups would be others.
    """
    free = free_components(fixed, A.values.device)
    groups = _groups(A, points, free)
    if groups is not like.groups and not np.array_equal(
        groups.label.numpy(), like.groups.label.numpy()
    ):
        return False
    matrix = _galerkin(A, groups, _motions(groups, lower, free), largest, like)
    start_warp().copy(like.inverse, inversion(len(matrix), str(matrix.device))(matrix))
    return True


def _galerkin(A: BlockMatrix, groups: Groups, motion: Any, largest: float, made: Coarse) -> Any:
    """Smooth the ``motion`` of the groups into the P of ``made``; the coarse matrix P^T A P."""
    from . import kernels_coarse as k

    wp, device = start_warp(), A.values.device
    launch, pattern = Recorder(A.nodes, device), [A.rows, A.columns]
    P = (made.start, made.aggregates, made.transfer)
    omega = 4 / (3 * largest)
    launch(k.smooth, [*pattern, A.values, groups.label, motion, omega, *P]).launch()
    matrix = wp.zeros((6 * made.count, 6 * made.count), dtype=wp.float64, device=device)
    launch(k.galerkin, [*pattern, A.values, *P, matrix]).launch()
    raised = RAISE if device.is_cuda else 0.0
    launch(k.mend, [raised, matrix], size=matrix.shape).launch()
    return matrix


def _members(start: Any, aggregates: Any, count: int) -> tuple[Any, Any, Any]:
    """Entries of a block CSR matrix by column: start of every column, entries, their rows."""
    from . import kernels_coarse as k

    wp = start_warp()
    launch = Recorder(len(start) - 1, start.device)
    first = wp.zeros(count + 1, dtype=wp.int32, device=start.device)
    launch(k.count_members, [aggregates, first[1:]], size=len(aggregates)).launch()
    wp.utils.array_scan(first, first, inclusive=True)
    member, owner = wp.empty_like(aggregates), wp.empty_like(aggregates)
    launch(k.list_members, [start, aggregates, wp.clone(first), member, owner]).launch()
    return first, member, owner


def _cholesky(matrix: np.ndarray):
    """Cholesky factor of ``matrix``, in place, its diagonal raised as little as makes it positive.

    Aggregates of one or two nodes have dependent rigid modes, so the matrix may be singular to
    round-off; a preconditioner may be that much off.
    """
    from scipy.linalg import LinAlgError, cho_factor

    diagonal = matrix.diagonal().copy()
    matrix = matrix.T  # LAPACK's order: the lower triangle is factored in place, the upper one kept
    for shift in (0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4):
        np.fill_diagonal(matrix, (1 + shift) * diagonal)
        try:
            return cho_factor(matrix, lower=True, overwrite_a=True)
        except LinAlgError:
            logger.info("coarse matrix is not positive with a shift of %g", shift)
            matrix[:] = np.triu(matrix) + np.triu(matrix, 1).T
    raise ConvergenceError("the stiffness matrix is not positive definite: is the body held?")
