# type: ignore  (warp code: its types are warp's, not Python's)
"""Stable neo-Hookean elasticity (Smith, de Goes & Kim 2018, without the log term).

W = mu/2 (|F|^2 - 3) - mu (J - 1) + lam'/2 (J - 1)^2 with lam' = lam + mu, so that small strains are
answered with exactly (E, nu).
"""

from typing import Any

import warp as wp

from .kernels_tensor import (
    Blocks,
    Doubles,
    IntRows,
    Tets,
    Vectors,
    add_mode,
    add_stretches,
    cofactor,
    cofactor_change,
    mat99d,
    twist,
    volume_change,
)
from .law import ElasticLaw

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


@wp.func
def energy_and_stress(H: wp.mat33d, lam: wp.float64, mu: wp.float64):
    """Without cancellation at small H.

    With J - 1 = tr H + tr cof H + det H and cof(I + H) = I + (tr H) I - H^T + cof H.
    """
    half = wp.float64(0.5)
    eye = wp.identity(n=3, dtype=wp.float64)
    cof = cofactor(H)
    trace = wp.trace(H)
    bend = wp.trace(cof) + wp.determinant(H)
    grow = trace + bend
    stretch = wp.ddot(H, H) - wp.float64(2.0) * bend
    rest = trace * eye - wp.transpose(H) + cof
    bulk = (lam + mu) * grow
    return half * (mu * stretch + bulk * grow), mu * (H - rest) + bulk * (eye + rest)


@wp.func
def kirchhoff(H: Any, lam: Any, mu: Any):
    """Kirchhoff stress P F^T = mu (b - I) + (lam' J - mu) (J - 1) I [Pa], of any precision.

    What particles need of the law: with b = F F^T it is a third of the work of P.
    """
    grow = volume_change(H)
    bulk = ((lam + mu) * (type(lam)(1.0) + grow) - mu) * grow
    strain = H + wp.transpose(H) + H * wp.transpose(H)
    return mu * strain + bulk * wp.identity(n=3, dtype=type(lam))


