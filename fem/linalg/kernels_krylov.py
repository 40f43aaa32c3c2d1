# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of Krylov methods: products, inner ones too, conjugate gradients, Lanczos."""

from typing import Any

import warp as wp

from ..elements.kernels_field import find_slot
from ..laws.kernels_tensor import Blocks, Doubles, Ints, Singles, Vectors

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

# Scalars of CG, kept on the device: one array of these.
RZ = wp.constant(0)
PAP = wp.constant(1)
RZ_NEW = wp.constant(2)
NORM2 = wp.constant(3)
TARGET2 = wp.constant(4)
ENDED = wp.constant(5)
DONE = wp.constant(6)
CURVED = wp.constant(7)
# (the last three: residual at the end, iterations done, whether negative curvature was met).
# Whole numbers of CG: whether it goes on, iterations done, most iterations.
GO = wp.constant(0)
COUNT = wp.constant(1)
LIMIT = wp.constant(2)


# Nodes of a slice: the threads of a GPU's warp then read numbers that lie together.
SLICE = wp.constant(32)


@wp.kernel
def slice_columns(rows: Ints, columns: Ints, base: Ints, sliced: Ints):
    """First scalar of the column of every block; a block that only fills a slice has its row's."""
    i = wp.tid()
    part = i // SLICE
    for s in range(base[part + 1] - base[part]):
        j = i
        if rows[i] + s < rows[i + 1]:
            j = columns[rows[i] + s]
        sliced[SLICE * (base[part] + s) + i - SLICE * part] = 3 * j


@wp.kernel
def slice_values(rows: Ints, base: Ints, values: Doubles, sliced: wp.array(dtype=Any)):
    """Numbers of the blocks, a thread a scalar row: s-th block, column of it, row of the slice."""
    i = wp.tid()
    node = i // 3
    part = node // SLICE
    lane = i - 3 * SLICE * part
    first = 9 * rows[node] + 3 * (i - 3 * node)
    for s in range(base[part + 1] - base[part]):
        for c in range(3):
            value = wp.float64(0.0)
            if rows[node] + s < rows[node + 1]:
                value = values[first + 9 * s + c]
            sliced[3 * SLICE * (3 * (base[part] + s) + c) + lane] = sliced.dtype(value)


# Scalar row i of A x. Warp's own indexing costs as much again as the reading.
_ROW_TIMES = """
    const int part = i / 96, lane = i - 96 * part;
    const int first = base.data[part], count = base.data[part + 1] - first;
    const int* __restrict__ column = columns.data + 32 * size_t(first) + lane / 3;
    const auto* __restrict__ a = values.data + 288 * size_t(first) + lane;
    auto sum = 0 * x.data[0];
    #pragma unroll 4
    for (int s = 0; s < count; ++s) {
        const auto* __restrict__ v = x.data + column[32 * s];
        sum += a[288 * s] * v[0] + a[288 * s + 96] * v[1] + a[288 * s + 192] * v[2];
    }
    return sum;
"""


@wp.func_native(_ROW_TIMES)
def single_row_times(
    base: Ints, columns: Ints, values: Singles, x: Singles, i: int
) -> wp.float32: ...


@wp.func_native(_ROW_TIMES)
def double_row_times(
    base: Ints, columns: Ints, values: Doubles, x: Doubles, i: int
) -> wp.float64: ...


@wp.kernel
def inner(a: Doubles, b: Doubles, slot: wp.int32, out: Doubles):
    """Add a . b to ``out[slot]``; the last block of threads may reach past the end."""
    i = wp.tid()
    product = wp.float64(0.0)
    if i < a.shape[0]:
        product = a[i] * b[i]
    wp.tile_atomic_add(out, wp.tile_sum(wp.tile(product)), offset=slot)


@wp.kernel
def combine(a: Vectors, by_a: wp.float64, b: Vectors, by_b: wp.float64, out: Vectors):
    i = wp.tid()
    out[i] = by_a * a[i] + by_b * b[i]


@wp.kernel
def cg_advance(
    p: Vectors,
    q: Vectors,
    lower: Blocks,
    scalars: Doubles,
    x: Vectors,
    r: Vectors,
    unscaled: Vectors,
):
    """Update x += alpha p, r -= alpha q; ``unscaled`` is the residual of the original system."""
    i = wp.tid()
    alpha = scalars[RZ_NEW] / scalars[PAP]
    x[i] = x[i] + alpha * p[i]
    res = r[i] - alpha * q[i]
    r[i] = res
    unscaled[i] = lower[i] * res


