# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of an elastic law on P1 and P2 tets, made for every law of its functions.

They live in the module of the law's functions: a law that is not used is not compiled, and no
kernel asks at run time which law it is of.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from ..laws.kernels_tensor import (
    Blocks,
    DoubleRows,
    Doubles,
    IntRows,
    Tets,
    Vectors,
    mat99d,
    positive_part,
)
from ..laws.law import ElasticLaw
from .kernels_field import (
    edge_ends,
    gradient_at,
    gradients,
    gradients_p2,
    mat43d,
    mat103d,
    row3,
    row10,
    shape_gradients,
    six_volumes,
    weighted_gradients,
)

wp.set_module_options({"enable_backward": False, "max_unroll": 4})

mat93d = wp.types.matrix(shape=(9, 3), dtype=wp.float64)


class ElasticKernels(NamedTuple):
    """Kernels of one law; those of a second derivative that it does not have are None."""

    energy_and_force: Any
    stress: Any
    exact: Any
    projected: Any
    exact_at: Any
    projected_at: Any
    stiffness_p1: Any
    stiffness_p2: Any


@wp.func
def columns_along(A: mat99d, q: wp.vec3d) -> mat93d:
    """Change of the stress with the displacement of a node: sum_d A[., (., d)] q_d."""
    B = mat93d()
    for r in range(9):
        for j in range(3):
            B[r, j] = A[r, j] * q[0] + A[r, 3 + j] * q[1] + A[r, 6 + j] * q[2]
    return B


@wp.func
def force_block(B: mat93d, p: wp.vec3d) -> wp.mat33d:
    """Change of the force on a node: sum_c p_c B[(., c), .]."""
    block = wp.mat33d()
    for i in range(3):
        for j in range(3):
            block[i, j] = p[0] * B[i, j] + p[1] * B[3 + i, j] + p[2] * B[6 + i, j]
    return block


@wp.func
def gradients_of(a: int, g: mat43d, tets: Tets) -> mat43d:
    """Gradients of the shape function a of a quadratic tet at the four quadrature points."""
    d = mat43d()
    if a < 4:
        for n in range(4):
            s = wp.float64(4.0) * tets.quadrature[n][a] - wp.float64(1.0)
            for c in range(3):
                d[n, c] = s * g[a, c]
    else:
        i, j = edge_ends(a - 4)
        for n in range(4):
            q = tets.quadrature[n]
            for c in range(3):
                d[n, c] = wp.float64(4.0) * (q[i] * g[j, c] + q[j] * g[i, c])
    return d


@cache
def elastic_kernels(law: ElasticLaw) -> ElasticKernels:
    """Kernels of ``law``, all at once: one more later would compile the others again."""
    change, projected, block = law.stress_change, law.projected_tangent, law.stiffness_block
    at = change or (_change_of_linear(law.energy_and_stress) if block else None)
    exact = law.exact_tangent or (_second_derivative(at) if at else None)
    return ElasticKernels(
        _energy_and_force(law),
        _stress(law),
        _tangent(law, exact) if change or law.exact_tangent else None,
        _tangent(law, projected) if projected else None,
        _tangent_at(law, exact) if exact else None,
        _tangent_at(law, projected) if projected else None,
        *(_stiffness(law, block) if block else (None, None)),
    )


def _stress(law: ElasticLaw) -> Any:
    energy_and_stress = law.energy_and_stress

    @wp.kernel(module=energy_and_stress.module)
    def stress(H: Blocks, lam: Doubles, mu: Doubles, W: Doubles, P: Blocks):
        i = wp.tid()
        energy, here = energy_and_stress(H[i], lam[i], mu[i])
        W[i] = energy
        P[i] = here

    return stress


