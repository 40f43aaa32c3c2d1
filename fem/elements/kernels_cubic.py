# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of the surplus of cubic tets over quadratic ones: forces, diagonal blocks, energy.

Gradients are sums of ten numbers by polynomials that are orthonormal over a tet of volume one: an
integral of a product is the sum of products. Those of quadratic functions have four alone.
"""

import warp as wp

from ..laws.kernels_tensor import Blocks, Doubles, IntRows, Tets, Vectors
from .kernels_elastic import Tensors, stiffness_tensor, strain_vector, tensor_of
from .kernels_field import mat43d, row3, weighted_gradients

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

vec10d = wp.types.vector(length=10, dtype=wp.float64)
mat310d = wp.types.matrix(shape=(3, 10), dtype=wp.float64)
# Numbers of the derivatives of ten functions by barycentric coordinates, (numbers, 4).
Slopes = wp.array2d(dtype=vec10d)


@wp.struct
class Cubic:
    """Quadratic ``tets`` of one quadrature point, Lame parameters or tensors [Pa], slopes.

    ``surplus`` numbers the ten functions of every tet: of its edges, then of its faces.
    """

    tets: Tets
    surplus: IntRows
    lam: Doubles
    mu: Doubles
    tensors: Tensors
    quadratic: Slopes
    cubic: Slopes


@wp.func
def edge_sign(c: Cubic, t: int, a: int) -> wp.float64:
    """The function of an edge changes its sign with the way along it: up in the mesh's points."""
    i = wp.where(a == 1 or a == 4, 1, wp.where(a == 5, 2, 0))
    j = wp.where(a == 0, 1, wp.where(a < 3, 2, 3))
    down = a < 6 and c.tets.elements[t, i] > c.tets.elements[t, j]
    return wp.where(down, wp.float64(-1.0), wp.float64(1.0))


@wp.func
def nodal(c: Cubic, u: Vectors, t: int) -> mat310d:
    X = mat310d()
    for a in range(10):
        v = u[c.tets.elements[t, a]]
        for axis in range(3):
            X[axis, a] = v[axis]
    return X


@wp.func
def surplus(c: Cubic, x: Vectors, t: int) -> mat310d:
    X = mat310d()
    for a in range(10):
        v = edge_sign(c, t, a) * x[c.surplus[t, a]]
        for axis in range(3):
            X[axis, a] = v[axis]
    return X


@wp.func
def add_surplus(c: Cubic, F: mat310d, t: int, out: Vectors):
    for a in range(10):
        f = edge_sign(c, t, a) * wp.vec3d(F[0, a], F[1, a], F[2, a])
        wp.atomic_add(out, c.surplus[t, a], f)


@wp.func
def number_of(X: mat310d, slopes: Slopes, n: int, g: mat43d) -> wp.mat33d:
    """Number n of the gradient of the functions times their vectors X."""
    H = wp.mat33d()
    for m in range(4):
        H += wp.outer(X * slopes[n, m], row3(g, m))
    return H


@wp.func
def pulled(S: wp.mat33d, slopes: Slopes, n: int, g: mat43d) -> mat310d:
    """Forces of the functions under the number n of a stress."""
    F = mat310d()
    for m in range(4):
        F += wp.outer(S * row3(g, m), slopes[n, m])
    return F


@wp.func
def stress_of(c: Cubic, H: wp.mat33d, w: wp.float64, t: int) -> wp.mat33d:
    S = wp.mat33d()
    if c.tensors.shape[0] > 0:
        C = w * stiffness_tensor(c.tensors, c.lam, c.mu, t)
        S = tensor_of(C * strain_vector(H, wp.mat33d(), False, False))
    else:
        S = (w * c.mu[t]) * (H + wp.transpose(H))
        S += (w * c.lam[t]) * wp.trace(H) * wp.identity(n=3, dtype=wp.float64)
    return S


@wp.kernel
def surplus_force(c: Cubic, x: Vectors, on_nodes: Vectors, on_surplus: Vectors):
    """Add the stiffness times surplus numbers x [m]: forces on the nodes and on the surplus."""
    t = wp.tid()
    g, w = weighted_gradients(c.tets, t)
    X = surplus(c, x, t)
    F = mat310d()
    N = mat310d()
    for n in range(10):
        S = stress_of(c, number_of(X, c.cubic, n, g), w, t)
        F += pulled(S, c.cubic, n, g)
        if n < 4:
            N += pulled(S, c.quadratic, n, g)
    add_surplus(c, F, t, on_surplus)
    for a in range(10):
        wp.atomic_add(on_nodes, c.tets.elements[t, a], wp.vec3d(N[0, a], N[1, a], N[2, a]))


@wp.kernel
def nodal_force(c: Cubic, u: Vectors, on_surplus: Vectors):
    """Add the stiffness times a quadratic displacement u [m]: forces on the surplus."""
    t = wp.tid()
    g, w = weighted_gradients(c.tets, t)
    U = nodal(c, u, t)
    F = mat310d()
    for n in range(4):
        F += pulled(stress_of(c, number_of(U, c.quadratic, n, g), w, t), c.cubic, n, g)
    add_surplus(c, F, t, on_surplus)


@wp.kernel
def surplus_energy(c: Cubic, u: Vectors, x: Vectors, energy: Doubles):
    """Strain energy of every tet, times two."""
    t = wp.tid()
    g, w = weighted_gradients(c.tets, t)
    X = surplus(c, x, t)
    U = nodal(c, u, t)
    total = wp.float64(0.0)
    for n in range(10):
        H = number_of(X, c.cubic, n, g)
        if n < 4:
            H += number_of(U, c.quadratic, n, g)
        total += wp.ddot(stress_of(c, H, w, t), H)
    energy[t] = total


@wp.kernel
def surplus_blocks(c: Cubic, blocks: Blocks):
    """Add the diagonal blocks of the surplus, of the Lame parameters alone."""
    t = wp.tid()
    g, w = weighted_gradients(c.tets, t)
    for a in range(10):
        G = wp.mat33d()
        for n in range(10):
            d = wp.vec3d()
            for m in range(4):
                d += c.cubic[n, m][a] * row3(g, m)
            G += wp.outer(d, d)
        G = w * (
            (c.lam[t] + c.mu[t]) * G + c.mu[t] * wp.trace(G) * wp.identity(n=3, dtype=wp.float64)
        )
        wp.atomic_add(blocks, c.surplus[t, a], G)
