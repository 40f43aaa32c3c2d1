# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernel: the nearest point of a triangle mesh."""

import warp as wp  # noqa: TID253 - a kernel module, imported where it is used

wp.set_module_options({"enable_backward": False})


@wp.kernel
def nearest(
    mesh: wp.uint64,
    where: wp.array(dtype=wp.vec3),
    reach: float,
    distance: wp.array(dtype=float),
    face: wp.array(dtype=int),
    point: wp.array(dtype=wp.vec3),
):
    """Distance, face and point; the reach, -1 and the place itself where none is nearer."""
    i = wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, where[i], reach)
    distance[i] = reach
    face[i] = -1
    point[i] = where[i]
    if found.result:
        on = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
        distance[i] = wp.length(on - where[i])
        face[i] = found.face
        point[i] = on
