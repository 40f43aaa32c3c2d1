# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of tets and their nodes: gradients, loads, steps in time, block matrices."""

from typing import Any

import warp as wp

from ..laws.kernels_tensor import Barycentric, Blocks, Doubles, IntRows, Ints, Tets, Vectors

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


# Barycentric gradients of a tet: row k is d lambda_k / dx.
mat43d = wp.types.matrix(shape=(4, 3), dtype=wp.float64)
mat103d = wp.types.matrix(shape=(10, 3), dtype=wp.float64)


@wp.func
def gradients(tets: Tets, t: int) -> mat43d:
    """Gradients of the barycentric coordinates, times six volumes."""
    a = tets.points[tets.elements[t, 0]]
    x = tets.points[tets.elements[t, 1]] - a
    y = tets.points[tets.elements[t, 2]] - a
    z = tets.points[tets.elements[t, 3]] - a
    gx = wp.cross(y, z)
    gy = wp.cross(z, x)
    gz = wp.cross(x, y)
    return wp.matrix_from_rows(-(gx + gy + gz), gx, gy, gz)


@wp.func
def six_volumes(tets: Tets, t: int) -> wp.float64:
    a = tets.points[tets.elements[t, 0]]
    x = tets.points[tets.elements[t, 1]] - a
    y = tets.points[tets.elements[t, 2]] - a
    z = tets.points[tets.elements[t, 3]] - a
    return wp.dot(x, wp.cross(y, z))


@wp.func
def weighted_gradients(tets: Tets, t: int):
    """Gradients of the barycentric coordinates; weight of each quadrature point, a volume."""
    six = six_volumes(tets, t)
    g = gradients(tets, t) * (wp.float64(1.0) / six)
    return g, six / wp.float64(6 * tets.quadrature.shape[0])


@wp.func
def row3(g: mat43d, k: int) -> wp.vec3d:
    return wp.vec3d(g[k, 0], g[k, 1], g[k, 2])


@wp.func
def edge_ends(k: int):
    """Corners of edge k, in the order of VTK's quadratic tetrahedron."""
    i = wp.where(k == 1 or k == 4, 1, wp.where(k == 5, 2, 0))
    return i, wp.where(k == 0, 1, wp.where(k < 3, 2, 3))


@wp.func
def gradients_p2(g: mat43d, q: wp.vec4d) -> mat103d:
    """Gradients of the ten shape functions at barycentric coordinates q."""
    d = mat103d()
    for a in range(4):
        s = wp.float64(4.0) * q[a] - wp.float64(1.0)
        for c in range(3):
            d[a, c] = s * g[a, c]
    for k in range(6):
        i, j = edge_ends(k)
        for c in range(3):
            d[4 + k, c] = wp.float64(4.0) * (q[i] * g[j, c] + q[j] * g[i, c])
    return d


@wp.func
def row10(g: mat103d, k: int) -> wp.vec3d:
    return wp.vec3d(g[k, 0], g[k, 1], g[k, 2])


@wp.func
def shape_gradients(g: mat43d, tets: Tets, q: wp.vec4d) -> mat103d:
    """Gradients of the 4 or 10 shape functions; the last six rows are zero for P1."""
    d = mat103d()
    if tets.elements.shape[1] == 10:
        d = gradients_p2(g, q)
    else:
        for a in range(4):
            for c in range(3):
                d[a, c] = g[a, c]
    return d


@wp.func
def gradient_at(d: mat103d, tets: Tets, u: Vectors, t: int) -> wp.mat33d:
    H = wp.mat33d()
    for a in range(tets.elements.shape[1]):
        H += wp.outer(u[tets.elements[t, a]], row10(d, a))
    return H


def spreading(kind: Any) -> Any:
    """Kernel that adds the integral of a density of this ``kind`` to the nodes.

    It is constant on every tet, whose nodes take the ``fraction`` of each.
    """
    Kind = wp.array(dtype=kind)

    @wp.kernel
    def spread(tets: Tets, density: Kind, fraction: Doubles, total: Kind):
        t = wp.tid()
        amount = density[t] * (six_volumes(tets, t) / wp.float64(6.0))
        for a in range(tets.elements.shape[1]):
            wp.atomic_add(total, tets.elements[t, a], fraction[a] * amount)

    return spread