@wp.func
def stress_change(H: wp.mat33d, dH: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    """Sum mu dH + lam' (cof F : dH) cof F + (lam' (J - 1) - mu) d(cof F)."""
    F = H + wp.identity(n=3, dtype=wp.float64)
    C = cofactor(F)
    k = (lam + mu) * volume_change(H) - mu
    return mu * dH + (lam + mu) * wp.ddot(C, dH) * C + k * cofactor_change(F, dH)


@wp.func
def exact_tangent(H: wp.mat33d, lam: wp.float64, mu: wp.float64) -> mat99d:
    """Sum mu I + lam' (cof F)(cof F)^T + k d(cof F)/dF, k = lam' (J - 1) - mu.

    Of columns c and d of F, the last is the matrix of the cross product with the third one.
    """
    F = H + wp.identity(n=3, dtype=wp.float64)
    C = cofactor(F)
    k = (lam + mu) * volume_change(H) - mu
    A = mat99d()
    for c in range(3):
        d = (c + 1) % 3
        e = (c + 2) % 3
        for i in range(3):
            row = (lam + mu) * C[i, c]
            for j in range(3):
                A[3 * c + i, 3 * c + j] = row * C[j, c]
                A[3 * c + i, 3 * d + j] = row * C[j, d]
                A[3 * c + i, 3 * e + j] = row * C[j, e]
            A[3 * c + i, 3 * c + i] += mu
            # d(cof F)_ic = eps_ijm F_me dF_jd - eps_ijm F_md dF_je
            j = (i + 1) % 3
            m = (i + 2) % 3
            A[3 * c + i, 3 * d + j] += k * F[m, e]
            A[3 * c + i, 3 * d + m] -= k * F[j, e]
            A[3 * c + i, 3 * e + j] -= k * F[m, d]
            A[3 * c + i, 3 * e + m] += k * F[j, d]
    return A


@wp.func
def projected_tangent(H: wp.mat33d, lam: wp.float64, mu: wp.float64) -> mat99d:
    """From the singular values s of F: twists by mu +- k s_i with k = lam' (J - 1) - mu."""
    zero = wp.float64(0.0)
    U = wp.mat33d()
    s = wp.vec3d()
    V = wp.mat33d()
    wp.svd3(H + wp.identity(n=3, dtype=wp.float64), U, s, V)
    k = (lam + mu) * (s[0] * s[1] * s[2] - wp.float64(1.0)) - mu
    c = wp.vec3d(s[1] * s[2], s[2] * s[0], s[0] * s[1])
    A = mat99d()
    by_stretch = wp.mat33d()
    for i in range(3):
        j = (i + 1) % 3
        A = add_mode(A, U, twist(i, wp.float64(-1.0)), V, wp.max(mu + k * s[i], zero))
        A = add_mode(A, U, twist(i, wp.float64(1.0)), V, wp.max(mu - k * s[i], zero))
        by_stretch[i, i] = mu + (lam + mu) * c[i] * c[i]
        by_stretch[i, j] = (lam + mu) * c[i] * c[j] + k * s[(i + 2) % 3]
        by_stretch[j, i] = by_stretch[i, j]
    return add_stretches(A, U, V, by_stretch)


@wp.func
def pair_block(
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
def add_pair(values: Blocks, slots: IntRows, t: int, a: int, b: int, block: wp.mat33d):
    """Add a block of nodes a, b of tet t, and its transpose."""
    wp.atomic_add(values, slots[t, 4 * a + b], block)
    wp.atomic_add(values, slots[t, 4 * b + a], wp.transpose(block))


@wp.kernel
def tangent_p1(tets: Tets, lam: Doubles, mu: Doubles, u: Vectors, slots: IntRows, values: Blocks):
    """Exact tangent of P1 tets, from edges X and doubled face areas P at rest, x and p deformed.

    With k = lam' (J - 1) - mu, C = cof F and shape gradients p, q, a block of the tangent is
    mu (p . q) I + lam' (C p)(C q)^T - k [F (p x q)]_x: C p is a deformed face, F (p x q) a deformed
    edge.
    """
    t = wp.tid()
    a = tets.elements[t, 0]
    b = tets.elements[t, 1]
    c = tets.elements[t, 2]
    d = tets.elements[t, 3]
    X = tets.points[b] - tets.points[a]
    Y = tets.points[c] - tets.points[a]
    Z = tets.points[d] - tets.points[a]
    x = X + (u[b] - u[a])
    y = Y + (u[c] - u[a])
    z = Z + (u[d] - u[a])
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
    wp.atomic_add(values, slots[t, 0], pair_block(S, S, s, s, none, m, n))
    wp.atomic_add(values, slots[t, 5], pair_block(P, P, p, p, none, m, n))
    wp.atomic_add(values, slots[t, 10], pair_block(Q, Q, q, q, none, m, n))
    wp.atomic_add(values, slots[t, 15], pair_block(R, R, r, r, none, m, n))
    add_pair(values, slots, t, 0, 1, pair_block(S, P, s, p, z - y, m, n))
    add_pair(values, slots, t, 0, 2, pair_block(S, Q, s, q, x - z, m, n))
    add_pair(values, slots, t, 0, 3, pair_block(S, R, s, r, y - x, m, n))
    add_pair(values, slots, t, 1, 2, pair_block(P, Q, p, q, z, m, n))
    add_pair(values, slots, t, 2, 3, pair_block(Q, R, q, r, x, m, n))
    add_pair(values, slots, t, 3, 1, pair_block(R, P, r, p, y, m, n))


NEO_HOOKEAN = ElasticLaw(
    title="neo-Hookean",
    energy_and_stress=energy_and_stress,
    stress_change=stress_change,
    exact_tangent=exact_tangent,
    projected_tangent=projected_tangent,
    tangent_p1=tangent_p1,
)
