# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of sparse elimination: its tree, its fronts, and where their numbers go.

What walks the tree is sequential: such kernels run with one thread, on the CPU.
"""

import warp as wp

from ..elements.kernels_field import find_sorted
from ..laws.kernels_tensor import Blocks, Doubles, Ints

wp.set_module_options({"enable_backward": False, "max_unroll": 3})


@wp.struct
class Graph:
    """Pattern of a matrix as CSR; the node that is eliminated k-th, and the position of each."""

    rows: Ints
    columns: Ints
    order: Ints
    position: Ints


@wp.struct
class Fronts:
    """Tables of the supernodes, as ``Elimination`` has them; ``below`` are positions."""

    owner: Ints
    first: Ints
    start: Ints
    below: Ints
    local: Ints
    child_start: Ints
    children: Ints
    panel: Ints
    update: Ints


@wp.kernel
def elimination_tree(graph: Graph, ancestor: Ints, parent: Ints):
    """Parent of every position: Liu's algorithm, compressing paths in ``ancestor``; both are -1."""
    for i in range(graph.order.shape[0]):
        node = graph.order[i]
        for s in range(graph.rows[node], graph.rows[node + 1]):
            k = graph.position[graph.columns[s]]
            while k != -1 and k < i:
                above = ancestor[k]
                ancestor[k] = i
                if above == -1:
                    parent[k] = i
                k = above


@wp.kernel
def postorder(parent: Ints, size: Ints, free: Ints, place: Ints):
    """Place of every position once children stand right before their parents.

    ``size`` is one everywhere, ``free`` (n + 1) the next free place of every subtree, zero.
    """
    n = parent.shape[0]
    for i in range(n):
        if parent[i] >= 0:
            size[parent[i]] += size[i]
    for back in range(n):
        i = n - 1 - back
        above = parent[i]
        if above < 0:
            above = n
        free[i] = free[above]
        free[above] += size[i]
        place[i] = free[i] + size[i] - 1


@wp.kernel
def column_counts(graph: Graph, parent: Ints, mark: Ints, count: Ints):
    """Entries of every column of the factor: each row is a subtree of the tree.

    ``mark`` is -1, ``count`` one: the diagonal.
    """
    for i in range(graph.order.shape[0]):
        node = graph.order[i]
        mark[i] = i
        for s in range(graph.rows[node], graph.rows[node + 1]):
            k = graph.position[graph.columns[s]]
            while k < i and mark[k] != i:
                mark[k] = i
                count[k] += 1
                k = parent[k]


@wp.kernel
def front_rows(graph: Graph, owner: Ints, parent: Ints, mark: Ints, cursor: Ints, below: Ints):
    """Rows below every supernode, ascending; only counted where ``below`` is empty.

    ``mark`` is -1, ``cursor`` where the rows of every supernode go, ``parent`` that of supernodes.
    """
    for i in range(graph.order.shape[0]):
        node = graph.order[i]
        top = owner[i]
        for s in range(graph.rows[node], graph.rows[node + 1]):
            k = graph.position[graph.columns[s]]
            if k < i:
                t = owner[k]
                while t != top and mark[t] != i:
                    mark[t] = i
                    if below.shape[0] > 0:
                        below[cursor[t]] = i
                    cursor[t] += 1
                    t = parent[t]


@wp.func
def find_local(f: Fronts, t: int, row: int):
    """Local row of position ``row`` in the front of supernode t: its columns, then its rows."""
    width = f.first[t + 1] - f.first[t]
    if row < f.first[t + 1]:
        return row - f.first[t]
    return width + find_sorted(f.below, f.start[t], f.start[t + 1], row) - f.start[t]


@wp.kernel
def locate_in_parent(f: Fronts, parent: Ints):
    """Where every row of a front lies in the front of its parent."""
    t = wp.tid()
    for s in range(f.start[t], f.start[t + 1]):
        f.local[s] = find_local(f, parent[t], f.below[s])


@wp.func
def entry(k: int, r: int, row: int, column: int):
    """Offset in a panel of k columns (a block k x k, then one r x k, both by columns)."""
    if row < k:
        return column * k + row
    return k * k + column * r + row - k


@wp.kernel
def place_matrix(
    rows: Ints, columns: Ints, values: Blocks, position: Ints, f: Fronts, factor: Doubles
):
    """Write the lower triangle of a matrix into the panels of its factor."""
    node = wp.tid()
    i = position[node]
    for s in range(rows[node], rows[node + 1]):
        j = position[columns[s]]
        if j <= i:
            t = f.owner[j]
            k = 3 * (f.first[t + 1] - f.first[t])
            r = 3 * (f.start[t + 1] - f.start[t])
            row = 3 * find_local(f, t, i)
            column = 3 * (j - f.first[t])
            block = values[s]
            for b in range(3):
                for a in range(3):
                    factor[f.panel[t] + entry(k, r, row + a, column + b)] = block[a, b]


@wp.func
def add_rows(
    f: Fronts, low: int, begin: int, end: int, node: int, b: int,
    source: Doubles, at: int, out: Doubles, to: int,
):  # fmt: skip
    """Add rows begin ... end of column (node, b) of an update to the column ``to`` of a front."""
    for other in range(begin, end):
        row = to + 3 * f.local[low + other]
        for a in range(3):
            if other > node or a >= b:
                out[row + a] = out[row + a] + source[at + 3 * other + a]


@wp.kernel
def extend_add(t: wp.int32, f: Fronts, stack: Doubles, factor: Doubles):
    """Clear the update of supernode t, then add those of its children to its front (lower part)."""
    width = f.first[t + 1] - f.first[t]
    k = 3 * width
    r = 3 * (f.start[t + 1] - f.start[t])
    square = f.panel[t]
    own = f.update[t]
    for column in range(r):
        for row in range(column, r):
            stack[own + column * r + row] = wp.float64(0.0)
    for e in range(f.child_start[t], f.child_start[t + 1]):
        c = f.children[e]
        low = f.start[c]
        size = f.start[c + 1] - low
        inner = find_sorted(f.local, low, f.start[c + 1], width) - low
        if size > 0 and f.local[low + inner] < width:
            inner += 1
        for node in range(size):
            for b in range(3):
                column = 3 * f.local[low + node] + b
                at = f.update[c] + (3 * node + b) * 3 * size
                if column < k:
                    to = square + column * k
                    below = square + k * k + column * r - k
                    add_rows(f, low, node, inner, node, b, stack, at, factor, to)
                    add_rows(f, low, inner, size, node, b, stack, at, factor, below)
                else:
                    to = own + (column - k) * r - k
                    add_rows(f, low, node, size, node, b, stack, at, stack, to)
