# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of the V-cycle: the coarse space, its transfers and inverse; Chebyshev steps."""

from typing import Any, NamedTuple

import warp as wp

from ..elements.kernels_field import row_times
from ..laws.kernels_tensor import Blocks, DoubleRows, Doubles, Ints, Singles, Vectors
from .kernels_krylov import mat36d, single_row_times, vec6d

# Loops over six motions are unrolled: their blocks then live in registers.
wp.set_module_options({"enable_backward": False, "max_unroll": 6})

mat66d = wp.types.matrix(shape=(6, 6), dtype=wp.float64)
# Part of a motion's own size that must be left once the motions before it are taken out: less is
# round-off of a dependent motion (one node, a line of nodes, all fixed).
RANK = wp.constant(wp.float64(1e-12))


@wp.kernel
def couplings(
    rows: Ints,
    columns: Ints,
    values: Blocks,
    label: Ints,
    free: Vectors,
    limit: wp.float64,
    strength: Doubles,
    weak: Ints,
):
    """Strength |A_ij| of every coupling, 1 to a node that is held; count the weak ones in a box."""
    i = wp.tid()
    zero = wp.float64(0.0)
    count = int(0)  # noqa: RUF046, UP018 (a plain 0 is a constant to warp)
    for s in range(rows[i], rows[i + 1]):
        j = columns[s]
        size = wp.float64(1.0)
        if wp.length_sq(free[i]) > zero and wp.length_sq(free[j]) > zero:
            size = wp.sqrt(wp.ddot(values[s], values[s]) / wp.float64(3.0))
        strength[s] = size
        if size < limit and label[i] == label[j]:
            count += 1
    if count > 0:
        wp.atomic_add(weak, 0, count)


@wp.kernel
def rigid_motions(
    points: Vectors,
    label: Ints,
    centre: Vectors,
    extent: Doubles,
    lower: Blocks,
    free: Vectors,
    motion: wp.array(dtype=mat36d),
    gram: wp.array(dtype=mat66d),
):
    """Rigid motions of every node's aggregate in scaled unknowns, and their inner products."""
    i = wp.tid()
    a = label[i]
    p = (points[i] - centre[a]) / extent[a]
    one = wp.float64(1.0)
    z = wp.float64(0.0)
    m = mat36d(
        one, z, z, z, p[2], -p[1],
        z, one, z, -p[2], z, p[0],
        z, z, one, p[1], -p[0], z,
    )  # fmt: skip
    m = wp.transpose(lower[i]) * wp.diag(free[i]) * m
    motion[i] = m
    wp.atomic_add(gram, a, wp.transpose(m) * m)


@wp.func
def orthonormal(gram: mat66d) -> mat66d:
    """Combinations of six vectors that are orthonormal: W^T gram W = 1, zero where dependent."""
    W = mat66d()
    for k in range(6):
        w = vec6d()
        w[k] = wp.float64(1.0)
        for j in range(k):
            c = wp.float64(0.0)
            for a in range(6):
                c += W[a, j] * gram[a, k]
            for a in range(6):
                w[a] = w[a] - c * W[a, j]
        square = wp.dot(w, gram * w)
        if square > RANK * gram[k, k]:
            for a in range(6):
                W[a, k] = w[a] / wp.sqrt(square)
    return W


@wp.kernel
def orthonormalise(gram: wp.array(dtype=mat66d), weight: wp.array(dtype=mat66d)):
    a = wp.tid()
    weight[a] = orthonormal(gram[a])


@wp.kernel
def weigh(label: Ints, weight: wp.array(dtype=mat66d), motion: wp.array(dtype=mat36d)):
    """Turn motions into orthonormal ones, in place."""
    i = wp.tid()
    motion[i] = motion[i] * weight[label[i]]


@wp.func
def next_label(rows: Ints, columns: Ints, label: Ints, i: int, last: int) -> int:
    """Smallest label above ``last`` in row i, or -1."""
    above = int(-1)  # noqa: RUF046, UP018
    for s in range(rows[i], rows[i + 1]):
        a = label[columns[s]]
        if a > last and (above < 0 or a < above):
            above = a
    return above


