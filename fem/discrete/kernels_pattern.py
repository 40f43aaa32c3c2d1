# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of the matrix pattern: which nodes couple, and where an element's blocks go."""

import warp as wp

wp.set_module_options({"enable_backward": False})


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