@wp.kernel
def multiply_and_measure(
    base: Ints, columns: Ints, values: Doubles, p: Doubles, q: Doubles, scalars: Doubles
):
    """Product q = A p and its curvature p . q; the last block of threads may reach past the end."""
    i = wp.tid()
    product = wp.float64(0.0)
    if i < p.shape[0]:
        here = double_row_times(base, columns, values, p, i)
        q[i] = here
        product = here * p[i]
    wp.tile_atomic_add(scalars, wp.tile_sum(wp.tile(product)), offset=PAP)


@wp.kernel
def advance_and_measure(
    p: Vectors, q: Vectors, lower: Blocks, scalars: Doubles, x: Vectors, r: Vectors
):
    """Update x += alpha p, r -= alpha q; size of the residual of the original system."""
    i = wp.tid()
    square = wp.float64(0.0)
    if i < p.shape[0]:
        alpha = scalars[RZ_NEW] / scalars[PAP]
        x[i] = x[i] + alpha * p[i]
        res = r[i] - alpha * q[i]
        r[i] = res
        square = wp.length_sq(lower[i] * res)
    wp.tile_atomic_add(scalars, wp.tile_sum(wp.tile(square)), offset=NORM2)


@wp.kernel
def cg_direction(z: Vectors, scalars: Doubles, p: Vectors):
    i = wp.tid()
    p[i] = z[i] + (scalars[RZ_NEW] / scalars[RZ]) * p[i]


@wp.kernel
def cg_open(target2: wp.float64, limit: wp.int32, scalars: Doubles, state: Ints):
    """Begin: nothing is summed or done yet, and the first direction has none before it."""
    for k in range(scalars.shape[0]):
        scalars[k] = wp.float64(0.0)
    scalars[RZ] = wp.float64(1.0)
    scalars[TARGET2] = target2
    state[GO] = 1
    state[COUNT] = 0
    state[LIMIT] = limit


@wp.kernel
def cg_close(scalars: Doubles, state: Ints):
    """End an iteration: decide whether to go on, and clear the sums for the next one."""
    count = state[COUNT] + 1
    state[COUNT] = count
    indefinite = scalars[PAP] < wp.float64(0.0)
    # A residual that is no number compares false, and so ends the loop.
    more = scalars[NORM2] > scalars[TARGET2] and count < state[LIMIT] and not indefinite
    state[GO] = wp.where(more, 1, 0)
    scalars[ENDED] = scalars[NORM2]
    scalars[DONE] = wp.float64(count)
    scalars[CURVED] = wp.where(indefinite, wp.float64(1.0), wp.float64(0.0))
    scalars[RZ] = scalars[RZ_NEW]
    scalars[RZ_NEW] = wp.float64(0.0)
    scalars[PAP] = wp.float64(0.0)
    scalars[NORM2] = wp.float64(0.0)


@wp.kernel
def lanczos_start(v: Vectors):
    """A vector without a pattern."""
    i = wp.tid()
    state = wp.rand_init(0, i)
    v[i] = wp.vec3d(wp.vec3(wp.randn(state), wp.randn(state), wp.randn(state)))


@wp.kernel
def lanczos_direction(w: Vectors, square: Doubles, k: wp.int32, v: Vectors, old: Vectors):
    """Next unit vector v = w / |w|, where |w|^2 is ``square[k]``; the last one becomes ``old``."""
    i = wp.tid()
    old[i] = v[i]
    v[i] = w[i] / wp.sqrt(square[k])


@wp.kernel
def lanczos_residual(
    v: Vectors, old: Vectors, along: Doubles, square: Doubles, k: wp.int32, w: Vectors
):
    """Drop the parts of w = A v along v and the vector before it."""
    i = wp.tid()
    w[i] = w[i] - along[k] * v[i] - wp.sqrt(square[k]) * old[i]


# Warp kernels of the linear solver: block scaling, Chebyshev steps, transfer, CG updates.

wp.set_module_options({"enable_backward": False, "max_unroll": 6})

vec6d = wp.types.vector(length=6, dtype=wp.float64)
mat36d = wp.types.matrix(shape=(3, 6), dtype=wp.float64)


@wp.func
def cholesky3(a: wp.mat33d) -> wp.mat33d:
    """Lower factor of a symmetric positive 3 x 3 matrix."""
    z = wp.float64(0.0)
    l00 = wp.sqrt(a[0, 0])
    l10 = a[1, 0] / l00
    l20 = a[2, 0] / l00
    l11 = wp.sqrt(a[1, 1] - l10 * l10)
    l21 = (a[2, 1] - l20 * l10) / l11
    l22 = wp.sqrt(a[2, 2] - l20 * l20 - l21 * l21)
    return wp.mat33d(l00, z, z, l10, l11, z, l20, l21, l22)


