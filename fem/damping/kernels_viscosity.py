# type: ignore  (warp code: its types are warp's, not Python's)
"""Viscous stress P = F S of the change D of Green's strain: S = 2 mu D + lam (tr D) I.

``along`` is the displacement that the strain changed from, or with ``rate`` the velocity: then D
is the rate of strain sym(F^T grad v). Neither changes with a turn of the body.
"""

import warp as wp

from ..discrete.kernels_elastic import gradient_at, shape_gradients
from ..discrete.kernels_tet import gradients, row10, six_volumes
from ..laws.kernels_tensor import positive_part
from ..laws.linear import stiffness_block

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


@wp.func
def strain_change(H: wp.mat33d, G: wp.mat33d, rate: bool) -> wp.mat33d:
    """Green's strain of H less that of G; or its rate at H with the gradient G of the velocity."""
    D = H - G
    A = D + wp.float64(0.5) * (wp.transpose(H) * D + wp.transpose(D) * G)
    if rate:
        A = G + wp.transpose(H) * G
    return wp.float64(0.5) * (A + wp.transpose(A))


@wp.func
def viscous_stress(D: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    return wp.float64(2.0) * mu * D + lam * wp.trace(D) * wp.identity(n=3, dtype=wp.float64)


@wp.kernel
def stress(
    H: wp.array(dtype=wp.mat33d),
    G: wp.array(dtype=wp.mat33d),
    rate: bool,
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    P: wp.array(dtype=wp.mat33d),
):
    i = wp.tid()
    S = viscous_stress(strain_change(H[i], G[i], rate), lam[i], mu[i])
    P[i] = S + H[i] * S


@wp.kernel
def energy_and_force(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    scale: wp.float64,
    u: wp.array(dtype=wp.vec3d),
    along: wp.array(dtype=wp.vec3d),
    rate: bool,
    energy: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec3d),
):
    """S : D / 2 of every tet, the potential of P in a step; add P along the shape gradients."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = scale * six / wp.float64(6 * quadrature.shape[0])
    total = wp.float64(0.0)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        D = strain_change(H, gradient_at(d, elements, along, t), rate)
        S = viscous_stress(D, w * lam[t], w * mu[t])
        P = S + H * S
        total += wp.float64(0.5) * wp.ddot(S, D)
        for a in range(elements.shape[1]):
            wp.atomic_add(force, elements[t, a], P * row10(d, a))
    energy[t] = total


@wp.kernel
def tangent(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    lam: wp.array(dtype=wp.float64),
    mu: wp.array(dtype=wp.float64),
    scale: wp.float64,
    u: wp.array(dtype=wp.vec3d),
    along: wp.array(dtype=wp.vec3d),
    projected: bool,
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    """Add (p . S q) I + F C(p, q) F^T of every pair of shape gradients, C of Hooke's law.

    ``projected``: of S its positive part alone, so that no tet has a negative one.
    """
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = scale * six / wp.float64(6 * quadrature.shape[0])
    size = elements.shape[1]
    eye = wp.identity(n=3, dtype=wp.float64)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        D = strain_change(H, gradient_at(d, elements, along, t), False)
        S = viscous_stress(D, w * lam[t], w * mu[t])
        if projected:
            S = positive_part(S)
        F = H + eye
        for b in range(size):
            q = row10(d, b)
            for a in range(size):
                p = row10(d, a)
                C = stiffness_block(p, q, w * lam[t], w * mu[t])
                block = wp.dot(p, S * q) * eye + F * C * wp.transpose(F)
                wp.atomic_add(values, slots[t, size * a + b], block)