@wp.kernel
def count_labels(rows: Ints, columns: Ints, label: Ints, count: Ints):
    """Distinct aggregates among the neighbours of every node, which is its own neighbour."""
    i = wp.tid()
    n = int(0)  # noqa: RUF046, UP018
    a = next_label(rows, columns, label, i, -1)
    while a >= 0:
        n += 1
        a = next_label(rows, columns, label, i, a)
    count[i] = n


@wp.kernel
def smooth(
    rows: Ints,
    columns: Ints,
    values: Blocks,
    label: Ints,
    motion: wp.array(dtype=mat36d),
    omega: wp.float64,
    start: Ints,
    aggregates: Ints,
    transfer: wp.array(dtype=mat36d),
):
    """Rows of P = (1 - omega A) ``motion``."""
    i = wp.tid()
    a = next_label(rows, columns, label, i, -1)
    slot = start[i]
    while a >= 0:
        total = mat36d()
        for s in range(rows[i], rows[i + 1]):
            if label[columns[s]] == a:
                total += values[s] * motion[columns[s]]
        total = -omega * total
        if label[i] == a:
            total += motion[i]
        aggregates[slot] = a
        transfer[slot] = total
        slot += 1
        a = next_label(rows, columns, label, i, a)


@wp.kernel
def count_members(aggregates: Ints, count: Ints):
    """Entries of P in the columns of every aggregate."""
    wp.atomic_add(count, aggregates[wp.tid()], 1)


@wp.kernel
def list_members(start: Ints, aggregates: Ints, place: Ints, member: Ints, owner: Ints):
    """Entries of P and their rows, by aggregate; ``place`` is where the next one of each goes."""
    i = wp.tid()
    for s in range(start[i], start[i + 1]):
        m = wp.atomic_add(place, aggregates[s], 1)
        member[m] = s
        owner[m] = i


@wp.kernel
def galerkin(
    rows: Ints,
    columns: Ints,
    values: Blocks,
    start: Ints,
    aggregates: Ints,
    transfer: wp.array(dtype=mat36d),
    matrix: DoubleRows,
):
    """Add the blocks on and above the diagonal of P^T A P, dense, to ``matrix``.

    The row of A P is made one aggregate b after the other, from its own first one on.
    """
    i = wp.tid()
    last = wp.int32(2147483647)
    b = aggregates[start[i]]
    while b < last:
        following = last
        total = mat36d()
        for s in range(rows[i], rows[i + 1]):
            j = columns[s]
            for t in range(start[j], start[j + 1]):
                a = aggregates[t]
                if a == b:
                    total += values[s] * transfer[t]
                if a > b:
                    following = wp.min(following, a)
                    break  # the aggregates of a node ascend
        for t in range(start[i], start[i + 1]):
            if aggregates[t] <= b:
                block = wp.transpose(transfer[t]) * total
                for c in range(6):
                    for d in range(6):
                        wp.atomic_add(matrix, 6 * aggregates[t] + c, 6 * b + d, block[c, d])
        b = following


@wp.kernel
def mend(fraction: wp.float64, matrix: DoubleRows):
    """Copy the upper triangle down; the diagonal is 1 where a motion does not exist.

    Elsewhere it is raised by ``fraction``.
    """
    i, j = wp.tid()
    if i > j:
        matrix[i, j] = matrix[j, i]
    if i == j:
        d = matrix[i, i]
        matrix[i, i] = wp.where(d > wp.float64(0.0), d + fraction * d, wp.float64(1.0))


class ChebyshevSteps(NamedTuple):
    """Kernels of the smoother: first step from x = 0, and from a given x; one more; r -= A d."""

    start: Any
    restart: Any
    step: Any
    subtract: Any


