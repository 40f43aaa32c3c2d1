"""Sparse Cholesky factor of a block matrix: dense fronts, LAPACK inside them."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ..device import Recent, Recorder, start_warp
from ..elements.assembly import BlockMatrix, Pattern
from ..errors import ConvergenceError
from ..note import Note


class NotPositive(ConvergenceError):
    """A pivot is not positive: the matrix is not, or it is singular."""


class CholeskyFactor:
    """L with P A P^T = L L^T, by the multifrontal method (Duff & Reid 1983).

    Every supernode adds its children's updates to its columns, factors them and leaves an update
    to its parent: nearly all arithmetic is in three routines of LAPACK and BLAS.

    matrix: Symmetric positive, on the CPU.
    plan: Elimination of its pattern.
    Raises NotPositive: If a pivot is not positive.
    """

    def __init__(self, matrix: BlockMatrix, plan: Elimination) -> None:
        from scipy.linalg.blas import dsyrk, dtrsm  # type: ignore  (by f2py)
        from scipy.linalg.lapack import dpotrf  # type: ignore  (by f2py)

        from . import kernels_cholesky as k

        wp = start_warp()
        self.plan = plan
        # By numpy: what is never written costs nothing, and large pages hold it.
        numbers = wp.array(np.zeros(plan.entries), dtype=wp.float64, device="cpu", copy=False)
        fronts = plan.fronts
        inputs = [matrix.rows, matrix.columns, matrix.values, plan.position, fronts, numbers]
        wp.launch(k.place_matrix, matrix.nodes, inputs=inputs, device="cpu")
        self._numbers = numbers  # the panels are views of it
        # Offsets of the diagonal of the factor
        first = 3 * fronts.first.numpy()
        width, panel = np.diff(first), fronts.panel.numpy()[:-1]
        along = np.arange(first[-1]) - np.repeat(first[:-1], width)
        self._diagonal = np.repeat(panel, width) + along * np.repeat(width + 1, width)
        self._before = numbers.numpy()[self._diagonal]
        # Of every supernode: square and lower part, columns from ... to, rows; of scalars
        start, ends, views = fronts.start.numpy(), fronts.panel.numpy(), numbers.numpy()
        below = (3 * fronts.below.numpy()[:, None] + np.arange(3)).ravel()
        self._panels: list[tuple[Any, Any, int, int, Any]] = []
        for t, k_ in enumerate(width):
            low, high, middle = 3 * start[t], 3 * start[t + 1], ends[t] + k_ * k_
            square = views[ends[t] : middle].reshape(k_, k_).T
            lower = views[middle : ends[t + 1]].reshape(k_, high - low).T
            own = int(first[t]), int(first[t + 1])
            self._panels.append((square, lower, *own, below[low:high]))
        stack = wp.empty(plan.stack, dtype=wp.float64, device="cpu")
        gather = Recorder(1, "cpu")(k.extend_add, [0, fronts, stack, numbers])
        updates, place = stack.numpy(), fronts.update.numpy()
        for t, (square, lower, *_) in enumerate(self._panels):
            gather.set_param_at_index(0, t)
            gather.launch()
            _, failed = dpotrf(square, lower=1, clean=0, overwrite_a=1)
            if failed:
                raise NotPositive(Note("cholesky.pivot_supernode", failed=failed, t=t))
            r = len(lower)
            if r:
                dtrsm(1.0, square, lower, side=1, lower=1, trans_a=1, overwrite_b=1)
                own = updates[place[t] : place[t] + r * r].reshape(r, r).T
                dsyrk(-1.0, lower, beta=1.0, c=own, lower=1, overwrite_c=1)
        if not np.isfinite(numbers.numpy()[self._diagonal]).all():  # LAPACK lets NaN pass
            raise NotPositive(Note("cholesky.matrix_entries"))

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot, as a share of its diagonal entry in A."""
        pivots = self._numbers.numpy()[self._diagonal] ** 2
        return float((pivots / self._before).min())

    def solve(self, b: Float[np.ndarray, "nodes 3 *vectors"]) -> Float[np.ndarray, "..."]:
        """Solve A x = b for one or more right-hand sides, shape (nodes, 3) or (nodes, 3, n)."""
        from scipy.linalg.blas import dgemv, dtrsm, dtrsv  # type: ignore  (by f2py)

        order = self.plan.order.numpy()
        x = b[order].reshape(3 * len(order), *b.shape[2:])
        if b.ndim == 2:
            for square, lower, low, high, rows in self._panels:
                own = dtrsv(square, x[low:high], lower=1, overwrite_x=1)
                if len(rows):
                    x[rows] -= dgemv(1.0, lower, own)
            for square, lower, low, high, rows in reversed(self._panels):
                own = x[low:high]
                if len(rows):
                    dgemv(-1.0, lower, x[rows], beta=1.0, y=own, trans=1, overwrite_y=1)
                dtrsv(square, own, lower=1, trans=1, overwrite_x=1)
        else:
            for square, lower, low, high, rows in self._panels:
                own = x[low:high]
                dtrsm(1.0, square, own.T, side=1, lower=1, trans_a=1, overwrite_b=1)
                if len(rows):
                    x[rows] -= lower @ own
            for square, lower, low, high, rows in reversed(self._panels):
                own = x[low:high]
                if len(rows):
                    own -= lower.T @ x[rows]
                dtrsm(1.0, square, own.T, side=1, lower=1, overwrite_b=1)
        out = np.empty_like(b)
        out[order] = x.reshape(b.shape)
        return out


