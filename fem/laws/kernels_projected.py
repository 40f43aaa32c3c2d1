# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of tangents made positive semi-definite."""

import warp as wp

from ..discrete.kernels_linear import gradients, row10, six_volumes
from .kernels_law import NEO_HOOKEAN, gradient_at, shape_gradients

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

mat99d = wp.types.matrix(shape=(9, 9), dtype=wp.float64)
vec9d = wp.types.vector(length=9, dtype=wp.float64)


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
