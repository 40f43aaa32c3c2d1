# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels on the tree of a surface: segments that meet it, distances from it."""

import warp as wp


@wp.kernel(enable_backward=False)
def crosses(
    mesh: wp.uint64, start: wp.array(dtype=wp.vec3), end: wp.array(dtype=wp.vec3),
    hit: wp.array(dtype=int),
):  # fmt: skip
    """1 where the segment meets a face of the mesh."""
    i = wp.tid()
    way = end[i] - start[i]
    length = wp.length(way)
    if length > 0.0:
        query = wp.mesh_query_ray(mesh, start[i], way / length, length)
        if query.result:
            hit[i] = 1


@wp.kernel(enable_backward=False)
def depths(mesh: wp.uint64, points: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    """Distance of every point from the mesh, whose size is one."""
    i = wp.tid()
    query = wp.mesh_query_point_no_sign(mesh, points[i], 10.0)
    if query.result:
        place = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        out[i] = wp.length(points[i] - place)
