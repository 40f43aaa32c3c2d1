"""Two-level preconditioner: Chebyshev smoothing and a coarse space of rigid aggregates."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ..device import Recorder, start_warp
from ..elements.assembly import BlockMatrix, Pattern
from ..elements.constraints import apply_supports, free_components
from ..errors import ConvergenceError
from .cholesky import CholeskyFactor, planned_elimination
from .krylov import BLOCK, LargestEigenvalue, SlicedMatrix, whole_blocks

# Chebyshev polynomials of a scaled matrix: before a coarse level, and after it.
#
# Degree 3 by default, damping the upper part [largest / SPREAD, largest] of the spectrum.

DEGREE = 3
SPREAD = 25.0


class Smoother:
    """Launches on vectors of vec3d: of ``r`` what is left is ``residual``, what is done ``z``.

    A coarse level corrects ``z`` by the ``residual`` between ``before`` and ``after``.
    """

    def __init__(self, matrix: BlockMatrix, largest: float, degree: int = DEGREE) -> None:
        from . import kernels_krylov as k

        wp, A = start_warp(), [matrix.rows, matrix.columns, matrix.values]
        device = matrix.values.device
        self.r, self.z, res, *d = (
            wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(5)
        )
        self.residual, self.correction = res, self.z
        theta, steps = chebyshev(largest, degree)
        launch = Recorder(matrix.nodes, device)
        smooth = [
            launch(k.chebyshev_step, [*A, old, keep, gain, res, new, self.z])
            for (old, new), (keep, gain) in zip(_turns(d), steps, strict=False)
        ]
        last = d[len(steps) % 2]
        self.before = [
            launch(k.chebyshev_start, [self.r, 1 / theta, res, d[0], self.z]),
            *smooth,
            launch(k.subtract, [*A, last, res]),
        ]
        self.after = [
            launch(k.chebyshev_restart, [*A, self.r, self.z, 1 / theta, res, d[0]]),
            launch(k.add, [self.z, d[0]]),
            *smooth,
        ]


class SingleSmoother:
    """The same in single precision, a thread a scalar: several times faster on a GPU.

    ``residual`` and ``correction`` are flat and single, ``r`` and ``z`` double.
    """

    def __init__(self, matrix: BlockMatrix, largest: float, degree: int = DEGREE) -> None:
        from . import kernels_multigrid as k

        wp = start_warp()
        device, size = matrix.values.device, 3 * matrix.nodes
        launch = Recorder(size, device)
        self.sliced = SlicedMatrix(matrix, wp.float32)
        self.sliced.refresh()
        A = self.sliced.arrays
        self.r, self.z = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(2))
        r, z = (v.view(wp.float64).flatten() for v in (self.r, self.z))
        res, x, *d = (wp.zeros(size, dtype=wp.float32, device=device) for _ in range(4))
        self.residual, self.correction = res, x
        theta, steps = chebyshev(largest, degree)

        def smooth(owed: float) -> list[Any]:
            """Launch commands of the steps after the first, which ``x`` may still be owed."""
            return [
                launch(
                    k.single_step, [*A, old, keep, gain, owed if i == 0 else 0.0, res, new, x, z]
                )
                for i, ((old, new), (keep, gain)) in enumerate(zip(_turns(d), steps, strict=False))
            ]

        last = d[len(steps) % 2]
        self.before = [
            launch(k.single_start, [r, 1 / theta, res, d[0], x]),
            *smooth(0.0),
            launch(k.single_subtract, [*A, last, res]),
        ]
        self.after = [
            launch(k.single_restart, [*A, r, x, 1 / theta, res, d[0]]),
            *smooth(1.0),
        ]


def _turns(pair: list[Any]):
    """Forever (old, new) and (new, old)."""
    while True:
        yield pair
        pair = pair[::-1]


def chebyshev(largest: float, degree: int) -> tuple[float, list[tuple[float, float]]]:
    """Centre theta of the interval and the (keep, gain) factors of the steps after the first."""
    low = largest / SPREAD
    theta, delta = (largest + low) / 2, (largest - low) / 2
    sigma = theta / delta
    rho, steps = 1 / sigma, []
    for _ in range(degree - 1):
        new = 1 / (2 * sigma - rho)
        steps.append((new * rho, 2 * new / delta))
        rho = new
    return theta, steps


# A smoother serves matrices whose largest eigenvalue is this near: its margin covers as much.
LIKE = 0.97


@dataclass(eq=False)
class Scaled:
    """The system with unit diagonal blocks: ``matrix`` = inv(L) A inv(L)^T, L block diagonal.

    ``largest`` is its largest eigenvalue; no number where a diagonal block is not positive.
    """

    matrix: BlockMatrix
    lower: Any
    inverse: Any
    commands: list[Any]
    eigenvalue: LargestEigenvalue
    largest: float

    def take(self, matrix: BlockMatrix) -> None:
        """Become the system of another ``matrix`` of the same pattern, in the same arrays."""
        start_warp().copy(self.matrix.values, matrix.values)
        self.refresh()

    def refresh(self) -> None:
        """Scale the numbers that the matrix has."""
        for command in self.commands:
            command.launch()
        self.largest = self.eigenvalue()


def scale(matrix: BlockMatrix) -> Scaled:
    """Scale ``matrix`` in place with the Cholesky factors of its diagonal blocks."""
    from . import kernels_krylov as k

    wp = start_warp()
    device = matrix.values.device
    lower = wp.empty(matrix.nodes, dtype=wp.mat33d, device=device)
    inverse = wp.empty(matrix.nodes, dtype=wp.mat33d, device=device)
    arrays = [matrix.rows, matrix.columns]
    launch = Recorder(matrix.nodes, device)
    commands = [
        launch(k.factor_diagonal, [*arrays, matrix.values, lower, inverse]),
        launch(k.scale_blocks, [*arrays, inverse, matrix.values]),
    ]
    system = Scaled(matrix, lower, inverse, commands, LargestEigenvalue(matrix), np.nan)
    system.refresh()
    return system


class AggregateLevel:
    """Adds P A_c^-1 P^T r to z, both of scaled unknowns; P has the rigid motions of aggregates.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes; r and z are of vec3d or,
    on a GPU, flat and single.
    """

    def __init__(
        self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray, r: Any, z: Any
    ) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        self.device = scaled.matrix.values.device
        self.coarse = coarse = coarsen(scaled.matrix, scaled.lower, points, fixed, scaled.largest)
        self.given, self.found = (
            wp.zeros(coarse.count, dtype=k.vec6d, device=self.device) for _ in range(2)
        )
        self.flat = [v.view(wp.float64).flatten() for v in (self.given, self.found)]
        if coarse.members is None:
            # Restriction, which adds to the coarse residual, and prolongation
            from . import kernels_krylov as k

            P = [self.coarse.start, self.coarse.aggregates, self.coarse.transfer]
            launch = Recorder(len(r), self.device)
            self.restrict, self.prolong = [
                launch(k.scatter, [*P, r, self.given]),
                launch(k.prolong, [*P, self.found, z]),
            ]
        else:
            self.restrict, self.prolong = self._single_launches(r, z, coarse.members)

    def _single_launches(self, r: Any, z: Any, members: tuple) -> list[Any]:
        """Restriction, which writes the coarse residual, and prolongation."""
        from . import kernels_multigrid as k

        wp, coarse = start_warp(), self.coarse
        launch = Recorder(len(z), self.device)
        given = coarse.transfer.view(wp.float64).flatten()
        transfer = wp.empty(len(given), dtype=wp.float32, device=self.device)
        self.narrow = launch(k.narrow, [given, transfer], size=len(given))
        self.narrow.launch()
        restrict = wp.launch_tiled(
            k.single_restrict,
            dim=[coarse.count],
            inputs=[*members, transfer, r, self.flat[0]],
            block_dim=BLOCK,
            device=self.device,
            record_cmd=True,
        )
        P = [coarse.start, coarse.aggregates, transfer]
        return [restrict, launch(k.single_prolong, [*P, self.flat[1], z])]

    def take(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> bool:
        """Become the level of another system of the same pattern, in the same arrays, on a GPU.

        False where it has other groups of nodes.
        """
        known = (scaled.matrix, scaled.lower, points, fixed)
        if not coarsen_again(self.coarse, *known, scaled.largest):
            return False
        self.narrow.launch()
        return True

    def apply(self) -> None:
        """Correct z by what the motions can of r."""
        if self.coarse.members is None:
            self.given.zero_()
        self.restrict.launch()
        self._solve()
        self.prolong.launch()

    def _solve(self) -> None:
        from . import kernels_multigrid as k

        if self.coarse.factor is not None:
            from scipy.linalg import cho_solve

            given, found = (v.numpy() for v in self.flat)
            found[:] = cho_solve(self.coarse.factor, given, check_finite=False)
            return
        start_warp().launch_tiled(
            k.dense_multiply,
            dim=[6 * self.coarse.count],
            inputs=[self.coarse.inverse, *self.flat],
            block_dim=BLOCK,
            device=self.device,
        )


class TwoLevel:
    """V-cycle ``z = M r`` on scaled vectors, recorded once and replayed.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes to the coarse level;
    ``degree`` is that of the smoother. With the ``edges`` of a P2 space (nodes - corners, 2) the
    linear functions of its corners are that level, else the rigid motions of aggregates.
    """

    def __init__(
        self,
        scaled: Scaled,
        points: np.ndarray,
        fixed: np.ndarray,
        degree: int = DEGREE,
        edges: np.ndarray | None = None,
    ) -> None:
        on_gpu, self.largest = scaled.matrix.values.device.is_cuda, scaled.largest
        smoother = SingleSmoother if on_gpu else Smoother
        self.smoother = smoother(scaled.matrix, scaled.largest, degree)
        self.r, self.z, self.device = self.smoother.r, self.smoother.z, self.smoother.r.device
        vectors = self.smoother.residual, self.smoother.correction
        if edges is None:
            self.level = AggregateLevel(scaled, points, fixed, *vectors)
        else:
            self.level = CornerLevel(scaled.matrix, scaled.lower, edges, fixed, *vectors)

    def take(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> bool:
        """Become the cycle of another system of the same pattern, in the same arrays, on a GPU.

        False where its polynomials or groups of nodes would be others: make a new one then.
        """
        level, smoother = self.level, self.smoother
        if not (isinstance(level, AggregateLevel) and isinstance(smoother, SingleSmoother)):
            return False
        known = LIKE * self.largest <= scaled.largest <= self.largest / LIKE
        if not known or not level.take(scaled, points, fixed):
            return False
        smoother.sliced.refresh()
        return True

    def apply(self) -> None:
        """Compute ``z`` from ``r``."""
        for command in self.smoother.before:
            command.launch()
        self.level.apply()
        for command in self.smoother.after:
            command.launch()


# Coarse space of the two-level preconditioner: smoothed rigid motions of groups of nodes.

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
    from . import kernels_multigrid as k

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
    from . import kernels_multigrid as k

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
    from . import kernels_multigrid as k

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
    from . import kernels_multigrid as k

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
    from . import kernels_multigrid as k

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


# Coarse level of quadratic tets: linear functions of their corners, their matrix factored.

# Patterns of the corners of the last spaces, by the identity of their edges.
_CORNERS_RECENT: list[tuple[np.ndarray, Pattern]] = []
_CORNERS_KEPT = 2


def corner_pattern(edges: np.ndarray, nodes: int) -> Pattern:
    """Pattern of the linear functions below a quadratic space of ``nodes`` with ``edges``."""
    from scipy.sparse import coo_array

    for known, pattern in _CORNERS_RECENT:
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
    _CORNERS_RECENT.insert(0, (edges, pattern))
    del _CORNERS_RECENT[_CORNERS_KEPT:]
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
        from . import kernels_krylov as k

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


# Inverse of a dense matrix on a device: what a GPU solves the coarse system with.


class Inversion:
    """Inverts dense symmetric positive matrices of ``size`` on one device.

    Block Gauss-Jordan: on a GPU its hundreds of launches are one graph.
    """

    def __init__(self, size: int, device: Any) -> None:
        from .kernels_multigrid import PIVOT

        wp = start_warp()
        self.matrix = wp.zeros((size, size), dtype=wp.float64, device=device)
        self.row = wp.empty((PIVOT, size), dtype=wp.float64, device=device)
        self.column = wp.empty((size, PIVOT), dtype=wp.float64, device=device)
        self.graph = None

    def __call__(self, matrix: Any) -> Any:
        """Invert ``matrix`` in place."""
        wp = start_warp()
        wp.copy(self.matrix, matrix)
        if matrix.device.is_cuda:
            self._replay()
        else:
            self._sweep()
        wp.copy(matrix, self.matrix)
        return matrix

    def _replay(self) -> None:
        wp = start_warp()
        if self.graph is None:
            with wp.ScopedCapture(device=self.matrix.device) as capture:
                self._sweep()
            self.graph = capture.graph
        wp.capture_launch(self.graph)

    def _sweep(self) -> None:
        from . import kernels_multigrid as k

        size, width = len(self.matrix), k.PIVOT
        launch = Recorder(size, self.matrix.device)
        given = [self.matrix, 0, width, self.row, self.column]
        pivot = launch(k.take_pivot, given, size=whole_blocks(width * size))
        given = [self.row, self.column, 0, width, self.matrix]
        step = launch(k.eliminate, given, size=(size, size))
        for first in range(0, size, width):
            for command, place in ((pivot, 1), (step, 2)):
                command.set_param_at_index(place, first)
                command.set_param_at_index(place + 1, min(width, size - first))
                command.launch()


@lru_cache(maxsize=4)
def inversion(size: int, device: str) -> Inversion:
    """Return what inverts matrices of this size on a device."""
    return Inversion(size, device)
