# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of Krylov methods: inner products, conjugate gradients, Lanczos."""

import warp as wp

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

# Scalars of CG, kept on the device: one array of these.
RZ = wp.constant(0)
PAP = wp.constant(1)
RZ_NEW = wp.constant(2)
NORM2 = wp.constant(3)
TARGET2 = wp.constant(4)
ENDED = wp.constant(5)
# Whole numbers of CG: whether it goes on, iterations done, most iterations, negative curvature met.
GO = wp.constant(0)
COUNT = wp.constant(1)
LIMIT = wp.constant(2)
INDEFINITE = wp.constant(3)


@wp.kernel
def inner(
    a: wp.array(dtype=wp.float64),
    b: wp.array(dtype=wp.float64),
    slot: wp.int32,
    out: wp.array(dtype=wp.float64),
):
    """Add a . b to ``out[slot]``; the last block of threads may reach past the end."""
    i = wp.tid()
    product = wp.float64(0.0)
    if i < a.shape[0]:
        product = a[i] * b[i]
    wp.tile_atomic_add(out, wp.tile_sum(wp.tile(product)), offset=slot)


@wp.kernel
def cg_advance(
    p: wp.array(dtype=wp.vec3d),
    q: wp.array(dtype=wp.vec3d),
    lower: wp.array(dtype=wp.mat33d),
    scalars: wp.array(dtype=wp.float64),
    x: wp.array(dtype=wp.vec3d),
    r: wp.array(dtype=wp.vec3d),
    unscaled: wp.array(dtype=wp.vec3d),
):
    """Update x += alpha p, r -= alpha q; ``unscaled`` is the residual of the original system."""
    i = wp.tid()
    alpha = scalars[RZ] / scalars[PAP]
    x[i] = x[i] + alpha * p[i]
    res = r[i] - alpha * q[i]
    r[i] = res
    unscaled[i] = lower[i] * res


@wp.kernel
def cg_direction(
    z: wp.array(dtype=wp.vec3d),
    scalars: wp.array(dtype=wp.float64),
    p: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    p[i] = z[i] + (scalars[RZ_NEW] / scalars[RZ]) * p[i]


@wp.kernel
def cg_close(scalars: wp.array(dtype=wp.float64), state: wp.array(dtype=wp.int32)):
    """End an iteration: decide whether to go on, and clear the sums for the next one."""
    count = state[COUNT] + 1
    state[COUNT] = count
    indefinite = scalars[PAP] < wp.float64(0.0)
    # A residual that is no number compares false, and so ends the loop.
    more = scalars[NORM2] > scalars[TARGET2] and count < state[LIMIT] and not indefinite
    state[INDEFINITE] = wp.where(indefinite, 1, 0)
    state[GO] = wp.where(more, 1, 0)
    scalars[ENDED] = scalars[NORM2]
    scalars[RZ] = scalars[RZ_NEW]
    scalars[RZ_NEW] = wp.float64(0.0)
    scalars[PAP] = wp.float64(0.0)
    scalars[NORM2] = wp.float64(0.0)


@wp.kernel
def lanczos_start(v: wp.array(dtype=wp.vec3d)):
    """A vector without a pattern."""
    i = wp.tid()
    state = wp.rand_init(0, i)
    v[i] = wp.vec3d(wp.vec3(wp.randn(state), wp.randn(state), wp.randn(state)))


@wp.kernel
def lanczos_direction(
    w: wp.array(dtype=wp.vec3d),
    square: wp.array(dtype=wp.float64),
    k: wp.int32,
    v: wp.array(dtype=wp.vec3d),
    old: wp.array(dtype=wp.vec3d),
):
    """Next unit vector v = w / |w|, where |w|^2 is ``square[k]``; the last one becomes ``old``."""
    i = wp.tid()
    old[i] = v[i]
    v[i] = w[i] / wp.sqrt(square[k])


@wp.kernel
def lanczos_residual(
    v: wp.array(dtype=wp.vec3d),
    old: wp.array(dtype=wp.vec3d),
    along: wp.array(dtype=wp.float64),
    square: wp.array(dtype=wp.float64),
    k: wp.int32,
    w: wp.array(dtype=wp.vec3d),
):
    """Drop the parts of w = A v along v and the vector before it."""
    i = wp.tid()
    w[i] = w[i] - along[k] * v[i] - wp.sqrt(square[k]) * old[i]