# Factors of the last matrices, by digests of their values: statics and modes share one.
_RECENT: list[tuple[bytes, CholeskyFactor]] = []
_KEPT = 2
KEPT_ENTRIES = 100_000_000  # 800 MB: beyond, only the last is kept


def find_factor(matrix: BlockMatrix, plan: Elimination) -> CholeskyFactor | None:
    """Factor of ``matrix`` if one of the last ones is of the very same values."""
    return _found(_digest(matrix), plan)


def cached_factor(matrix: BlockMatrix, plan: Elimination) -> CholeskyFactor:
    """Factor of ``matrix``, made only if the last ones were not of the very same values."""
    digest = _digest(matrix)
    if (known := _found(digest, plan)) is not None:
        return known
    del _RECENT[_KEPT - 1 :]  # room for the new one is made before it is
    while _RECENT and plan.entries + sum(f.plan.entries for _, f in _RECENT) > KEPT_ENTRIES:
        _RECENT.pop()
    factor = CholeskyFactor(matrix, plan)
    _RECENT.insert(0, (digest, factor))
    return factor


def _found(digest: bytes, plan: Elimination) -> CholeskyFactor | None:
    return next((f for kept, f in _RECENT if f.plan is plan and kept == digest), None)


def _digest(matrix: BlockMatrix) -> bytes:
    return sha256(np.ascontiguousarray(matrix.values.numpy()).data).digest()


# Nested dissection, supernodes and their fronts.
#
# A supernode joins its parent while the zeros that it brings stay below this part of the entries:
# (columns of nodes, part). Few columns cost more in calls than in arithmetic.
JOIN = ((6, 1.0), (12, 0.4), (32, 0.1), (64, 0.05), (np.inf, 0.02))
# Columns of nodes beyond which a supernode is cut: the square of its columns is kept whole.
WIDEST = 96


@dataclass(frozen=True, eq=False)
class Elimination:
    """Order and fronts of a pattern, in blocks of one node; device arrays of warp on the CPU.

    order, position: Node that is eliminated k-th, and its inverse, shape (nodes,).
    fronts: Of the supernodes, as kernels take them.
        owner, first: Supernode of every position (nodes,), and where each begins (supernodes + 1).
        start, below: Positions below the columns of every supernode, ascending, and where they
            begin (supernodes + 1).
        local: Place of each of ``below`` in the front of the parent.
        child_start, children: Tree of the supernodes.
        panel, update: Where the columns of every supernode begin in the factor (supernodes + 1),
            and what is left to its parent in the stack of updates.
    stack, entries: Length of that stack; numbers in the factor. Beyond 2^31 of either ``panel`` and
        ``update``, int32, are void, and no factor can be made.
    operations: Multiplications and additions of the factorisation.
    """

    order: Any
    position: Any
    fronts: Any
    stack: int
    entries: int
    operations: float


def _ints(values: Any) -> Any:
    wp = start_warp()
    return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=wp.int32, device="cpu")


