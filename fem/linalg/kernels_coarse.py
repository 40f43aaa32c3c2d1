# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels that make the coarse space: rigid motions, smoothing, Galerkin product."""

import warp as wp

from .kernels_solver import mat36d, vec6d

# Loops over six motions are unrolled: their blocks then live in registers.
wp.set_module_options({"enable_backward": False, "max_unroll": 6})

mat66d = wp.types.matrix(shape=(6, 6), dtype=wp.float64)
# Part of a motion's own size that must be left once the motions before it are taken out: less is
# round-off of a dependent motion (one node, a line of nodes, all fixed).
RANK = wp.constant(wp.float64(1e-12))


@wp.kernel
def couplings(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    label: wp.array(dtype=wp.int32),
    free: wp.array(dtype=wp.vec3d),
    limit: wp.float64,
    strength: wp.array(dtype=wp.float64),
    weak: wp.array(dtype=wp.int32),
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
    points: wp.array(dtype=wp.vec3d),
    label: wp.array(dtype=wp.int32),
    centre: wp.array(dtype=wp.vec3d),
    extent: wp.array(dtype=wp.float64),
    lower: wp.array(dtype=wp.mat33d),
    free: wp.array(dtype=wp.vec3d),
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
def weigh(
    label: wp.array(dtype=wp.int32), weight: wp.array(dtype=mat66d), motion: wp.array(dtype=mat36d)
):
    """Turn motions into orthonormal ones, in place."""
    i = wp.tid()
    motion[i] = motion[i] * weight[label[i]]


@wp.func
def next_label(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    label: wp.array(dtype=wp.int32),
    i: int,
    last: int,
) -> int:
    """Smallest label above ``last`` in row i, or -1."""
    found = int(-1)  # noqa: RUF046, UP018
    for s in range(rows[i], rows[i + 1]):
        a = label[columns[s]]
        if a > last and (found < 0 or a < found):
            found = a
    return found


@wp.kernel
def count_labels(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    label: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
):
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
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    label: wp.array(dtype=wp.int32),
    motion: wp.array(dtype=mat36d),
    omega: wp.float64,
    start: wp.array(dtype=wp.int32),
    aggregates: wp.array(dtype=wp.int32),
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
def count_members(aggregates: wp.array(dtype=wp.int32), count: wp.array(dtype=wp.int32)):
    """Entries of P in the columns of every aggregate."""
    wp.atomic_add(count, aggregates[wp.tid()], 1)


@wp.kernel
def list_members(
    start: wp.array(dtype=wp.int32),
    aggregates: wp.array(dtype=wp.int32),
    place: wp.array(dtype=wp.int32),
    member: wp.array(dtype=wp.int32),
    owner: wp.array(dtype=wp.int32),
):
    """Entries of P and their rows, by aggregate; ``place`` is where the next one of each goes."""
    i = wp.tid()
    for s in range(start[i], start[i + 1]):
        m = wp.atomic_add(place, aggregates[s], 1)
        member[m] = s
        owner[m] = i


@wp.kernel
def galerkin(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    start: wp.array(dtype=wp.int32),
    aggregates: wp.array(dtype=wp.int32),
    transfer: wp.array(dtype=mat36d),
    matrix: wp.array2d(dtype=wp.float64),
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
def mend(share: wp.float64, matrix: wp.array2d(dtype=wp.float64)):
    """Copy the upper triangle down; the diagonal is 1 where a motion does not exist.

    Elsewhere it is raised by ``share``.
    """
    i, j = wp.tid()
    if i > j:
        matrix[i, j] = matrix[j, i]
    if i == j:
        d = matrix[i, i]
        matrix[i, i] = wp.where(d > wp.float64(0.0), d + share * d, wp.float64(1.0))
