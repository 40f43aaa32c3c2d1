# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of the elastic laws: energy, internal force and tangent of P1 and P2 tets."""

import warp as wp

from .kernels_linear import (
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

mat99d = wp.types.matrix(shape=(9, 9), dtype=wp.float64)
vec9d = wp.types.vector(length=9, dtype=wp.float64)


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
def energy_density(law: int, H: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.float64:
    """Energy per volume of the displacement gradient H."""
    one = wp.float64(1.0)
    half = wp.float64(0.5)
    if law == LINEAR:
        e = half * (H + wp.transpose(H))
        t = wp.trace(e)
        return half * lam * t * t + mu * wp.ddot(e, e)
    F = H + wp.identity(n=3, dtype=wp.float64)
    if law == COROTATED:
        R = rotation(F)
        t = wp.ddot(R, F) - wp.float64(3.0)
        return mu * wp.ddot(F - R, F - R) + half * lam * t * t
    # |F|^2 - 3 - 2 (J - 1) without cancellation at small H: J - 1 = tr H + tr cof H + det H
    grow = volume_change(H)
    stretch = wp.ddot(H, H) - wp.float64(2.0) * (grow - wp.trace(H))
    return half * mu * stretch + half * (lam + mu) * grow * grow * one


@wp.func
def volume_change(H: wp.mat33d) -> wp.float64:
    """J - 1 = det(I + H) - 1, exact for small H."""
    return wp.trace(H) + wp.trace(cofactor(H)) + wp.determinant(H)


@wp.func
def first_piola(law: int, H: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    """First Piola stress of the displacement gradient H."""
    eye = wp.identity(n=3, dtype=wp.float64)
    if law == LINEAR:
        return lam * wp.trace(H) * eye + mu * (H + wp.transpose(H))
    F = H + eye
    if law == COROTATED:
        R = rotation(F)
        t = wp.ddot(R, F) - wp.float64(3.0)
        return wp.float64(2.0) * mu * (F - R) + lam * t * R
    # mu F - mu cof F without cancellation: cof(I + H) = I + (tr H) I - H^T + cof H
    grow = volume_change(H)
    rest = wp.trace(H) * eye - wp.transpose(H) + cofactor(H)
    return mu * (H - rest) + (lam + mu) * grow * (eye + rest)


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
def element_energy(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    law: wp.int32,
    u: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
):
    """Elastic energy of every tet."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = six / wp.float64(6 * quadrature.shape[0])
    total = wp.float64(0.0)
    if elements.shape[1] == 4:
        total = w * energy_density(law, gradient_p1(g, elements, u, t), lam[t], mu[t])
    else:
        for q in range(quadrature.shape[0]):
            H = gradient_at(gradients_p2(g, quadrature[q]), elements, u, t)
            total += w * energy_density(law, H, lam[t], mu[t])
    energy[t] = total


@wp.kernel
def internal_force(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    law: wp.int32,
    u: wp.array(dtype=wp.vec3d),
    force: wp.array(dtype=wp.vec3d),
):
    """Add dW/du, the elastic force with which nodes resist, to ``force``."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = six / wp.float64(6 * quadrature.shape[0])
    if elements.shape[1] == 4:
        P = w * first_piola(law, gradient_p1(g, elements, u, t), lam[t], mu[t])
        for a in range(4):
            wp.atomic_add(force, elements[t, a], P * row3(g, a))
    else:
        for q in range(quadrature.shape[0]):
            d = gradients_p2(g, quadrature[q])
            P = w * first_piola(law, gradient_at(d, elements, u, t), lam[t], mu[t])
            for a in range(10):
                wp.atomic_add(force, elements[t, a], P * row10(d, a))


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
    if law == NEO_HOOKEAN and size == 4:  # the common case, with nothing of P2 in its way
        H = gradient_p1(g, elements, u, t)
        F = H + wp.identity(n=3, dtype=wp.float64)
        C = cofactor(F)
        k = w * ((lam[t] + mu[t]) * volume_change(H) - mu[t])
        for a in range(4):
            p = row3(g, a)
            for b in range(a, 4):
                block = neo_hookean_block(p, row3(g, b), F, C, k, w * lam[t], w * mu[t])
                wp.atomic_add(values, slots[t, 4 * a + b], block)
                if b > a:
                    wp.atomic_add(values, slots[t, 4 * b + a], wp.transpose(block))
        return
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


@wp.func
def add_mode(A: mat99d, U: wp.mat33d, M: wp.mat33d, V: wp.mat33d, value: wp.float64) -> mat99d:
    """Add ``value`` m m^T with m the nine entries of U M V^T, column by column."""
    T = U * M * wp.transpose(V)
    m = vec9d()
    for c in range(3):
        for r in range(3):
            m[3 * c + r] = T[r, c]
    return A + value * wp.outer(m, m)


@wp.func
def twist(axis: int, sign: wp.float64) -> wp.mat33d:
    """Unit matrix with entries 1/sqrt(2) and sign/sqrt(2) in the plane across ``axis``."""
    M = wp.mat33d()
    i = (axis + 1) % 3
    j = (axis + 2) % 3
    M[i, j] = wp.float64(0.7071067811865476)
    M[j, i] = sign * wp.float64(0.7071067811865476)
    return M


@wp.func
def projected_density_tangent(law: int, F: wp.mat33d, lam: wp.float64, mu: wp.float64) -> mat99d:
    """Second derivative of the density, negative eigenvalues set to zero (Smith et al. 2018)."""
    zero = wp.float64(0.0)
    U = wp.mat33d()
    s = wp.vec3d()
    V = wp.mat33d()
    wp.svd3(F, U, s, V)
    scaling = wp.mat33d()
    A = mat99d()
    t = s[0] + s[1] + s[2] - wp.float64(3.0)
    J = s[0] * s[1] * s[2]
    k = (lam + mu) * (J - wp.float64(1.0)) - mu
    for i in range(3):
        a = s[(i + 1) % 3]
        b = s[(i + 2) % 3]
        if law == NEO_HOOKEAN:
            A = add_mode(A, U, twist(i, wp.float64(-1.0)), V, wp.max(mu + k * s[i], zero))
            A = add_mode(A, U, twist(i, wp.float64(1.0)), V, wp.max(mu - k * s[i], zero))
        else:
            two = wp.float64(2.0) * mu
            turn = wp.float64(2.0) * (two - lam * t) / wp.max(a + b, wp.float64(1.0e-6))
            A = add_mode(A, U, twist(i, wp.float64(-1.0)), V, wp.max(two - turn, zero))
            A = add_mode(A, U, twist(i, wp.float64(1.0)), V, two)
            for j in range(3):
                scaling[i, j] = lam
    for i in range(3):
        j = (i + 1) % 3
        if law == NEO_HOOKEAN:
            c = wp.vec3d(s[1] * s[2], s[2] * s[0], s[0] * s[1])
            scaling[i, i] = mu + (lam + mu) * c[i] * c[i]
            scaling[i, j] = (lam + mu) * c[i] * c[j] + k * s[(i + 2) % 3]
            scaling[j, i] = scaling[i, j]
        else:
            scaling[i, i] = scaling[i, i] + wp.float64(2.0) * mu
    Q = wp.mat33d()
    e = wp.vec3d()
    wp.eig3(scaling, Q, e)
    for i in range(3):
        A = add_mode(A, U, wp.diag(wp.vec3d(Q[0, i], Q[1, i], Q[2, i])), V, wp.max(e[i], zero))
    return A


@wp.func
def contract(A: mat99d, p: wp.vec3d, q: wp.vec3d) -> wp.mat33d:
    """Block sum_cd A[(., c), (., d)] p_c q_d."""
    block = wp.mat33d()
    for c in range(3):
        for d in range(3):
            for i in range(3):
                for j in range(3):
                    block[i, j] = block[i, j] + A[3 * c + i, 3 * d + j] * p[c] * q[d]
    return block


@wp.kernel
def projected_tangent(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    law: wp.int32,  # NEO_HOOKEAN or COROTATED
    u: wp.array(dtype=wp.vec3d),
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    """Tangent stiffness whose density is projected to positive semi-definite."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = six / wp.float64(6 * quadrature.shape[0])
    size = elements.shape[1]
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        F = gradient_at(d, elements, u, t) + wp.identity(n=3, dtype=wp.float64)
        A = projected_density_tangent(law, F, w * lam[t], w * mu[t])
        for a in range(size):
            for b in range(a, size):
                block = contract(A, row10(d, a), row10(d, b))
                wp.atomic_add(values, slots[t, size * a + b], block)
                if b > a:
                    wp.atomic_add(values, slots[t, size * b + a], wp.transpose(block))
