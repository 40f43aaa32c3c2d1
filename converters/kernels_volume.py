"""Warp kernel that reads the voxels of a NanoVDB volume."""

import warp as wp  # noqa: TID253 - a kernel module, imported where a volume is read


@wp.kernel
def lookup(volume: wp.uint64, cells: wp.array2d(dtype=wp.int32), out: wp.array(dtype=wp.float32)):
    """Value of a float volume at integer cells."""
    i = wp.tid()
    out[i] = wp.volume_lookup_f(volume, cells[i, 0], cells[i, 1], cells[i, 2])