def chebyshev_steps(
    row_times: Any, block: Any, wide: Any, entry: Any, number: Any
) -> ChebyshevSteps:
    """Kernels of a matrix of ``block``, by its ``row_times``, and of ``entry`` for ``wide``.

    ``wide`` are those outside, in double precision. The V-cycle only shapes a search direction of
    CG, whose residual stays double: a GPU runs it in single precision, a thread a scalar, for half
    the bytes and as many iterations.
    """
    Matrix, Wide, Entries = (wp.array(dtype=kind) for kind in (block, wide, entry))

    @wp.kernel
    def chebyshev_start(b: Wide, scale: number, r: Entries, d: Entries, x: Entries):
        i = wp.tid()
        here = entry(b[i])
        r[i] = here
        d[i] = scale * here
        x[i] = scale * here

    @wp.kernel
    def chebyshev_restart(
        rows: Ints,
        columns: Ints,
        values: Matrix,
        b: Wide,
        x: Entries,
        scale: number,
        r: Entries,
        d: Entries,
    ):
        """The x takes its step in with the next: others read it now."""
        i = wp.tid()
        res = entry(b[i]) - row_times(rows, columns, values, x, i)
        r[i] = res
        d[i] = scale * res

    @wp.kernel
    def chebyshev_step(
        rows: Ints,
        columns: Ints,
        values: Matrix,
        old: Entries,
        keep: number,
        scale: number,
        owed: number,
        r: Entries,
        d: Entries,
        x: Entries,
        z: Wide,
    ):
        """Update r -= A old, d = keep old + scale r, x += d + ``owed`` old; z is x."""
        i = wp.tid()
        res = r[i] - row_times(rows, columns, values, old, i)
        r[i] = res
        change = keep * old[i] + scale * res
        d[i] = change
        here = x[i] + owed * old[i] + change
        x[i] = here
        z[i] = wide(here)

    @wp.kernel
    def chebyshev_subtract(rows: Ints, columns: Ints, values: Matrix, d: Entries, r: Entries):
        i = wp.tid()
        r[i] = r[i] - row_times(rows, columns, values, d, i)

    return ChebyshevSteps(chebyshev_start, chebyshev_restart, chebyshev_step, chebyshev_subtract)


DOUBLE_STEPS = chebyshev_steps(row_times, wp.mat33d, wp.vec3d, wp.vec3d, wp.float64)
SINGLE_STEPS = chebyshev_steps(single_row_times, wp.float32, wp.float64, wp.float32, wp.float32)


@wp.kernel
def narrow(numbers: Doubles, out: Singles):
    i = wp.tid()
    out[i] = wp.float32(numbers[i])


