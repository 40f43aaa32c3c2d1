# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of the elastic laws: energy, internal force and tangent of P1 and P2 tets."""

import warp as wp

from ..discrete.kernels_linear import (
    gradients,
    gradients_p2,
    mat43d,
    mat103d,
    row3,
    row10,
    six_volumes,
    stiffness_block,
)

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

LINEAR = wp.constant(0)
NEO_HOOKEAN = wp.constant(1)
COROTATED = wp.constant(2)


@wp.func
def cofactor(F: wp.mat33d) -> wp.mat33d:
    a = wp.vec3d(F[0, 0], F[1, 0], F[2, 0])
    b = wp.vec3d(F[0, 1], F[1, 1], F[2, 1])
    c = wp.vec3d(F[0, 2], F[1, 2], F[2, 2])
    return wp.matrix_from_cols(wp.cross(b, c), wp.cross(c, a), wp.cross(a, b))


@wp.func
def rotation(F: wp.mat33d) -> wp.mat33d:
    """Rotation of the polar decomposition."""
    U = wp.mat33d()
    s = wp.vec3d()
    V = wp.mat33d()
    wp.svd3(F, U, s, V)
    return U * wp.transpose(V)


@wp.func
def energy_and_stress(law: int, H: wp.mat33d, lam: wp.float64, mu: wp.float64):
    """Energy per volume and first Piola stress of the displacement gradient H."""
    half = wp.float64(0.5)
    eye = wp.identity(n=3, dtype=wp.float64)
    if law == LINEAR:
        sigma = lam * wp.trace(H) * eye + mu * (H + wp.transpose(H))
        return half * wp.ddot(sigma, H), sigma
    if law == COROTATED:
        F = H + eye
        R = rotation(F)
        t = wp.ddot(R, F) - wp.float64(3.0)
        D = F - R
        return mu * wp.ddot(D, D) + half * lam * t * t, wp.float64(2.0) * mu * D + lam * t * R
    # |F|^2 - 3 - 2 (J - 1) and mu F - mu cof F without cancellation at small H:
    # J - 1 = tr H + tr cof H + det H and cof(I + H) = I + (tr H) I - H^T + cof H.
    cof = cofactor(H)
    trace = wp.trace(H)
    grow = trace + wp.trace(cof) + wp.determinant(H)
    stretch = wp.ddot(H, H) - wp.float64(2.0) * (grow - trace)
    rest = trace * eye - wp.transpose(H) + cof
    bulk = (lam + mu) * grow
    return half * (mu * stretch + bulk * grow), mu * (H - rest) + bulk * (eye + rest)


@wp.func
def volume_change(H: wp.mat33d) -> wp.float64:
    """J - 1 = det(I + H) - 1, exact for small H."""
    return wp.trace(H) + wp.trace(cofactor(H)) + wp.determinant(H)


@wp.func
def shape_gradients(g: mat43d, elements: wp.array2d(dtype=wp.int32), q: wp.vec4d) -> mat103d:
    """Gradients of the 4 or 10 shape functions; the last six rows are zero for P1."""
    d = mat103d()
    if elements.shape[1] == 10:
        d = gradients_p2(g, q)
    else:
        for a in range(4):
            for c in range(3):
                d[a, c] = g[a, c]
    return d


@wp.func
def gradient_at(
    d: mat103d, elements: wp.array2d(dtype=wp.int32), u: wp.array(dtype=wp.vec3d), t: int
) -> wp.mat33d:
    H = wp.mat33d()
    for a in range(elements.shape[1]):
        H += wp.outer(u[elements[t, a]], row10(d, a))
    return H


@wp.func
def gradient_p1(
    g: mat43d, elements: wp.array2d(dtype=wp.int32), u: wp.array(dtype=wp.vec3d), t: int
) -> wp.mat33d:
    H = wp.mat33d()
    for a in range(4):
        H += wp.outer(u[elements[t, a]], row3(g, a))
    return H


