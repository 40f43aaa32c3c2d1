# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of the V-cycle as a GPU runs it: in single precision, a thread a scalar.

The cycle only shapes a search direction of CG, whose residual stays double: half the bytes, and as
many iterations. Vectors and blocks are flat: 9 numbers a block of A, 18 of P. The coarse matrix is
inverted, in double precision.
"""

import warp as wp

from .kernels_coarse import RANK, mat66d
from .kernels_solver import vec6d

wp.set_module_options({"enable_backward": False, "max_unroll": 6})


@wp.kernel
def narrow(given: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float32)):
    i = wp.tid()
    out[i] = wp.float32(given[i])


@wp.func
def scalar_row_times(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float32),
    x: wp.array(dtype=wp.float32),
    i: int,
) -> wp.float32:
    """Scalar row i of A x."""
    node = i // 3
    c = 3 * (i - 3 * node)
    total = wp.float32(0.0)
    for s in range(rows[node], rows[node + 1]):
        j = 3 * columns[s]
        k = 9 * s + c
        total += values[k] * x[j] + values[k + 1] * x[j + 1] + values[k + 2] * x[j + 2]
    return total


@wp.kernel
def single_start(
    b: wp.array(dtype=wp.float64),
    scale: wp.float32,
    r: wp.array(dtype=wp.float32),
    d: wp.array(dtype=wp.float32),
    x: wp.array(dtype=wp.float32),
):
    """First Chebyshev step from x = 0."""
    i = wp.tid()
    here = wp.float32(b[i])
    r[i] = here
    d[i] = scale * here
    x[i] = scale * here


@wp.kernel
def single_restart(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float32),
    b: wp.array(dtype=wp.float64),
    x: wp.array(dtype=wp.float32),
    scale: wp.float32,
    r: wp.array(dtype=wp.float32),
    d: wp.array(dtype=wp.float32),
):
    """First Chebyshev step from a given x, which takes it in with the next: others read it now."""
    i = wp.tid()
    res = wp.float32(b[i]) - scalar_row_times(rows, columns, values, x, i)
    r[i] = res
    d[i] = scale * res


@wp.kernel
def single_step(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float32),
    old: wp.array(dtype=wp.float32),
    keep: wp.float32,
    scale: wp.float32,
    owed: wp.float32,
    r: wp.array(dtype=wp.float32),
    d: wp.array(dtype=wp.float32),
    x: wp.array(dtype=wp.float32),
    z: wp.array(dtype=wp.float64),
):
    """Chebyshev step: r -= A old, d = keep old + scale r, x += d + ``owed`` old; z is x."""
    i = wp.tid()
    res = r[i] - scalar_row_times(rows, columns, values, old, i)
    r[i] = res
    change = keep * old[i] + scale * res
    d[i] = change
    here = x[i] + owed * old[i] + change
    x[i] = here
    z[i] = wp.float64(here)


@wp.kernel
def single_subtract(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float32),
    d: wp.array(dtype=wp.float32),
    r: wp.array(dtype=wp.float32),
):
    """Update r -= A d."""
    i = wp.tid()
    r[i] = r[i] - scalar_row_times(rows, columns, values, d, i)


@wp.kernel
def single_restrict(
    first: wp.array(dtype=wp.int32),
    member: wp.array(dtype=wp.int32),
    owner: wp.array(dtype=wp.int32),
    transfer: wp.array(dtype=wp.float32),
    r: wp.array(dtype=wp.float32),
    coarse: wp.array(dtype=wp.float64),
):
    """Product P^T r, one block of threads an aggregate: no two of them write to one place."""
    a, lane = wp.tid()
    total = vec6d()
    for m in range(first[a] + lane, first[a + 1], wp.block_dim()):
        i = 3 * owner[m]
        t = 18 * member[m]
        for c in range(6):
            part = transfer[t + c] * r[i] + transfer[t + 6 + c] * r[i + 1]
            total[c] = total[c] + wp.float64(part + transfer[t + 12 + c] * r[i + 2])
    for c in range(6):
        wp.tile_store(coarse, wp.tile_sum(wp.tile(total[c])), offset=6 * a + c)


@wp.kernel
def single_prolong(
    start: wp.array(dtype=wp.int32),
    aggregates: wp.array(dtype=wp.int32),
    transfer: wp.array(dtype=wp.float32),
    coarse: wp.array(dtype=wp.float64),
    x: wp.array(dtype=wp.float32),
):
    """Add P ``coarse`` to ``x``."""
    i = wp.tid()
    node = i // 3
    c = i - 3 * node
    total = x[i]
    for s in range(start[node], start[node + 1]):
        a = 6 * aggregates[s]
        t = 18 * s + 6 * c
        for k in range(6):
            total += transfer[t + k] * wp.float32(coarse[a + k])
    x[i] = total


@wp.kernel
def dense_multiply(
    matrix: wp.array2d(dtype=wp.float64),
    x: wp.array(dtype=wp.float64),
    y: wp.array(dtype=wp.float64),
):
    """Product y = matrix x, one block of threads a row."""
    i, lane = wp.tid()
    total = wp.float64(0.0)
    for k in range(lane, x.shape[0], wp.block_dim()):
        total += matrix[i, k] * x[k]
    wp.tile_store(y, wp.tile_sum(wp.tile(total)), offset=i)


@wp.func
def inverted(A: mat66d) -> mat66d:
    """Inverse of a symmetric positive block by sweeps, zero where a row depends on those above."""
    S = mat66d(A)
    for k in range(6):
        column = vec6d()
        pivot = S[k, k]
        if pivot > RANK * A[k, k]:
            for i in range(6):
                column[i] = S[i, k] / pivot
            for i in range(6):
                for j in range(6):
                    if i != k and j != k:
                        S[i, j] = S[i, j] - column[i] * S[k, j]
            column[k] = -wp.float64(1.0) / pivot
        for i in range(6):
            S[i, k] = column[i]
            S[k, i] = column[i]
    return -S


@wp.kernel
def take_pivot(
    matrix: wp.array2d(dtype=wp.float64),
    k: wp.int32,
    row: wp.array2d(dtype=wp.float64),
    column: wp.array2d(dtype=wp.float64),
):
    """Block Gauss-Jordan: ``row`` = pivot^-1 times block row k, ``column`` = block column k."""
    c = wp.tid()
    pivot = mat66d()
    for a in range(6):
        for b in range(6):
            pivot[a, b] = matrix[6 * k + a, 6 * k + b]
    inverse = inverted(pivot)
    inside = c // 6 == k
    for a in range(6):
        total = wp.float64(0.0)
        for b in range(6):
            if inside:
                total = inverse[a, c - 6 * k]
            else:
                total += inverse[a, b] * matrix[6 * k + b, c]
        row[a, c] = total
        column[c, a] = matrix[c, 6 * k + a]


@wp.kernel
def eliminate(
    row: wp.array2d(dtype=wp.float64),
    column: wp.array2d(dtype=wp.float64),
    k: wp.int32,
    matrix: wp.array2d(dtype=wp.float64),
):
    """Block Gauss-Jordan: one step towards the inverse of ``matrix``, in place."""
    i, j = wp.tid()
    if i // 6 == k:
        matrix[i, j] = row[i - 6 * k, j]
        return
    total = matrix[i, j]
    if j // 6 == k:
        total = wp.float64(0.0)
    for a in range(6):
        total -= column[i, a] * row[a, j]
    matrix[i, j] = total