@wp.kernel
def single_restrict(
    first: Ints, member: Ints, owner: Ints, transfer: Singles, r: Singles, coarse: Doubles
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
def single_prolong(start: Ints, aggregates: Ints, transfer: Singles, coarse: Doubles, x: Singles):
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
def single_restrict_to_corners(
    first: Ints, member: Ints, transfer: Blocks, inverse: Blocks, r: Singles, coarse: Vectors
):
    """Load of a level of corners, scaled, a block of threads a corner: nodes that end there."""
    a, lane = wp.tid()
    total = wp.vec3d()
    for m in range(first[a] + lane, first[a + 1], wp.block_dim()):
        i = member[m]
        here = wp.vec3d(wp.vec3(r[3 * i], r[3 * i + 1], r[3 * i + 2]))
        total += wp.transpose(transfer[i]) * here
    whole = wp.vec3d()
    for c in range(3):
        whole[c] = wp.tile_extract(wp.tile_sum(wp.tile(total[c])), 0)
    if lane == 0:
        coarse[a] = inverse[a] * whole


@wp.kernel
def single_prolong_from_corners(
    ends: wp.array(dtype=wp.vec2i), transfer: Blocks, inverse: Blocks, coarse: Vectors, x: Singles
):
    """Add to ``x`` what the level of corners found, scaled."""
    i = wp.tid()
    a = ends[i][0]
    b = ends[i][1]
    sum = wp.transpose(inverse[a]) * coarse[a] + wp.transpose(inverse[b]) * coarse[b]
    part = transfer[i] * sum
    for c in range(3):
        x[3 * i + c] = x[3 * i + c] + wp.float32(part[c])


@wp.kernel
def dense_multiply(matrix: DoubleRows, x: Doubles, y: Doubles):
    """Product y = matrix x, one block of threads a row."""
    i, lane = wp.tid()
    total = wp.float64(0.0)
    for k in range(lane, x.shape[0], wp.block_dim()):
        total += matrix[i, k] * x[k]
    wp.tile_store(y, wp.tile_sum(wp.tile(total)), offset=i)


# Inverse, by sweeps, of a symmetric block within the threads of a block: zero where a row depends
# on those above. Then row ``a`` of what it takes the rows of the matrix to, column ``c``.
_PIVOT = """
#if defined(__CUDA_ARCH__)
    __shared__ double S[2][16][16];
    __shared__ double least[16];
    const int me = threadIdx.x, all = blockDim.x;
    #define MEET __syncthreads()
#else
    double S[2][16][16], least[16];
    const int me = 0, all = 1;
    #define MEET
#endif
    const int n = matrix.shape[0], now = width & 1;
    const double* A = matrix.data + first * size_t(n);
    for (int e = me; e < width * width; e += all) {
        const double value = A[(e / width) * size_t(n) + first + e % width];
        S[0][e / width][e % width] = value;
        if (e / width == e % width) least[e / width] = rank * value;
    }
    MEET;
    for (int k = 0; k < width; ++k) {
        const double (*old)[16] = S[k & 1];
        const double pivot = old[k][k], inverse = pivot > least[k] ? 1.0 / pivot : 0.0;
        for (int e = me; e < width * width; e += all) {
            const int i = e / width, j = e % width;
            double value = old[i][j] * inverse;
            if (i == k && j == k) value = -inverse;
            if (i != k && j != k) value = old[i][j] - old[i][k] * old[k][j] * inverse;
            S[(k + 1) & 1][i][j] = value;
        }
        MEET;
    }
    const int a = index / n, c = index - a * n;
    if (a < width) {
        double total = 0.0;
        if (c >= first && c < first + width) total = -S[now][a][c - first];
        else for (int b = 0; b < width; ++b) total -= S[now][a][b] * A[b * size_t(n) + c];
        row.data[a * size_t(n) + c] = total;
        column.data[16 * c + a] = matrix.data[c * size_t(n) + first + a];
    }
    #undef MEET
"""
# Rows that Gauss-Jordan eliminates at once: their inverse has one entry a thread of a block.
PIVOT = 16


@wp.func_native(_PIVOT)
def pivot_entry(
    matrix: DoubleRows,
    first: int,
    width: int,
    rank: wp.float64,
    row: DoubleRows,
    column: DoubleRows,
    index: int,
): ...


@wp.kernel
def take_pivot(
    matrix: DoubleRows, first: wp.int32, width: wp.int32, row: DoubleRows, column: DoubleRows
):
    """Block Gauss-Jordan: ``row`` = pivot^-1 times rows of the matrix, ``column`` its columns.

    The pivot has ``width`` rows from ``first`` on. To be launched in whole blocks of threads.
    """
    pivot_entry(matrix, first, width, RANK, row, column, wp.tid())


@wp.kernel
def eliminate(
    row: DoubleRows, column: DoubleRows, first: wp.int32, width: wp.int32, matrix: DoubleRows
):
    """Block Gauss-Jordan: one step towards the inverse of ``matrix``, in place."""
    i, j = wp.tid()
    if i >= first and i < first + width:
        matrix[i, j] = row[i - first, j]
        return
    total = matrix[i, j]
    if j >= first and j < first + width:
        total = wp.float64(0.0)
    for a in range(width):
        total -= column[i, a] * row[a, j]
    matrix[i, j] = total
