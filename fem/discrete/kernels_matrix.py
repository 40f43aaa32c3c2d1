# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of block matrices: pattern, where an element's blocks go, products, supports."""

import warp as wp

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


@wp.kernel
def sorted_rows(
    start: wp.array(dtype=wp.int32),  # (nodes + 1), into `incident`
    incident: wp.array(dtype=wp.int32),  # elements around every node
    elements: wp.array2d(dtype=wp.int32),
    scratch: wp.array(dtype=wp.int32),  # room for all neighbours, with repetitions
    count: wp.array(dtype=wp.int32),
):
    """Sorted distinct neighbours of every node, by insertion."""
    i = wp.tid()
    size = elements.shape[1]
    base = start[i] * size + i
    n = int(1)  # noqa: RUF046, UP018 (a plain 1 is a constant to warp)
    scratch[base] = i  # the diagonal exists even for a node of no element
    for s in range(start[i], start[i + 1]):
        e = incident[s]
        for k in range(size):
            j = elements[e, k]
            p = n
            while p > 0 and scratch[base + p - 1] > j:
                p -= 1
            if p == 0 or scratch[base + p - 1] != j:
                q = n
                while q > p:
                    scratch[base + q] = scratch[base + q - 1]
                    q -= 1
                scratch[base + p] = j
                n += 1
    count[i] = n


@wp.kernel
def copy_rows(
    start: wp.array(dtype=wp.int32),
    size: wp.int32,
    scratch: wp.array(dtype=wp.int32),
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    for k in range(rows[i + 1] - rows[i]):
        columns[rows[i] + k] = scratch[start[i] * size + i + k]


@wp.func
def find_slot(rows: wp.array(dtype=wp.int32), columns: wp.array(dtype=wp.int32), i: int, j: int):
    """Position of column j in the sorted row i."""
    lo = rows[i]
    hi = rows[i + 1] - 1
    while lo < hi:
        mid = (lo + hi) // 2
        if columns[mid] < j:
            lo = mid + 1
        else:
            hi = mid
    return lo


@wp.kernel
def element_slots(
    elements: wp.array2d(dtype=wp.int32),
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    slots: wp.array2d(dtype=wp.int32),  # (tets, size * size)
):
    t = wp.tid()
    size = elements.shape[1]
    for a in range(size):
        for b in range(size):
            slots[t, a * size + b] = find_slot(rows, columns, elements[t, a], elements[t, b])


@wp.kernel
def add_diagonal(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.mat33d),
    values: wp.array(dtype=wp.mat33d),
):
    i = wp.tid()
    s = find_slot(rows, columns, i, i)
    values[s] = values[s] + blocks[i]


@wp.kernel
def add_diagonal_numbers(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    numbers: wp.array(dtype=wp.vec3d),
    values: wp.array(dtype=wp.mat33d),
):
    i = wp.tid()
    s = find_slot(rows, columns, i, i)
    values[s] = values[s] + wp.diag(numbers[i])


@wp.kernel
def add_pairs(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    i: wp.array(dtype=wp.int32),
    j: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.mat33d),
    values: wp.array(dtype=wp.mat33d),
):
    n = wp.tid()
    wp.atomic_add(values, find_slot(rows, columns, i[n], j[n]), blocks[n])


@wp.kernel
def lift_fixed(fixed: wp.array(dtype=wp.uint8), free: wp.array(dtype=wp.float64)):
    i = wp.tid()
    free[i] = wp.float64(1.0) - wp.float64(fixed[i])


@wp.kernel
def fix_rows(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    free: wp.array(dtype=wp.vec3d),  # 1 where free, 0 where prescribed
    values: wp.array(dtype=wp.mat33d),
):
    """Drop prescribed rows and columns; their own diagonal entry stays, to keep the scale.

    A node of no element has a zero row: it gets a 1, and stays where it is.
    """
    i = wp.tid()
    all = wp.float64(3.0)
    mine = wp.length_sq(free[i])
    for s in range(rows[i], rows[i + 1]):
        j = columns[s]
        if i == j or mine < all or wp.length_sq(free[j]) < all:
            block = values[s]
            for a in range(3):
                for b in range(3):
                    if i != j or a != b:
                        block[a, b] = block[a, b] * free[i][a] * free[j][b]
                if i == j and block[a, a] == wp.float64(0.0):
                    block[a, a] = wp.float64(1.0)
            values[s] = block


@wp.func
def row_times(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    x: wp.array(dtype=wp.vec3d),
    i: int,
) -> wp.vec3d:
    """Row i of A x, two blocks at a time: on a GPU their loads overlap."""
    end = rows[i + 1]
    s = rows[i]
    even = wp.vec3d()
    odd = wp.vec3d()
    while s + 1 < end:
        even += values[s] * x[columns[s]]
        odd += values[s + 1] * x[columns[s + 1]]
        s += 2
    if s < end:
        even += values[s] * x[columns[s]]
    return even + odd


@wp.kernel
def multiply_scalars(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float64),
    x: wp.array(dtype=wp.float64),
    y: wp.array(dtype=wp.float64),
):
    """Product y = A x, a thread a scalar: threads of a GPU then read what lies together."""
    i = wp.tid()
    node = i // 3
    c = 3 * (i - 3 * node)
    total = wp.float64(0.0)
    for s in range(rows[node], rows[node + 1]):
        j = 3 * columns[s]
        k = 9 * s + c
        total += values[k] * x[j] + values[k + 1] * x[j + 1] + values[k + 2] * x[j + 2]
    y[i] = total


@wp.kernel
def multiply(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    x: wp.array(dtype=wp.vec3d),
    y: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    y[i] = row_times(rows, columns, values, x, i)