@wp.kernel
def energy_and_force(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    law: wp.int32,
    u: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec3d),
):
    """Elastic energy of every tet; add dW/du, with which nodes resist, to ``force``."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = six / wp.float64(6 * quadrature.shape[0])
    if elements.shape[1] == 4:
        W, P = energy_and_stress(law, gradient_p1(g, elements, u, t), w * lam[t], w * mu[t])
        energy[t] = W
        p = P * row3(g, 1)
        q = P * row3(g, 2)
        r = P * row3(g, 3)
        wp.atomic_add(force, elements[t, 0], -(p + q + r))
        wp.atomic_add(force, elements[t, 1], p)
        wp.atomic_add(force, elements[t, 2], q)
        wp.atomic_add(force, elements[t, 3], r)
    else:
        total = wp.float64(0.0)
        for n in range(quadrature.shape[0]):
            d = gradients_p2(g, quadrature[n])
            H = gradient_at(d, elements, u, t)
            W, P = energy_and_stress(law, H, w * lam[t], w * mu[t])
            total += W
            for a in range(10):
                wp.atomic_add(force, elements[t, a], P * row10(d, a))
        energy[t] = total


@wp.func
def neo_hookean_block(
    p: wp.vec3d, q: wp.vec3d, F: wp.mat33d, C: wp.mat33d, k: wp.float64, lam: wp.float64,
    mu: wp.float64,
) -> wp.mat33d:  # fmt: skip
    """Second derivative of the density in directions (., p), (., q): see ``tangent``."""
    v = k * (F * wp.cross(p, q))
    d = mu * wp.dot(p, q)
    block = (lam + mu) * wp.outer(C * p, C * q)
    return block + wp.mat33d(d, v[2], -v[1], -v[2], d, v[0], v[1], -v[0], d)


@wp.func
def neo_hookean_pair(
    P: wp.vec3d, Q: wp.vec3d, p: wp.vec3d, q: wp.vec3d, v: wp.vec3d, m: wp.float64, n: wp.float64
) -> wp.mat33d:
    """Block m (P . Q) I + n p q^T + [v]_x."""
    d = m * wp.dot(P, Q)
    s = n * p
    return wp.mat33d(
        s[0] * q[0] + d, s[0] * q[1] - v[2], s[0] * q[2] + v[1],
        s[1] * q[0] + v[2], s[1] * q[1] + d, s[1] * q[2] - v[0],
        s[2] * q[0] - v[1], s[2] * q[1] + v[0], s[2] * q[2] + d,
    )  # fmt: skip


@wp.func
def add_pair(
    values: wp.array(dtype=wp.mat33d),
    slots: wp.array2d(dtype=wp.int32),
    t: int,
    a: int,
    b: int,
    block: wp.mat33d,
):
    """Add a block of nodes a, b of tet t, and its transpose."""
    wp.atomic_add(values, slots[t, 4 * a + b], block)
    wp.atomic_add(values, slots[t, 4 * b + a], wp.transpose(block))


@wp.kernel
def neo_hookean_tangent_p1(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    u: wp.array(dtype=wp.vec3d),
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    """Exact tangent of P1 tets, from edges X and doubled face areas P at rest, x and p deformed.

    Of ``tangent``'s terms, cof F p is a deformed face and F (p x q) a deformed edge.
    """
    t = wp.tid()
    i = elements[t, 0]
    X = points[elements[t, 1]] - points[i]
    Y = points[elements[t, 2]] - points[i]
    Z = points[elements[t, 3]] - points[i]
    x = X + (u[elements[t, 1]] - u[i])
    y = Y + (u[elements[t, 2]] - u[i])
    z = Z + (u[elements[t, 3]] - u[i])
    P = wp.cross(Y, Z)
    Q = wp.cross(Z, X)
    R = wp.cross(X, Y)
    S = -(P + Q + R)
    p = wp.cross(y, z)
    q = wp.cross(z, x)
    r = wp.cross(x, y)
    s = -(p + q + r)
    six = wp.dot(X, P)
    m = mu[t] / (wp.float64(6.0) * six)
    n = (lam[t] + mu[t]) / (wp.float64(6.0) * six)
    grow = wp.dot(x, p) / six - wp.float64(1.0)
    k = (mu[t] - (lam[t] + mu[t]) * grow) / wp.float64(6.0)
    x = k * x
    y = k * y
    z = k * z
    none = wp.vec3d()
    wp.atomic_add(values, slots[t, 0], neo_hookean_pair(S, S, s, s, none, m, n))
    wp.atomic_add(values, slots[t, 5], neo_hookean_pair(P, P, p, p, none, m, n))
    wp.atomic_add(values, slots[t, 10], neo_hookean_pair(Q, Q, q, q, none, m, n))
    wp.atomic_add(values, slots[t, 15], neo_hookean_pair(R, R, r, r, none, m, n))
    add_pair(values, slots, t, 0, 1, neo_hookean_pair(S, P, s, p, z - y, m, n))
    add_pair(values, slots, t, 0, 2, neo_hookean_pair(S, Q, s, q, x - z, m, n))
    add_pair(values, slots, t, 0, 3, neo_hookean_pair(S, R, s, r, y - x, m, n))
    add_pair(values, slots, t, 1, 2, neo_hookean_pair(P, Q, p, q, z, m, n))
    add_pair(values, slots, t, 2, 3, neo_hookean_pair(Q, R, q, r, x, m, n))
    add_pair(values, slots, t, 3, 1, neo_hookean_pair(R, P, r, p, y, m, n))


@wp.kernel
def tangent(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    law: wp.int32,  # LINEAR or NEO_HOOKEAN
    u: wp.array(dtype=wp.vec3d),
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    """Exact tangent stiffness.

    With k = lam' (J - 1) - mu, C = cof F and shape gradients p, q, a block of the neo-Hookean
    tangent is mu (p . q) I + lam' (C p)(C q)^T - k [F (p x q)]_x.
    """
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = six / wp.float64(6 * quadrature.shape[0])
    size = elements.shape[1]
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        F = H + wp.identity(n=3, dtype=wp.float64)
        C = cofactor(F)
        k = w * ((lam[t] + mu[t]) * volume_change(H) - mu[t])
        for a in range(size):
            p = row10(d, a)
            for b in range(a, size):
                q = row10(d, b)
                if law == LINEAR:
                    block = stiffness_block(p, q, w * lam[t], w * mu[t])
                else:
                    block = neo_hookean_block(p, q, F, C, k, w * lam[t], w * mu[t])
                wp.atomic_add(values, slots[t, size * a + b], block)
                if b > a:
                    wp.atomic_add(values, slots[t, size * b + a], wp.transpose(block))