spread_scalar, spread_vector = spreading(wp.float64), spreading(wp.vec3d)


@wp.kernel
def displacement_gradient(
    tets: Tets, where: Barycentric, u: Vectors, grad: wp.array2d(dtype=wp.mat33d)
):
    """The gradient du_i/dx_j of a displacement at points ``where`` of every tet, its row."""
    t = wp.tid()
    g, _w = weighted_gradients(tets, t)
    for q in range(where.shape[0]):
        grad[t, q] = gradient_at(shape_gradients(g, tets, where[q]), tets, u, t)


@wp.kernel
def geometric_stiffness(
    tets: Tets, stress: wp.array2d(dtype=wp.mat33d), slots: IntRows, values: Doubles
):
    """Add the integrals of grad N_a . stress grad N_b: the same for every direction.

    The stress has a row for every tet, a column for every quadrature point.
    """
    t = wp.tid()
    g, w = weighted_gradients(tets, t)
    size = tets.elements.shape[1]
    for q in range(tets.quadrature.shape[0]):
        s = w * stress[t, q]
        d = shape_gradients(g, tets, tets.quadrature[q])
        for a in range(size):
            p = s * row10(d, a)
            for b in range(size):
                wp.atomic_add(values, slots[t, size * a + b], wp.dot(p, row10(d, b)))


@wp.kernel
def foresee(
    old: Vectors,
    target: Vectors,
    free: Vectors,
    differences: wp.array2d(dtype=wp.vec3d),
    terms: wp.int32,
    factor: wp.float64,
    aim: Vectors,
    start: Vectors,
):
    """``target`` of a step where a component is free, and with the acceleration to expect."""
    i = wp.tid()
    ahead = target[i] - old[i]
    aim[i] = old[i] + wp.cw_mul(free[i], ahead)
    for k in range(terms):
        ahead += factor * differences[k, i]
    start[i] = old[i] + wp.cw_mul(free[i], ahead)


@wp.kernel
def incremental(
    u: Vectors,
    target: Vectors,
    factor: wp.float64,
    mass: Doubles,
    rigidity: Doubles,
    force: Vectors,
    load: Vectors,
    springs: Vectors,
    free: Vectors,
    gradient: Vectors,
    sums: Doubles,
):
    """Gradient of the incremental potential; its energy but the elastic one goes to ``sums``.

    So do the squares of the inertia, of the gradient, and of what inertia and elasticity would make
    of the target; the last block of threads may reach past the end.
    """
    i = wp.tid()
    energy = wp.float64(0.0)
    pushed = wp.float64(0.0)
    left = wp.float64(0.0)
    known = wp.float64(0.0)
    if i < u.shape[0]:
        inertia = factor * mass[i]
        away = u[i] - target[i]
        push = inertia * away
        spring = wp.cw_mul(springs[i], u[i])
        g = wp.cw_mul(free[i], force[i] + push - load[i] + spring)
        gradient[i] = g
        half = wp.float64(0.5)
        energy = half * (wp.dot(push, away) + wp.dot(spring, u[i])) - wp.dot(load[i], u[i])
        pushed = wp.dot(push, push)
        left = wp.dot(g, g)
        known = wp.length_sq((inertia + rigidity[i]) * target[i])
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(energy)), offset=0)
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(pushed)), offset=1)
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(left)), offset=2)
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(known)), offset=3)


