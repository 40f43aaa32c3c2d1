# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of sparse elimination: its tree, its fronts, and where their numbers go.

What walks the tree is sequential: such kernels run with one thread, on the CPU.
"""

import warp as wp

from ..elements.kernels_field import find_sorted
from ..laws.kernels_tensor import Blocks, Doubles, Ints

wp.set_module_options({"enable_backward": False, "max_unroll": 3})


@wp.kernel
def elimination_tree(
    rows: Ints,
    columns: Ints,
    order: Ints,  # node eliminated k-th
    position: Ints,  # its inverse
    ancestor: Ints,  # scratch, -1
    parent: Ints,  # -1
):
    """Parent of every position: Liu's algorithm, with compressed paths."""
    for i in range(order.shape[0]):
        node = order[i]
        for s in range(rows[node], rows[node + 1]):
            k = position[columns[s]]
            while k != -1 and k < i:
                above = ancestor[k]
                ancestor[k] = i
                if above == -1:
                    parent[k] = i
                k = above


@wp.kernel
def postorder(
    parent: Ints,
    size: Ints,  # scratch, ones
    free: Ints,  # scratch (n + 1), 0: next free place of every subtree
    place: Ints,
):
    """Place of every position once children stand right before their parents."""
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
def column_counts(
    rows: Ints,
    columns: Ints,
    order: Ints,
    position: Ints,
    parent: Ints,
    mark: Ints,  # scratch, -1
    count: Ints,  # ones: the diagonal
):
    """Entries of every column of the factor: each row is a subtree of the tree."""
    for i in range(order.shape[0]):
        node = order[i]
        mark[i] = i
        for s in range(rows[node], rows[node + 1]):
            k = position[columns[s]]
            while k < i and mark[k] != i:
                mark[k] = i
                count[k] += 1
                k = parent[k]


@wp.kernel
def front_rows(
    rows: Ints,
    columns: Ints,
    order: Ints,
    position: Ints,
    owner: Ints,
    parent: Ints,  # of supernodes
    mark: Ints,  # scratch, -1
    cursor: Ints,  # where the rows of every supernode go, or a count of them
    below: Ints,  # empty while they are counted
):
    """Rows below every supernode, ascending."""
    for i in range(order.shape[0]):
        node = order[i]
        top = owner[i]
        for s in range(rows[node], rows[node + 1]):
            k = position[columns[s]]
            if k < i:
                t = owner[k]
                while t != top and mark[t] != i:
                    mark[t] = i
                    if below.shape[0] > 0:
                        below[cursor[t]] = i
                    cursor[t] += 1
                    t = parent[t]


@wp.func
def find_local(first: Ints, start: Ints, below: Ints, t: int, row: int):
    """Local row of position ``row`` in the front of supernode t: its columns, then its rows."""
    if row < first[t + 1]:
        return row - first[t]
    return first[t + 1] - first[t] + find_sorted(below, start[t], start[t + 1], row) - start[t]


@wp.kernel
def locate_in_parent(first: Ints, start: Ints, below: Ints, parent: Ints, local: Ints):
    """Where every row of a front lies in the front of its parent."""
    t = wp.tid()
    for s in range(start[t], start[t + 1]):
        local[s] = find_local(first, start, below, parent[t], below[s])


@wp.func
def entry(k: int, r: int, row: int, column: int):
    """Offset in a panel of k columns (a block k x k, then one r x k, both by columns)."""
    if row < k:
        return column * k + row
    return k * k + column * r + row - k


@wp.kernel
def place_matrix(
    rows: Ints,
    columns: Ints,
    values: Blocks,
    position: Ints,
    owner: Ints,
    first: Ints,
    start: Ints,
    below: Ints,
    panel: Ints,
    factor: Doubles,
):
    """Write the lower triangle of a matrix into the panels of its factor."""
    node = wp.tid()
    i = position[node]
    for s in range(rows[node], rows[node + 1]):
        j = position[columns[s]]
        if j <= i:
            t = owner[j]
            k = 3 * (first[t + 1] - first[t])
            r = 3 * (start[t + 1] - start[t])
            row = 3 * find_local(first, start, below, t, i)
            column = 3 * (j - first[t])
            block = values[s]
            for b in range(3):
                for a in range(3):
                    factor[panel[t] + entry(k, r, row + a, column + b)] = block[a, b]


@wp.func
def add_rows(
    local: Ints,
    low: int,
    begin: int,
    end: int,
    node: int,
    b: int,
    source: Doubles,
    at: int,
    out: Doubles,
    to: int,
):
    """Add rows begin ... end of column (node, b) of an update to the column ``to`` of a front."""
    for other in range(begin, end):
        row = to + 3 * local[low + other]
        for a in range(3):
            if other > node or a >= b:
                out[row + a] = out[row + a] + source[at + 3 * other + a]


@wp.kernel
def extend_add(
    t: wp.int32,
    first: Ints,
    start: Ints,
    local: Ints,
    child_start: Ints,
    children: Ints,
    panel: Ints,
    update: Ints,
    stack: Doubles,
    factor: Doubles,
):
    """Clear the update of supernode t, then add those of its children to its front (lower part)."""
    k = 3 * (first[t + 1] - first[t])
    r = 3 * (start[t + 1] - start[t])
    square = panel[t]
    own = update[t]
    for column in range(r):
        for row in range(column, r):
            stack[own + column * r + row] = wp.float64(0.0)
    for e in range(child_start[t], child_start[t + 1]):
        c = children[e]
        low = start[c]
        size = start[c + 1] - low
        inner = find_sorted(local, low, start[c + 1], first[t + 1] - first[t]) - low
        if size > 0 and local[low + inner] < first[t + 1] - first[t]:
            inner += 1
        for node in range(size):
            for b in range(3):
                column = 3 * local[low + node] + b
                at = update[c] + (3 * node + b) * 3 * size
                if column < k:
                    to = square + column * k
                    below = square + k * k + column * r - k
                    add_rows(local, low, node, inner, node, b, stack, at, factor, to)
                    add_rows(local, low, inner, size, node, b, stack, at, factor, below)
                else:
                    to = own + (column - k) * r - k
                    add_rows(local, low, node, size, node, b, stack, at, stack, to)
