# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp types of arrays; functions of 3 x 3 tensors, and of second derivatives by them.

Those of ``Any`` serve single precision too: the kernels of particles on a GPU.
"""

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

# What kernels take: numbers, rows of numbers (two indices), vectors and 3 x 3 blocks.
Ints = wp.array(dtype=wp.int32)
IntRows = wp.array2d(dtype=wp.int32)
Doubles = wp.array(dtype=wp.float64)
DoubleRows = wp.array2d(dtype=wp.float64)
Singles = wp.array(dtype=wp.float32)
Vectors = wp.array(dtype=wp.vec3d)
Blocks = wp.array(dtype=wp.mat33d)
# Barycentric coordinates of the points of a quadrature.
Barycentric = wp.array(dtype=wp.vec4d)


@wp.struct
class Tets:
    """Tets of a space: positions of nodes [m], node ids, points of equal weights in every tet."""

    points: Vectors
    elements: IntRows
    quadrature: Barycentric


# Second derivative of a density by F: entry (3 c + i, 3 d + j) is that by F_ic and F_jd.
mat99d = wp.types.matrix(shape=(9, 9), dtype=wp.float64)
vec9d = wp.types.vector(length=9, dtype=wp.float64)


@wp.func
def column(F: Any, k: int):
    return wp.vector(F[0, k], F[1, k], F[2, k])


@wp.func
def cofactor(F: Any):
    a = column(F, 0)
    b = column(F, 1)
    c = column(F, 2)
    return wp.matrix_from_cols(wp.cross(b, c), wp.cross(c, a), wp.cross(a, b))


@wp.func
def cofactor_change(F: wp.mat33d, G: wp.mat33d) -> wp.mat33d:
    """Change of cof F with a change G of F."""
    a = column(F, 0)
    b = column(F, 1)
    c = column(F, 2)
    x = column(G, 0)
    y = column(G, 1)
    z = column(G, 2)
    return wp.matrix_from_cols(
        wp.cross(b, z) + wp.cross(y, c),
        wp.cross(c, x) + wp.cross(z, a),
        wp.cross(a, y) + wp.cross(x, b),
    )


@wp.func
def volume_change(H: Any):
    """J - 1 = det(I + H) - 1, exact for small H."""
    return wp.trace(H) + wp.trace(cofactor(H)) + wp.determinant(H)


@wp.func
def positive_part(S: wp.mat33d) -> wp.mat33d:
    """The symmetric S without its negative eigenvalues."""
    Q = wp.mat33d()
    e = wp.vec3d()
    wp.eig3(S, Q, e)
    kept = wp.vec3d()
    for i in range(3):
        kept[i] = wp.max(e[i], wp.float64(0.0))
    return Q * wp.diag(kept) * wp.transpose(Q)


@wp.func
def twist(axis: int, sign: wp.float64) -> wp.mat33d:
    """Unit matrix with entries 1/sqrt(2) and sign/sqrt(2) in the plane across ``axis``."""
    M = wp.mat33d()
    i = (axis + 1) % 3
    j = (axis + 2) % 3
    M[i, j] = wp.float64(0.7071067811865476)
    M[j, i] = sign * wp.float64(0.7071067811865476)
    return M


@wp.func
def add_mode(A: mat99d, U: wp.mat33d, M: wp.mat33d, V: wp.mat33d, value: wp.float64) -> mat99d:
    """Add ``value`` m m^T with m the nine entries of U M V^T, column by column."""
    T = U * M * wp.transpose(V)
    m = vec9d()
    for c in range(3):
        for r in range(3):
            m[3 * c + r] = T[r, c]
    return A + value * wp.outer(m, m)


@wp.func
def add_stretches(A: mat99d, U: wp.mat33d, V: wp.mat33d, by_stretch: wp.mat33d) -> mat99d:
    """Add the second derivative ``by_stretch`` of the principal stretches, projected."""
    Q = wp.mat33d()
    e = wp.vec3d()
    wp.eig3(by_stretch, Q, e)
    for i in range(3):
        M = wp.diag(wp.vec3d(Q[0, i], Q[1, i], Q[2, i]))
        A = add_mode(A, U, M, V, wp.max(e[i], wp.float64(0.0)))
    return A