@wp.kernel
def end_of_step(
    u: Vectors,
    v: Vectors,
    by_v: wp.float64,
    a: Vectors,
    by_a: wp.float64,
    free: Vectors,
    mass: Doubles,
    load: Vectors,
    springs: Vectors,
    count: wp.int32,
    motion: wp.array2d(dtype=wp.vec3d),
    differences: wp.array2d(dtype=wp.vec3d),
    sums: Doubles,
):
    """Motion at the end of a step, ``v`` and ``a`` times their factors, and what ``sums`` takes.

    That is kinetic energy, that of springs, and of the load; then the squares of the backward
    differences of ``a``, of which there are ``count`` now. The last block may reach past the end.
    """
    i = wp.tid()
    kinetic = wp.float64(0.0)
    sprung = wp.float64(0.0)
    lifted = wp.float64(0.0)
    new = wp.vec3d()
    inside = i < u.shape[0]
    if inside:
        speed = wp.cw_mul(free[i], by_v * v[i])
        new = wp.cw_mul(free[i], by_a * a[i])
        motion[0, i] = u[i]
        motion[1, i] = speed
        motion[2, i] = new
        half = wp.float64(0.5)
        kinetic = half * mass[i] * wp.dot(speed, speed)
        sprung = half * wp.dot(wp.cw_mul(springs[i], u[i]), u[i])
        lifted = -wp.dot(load[i], u[i])
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(kinetic)), offset=0)
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(sprung)), offset=1)
    wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(lifted)), offset=2)
    for k in range(count):
        square = wp.dot(new, new)
        wp.tile_atomic_add(sums, wp.tile_sum(wp.tile(square)), offset=3 + k)
        if inside:
            old = differences[k, i]
            differences[k, i] = new
            new = new - old


# Block matrices: pattern, where an element's blocks go, products, supports.


@wp.kernel
def sorted_rows(
    start: Ints,  # (nodes + 1), into `incident`
    incident: Ints,  # elements around every node
    elements: IntRows,
    scratch: Ints,  # room for all neighbours, with repetitions
    count: Ints,
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
def copy_rows(start: Ints, size: wp.int32, scratch: Ints, rows: Ints, columns: Ints):
    i = wp.tid()
    for k in range(rows[i + 1] - rows[i]):
        columns[rows[i] + k] = scratch[start[i] * size + i + k]


@wp.func
def find_sorted(values: Ints, low: int, high: int, value: int):
    """Position of ``value`` in the ascending values[low:high]."""
    lo = low
    hi = high - 1
    while lo < hi:
        mid = (lo + hi) // 2
        if values[mid] < value:
            lo = mid + 1
        else:
            hi = mid
    return lo


@wp.func
def find_slot(rows: Ints, columns: Ints, i: int, j: int):
    """Position of column j in the sorted row i."""
    return find_sorted(columns, rows[i], rows[i + 1], j)


@wp.kernel
def element_slots(
    elements: IntRows,
    rows: Ints,
    columns: Ints,
    slots: IntRows,  # (tets, size * size)
):
    t = wp.tid()
    size = elements.shape[1]
    for a in range(size):
        for b in range(size):
            slots[t, a * size + b] = find_slot(rows, columns, elements[t, a], elements[t, b])


@wp.kernel
def add_diagonal(rows: Ints, columns: Ints, numbers: Vectors, values: Blocks):
    i = wp.tid()
    s = find_slot(rows, columns, i, i)
    values[s] = values[s] + wp.diag(numbers[i])


@wp.kernel
def add_pairs(rows: Ints, columns: Ints, i: Ints, j: Ints, blocks: Blocks, values: Blocks):
    n = wp.tid()
    wp.atomic_add(values, find_slot(rows, columns, i[n], j[n]), blocks[n])


@wp.kernel
def lift_fixed(fixed: wp.array(dtype=wp.uint8), free: Doubles):
    i = wp.tid()
    free[i] = wp.float64(1.0) - wp.float64(fixed[i])


@wp.kernel
def fix_rows(
    rows: Ints,
    columns: Ints,
    free: Vectors,  # 1 where free, 0 where prescribed
    values: Blocks,
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
def row_times(rows: Ints, columns: Ints, values: Blocks, x: Vectors, i: int) -> wp.vec3d:
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
def multiply_scalars(rows: Ints, columns: Ints, values: Doubles, x: Doubles, y: Doubles):
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
def multiply(rows: Ints, columns: Ints, values: Blocks, x: Vectors, y: Vectors):
    i = wp.tid()
    y[i] = row_times(rows, columns, values, x, i)
