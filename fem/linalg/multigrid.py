"""Two-level preconditioner: Chebyshev smoothing and a coarse space.

Its functions are smoothed rigid motions of aggregates, or linear ones of the corners of P2 tets.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ..device import Recent, Recorder, Replay, start_warp
from ..elements.assembly import BlockMatrix, Pattern, apply_supports, free_components
from ..errors import ConvergenceError
from .cholesky import CholeskyFactor, NotPositive, planned_elimination
from .krylov import BLOCK, LargestEigenvalue, SlicedMatrix, whole_blocks

logger = logging.getLogger(__name__)

# Degree of the Chebyshev smoother, which damps the upper part [largest / SPREAD, largest].
DEGREE = 3
SPREAD = 25.0


class Smoother:
    """Chebyshev polynomials of a scaled matrix, as launches before and after a coarse level.

    Of ``r``, vectors of vec3d, what is left is ``residual``, what is done ``z``; the coarse level
    corrects ``correction`` by the ``residual`` in between. With ``single`` these two are flat and
    in single precision, a thread a scalar: several times faster on a GPU.
    """

    def __init__(
        self, matrix: BlockMatrix, largest: float, degree: int = DEGREE, *, single: bool = False
    ) -> None:
        from .kernels_multigrid import DOUBLE_STEPS, SINGLE_STEPS

        wp, device, size = start_warp(), matrix.values.device, matrix.nodes
        self.r, self.z = (wp.zeros(size, dtype=wp.vec3d, device=device) for _ in range(2))
        if single:
            kernels, size = SINGLE_STEPS, 3 * size
            self.sliced = SlicedMatrix(matrix, wp.float32)
            self.sliced.refresh()
            A = self.sliced.arrays
            r, z = (v.view(wp.float64).flatten() for v in (self.r, self.z))
            res, x, *d = (wp.zeros(size, dtype=wp.float32, device=device) for _ in range(4))
        else:
            kernels, self.sliced, r, z, x = DOUBLE_STEPS, None, self.r, self.z, self.z
            A = (matrix.rows, matrix.columns, matrix.values)
            res, *d = (wp.zeros(size, dtype=wp.vec3d, device=device) for _ in range(3))
        self.residual, self.correction = res, x
        low = largest / SPREAD
        theta, delta = (largest + low) / 2, (largest - low) / 2
        launch = Recorder(size, device)
        self.before = [launch(kernels.start, [r, 1 / theta, res, d[0], x])]
        self.after = [launch(kernels.restart, [*A, r, x, 1 / theta, res, d[0]])]
        sigma = theta / delta
        rho = 1 / sigma
        for step in range(degree - 1):
            new = 1 / (2 * sigma - rho)
            factors, rho = (new * rho, 2 * new / delta), new
            for commands, restarted in ((self.before, 0.0), (self.after, 1.0)):
                owed = restarted if step == 0 else 0.0  # x has not taken in the first step yet
                inputs = [*A, d[0], *factors, owed, res, d[1], x, z]
                commands.append(launch(kernels.step, inputs))
            d.reverse()
        self.before.append(launch(kernels.subtract, [*A, d[0], res]))


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
        from . import kernels_multigrid as m

        wp = start_warp()
        self.device = device = scaled.matrix.values.device
        coarse = coarsen(scaled.matrix, scaled.lower, points, fixed, scaled.largest)
        assert coarse is not None  # it is a new one
        self.coarse = coarse
        self.load, self.solution = (
            wp.zeros(coarse.count, dtype=k.vec6d, device=device) for _ in range(2)
        )
        self.flat = [v.view(wp.float64).flatten() for v in (self.load, self.solution)]
        launch, P = Recorder(len(r), device), [coarse.start, coarse.aggregates]
        if coarse.members is None:  # restriction adds to the coarse load
            self.restrict = launch(k.scatter, [*P, coarse.transfer, r, self.load])
            self.prolong = launch(k.prolong, [*P, coarse.transfer, self.solution, z])
            return
        numbers = coarse.transfer.view(wp.float64).flatten()
        transfer = wp.empty(len(numbers), dtype=wp.float32, device=device)
        self.narrow = launch(m.narrow, [numbers, transfer], size=len(numbers))
        self.narrow.launch()
        self.restrict = wp.launch_tiled(
            m.single_restrict,
            dim=[coarse.count],
            inputs=[*coarse.members, transfer, r, self.flat[0]],
            block_dim=BLOCK,
            device=device,
            record_cmd=True,
        )
        self.prolong = launch(m.single_prolong, [*P, transfer, self.flat[1], z])

    def take(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> bool:
        """Become the level of another system of the same pattern, in the same arrays, on a GPU.

        False where it has other groups of nodes.
        """
        system = (scaled.matrix, scaled.lower, points, fixed, scaled.largest)
        if coarsen(*system, like=self.coarse) is None:
            return False
        self.narrow.launch()
        return True

    def apply(self) -> None:
        """Correct z by what the motions can of r."""
        coarse = self.coarse
        if coarse.factor is not None:
            from scipy.linalg import cho_solve

            self.load.zero_()
            self.restrict.launch()
            load, solution = (v.numpy() for v in self.flat)
            solution[:] = cho_solve(coarse.factor, load, check_finite=False)
        else:
            from .kernels_multigrid import dense_multiply

            self.restrict.launch()
            start_warp().launch_tiled(
                dense_multiply,
                dim=[6 * coarse.count],
                inputs=[coarse.inverse, *self.flat],
                block_dim=BLOCK,
                device=self.device,
            )
        self.prolong.launch()


class TwoLevel:
    """V-cycle ``z = M r`` on scaled vectors, recorded once and replayed.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes to the coarse level;
    ``degree`` is that of the smoother. With the ``edges`` of a P2 space (nodes - corners, 2) the
    linear functions of its corners are that level, ``factored`` or with a level below in turn, else
    the rigid motions of aggregates.
    """

    def __init__(
        self,
        scaled: Scaled,
        points: np.ndarray,
        fixed: np.ndarray,
        degree: int = DEGREE,
        edges: np.ndarray | None = None,
        factored: bool = True,
    ) -> None:
        on_gpu, self.largest = scaled.matrix.values.device.is_cuda, scaled.largest
        self.smoother = Smoother(scaled.matrix, scaled.largest, degree, single=on_gpu)
        self.r, self.z, self.device = self.smoother.r, self.smoother.z, self.smoother.r.device
        vectors = self.smoother.residual, self.smoother.correction
        if edges is None:
            self.level = AggregateLevel(scaled, points, fixed, *vectors)
        else:
            corners = points[: len(points) - len(edges)]
            below = None if factored and not on_gpu else corners
            self.level = CornerLevel(scaled.matrix, scaled.lower, edges, fixed, *vectors, below)

    def take(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> bool:
        """Become the cycle of another system of the same pattern, in the same arrays, on a GPU.

        False where its polynomials or groups of nodes would be others: make a new one then.
        """
        sliced = self.smoother.sliced
        if sliced is None:
            return False
        alike = LIKE * self.largest <= scaled.largest <= self.largest / LIKE
        if not alike or not self.level.take(scaled, points, fixed):
            return False
        sliced.refresh()
        return True

    def apply(self) -> None:
        """Compute ``z`` from ``r``."""
        for command in self.smoother.before:
            command.launch()
        self.level.apply()
        for command in self.smoother.after:
            command.launch()


# Boxes of the coarse space, six unknowns each: its functions are smoothed rigid motions of their
# nodes. A dense factor of 1536 takes a CPU 50 ms; a GPU inverts the matrix: fewer pay there, but of
# few nodes each, for an iteration takes small bodies as long as large ones.
BOXES = 256
BOXES_GPU = 128
NODES_PER_BOX = 100
NODES_PER_BOX_GPU = 40
# Fraction by which the diagonal of a coarse matrix is raised before a GPU inverts it: dependent
# rigid modes of small groups leave it singular to round-off.
RAISE = 1e-12

# Neighbours couple strongly when |A_ij| >= this fraction of sqrt(|A_ii| |A_jj|). Within one
# material it is 0.02 and more; across an interface it falls with the root of the contrast.
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


# Boxes of the last meshes: materials come and go on one mesh.
_RECENT_BOXES: Recent[Groups] = Recent(4)


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


def _groups(A: BlockMatrix, points: np.ndarray, free: Any) -> Groups:
    """Boxes of about equally many nodes, split where the couplings of the scaled ``A`` are weak."""
    from . import kernels_multigrid as k

    wp, device = start_warp(), A.values.device
    groups = _RECENT_BOXES.get(points, device)
    if groups is None:
        most, size = BOXES, NODES_PER_BOX
        if device.is_cuda:
            most, size = BOXES_GPU, NODES_PER_BOX_GPU
        count = min(most, max(1, len(points) // size))
        groups = make_groups(points, boxes(points, count), device)
        _RECENT_BOXES.keep(groups, points, device)
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
    A: BlockMatrix,
    lower: Any,
    points: np.ndarray,
    fixed: np.ndarray,
    largest: float,
    like: Coarse | None = None,
) -> Coarse | None:
    """Smoothed aggregation with rigid motions for the matrix ``A`` scaled by ``lower``.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes, ``largest`` is the
    largest eigenvalue of A. On a GPU a space ``like`` of another matrix of its pattern becomes that
    of this one, in the same arrays: None where its groups would be others.
    """
    from . import kernels_multigrid as k

    wp = start_warp()
    device, pattern = A.values.device, [A.rows, A.columns]
    launch, free = Recorder(A.nodes, device), free_components(fixed, device)
    groups = _groups(A, points, free)
    if like is None:
        start = wp.zeros(A.nodes + 1, dtype=wp.int32, device=device)
        launch(k.count_labels, [*pattern, groups.label, start[1:]]).launch()
        wp.utils.array_scan(start, start, inclusive=True)
        total = int(start[A.nodes :].numpy()[0])
        aggregates = wp.empty(total, dtype=wp.int32, device=device)
        transfer = wp.empty(total, dtype=k.mat36d, device=device)
        made = Coarse(groups, start, aggregates, transfer, None, len(groups.extent), None, None)
    else:
        made = like
        label, old = groups.label, like.groups.label
        if label is not old and not np.array_equal(label.numpy(), old.numpy()):
            return None
    # P = (1 - omega A) motions, and the coarse matrix P^T A P
    P = (made.start, made.aggregates, made.transfer)
    motions, omega = _motions(groups, lower, free), 4 / (3 * largest)
    launch(k.smooth, [*pattern, A.values, groups.label, motions, omega, *P]).launch()
    matrix = wp.zeros((6 * made.count, 6 * made.count), dtype=wp.float64, device=device)
    launch(k.galerkin, [*pattern, A.values, *P, matrix]).launch()
    raised = RAISE if device.is_cuda else 0.0
    launch(k.mend, [raised, matrix], size=matrix.shape).launch()
    if not device.is_cuda:
        return replace(made, factor=_raised_factor(matrix.numpy()))
    inverse = inversion(len(matrix), str(device))(matrix)
    if like is None:
        members = _members(made.start, made.aggregates, made.count)
        return replace(made, members=members, inverse=inverse)
    wp.copy(like.inverse, inverse)
    return like


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


def _raised_factor(matrix: np.ndarray):
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
    raise ConvergenceError("multigrid.stiffness_matrix")


# Threads that a GPU gives a row of the matrix when the linear functions' one is made of it.
LANES = 8
# Patterns of the corners of the last spaces, by their edges.
_RECENT_CORNERS: Recent[Pattern] = Recent(2)


def corner_pattern(edges: np.ndarray, nodes: int, device: str = "cpu") -> Pattern:
    """Pattern of the linear functions below a quadratic space of ``nodes`` with ``edges``."""
    if (kept := _RECENT_CORNERS.get(edges, device)) is not None:
        return kept
    from scipy.sparse import coo_array

    wp, corners = start_warp(), nodes - len(edges)
    own = np.arange(corners)
    i, j = np.concatenate([edges, edges[:, ::-1], np.stack([own, own], axis=1)]).T
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(corners,) * 2).tocsr()
    graph.sort_indices()
    rows = wp.array(graph.indptr, dtype=wp.int32, device=device)
    columns = wp.array(graph.indices, dtype=wp.int32, device=device)
    return _RECENT_CORNERS.keep(Pattern(rows, columns, None), edges, device)


class CornerLevel:
    """Adds P B P^T r to z; P interpolates linearly between corners, B is near (P^T A P)^-1.

    A p-multigrid: the smoother has only the middles of the edges to care for, however thin the body
    or flat its tets. A is ``matrix``, scaled by the blocks ``lower``; ``fixed`` (nodes, 3) stay 0.
    B is a factor, on the CPU, or with the ``points`` (corners, 3) [m] a V-cycle over aggregates of
    them; r and z are of vec3d or, on a GPU, flat and single.

    Raises NotPositive: If P^T A P is singular: the body is not held.
    """

    def __init__(
        self,
        matrix: BlockMatrix,
        lower: Any,
        edges: np.ndarray,
        fixed: np.ndarray,
        r: Any,
        z: Any,
        points: np.ndarray | None = None,
    ) -> None:
        from . import kernels_krylov as k
        from . import kernels_multigrid as m

        wp, device = start_warp(), matrix.values.device
        self.corners, self.points = matrix.nodes - len(edges), points
        own = np.arange(self.corners)
        both = np.concatenate([np.stack([own, own], axis=1), edges])
        ends = wp.array(both, dtype=wp.vec2i, device=device)
        self.free, transfer = (
            wp.empty(matrix.nodes, dtype=dtype, device=device) for dtype in (wp.vec3d, wp.mat33d)
        )
        pattern = corner_pattern(edges, matrix.nodes, str(device))
        values = wp.empty(len(pattern.columns), dtype=wp.mat33d, device=device)
        self.below = BlockMatrix(pattern.rows, pattern.columns, values)
        launch = Recorder(matrix.nodes, device)
        lanes = LANES if device.is_cuda else 1
        arrays = [matrix.rows, matrix.columns, matrix.values, ends, transfer]
        arrays += [pattern.rows, pattern.columns, values, lanes]
        self.commands = [
            launch(k.corner_transfers, [lower, self.free, transfer]),
            launch(k.corner_matrix, arrays, size=(matrix.nodes, lanes)),
        ]
        self._project(fixed)
        # What makes z of r: functions without arguments
        self.work: list[Callable[[], None]] = []
        self.cycle: TwoLevel | None = None
        if points is not None:
            self.system = scale(self.below)
            if np.isnan(self.system.largest):
                raise NotPositive
            cycle = self.cycle = TwoLevel(self.system, points, fixed[: self.corners])
            inverse = self.system.inverse
            if device.is_cuda:
                order = np.argsort(both, axis=None, kind="stable")
                first = np.concatenate([[0], np.cumsum(np.bincount(both.ravel()))])
                listed = [wp.array(x, dtype=int, device=device) for x in (first, order // 2)]
                restrict = wp.launch_tiled(
                    m.single_restrict_to_corners,
                    dim=[self.corners],
                    inputs=[*listed, transfer, inverse, r, cycle.r],
                    block_dim=k.SLICE,
                    device=device,
                    record_cmd=True,
                )
                inputs = [ends, transfer, inverse, cycle.z, z]
                prolong = launch(m.single_prolong_from_corners, inputs)
                self.work = [restrict.launch, cycle.apply, prolong.launch]
                return
        load, solution = (wp.zeros(self.corners, dtype=wp.vec3d, device=device) for _ in range(2))
        restrict = launch(k.restrict_to_corners, [ends, transfer, r, load])
        prolong = launch(k.prolong_from_corners, [ends, transfer, solution, z])
        if self.cycle is None:
            factor = CholeskyFactor(self.below, planned_elimination(pattern))
            between = [lambda: np.copyto(solution.numpy(), factor.solve(load.numpy()))]
        else:
            launch = Recorder(self.corners, device)
            scaling = launch(k.block_multiply, [inverse, load, False, cycle.r])
            back = launch(k.block_multiply, [inverse, cycle.z, True, solution])
            between = [scaling.launch, cycle.apply, back.launch]
        self.work = [load.zero_, restrict.launch, *between, prolong.launch]

    def _project(self, fixed: np.ndarray) -> None:
        """Make P and P^T A P of the numbers that A has."""
        start_warp().copy(self.free, free_components(fixed, self.free.device))
        self.below.values.zero_()
        for command in self.commands:
            command.launch()
        apply_supports(self.below, np.zeros((self.corners, 3), dtype=bool))  # empty rows get a 1

    def take(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> bool:
        """Become the level of another system of the same pattern, in the same arrays, on a GPU.

        False where the level below would be another.
        """
        assert self.cycle is not None  # on a GPU
        assert self.points is not None
        self._project(fixed)
        self.system.refresh()
        return self.cycle.take(self.system, self.points, fixed[: self.corners])

    def apply(self) -> None:
        """Correct z by what the linear functions can of r."""
        for each in self.work:
            each()


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
        self.sweep = Replay(self._sweep, self.matrix.device)

    def __call__(self, matrix: Any) -> Any:
        """Invert ``matrix`` in place."""
        wp = start_warp()
        wp.copy(self.matrix, matrix)
        self.sweep()
        wp.copy(matrix, self.matrix)
        return matrix

    def _sweep(self) -> None:
        from . import kernels_multigrid as k

        size, width = len(self.matrix), k.PIVOT
        launch = Recorder(size, self.matrix.device)
        inputs = [self.matrix, 0, width, self.row, self.column]
        pivot = launch(k.take_pivot, inputs, size=whole_blocks(width * size))
        inputs = [self.row, self.column, 0, width, self.matrix]
        step = launch(k.eliminate, inputs, size=(size, size))
        for first in range(0, size, width):
            for command, place in ((pivot, 1), (step, 2)):
                command.set_param_at_index(place, first)
                command.set_param_at_index(place + 1, min(width, size - first))
                command.launch()


@lru_cache(maxsize=4)
def inversion(size: int, device: str) -> Inversion:
    """Return what inverts matrices of this size on a device."""
    return Inversion(size, device)