def _walk(kernel: Any, *inputs: Any) -> None:
    start_warp().launch(kernel, 1, inputs=list(inputs), device="cpu")


def dissect(rows: np.ndarray, columns: np.ndarray) -> Int[np.ndarray, "nodes"]:
    """Nested dissection of the graph of a pattern by METIS: node eliminated k-th."""
    import pymetis

    count = len(rows) - 1
    owner = np.repeat(np.arange(count), np.diff(rows))
    off = owner != columns
    starts = np.concatenate([[0], np.cumsum(np.bincount(owner[off], minlength=count))])
    if not off.any():
        return np.arange(count)
    graph = pymetis.CSRAdjacency(starts.astype(np.int32), columns[off].astype(np.int32))
    return np.array(pymetis.nested_dissection(graph)[0], dtype=np.int64)


def dissect_edges(edges: Int[np.ndarray, "edges 2"], count: int) -> Int[np.ndarray, "nodes"]:
    """Order of a P2 space from that of its corners.

    A separator of the corners' graph and the edges inside it separate the quadratic nodes too: an
    edge stands right before the first of its ends. The graph is eight times smaller.
    """
    from scipy.sparse import coo_array

    corners = count - len(edges)
    both = np.concatenate([edges, edges[:, ::-1]])
    ones = np.ones(len(both), dtype=np.int8)
    graph = coo_array((ones, tuple(both.T)), shape=(corners, corners)).tocsr()
    position = np.empty(corners, dtype=np.int64)
    position[dissect(graph.indptr, graph.indices)] = np.arange(corners)
    ends = position[edges]
    before = np.concatenate([position, ends.min(axis=1)])
    after = np.concatenate([np.full(corners, corners), ends.max(axis=1)])
    return np.lexsort((after, before))


# Eliminations of the last patterns: the values come and go.
_RECENT_PLANS: Recent[Elimination] = Recent(4)


def planned_elimination(
    matrix: BlockMatrix | Pattern, edges: Int[np.ndarray, "edges 2"] | None = None
) -> Elimination:
    """``plan_elimination``, kept for the next matrix of the same pattern."""
    plan = _RECENT_PLANS.get(matrix.columns)
    return plan or _RECENT_PLANS.keep(plan_elimination(matrix, edges), matrix.columns)


def plan_elimination(
    matrix: BlockMatrix | Pattern, edges: Int[np.ndarray, "edges 2"] | None = None
) -> Elimination:
    """Order, supernodes and fronts of the pattern of ``matrix``.

    ``edges``: the corner nodes that the last nodes lie between, of a P2 space.
    """
    from . import kernels_cholesky as k

    graph, fronts, count = k.Graph(), k.Fronts(), len(matrix.rows) - 1
    graph.rows, graph.columns = (_ints(a.numpy()) for a in (matrix.rows, matrix.columns))
    if edges is None or not len(edges):
        order = dissect(graph.rows.numpy(), graph.columns.numpy())
    else:
        order = dissect_edges(edges, count)
    none = np.full(count, -1)
    graph.order, graph.position = _ints(order), _ints(np.argsort(order))
    parent, place = _ints(none), _ints(none)
    _walk(k.elimination_tree, graph, _ints(none), parent)
    _walk(k.postorder, parent, _ints(none + 2), _ints(np.zeros(count + 1)), place)
    place, up = place.numpy(), parent.numpy()
    order = order[np.argsort(place)]
    graph.order, graph.position = _ints(order), _ints(np.argsort(order))
    tree = none.copy()
    tree[place] = np.where(up >= 0, place[up], -1)
    counts = _ints(none + 2)
    _walk(k.column_counts, graph, _ints(tree), _ints(none), counts)
    first = join_supernodes(tree, counts.numpy())
    supernodes = len(first) - 1
    owner = np.repeat(np.arange(supernodes), np.diff(first))
    above = tree[first[1:] - 1]
    parent = np.where(above >= 0, owner[above], -1)
    fronts.owner, fronts.first, up = _ints(owner), _ints(first), _ints(parent)
    mark, heights = np.full(supernodes, -1), _ints(np.zeros(supernodes))
    _walk(k.front_rows, graph, fronts.owner, up, _ints(mark), heights, _ints([]))
    start = np.concatenate([[0], np.cumsum(heights.numpy())])
    fronts.start, below = _ints(start), _ints(np.zeros(start[-1]))
    _walk(k.front_rows, graph, fronts.owner, up, _ints(mark), _ints(start[:-1]), below)
    fronts.below, fronts.local = below, _ints(np.zeros(start[-1]))
    start_warp().launch(k.locate_in_parent, supernodes, inputs=[fronts, up], device="cpu")
    k_, r_ = 3 * np.diff(first).astype(np.int64), 3 * np.diff(start).astype(np.int64)
    panel = np.concatenate([[0], np.cumsum(k_ * (k_ + r_))])
    has = parent >= 0
    child_start = np.concatenate([[0], np.cumsum(np.bincount(parent[has], minlength=supernodes))])
    fronts.child_start = _ints(child_start)
    fronts.children = _ints(np.flatnonzero(has)[np.argsort(parent[has], kind="stable")])
    update, stack = _stack(parent, r_)
    fronts.panel, fronts.update = _ints(panel), _ints(update)
    operations = float((k_**3 / 3 + k_**2 * r_ + k_.astype(float) * r_**2).sum())
    return Elimination(graph.order, graph.position, fronts, stack, int(panel[-1]), operations)