def _energy_and_force(law: ElasticLaw) -> Any:
    energy_and_stress = law.energy_and_stress

    @wp.kernel(module=energy_and_stress.module)
    def energy_and_force(
        tets: Tets, lam: Doubles, mu: Doubles, u: Vectors, energy: Doubles, force: Vectors
    ):
        """Elastic energy of every tet; add dW/du, with which nodes resist, to ``force``."""
        t = wp.tid()
        g, w = weighted_gradients(tets, t)
        if tets.elements.shape[1] == 4:
            H = wp.mat33d()
            for a in range(4):
                H += wp.outer(u[tets.elements[t, a]], row3(g, a))
            W, P = energy_and_stress(H, w * lam[t], w * mu[t])
            energy[t] = W
            p = P * row3(g, 1)
            q = P * row3(g, 2)
            r = P * row3(g, 3)
            wp.atomic_add(force, tets.elements[t, 0], -(p + q + r))
            wp.atomic_add(force, tets.elements[t, 1], p)
            wp.atomic_add(force, tets.elements[t, 2], q)
            wp.atomic_add(force, tets.elements[t, 3], r)
        else:
            total = wp.float64(0.0)
            for n in range(tets.quadrature.shape[0]):
                d = gradients_p2(g, tets.quadrature[n])
                H = gradient_at(d, tets, u, t)
                W, P = energy_and_stress(H, w * lam[t], w * mu[t])
                total += W
                for a in range(10):
                    wp.atomic_add(force, tets.elements[t, a], P * row10(d, a))
            energy[t] = total

    return energy_and_force


