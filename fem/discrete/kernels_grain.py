# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of tets with a grain: stress S = C : E of a stiffness tensor of every tet.

``finite``: E is Green's strain and P = F S, which leaves turns of any size alone (St Venant and
Kirchhoff); else E is the small strain and P = S.
"""

import warp as wp

from ..laws.kernels_tensor import positive_part
from .kernels_elastic import gradient_at, shape_gradients
from .kernels_tet import gradients, row10, six_volumes

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

vec6d = wp.types.vector(length=6, dtype=wp.float64)
mat66d = wp.types.matrix(shape=(6, 6), dtype=wp.float64)
mat63d = wp.types.matrix(shape=(6, 3), dtype=wp.float64)
HALF_ROOT = wp.constant(wp.float64(0.7071067811865476))


@wp.func
def strain_vector(H: wp.mat33d, finite: bool) -> vec6d:
    """Strain of the displacement gradient H in Mandel's notation."""
    A = H + wp.transpose(H)
    if finite:
        A += wp.transpose(H) * H
    e = vec6d()
    for c in range(3):
        e[c] = wp.float64(0.5) * A[c, c]
        e[3 + c] = HALF_ROOT * A[(c + 1) % 3, (c + 2) % 3]
    return e


@wp.func
def tensor_of(s: vec6d) -> wp.mat33d:
    S = wp.mat33d()
    for c in range(3):
        a = (c + 1) % 3
        b = (c + 2) % 3
        S[c, c] = s[c]
        S[a, b] = HALF_ROOT * s[3 + c]
        S[b, a] = HALF_ROOT * s[3 + c]
    return S


@wp.func
def strain_columns(p: wp.vec3d) -> mat63d:
    """Strain, in Mandel's notation, of displacements along x, y, z with the shape gradient p."""
    B = mat63d()
    for c in range(3):
        a = (c + 1) % 3
        b = (c + 2) % 3
        B[c, c] = p[c]
        B[3 + c, a] = HALF_ROOT * p[b]
        B[3 + c, b] = HALF_ROOT * p[a]
    return B


@wp.kernel
def grain_response(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    tensor: wp.array(dtype=mat66d),
    finite: bool,
    u: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec3d),
):
    """Add E : C : E / 2 of every tet, and P along the shape gradients."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    C = six / wp.float64(6 * quadrature.shape[0]) * tensor[t]
    total = wp.float64(0.0)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        e = strain_vector(H, finite)
        s = C * e
        P = tensor_of(s)
        if finite:
            P += H * P
        total += wp.float64(0.5) * wp.dot(s, e)
        for a in range(elements.shape[1]):
            wp.atomic_add(force, elements[t, a], P * row10(d, a))
    energy[t] += total


@wp.kernel
def grain_tangent(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    tensor: wp.array(dtype=mat66d),
    u: wp.array(dtype=wp.vec3d),
    projected: bool,
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    """Add the finite one's (p . S q) I + F B_p^T C B_q F^T of every pair of shape gradients.

    ``projected``: of S its positive part alone, so that no tet has a negative one.
    """
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    C = six / wp.float64(6 * quadrature.shape[0]) * tensor[t]
    size = elements.shape[1]
    eye = wp.identity(n=3, dtype=wp.float64)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        F = H + eye
        S = tensor_of(C * strain_vector(H, True))
        if projected:
            S = positive_part(S)
        for b in range(size):
            q = row10(d, b)
            CB = C * strain_columns(q) * wp.transpose(F)
            for a in range(size):
                p = row10(d, a)
                block = F * (wp.transpose(strain_columns(p)) * CB) + wp.dot(p, S * q) * eye
                wp.atomic_add(values, slots[t, size * a + b], block)


@wp.kernel
def anisotropic_stiffness(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    tensor: wp.array(dtype=mat66d),
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.mat33d),
):
    """Add the tangent of small strains."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = six / wp.float64(6 * quadrature.shape[0])
    size = elements.shape[1]
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        for b in range(size):
            S = (w * tensor[t]) * strain_columns(row10(d, b))
            for a in range(size):
                block = wp.transpose(strain_columns(row10(d, a))) * S
                wp.atomic_add(values, slots[t, size * a + b], block)