def join_supernodes(
    parent: Int[np.ndarray, "n"], counts: Int[np.ndarray, "n"]
) -> Int[np.ndarray, "_"]:
    """First columns of the supernodes, and n at the end.

    Columns of one structure are one; a supernode right before its parent joins it for few zeros.
    ``parent`` is the elimination tree in postorder, ``counts`` the entries of every column.
    """
    count = len(parent)
    single = np.bincount(parent[parent >= 0], minlength=count) == 1
    chained = (parent[:-1] == np.arange(1, count)) & (counts[:-1] == counts[1:] + 1) & single[1:]
    starts = np.flatnonzero(np.concatenate([[True], ~chained])).tolist()
    up = parent.tolist()
    groups: list[tuple[int, int, int, int]] = []  # begin, end, height of the front, true entries
    for begin, end in zip(starts, [*starts[1:], count], strict=True):
        height = int(counts[begin])
        true = _trapezoid(end - begin, height)
        while groups and begin <= up[groups[-1][1] - 1] < end:
            low, middle, _, inner = groups[-1]
            width, tall = end - low, height + middle - low
            fraction = next(s for most, s in JOIN if width <= most)
            if _trapezoid(width, tall) > (1 + fraction) * (true + inner):
                break
            begin, height, true = low, tall, true + inner
            groups.pop()
        groups.append((begin, end, height, true))
    cuts = []
    for begin, end, *_ in groups:  # equal pieces, ``WIDEST`` at most
        pieces = -(-(end - begin) // WIDEST)
        cuts += [begin + (end - begin) * piece // pieces for piece in range(pieces)]
    return np.array([*cuts, count])


def _trapezoid(columns: int, rows: int) -> int:
    """Entries of the first ``columns`` of a lower triangle of ``rows``."""
    return columns * rows - columns * (columns - 1) // 2


def _stack(parent: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, int]:
    """Where the update of every supernode lies, and the length of both stacks together.

    A front is made from its children's updates: they lie on one stack, its own goes to the other.
    Even depths have one and odd depths the other, so that neither moves.
    """
    count = len(parent)
    depth = np.zeros(count, dtype=np.int64)
    for t in range(count - 1, -1, -1):
        if parent[t] >= 0:
            depth[t] = depth[parent[t]] + 1
    side, sizes = (depth % 2).tolist(), (heights.astype(np.int64) ** 2).tolist()
    above, up = [0] * count, parent.tolist()  # total of the children's updates
    top, most, update = [0, 0], [0, 0], np.zeros(count, dtype=np.int64)
    for t in range(count):
        top[1 - side[t]] -= above[t]
        update[t] = top[side[t]]
        top[side[t]] += sizes[t]
        most[side[t]] = max(most[side[t]], top[side[t]])
        if up[t] >= 0:
            above[up[t]] += sizes[t]
    update[np.array(side, dtype=bool)] += most[0]
    return update, most[0] + most[1]
