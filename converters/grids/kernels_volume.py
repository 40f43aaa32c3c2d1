# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels on voxels: reading a NanoVDB volume, adding Gaussians to a grid."""

import warp as wp  # noqa: TID253 - a kernel module, imported where it is used

wp.set_module_options({"enable_backward": False})


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
