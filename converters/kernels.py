# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels that blend splats into a picture, the nearest first: over the pixels of its box."""

import warp as wp  # noqa: TID253 - a kernel module, imported where it is used

wp.set_module_options({"enable_backward": False})

# What is fainter than an eighth bit, and light that is nearly gone, as in 3D Gaussian splatting.
FAINT = wp.constant(1.0 / 255.0)
SPENT = wp.constant(1.0e-4)
DENSEST = wp.constant(0.99)


@wp.kernel
def blend(
    centre: wp.array(dtype=wp.vec2),
    conic: wp.array(dtype=wp.vec3),
    reach: wp.array(dtype=wp.vec2),
    opacity: wp.array(dtype=float),
    colour: wp.array(dtype=wp.vec3),
    image: wp.array2d(dtype=wp.vec4),
):
    """Add splats, sorted by depth, to ``image``: colour, and the light that still comes through."""
    for i in range(centre.shape[0]):
        c = centre[i]
        e = reach[i]
        y0 = wp.max(int(wp.ceil(c[1] - e[1] - 0.5)), 0)
        y1 = wp.min(int(wp.floor(c[1] + e[1] - 0.5)) + 1, image.shape[0])
        x0 = wp.max(int(wp.ceil(c[0] - e[0] - 0.5)), 0)
        x1 = wp.min(int(wp.floor(c[0] + e[0] - 0.5)) + 1, image.shape[1])
        if y0 < y1 and x0 < x1:
            q = conic[i]
            most = opacity[i]
            own = colour[i]
            # Where most exp(-d^T q d / 2) is not faint: between the roots of a parabola in a row.
            level = 2.0 * wp.log(most / FAINT)
            for y in range(y0, y1):
                dy = float(y) + 0.5 - c[1]
                half = q[1] * dy
                inner = half * half - q[0] * (q[2] * dy * dy - level)
                if inner < 0.0:
                    continue
                width = wp.sqrt(inner)
                first = int(wp.ceil(c[0] - (half + width) / q[0] - 0.5))
                last = int(wp.floor(c[0] - (half - width) / q[0] - 0.5))
                for x in range(wp.max(first, x0), wp.min(last + 1, x1)):
                    p = image[y, x]
                    if p[3] > SPENT:
                        dx = float(x) + 0.5 - c[0]
                        power = -0.5 * (q[0] * dx * dx + q[2] * dy * dy) - q[1] * dx * dy
                        a = wp.min(DENSEST, most * wp.exp(power))
                        if a > FAINT:
                            t = p[3] * a
                            image[y, x] = wp.vec4(
                                p[0] + t * own[0], p[1] + t * own[1], p[2] + t * own[2], p[3] - t
                            )


@wp.kernel
def lookup(volume: wp.uint64, cells: wp.array2d(dtype=wp.int32), out: wp.array(dtype=wp.float32)):
    """Value of a float volume at integer cells."""
    i = wp.tid()
    out[i] = wp.volume_lookup_f(volume, cells[i, 0], cells[i, 1], cells[i, 2])


@wp.kernel
def add_gaussians(
    mean: wp.array(dtype=wp.vec3d),
    whiten: wp.array(dtype=wp.mat33d),
    opacity: wp.array(dtype=wp.float64),
    lower: wp.array(dtype=wp.vec3i),
    upper: wp.array(dtype=wp.vec3i),
    reach: wp.float64,
    density: wp.array3d(dtype=wp.float64),
):
    """Add opacity exp(-|W (x - mean)|^2 / 2) to the cells from lower to upper.

    Lengths are in cells, so that a cell's centre is its index; it ends where |W d| > reach.
    """
    n = wp.tid()
    lo = lower[n]
    hi = upper[n]
    for i in range(lo[0], hi[0] + 1):
        for j in range(lo[1], hi[1] + 1):
            for k in range(lo[2], hi[2] + 1):
                d = wp.vec3d(wp.float64(i), wp.float64(j), wp.float64(k)) - mean[n]
                w = whiten[n] * d
                squared = wp.dot(w, w)
                if squared < reach * reach:
                    value = opacity[n] * wp.exp(-wp.float64(0.5) * squared)
                    wp.atomic_add(density, i, j, k, value)
