# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of loads on the nodes of tets, of displacement gradients, and of steps in time."""

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


@wp.kernel
def foresee(
    old: wp.array(dtype=wp.vec3d),
    target: wp.array(dtype=wp.vec3d),
    free: wp.array(dtype=wp.vec3d),
    differences: wp.array2d(dtype=wp.vec3d),
    terms: wp.int32,
    share: wp.float64,
    aim: wp.array(dtype=wp.vec3d),
    start: wp.array(dtype=wp.vec3d),
):
    """``target`` of a step where a component is free, and with the acceleration to expect."""
    i = wp.tid()
    ahead = target[i] - old[i]
    aim[i] = old[i] + wp.cw_mul(free[i], ahead)
    for k in range(terms):
        ahead += share * differences[k, i]
    start[i] = old[i] + wp.cw_mul(free[i], ahead)


@wp.kernel
def incremental(
    u: wp.array(dtype=wp.vec3d),
    target: wp.array(dtype=wp.vec3d),
    factor: wp.float64,
    mass: wp.array(dtype=wp.float64),
    rigidity: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec3d),
    load: wp.array(dtype=wp.vec3d),
    springs: wp.array(dtype=wp.vec3d),
    free: wp.array(dtype=wp.vec3d),
    gradient: wp.array(dtype=wp.vec3d),
    sums: wp.array(dtype=wp.float64),
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
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    by_v: wp.float64,
    a: wp.array(dtype=wp.vec3d),
    by_a: wp.float64,
    free: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    load: wp.array(dtype=wp.vec3d),
    springs: wp.array(dtype=wp.vec3d),
    count: wp.int32,
    motion: wp.array2d(dtype=wp.vec3d),
    differences: wp.array2d(dtype=wp.vec3d),
    sums: wp.array(dtype=wp.float64),
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
