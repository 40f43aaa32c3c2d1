# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp functions of one tet: volume, gradients of its shape functions, of a displacement."""

import warp as wp

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

# Barycentric gradients of a tet: row k is d lambda_k / dx.
mat43d = wp.types.matrix(shape=(4, 3), dtype=wp.float64)
mat103d = wp.types.matrix(shape=(10, 3), dtype=wp.float64)


@wp.func
def gradients(
    points: wp.array(dtype=wp.vec3d), elements: wp.array2d(dtype=wp.int32), t: int
) -> mat43d:
    """Gradients of the barycentric coordinates, times six volumes."""
    a = points[elements[t, 0]]
    x = points[elements[t, 1]] - a
    y = points[elements[t, 2]] - a
    z = points[elements[t, 3]] - a
    gx = wp.cross(y, z)
    gy = wp.cross(z, x)
    gz = wp.cross(x, y)
    g0 = -(gx + gy + gz)
    return mat43d(
        g0[0], g0[1], g0[2], gx[0], gx[1], gx[2], gy[0], gy[1], gy[2], gz[0], gz[1], gz[2]
    )


@wp.func
def six_volumes(
    points: wp.array(dtype=wp.vec3d), elements: wp.array2d(dtype=wp.int32), t: int
) -> wp.float64:
    a = points[elements[t, 0]]
    x = points[elements[t, 1]] - a
    y = points[elements[t, 2]] - a
    z = points[elements[t, 3]] - a
    return wp.dot(x, wp.cross(y, z))


@wp.func
def row3(g: mat43d, k: int) -> wp.vec3d:
    return wp.vec3d(g[k, 0], g[k, 1], g[k, 2])


@wp.func
def edge_ends(k: int):
    """Corners of edge k, in the order of VTK's quadratic tetrahedron."""
    i = 0
    j = 1
    if k == 1:
        i = 1
        j = 2
    elif k == 2:
        j = 2
    elif k == 3:
        j = 3
    elif k == 4:
        i = 1
        j = 3
    elif k == 5:
        i = 2
        j = 3
    return i, j


@wp.func
def gradients_p2(g: mat43d, q: wp.vec4d) -> mat103d:
    """Gradients of the ten shape functions at barycentric coordinates q."""
    d = mat103d()
    for a in range(4):
        s = wp.float64(4.0) * q[a] - wp.float64(1.0)
        for c in range(3):
            d[a, c] = s * g[a, c]
    for k in range(6):
        i, j = edge_ends(k)
        for c in range(3):
            d[4 + k, c] = wp.float64(4.0) * (q[i] * g[j, c] + q[j] * g[i, c])
    return d


@wp.func
def row10(g: mat103d, k: int) -> wp.vec3d:
    return wp.vec3d(g[k, 0], g[k, 1], g[k, 2])
