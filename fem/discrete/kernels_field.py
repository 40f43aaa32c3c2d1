# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of loads spread over the nodes of tets, and of displacement gradients."""

import warp as wp

from .kernels_tet import gradients, gradients_p2, row3, row10, six_volumes

wp.set_module_options({"enable_backward": False, "max_unroll": 4})


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


@wp.kernel
def geometric_stiffness(
    points: wp.array(dtype=wp.vec3d),
    elements: wp.array2d(dtype=wp.int32),
    quadrature: wp.array(dtype=wp.vec4d),
    stress: wp.array2d(dtype=wp.mat33d),  # (tets, quadrature points)
    slots: wp.array2d(dtype=wp.int32),
    values: wp.array(dtype=wp.float64),
):
    """Add the integrals of grad N_a . stress grad N_b: the same for every direction."""
    t = wp.tid()
    six = six_volumes(points, elements, t)
    g = gradients(points, elements, t) * (wp.float64(1.0) / six)
    w = six / wp.float64(6 * quadrature.shape[0])
    size = elements.shape[1]
    for q in range(quadrature.shape[0]):
        s = w * stress[t, q]
        if size == 4:
            for a in range(4):
                p = s * row3(g, a)
                for b in range(4):
                    wp.atomic_add(values, slots[t, 4 * a + b], wp.dot(p, row3(g, b)))
        else:
            d = gradients_p2(g, quadrature[q])
            for a in range(10):
                p = s * row10(d, a)
                for b in range(10):
                    wp.atomic_add(values, slots[t, 10 * a + b], wp.dot(p, row10(d, b)))