@wp.func
def invert_lower(m: wp.mat33d) -> wp.mat33d:
    z = wp.float64(0.0)
    i0 = wp.float64(1.0) / m[0, 0]
    i1 = wp.float64(1.0) / m[1, 1]
    i2 = wp.float64(1.0) / m[2, 2]
    i10 = -m[1, 0] * i0 * i1
    i21 = -m[2, 1] * i1 * i2
    i20 = -(m[2, 0] * i0 + m[2, 1] * i10) * i2
    return wp.mat33d(i0, z, z, i10, i1, z, i20, i21, i2)


@wp.kernel
def factor_diagonal(rows: Ints, columns: Ints, values: Blocks, lower: Blocks, inverse: Blocks):
    """Cholesky factor of every diagonal block, and its inverse."""
    i = wp.tid()
    for s in range(rows[i], rows[i + 1]):
        if columns[s] == i:
            factor = cholesky3(values[s])
            lower[i] = factor
            inverse[i] = invert_lower(factor)


@wp.kernel
def scale_blocks(rows: Ints, columns: Ints, inverse: Blocks, values: Blocks):
    """Two-sided scaling with the inverse factors: every diagonal block becomes I."""
    i = wp.tid()
    for s in range(rows[i], rows[i + 1]):
        values[s] = inverse[i] * values[s] * wp.transpose(inverse[columns[s]])


@wp.kernel
def block_multiply(blocks: Blocks, x: Vectors, transposed: wp.bool, y: Vectors):
    i = wp.tid()
    if transposed:
        y[i] = wp.transpose(blocks[i]) * x[i]
    else:
        y[i] = blocks[i] * x[i]


@wp.kernel
def remainder(b: Vectors, lower: Blocks, product: Vectors, rest: Vectors):
    """Residual of the original system of the ``product`` of the scaled one."""
    i = wp.tid()
    rest[i] = b[i] - lower[i] * product[i]


@wp.kernel
def scatter(
    start: Ints,
    aggregates: Ints,
    transfer: wp.array(dtype=mat36d),
    r: Vectors,
    coarse: wp.array(dtype=vec6d),
):
    """Add P^T r to ``coarse``, row by row: the faster way for one thread."""
    i = wp.tid()
    for s in range(start[i], start[i + 1]):
        wp.atomic_add(coarse, aggregates[s], wp.transpose(transfer[s]) * r[i])


@wp.kernel
def prolong(
    start: Ints,
    aggregates: Ints,
    transfer: wp.array(dtype=mat36d),
    coarse: wp.array(dtype=vec6d),
    x: Vectors,
):
    """Add P ``coarse`` to ``x``."""
    i = wp.tid()
    total = x[i]
    for s in range(start[i], start[i + 1]):
        total += transfer[s] * coarse[aggregates[s]]
    x[i] = total


@wp.kernel
def corner_transfers(lower: Blocks, free: Vectors, transfer: Blocks):
    """Blocks B of P, whose row is B / 2 at both ends of a node (a corner ends in itself, twice)."""
    i = wp.tid()
    transfer[i] = wp.transpose(lower[i]) * wp.diag(wp.float64(0.5) * free[i])


@wp.kernel
def corner_matrix(
    rows: Ints,
    columns: Ints,
    values: Blocks,
    ends: wp.array(dtype=wp.vec2i),
    transfer: Blocks,
    coarse_rows: Ints,
    coarse_columns: Ints,
    coarse: Blocks,
    lanes: int,
):
    """Add P^T A P, row by row of A, each by so many threads."""
    i, lane = wp.tid()
    for s in range(rows[i] + lane, rows[i + 1], lanes):
        j = columns[s]
        block = wp.transpose(transfer[i]) * values[s] * transfer[j]
        for a in range(2):
            for b in range(2):
                slot = find_slot(coarse_rows, coarse_columns, ends[i][a], ends[j][b])
                wp.atomic_add(coarse, slot, block)


@wp.kernel
def restrict_to_corners(
    ends: wp.array(dtype=wp.vec2i), transfer: Blocks, r: Vectors, coarse: Vectors
):
    i = wp.tid()
    part = wp.transpose(transfer[i]) * r[i]
    wp.atomic_add(coarse, ends[i][0], part)
    wp.atomic_add(coarse, ends[i][1], part)


@wp.kernel
def prolong_from_corners(
    ends: wp.array(dtype=wp.vec2i), transfer: Blocks, coarse: Vectors, x: Vectors
):
    i = wp.tid()
    x[i] = x[i] + transfer[i] * (coarse[ends[i][0]] + coarse[ends[i][1]])