def _second_derivative(stress_change: Any) -> Any:
    """Second derivative (mat99d) of a law from the changes of its stress with every entry of F."""

    @wp.func
    def second_derivative(H: wp.mat33d, lam: wp.float64, mu: wp.float64) -> mat99d:
        A = mat99d()
        for k in range(9):
            G = wp.mat33d()
            G[k % 3, k // 3] = wp.float64(1.0)
            D = stress_change(H, G, lam, mu)
            for c in range(3):
                for i in range(3):
                    A[3 * c + i, k] = D[i, c]
        return A

    return second_derivative


def _change_of_linear(energy_and_stress: Any) -> Any:
    """Change of the stress of a law that is linear in H: the stress of the change."""

    @wp.func
    def stress_change(H: wp.mat33d, G: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
        _W, P = energy_and_stress(G, lam, mu)
        return P

    return stress_change


def _tangent_at(law: ElasticLaw, second_derivative: Any) -> Any:
    @wp.kernel(module=law.energy_and_stress.module)
    def tangent_at(H: Blocks, lam: Doubles, mu: Doubles, out: DoubleRows):
        """Second derivative by F_ic and F_jd, at 27 i + 9 c + 3 j + d of a row."""
        t = wp.tid()
        A = second_derivative(H[t], lam[t], mu[t])
        for r in range(9):
            for s in range(9):
                out[t, 27 * (r % 3) + 9 * (r // 3) + 3 * (s % 3) + s // 3] = A[r, s]

    return tangent_at


def _tangent_at(law: ElasticLaw, second_derivative: Any) -> Any:
    @wp.kernel(module=law.energy_and_stress.module)
    def tangent_at(H: Blocks, lam: Doubles, mu: Doubles, out: DoubleRows):
        """Second derivative by F_ic and F_jd, at 27 i + 9 c + 3 j + d of a row."""
        t = wp.tid()
        A = second_derivative(H[t], lam[t], mu[t])
        for r in range(9):
            for s in range(9):
                out[t, 27 * (r % 3) + 9 * (r // 3) + 3 * (s % 3) + s // 3] = A[r, s]

    return tangent_at


def _tangent(law: ElasticLaw, second_derivative: Any) -> Any:
    @wp.kernel(module=law.energy_and_stress.module)
    def tangent(tets: Tets, lam: Doubles, mu: Doubles, u: Vectors, slots: IntRows, values: Blocks):
        """Add the blocks of every tet to the tangent stiffness."""
        t = wp.tid()
        g, w = weighted_gradients(tets, t)
        size = tets.elements.shape[1]
        for n in range(tets.quadrature.shape[0]):
            d = shape_gradients(g, tets, tets.quadrature[n])
            A = second_derivative(gradient_at(d, tets, u, t), w * lam[t], w * mu[t])
            for b in range(size):
                B = columns_along(A, row10(d, b))
                for a in range(b + 1):
                    block = force_block(B, row10(d, a))
                    wp.atomic_add(values, slots[t, size * a + b], block)
                    if b > a:
                        wp.atomic_add(values, slots[t, size * b + a], wp.transpose(block))

    return tangent


def _stiffness(law: ElasticLaw, stiffness_block: Any) -> tuple[Any, Any]:
    """Kernels of P1 and P2 tets, by gradients that are not divided by six volumes."""

    @wp.kernel(module=law.energy_and_stress.module)
    def stiffness_p1(tets: Tets, lam: Doubles, mu: Doubles, slots: IntRows, values: Blocks):
        t = wp.tid()
        g = gradients(tets, t)
        w = wp.float64(1.0) / (wp.float64(6.0) * six_volumes(tets, t))  # volume / (6 volume)^2
        for a in range(4):
            p = row3(g, a)
            block = stiffness_block(p, p, w * lam[t], w * mu[t])
            wp.atomic_add(values, slots[t, 5 * a], block)
            for b in range(a + 1, 4):
                block = stiffness_block(p, row3(g, b), w * lam[t], w * mu[t])
                wp.atomic_add(values, slots[t, 4 * a + b], block)
                wp.atomic_add(values, slots[t, 4 * b + a], wp.transpose(block))

    @wp.kernel(module=law.energy_and_stress.module)
    def stiffness_p2(tets: Tets, lam: Doubles, mu: Doubles, slots: IntRows, values: Blocks):
        """A thread has one of the ten rows of a tet."""
        t = wp.tid() // 10
        a = wp.tid() - 10 * t
        g = gradients(tets, t)
        w = wp.float64(1.0) / (wp.float64(24.0) * six_volumes(tets, t))
        p = gradients_of(a, g, tets)
        for b in range(a, 10):
            q = gradients_of(b, g, tets)
            block = wp.mat33d()
            for n in range(4):
                block += stiffness_block(row3(p, n), row3(q, n), w * lam[t], w * mu[t])
            wp.atomic_add(values, slots[t, 10 * a + b], block)
            if b > a:
                wp.atomic_add(values, slots[t, 10 * b + a], wp.transpose(block))

    return stiffness_p1, stiffness_p2


# Kernels of stresses by a stiffness tensor in Mandel's notation: S = C : E.
#
# ``finite``: E is Green's strain and P = F S, which leaves turns of any size alone (St Venant and
# Kirchhoff); else E is the small strain and P = S. Viscous stresses are the same of a change of E,
# from that of the displacement ``along``, or with ``rate`` of its rate sym(F^T grad v), where
# ``along`` is the velocity v.

vec6d = wp.types.vector(length=6, dtype=wp.float64)
mat66d = wp.types.matrix(shape=(6, 6), dtype=wp.float64)
mat63d = wp.types.matrix(shape=(6, 3), dtype=wp.float64)
Tensors = wp.array(dtype=mat66d)
HALF_ROOT = wp.constant(wp.float64(0.7071067811865476))


@wp.func
def stiffness_tensor(tensors: Tensors, lam: Doubles, mu: Doubles, t: int) -> mat66d:
    """Tensor of a tet; of its Lame parameters where there are no ``tensors``."""
    C = mat66d()
    if tensors.shape[0] > 0:
        C = tensors[t]
    else:
        for i in range(6):
            C[i, i] = wp.float64(2.0) * mu[t]
        for i in range(3):
            for j in range(3):
                C[i, j] = C[i, j] + lam[t]
    return C


@wp.func
def strain_vector(H: wp.mat33d, G: wp.mat33d, finite: bool, rate: bool) -> vec6d:
    """Strain of H beyond that of G; with ``rate`` that of H with the velocity's gradient G."""
    A = H - G
    if rate:
        A = G + wp.transpose(H) * G
    elif finite:
        A += wp.float64(0.5) * (wp.transpose(H) * A + wp.transpose(A) * G)
    e = vec6d()
    for c in range(3):
        a = (c + 1) % 3
        b = (c + 2) % 3
        e[c] = A[c, c]
        e[3 + c] = HALF_ROOT * (A[a, b] + A[b, a])
    return e


@wp.func
def tensor_of(s: vec6d) -> wp.mat33d:
    S = wp.mat33d()
    for c in range(3):
        a = (c + 1) % 3
        b = (c + 2) % 3
        S[c, c] = s[c]
        S[a, b] = HALF_ROOT * s[3 + c]
        S[b, a] = HALF_ROOT * s[3 + c]
    return S


@wp.func
def strain_columns(p: wp.vec3d) -> mat63d:
    """Strain of displacements along x, y, z with the shape gradient p."""
    B = mat63d()
    for c in range(3):
        a = (c + 1) % 3
        b = (c + 2) % 3
        B[c, c] = p[c]
        B[3 + c, a] = HALF_ROOT * p[b]
        B[3 + c, b] = HALF_ROOT * p[a]
    return B


@wp.func
def gradient_where(d: mat103d, tets: Tets, u: Vectors, t: int) -> wp.mat33d:
    """Gradient of ``u``, which is zero where there is none."""
    H = wp.mat33d()
    if u.shape[0] > 0:
        H = gradient_at(d, tets, u, t)
    return H


@wp.kernel
def tensor_response(
    tets: Tets,
    lam: Doubles,
    mu: Doubles,
    tensors: Tensors,
    finite: bool,
    scale: wp.float64,
    u: Vectors,
    along: Vectors,
    rate: bool,
    energy: Doubles,
    force: Vectors,
):
    """Add E : C : E / 2 of every tet times ``scale``, and P along the shape gradients."""
    t = wp.tid()
    g, w = weighted_gradients(tets, t)
    C = (scale * w) * stiffness_tensor(tensors, lam, mu, t)
    total = wp.float64(0.0)
    for n in range(tets.quadrature.shape[0]):
        d = shape_gradients(g, tets, tets.quadrature[n])
        H = gradient_at(d, tets, u, t)
        e = strain_vector(H, gradient_where(d, tets, along, t), finite, rate)
        s = C * e
        P = tensor_of(s)
        if finite:
            P += H * P
        total += wp.float64(0.5) * wp.dot(s, e)
        for a in range(tets.elements.shape[1]):
            wp.atomic_add(force, tets.elements[t, a], P * row10(d, a))
    energy[t] += total


@wp.kernel
def tensor_tangent(
    tets: Tets,
    lam: Doubles,
    mu: Doubles,
    tensors: Tensors,
    finite: bool,
    scale: wp.float64,
    u: Vectors,
    along: Vectors,
    projected: bool,
    slots: IntRows,
    values: Blocks,
):
    """Add the finite one's (p . S q) I + F B_p^T C B_q F^T of every pair of shape gradients.

    ``projected``: of S its positive part alone, so that no tet has a negative one.
    """
    t = wp.tid()
    g, w = weighted_gradients(tets, t)
    C = (scale * w) * stiffness_tensor(tensors, lam, mu, t)
    size = tets.elements.shape[1]
    eye = wp.identity(n=3, dtype=wp.float64)
    for n in range(tets.quadrature.shape[0]):
        d = shape_gradients(g, tets, tets.quadrature[n])
        H = gradient_where(d, tets, u, t)
        F = H + eye
        S = wp.mat33d()
        if finite:
            S = tensor_of(C * strain_vector(H, gradient_where(d, tets, along, t), True, False))
        if projected:
            S = positive_part(S)
        for b in range(size):
            q = row10(d, b)
            CB = C * strain_columns(q) * wp.transpose(F)
            for a in range(size):
                p = row10(d, a)
                block = F * (wp.transpose(strain_columns(p)) * CB) + wp.dot(p, S * q) * eye
                wp.atomic_add(values, slots[t, size * a + b], block)
