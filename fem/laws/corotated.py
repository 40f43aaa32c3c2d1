# type: ignore  (warp code: its types are warp's, not Python's)
"""Corotated elasticity: W = mu |F - R|^2 + lam/2 (tr(R^T F) - 3)^2, R the rotation of F."""

import warp as wp

from .kernels_tensor import add_mode, add_stretches, mat99d, twist
from .law import ElasticLaw

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


@wp.func
def energy_and_stress(H: wp.mat33d, lam: wp.float64, mu: wp.float64):
    F = H + wp.identity(n=3, dtype=wp.float64)
    U = wp.mat33d()
    s = wp.vec3d()
    V = wp.mat33d()
    wp.svd3(F, U, s, V)
    R = U * wp.transpose(V)
    t = wp.ddot(R, F) - wp.float64(3.0)
    D = F - R
    energy = mu * wp.ddot(D, D) + wp.float64(0.5) * lam * t * t
    return energy, wp.float64(2.0) * mu * D + lam * t * R


@wp.func
def tangent_from(H: wp.mat33d, lam: wp.float64, mu: wp.float64, least: wp.float64) -> mat99d:
    """From the singular values s of F: twists by 2 mu - 2 (2 mu - lam t) / (s_a + s_b), or more.

    Twists resist by ``least`` [Pa] where they would by less; nothing else can be negative.
    """
    U = wp.mat33d()
    s = wp.vec3d()
    V = wp.mat33d()
    wp.svd3(H + wp.identity(n=3, dtype=wp.float64), U, s, V)
    two = wp.float64(2.0) * mu
    t = s[0] + s[1] + s[2] - wp.float64(3.0)
    A = mat99d()
    by_stretch = two * wp.identity(n=3, dtype=wp.float64)
    for i in range(3):
        sides = wp.max(s[(i + 1) % 3] + s[(i + 2) % 3], wp.float64(1.0e-6))
        turn = two - wp.float64(2.0) * (two - lam * t) / sides
        A = add_mode(A, U, twist(i, wp.float64(-1.0)), V, wp.max(turn, least))
        A = add_mode(A, U, twist(i, wp.float64(1.0)), V, two)
        for j in range(3):
            by_stretch[i, j] = by_stretch[i, j] + lam
    return add_stretches(A, U, V, by_stretch)


@wp.func
def exact_tangent(H: wp.mat33d, lam: wp.float64, mu: wp.float64) -> mat99d:
    return tangent_from(H, lam, mu, wp.float64(-wp.inf))


@wp.func
def projected_tangent(H: wp.mat33d, lam: wp.float64, mu: wp.float64) -> mat99d:
    return tangent_from(H, lam, mu, wp.float64(0.0))


COROTATED = ElasticLaw(
    title="corotated",
    energy_and_stress=energy_and_stress,
    exact_tangent=exact_tangent,
    projected_tangent=projected_tangent,
)
