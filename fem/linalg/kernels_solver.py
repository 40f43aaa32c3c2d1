# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of the linear solver: block scaling, Chebyshev steps, transfer, CG updates."""

import warp as wp

from ..discrete.kernels_matrix import find_slot, row_times

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
def factor_diagonal(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    lower: wp.array(dtype=wp.mat33d),
    inverse: wp.array(dtype=wp.mat33d),
):
    """Cholesky factor of every diagonal block, and its inverse."""
    i = wp.tid()
    for s in range(rows[i], rows[i + 1]):
        if columns[s] == i:
            factor = cholesky3(values[s])
            lower[i] = factor
            inverse[i] = invert_lower(factor)


@wp.kernel
def scale_blocks(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    inverse: wp.array(dtype=wp.mat33d),
    values: wp.array(dtype=wp.mat33d),
):
    """Two-sided scaling with the inverse factors: every diagonal block becomes I."""
    i = wp.tid()
    for s in range(rows[i], rows[i + 1]):
        values[s] = inverse[i] * values[s] * wp.transpose(inverse[columns[s]])


@wp.kernel
def block_multiply(
    blocks: wp.array(dtype=wp.mat33d),
    x: wp.array(dtype=wp.vec3d),
    transposed: wp.bool,
    y: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    if transposed:
        y[i] = wp.transpose(blocks[i]) * x[i]
    else:
        y[i] = blocks[i] * x[i]


@wp.kernel
def remainder(
    b: wp.array(dtype=wp.vec3d),
    lower: wp.array(dtype=wp.mat33d),
    product: wp.array(dtype=wp.vec3d),
    rest: wp.array(dtype=wp.vec3d),
):
    """Residual of the original system of the ``product`` of the scaled one."""
    i = wp.tid()
    rest[i] = b[i] - lower[i] * product[i]


@wp.kernel
def chebyshev_start(
    b: wp.array(dtype=wp.vec3d),
    scale: wp.float64,
    r: wp.array(dtype=wp.vec3d),
    d: wp.array(dtype=wp.vec3d),
    x: wp.array(dtype=wp.vec3d),
):
    """First step from x = 0."""
    i = wp.tid()
    r[i] = b[i]
    d[i] = b[i] * scale
    x[i] = b[i] * scale


@wp.kernel
def chebyshev_restart(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    b: wp.array(dtype=wp.vec3d),
    x: wp.array(dtype=wp.vec3d),
    scale: wp.float64,
    r: wp.array(dtype=wp.vec3d),
    d: wp.array(dtype=wp.vec3d),
):
    """First step from a given x; the x itself moves in `add`, after all rows have read it."""
    i = wp.tid()
    res = b[i] - row_times(rows, columns, values, x, i)
    r[i] = res
    d[i] = res * scale


@wp.kernel
def chebyshev_step(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    old: wp.array(dtype=wp.vec3d),
    keep: wp.float64,
    scale: wp.float64,
    r: wp.array(dtype=wp.vec3d),
    d: wp.array(dtype=wp.vec3d),
    x: wp.array(dtype=wp.vec3d),
):
    """Update r = r - A old, d = keep old + scale r, x = x + d."""
    i = wp.tid()
    res = r[i] - row_times(rows, columns, values, old, i)
    r[i] = res
    step = keep * old[i] + scale * res
    d[i] = step
    x[i] = x[i] + step


@wp.kernel
def add(x: wp.array(dtype=wp.vec3d), d: wp.array(dtype=wp.vec3d)):
    i = wp.tid()
    x[i] = x[i] + d[i]


@wp.kernel
def subtract(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    d: wp.array(dtype=wp.vec3d),
    r: wp.array(dtype=wp.vec3d),
):
    """Update r = r - A d."""
    i = wp.tid()
    r[i] = r[i] - row_times(rows, columns, values, d, i)


@wp.kernel
def scatter(
    start: wp.array(dtype=wp.int32),
    aggregates: wp.array(dtype=wp.int32),
    transfer: wp.array(dtype=mat36d),
    r: wp.array(dtype=wp.vec3d),
    coarse: wp.array(dtype=vec6d),
):
    """Add P^T r to ``coarse``, row by row: the faster way for one thread."""
    i = wp.tid()
    for s in range(start[i], start[i + 1]):
        wp.atomic_add(coarse, aggregates[s], wp.transpose(transfer[s]) * r[i])


@wp.kernel
def prolong(
    start: wp.array(dtype=wp.int32),
    aggregates: wp.array(dtype=wp.int32),
    transfer: wp.array(dtype=mat36d),
    coarse: wp.array(dtype=vec6d),
    x: wp.array(dtype=wp.vec3d),
):
    """Add P ``coarse`` to ``x``."""
    i = wp.tid()
    total = x[i]
    for s in range(start[i], start[i + 1]):
        total += transfer[s] * coarse[aggregates[s]]
    x[i] = total


@wp.kernel
def corner_transfers(
    lower: wp.array(dtype=wp.mat33d),
    free: wp.array(dtype=wp.vec3d),
    transfer: wp.array(dtype=wp.mat33d),
):
    """Blocks B of P, whose row is B / 2 at both ends of a node (a corner ends in itself, twice)."""
    i = wp.tid()
    transfer[i] = wp.transpose(lower[i]) * wp.diag(wp.float64(0.5) * free[i])


@wp.kernel
def corner_matrix(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    ends: wp.array(dtype=wp.vec2i),
    transfer: wp.array(dtype=wp.mat33d),
    coarse_rows: wp.array(dtype=wp.int32),
    coarse_columns: wp.array(dtype=wp.int32),
    coarse: wp.array(dtype=wp.mat33d),
):
    """Add P^T A P, row by row of A."""
    i = wp.tid()
    for s in range(rows[i], rows[i + 1]):
        j = columns[s]
        block = wp.transpose(transfer[i]) * values[s] * transfer[j]
        for a in range(2):
            for b in range(2):
                slot = find_slot(coarse_rows, coarse_columns, ends[i][a], ends[j][b])
                wp.atomic_add(coarse, slot, block)


@wp.kernel
def restrict_to_corners(
    ends: wp.array(dtype=wp.vec2i),
    transfer: wp.array(dtype=wp.mat33d),
    r: wp.array(dtype=wp.vec3d),
    coarse: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    part = wp.transpose(transfer[i]) * r[i]
    wp.atomic_add(coarse, ends[i][0], part)
    wp.atomic_add(coarse, ends[i][1], part)


@wp.kernel
def prolong_from_corners(
    ends: wp.array(dtype=wp.vec2i),
    transfer: wp.array(dtype=wp.mat33d),
    coarse: wp.array(dtype=wp.vec3d),
    x: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    x[i] = x[i] + transfer[i] * (coarse[ends[i][0]] + coarse[ends[i][1]])
