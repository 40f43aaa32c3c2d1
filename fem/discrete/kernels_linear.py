# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of linear elasticity: element stiffness, loads, supports, block rows, strain."""

import warp as wp

from .kernels_pattern import find_slot

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

# Barycentric gradients of a tet: row k is d lambda_k / dx.
mat43d = wp.types.matrix(shape=(4, 3), dtype=wp.float64)
mat103d = wp.types.matrix(shape=(10, 3), dtype=wp.float64)


@wp.func
def gradients(
    points: wp.array(dtype=wp.vec3d), elements: wp.array2d(dtype=wp.int32), t: int
) -> mat43d:
    """Gradients of the barycentric coordinates, times six volumes."""
    a = points[elements[t, 0]]
    x = points[elements[t, 1]] - a
    y = points[elements[t, 2]] - a
    z = points[elements[t, 3]] - a
    gx = wp.cross(y, z)
    gy = wp.cross(z, x)
    gz = wp.cross(x, y)
    g0 = -(gx + gy + gz)
    return mat43d(
        g0[0], g0[1], g0[2], gx[0], gx[1], gx[2], gy[0], gy[1], gy[2], gz[0], gz[1], gz[2]
    )


@wp.func
def six_volumes(
    points: wp.array(dtype=wp.vec3d), elements: wp.array2d(dtype=wp.int32), t: int
) -> wp.float64:
    a = points[elements[t, 0]]
    x = points[elements[t, 1]] - a
    y = points[elements[t, 2]] - a
    z = points[elements[t, 3]] - a
    return wp.dot(x, wp.cross(y, z))


@wp.func
def row3(g: mat43d, k: int) -> wp.vec3d:
    return wp.vec3d(g[k, 0], g[k, 1], g[k, 2])


@wp.func
def stiffness_block(p: wp.vec3d, q: wp.vec3d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    """Lam p q^T + mu (q p^T + (p . q) I): the block of shape gradients p and q."""
    d = mu * wp.dot(p, q)
    return wp.mat33d(
        (lam + mu) * p[0] * q[0] + d,
        lam * p[0] * q[1] + mu * q[0] * p[1],
        lam * p[0] * q[2] + mu * q[0] * p[2],
        lam * p[1] * q[0] + mu * q[1] * p[0],
        (lam + mu) * p[1] * q[1] + d,
        lam * p[1] * q[2] + mu * q[1] * p[2],
        lam * p[2] * q[0] + mu * q[2] * p[0],
        lam * p[2] * q[1] + mu * q[2] * p[1],
        (lam + mu) * p[2] * q[2] + d,
    )


@wp.kernel
def assemble_p1(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    t = wp.tid()
    g = gradients(points, elements, t)
    # volume / (6 volume)^2
    w = wp.float64(1.0) / (wp.float64(6.0) * six_volumes(points, elements, t))
    for a in range(4):
        p = row3(g, a)
        block = stiffness_block(p, p, w * lam[t], w * mu[t])
        wp.atomic_add(values, slots[t, 5 * a], block)
        for b in range(a + 1, 4):
            block = stiffness_block(p, row3(g, b), w * lam[t], w * mu[t])
            wp.atomic_add(values, slots[t, 4 * a + b], block)
            wp.atomic_add(values, slots[t, 4 * b + a], wp.transpose(block))


@wp.func
def edge_ends(k: int):
    """Corners of edge k, in the order of VTK's quadratic tetrahedron."""
    i = 0
    j = 1
    if k == 1:
        i = 1
        j = 2
    elif k == 2:
        j = 2
    elif k == 3:
        j = 3
    elif k == 4:
        i = 1
        j = 3
    elif k == 5:
        i = 2
        j = 3
    return i, j


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


@wp.kernel
def assemble_p2(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    quadrature: wp.array(dtype=wp.vec4d),
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    t = wp.tid()
    g = gradients(points, elements, t)
    w = wp.float64(1.0) / (wp.float64(24.0) * six_volumes(points, elements, t))
    for q in range(quadrature.shape[0]):
        d = gradients_p2(g, quadrature[q])
        for a in range(elements.shape[1]):
            p = row10(d, a)
            for b in range(a, elements.shape[1]):
                block = stiffness_block(p, row10(d, b), w * lam[t], w * mu[t])
                wp.atomic_add(values, slots[t, 10 * a + b], block)
                if b > a:
                    wp.atomic_add(values, slots[t, 10 * b + a], wp.transpose(block))


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
def add_scaled(
    factor: wp.float64,
    other: wp.array(dtype=wp.mat33d),
    values: wp.array(dtype=wp.mat33d),
):
    s = wp.tid()
    values[s] = values[s] + factor * other[s]


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
    for s in range(rows[i], rows[i + 1]):
        j = columns[s]
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
def multiply(
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
    x: wp.array(dtype=wp.vec3d),
    y: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    y[i] = row_times(rows, columns, values, x, i)


@wp.kernel
def spread(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    density: wp.array(dtype=wp.float64),
    share: wp.array(dtype=wp.float64),
    total: wp.array(dtype=wp.float64),
):
    """Add the integral of a density, constant on every tet: every node takes its ``share``."""
    t = wp.tid()
    amount = density[t] * (six_volumes(points, elements, t) / wp.float64(6.0))
    for a in range(elements.shape[1]):
        wp.atomic_add(total, elements[t, a], share[a] * amount)


@wp.kernel
def body_force(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    density: wp.array(dtype=wp.vec3d),
    share: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec3d),
):
    """Add the force of a density, constant on every tet: every node takes its ``share``."""
    t = wp.tid()
    total = density[t] * (six_volumes(points, elements, t) / wp.float64(6.0))
    for a in range(elements.shape[1]):
        wp.atomic_add(force, elements[t, a], share[a] * total)


@wp.kernel
def displacement_gradient(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    u: wp.array(dtype=wp.vec3d),
    grad: wp.array2d(dtype=wp.mat33d),  # (tets, quadrature points)
):
    """The gradient du_i/dx_j of a P1 or P2 displacement at barycentric points of every tet."""
    t = wp.tid()
    s = wp.float64(1.0) / six_volumes(points, elements, t)
    g = gradients(points, elements, t) * s
    for q in range(quadrature.shape[0]):
        total = wp.mat33d()
        if elements.shape[1] == 4:
            for a in range(4):
                total += wp.outer(u[elements[t, a]], row3(g, a))
        else:
            d = gradients_p2(g, quadrature[q])
            for a in range(10):
                total += wp.outer(u[elements[t, a]], row10(d, a))
        grad[t, q] = total
