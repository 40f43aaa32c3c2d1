# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp kernels of an elastic law on P1 and P2 tets, made for every law of its functions.

They live in the module of the law's functions: a law that is not used is not compiled, and no
kernel asks at run time which law it is of.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from ..laws.kernels_tensor import (
    Barycentric,
    Blocks,
    DoubleRows,
    Doubles,
    IntRows,
    Vectors,
    mat99d,
    positive_part,
)
from ..laws.law import ElasticLaw
from ..laws.linear import stiffness_block
from .kernels_field import (
    gradient_at,
    gradients,
    gradients_p2,
    mat43d,
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
def gradient_p1(g: mat43d, elements: IntRows, u: Vectors, t: int) -> wp.mat33d:
    H = wp.mat33d()
    for a in range(4):
        H += wp.outer(u[elements[t, a]], row3(g, a))
    return H


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
        _stiffness_p1(law, block) if block else None,
        _stiffness_p2(law, block) if block else None,
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
        points: Vectors,
        elements: IntRows,
        quadrature: Barycentric,
        lam: Doubles,
        mu: Doubles,
        u: Vectors,
        energy: Doubles,
        force: Vectors,
    ):
        """Elastic energy of every tet; add dW/du, with which nodes resist, to ``force``."""
        t = wp.tid()
        g, w = weighted_gradients(points, elements, t, quadrature.shape[0])
        if elements.shape[1] == 4:
            W, P = energy_and_stress(gradient_p1(g, elements, u, t), w * lam[t], w * mu[t])
            energy[t] = W
            p = P * row3(g, 1)
            q = P * row3(g, 2)
            r = P * row3(g, 3)
            wp.atomic_add(force, elements[t, 0], -(p + q + r))
            wp.atomic_add(force, elements[t, 1], p)
            wp.atomic_add(force, elements[t, 2], q)
            wp.atomic_add(force, elements[t, 3], r)
        else:
            total = wp.float64(0.0)
            for n in range(quadrature.shape[0]):
                d = gradients_p2(g, quadrature[n])
                H = gradient_at(d, elements, u, t)
                W, P = energy_and_stress(H, w * lam[t], w * mu[t])
                total += W
                for a in range(10):
                    wp.atomic_add(force, elements[t, a], P * row10(d, a))
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


def _tangent(law: ElasticLaw, second_derivative: Any) -> Any:
    @wp.kernel(module=law.energy_and_stress.module)
    def tangent(
        points: Vectors,
        elements: IntRows,
        quadrature: Barycentric,
        lam: Doubles,
        mu: Doubles,
        u: Vectors,
        slots: IntRows,
        values: Blocks,
    ):
        """Add the blocks of every tet to the tangent stiffness."""
        t = wp.tid()
        g, w = weighted_gradients(points, elements, t, quadrature.shape[0])
        size = elements.shape[1]
        for n in range(quadrature.shape[0]):
            d = shape_gradients(g, elements, quadrature[n])
            A = second_derivative(gradient_at(d, elements, u, t), w * lam[t], w * mu[t])
            for b in range(size):
                B = columns_along(A, row10(d, b))
                for a in range(b + 1):
                    block = force_block(B, row10(d, a))
                    wp.atomic_add(values, slots[t, size * a + b], block)
                    if b > a:
                        wp.atomic_add(values, slots[t, size * b + a], wp.transpose(block))

    return tangent


def _stiffness_p1(law: ElasticLaw, stiffness_block: Any) -> Any:
    @wp.kernel(module=law.energy_and_stress.module)
    def stiffness_p1(
        points: Vectors,
        elements: IntRows,
        lam: Doubles,
        mu: Doubles,
        slots: IntRows,
        values: Blocks,
    ):
        t = wp.tid()
        g = gradients(points, elements, t)
        # volume / (6 volume)^2
        w = wp.float64(1.0) / (wp.float64(6.0) * six_volumes(points, elements, t))
        for a in range(4):
            p = row3(g, a)
            block = stiffness_block(p, p, w * lam[t], w * mu[t])
            wp.atomic_add(values, slots[t, 5 * a], block)
            for b in range(a + 1, 4):
                block = stiffness_block(p, row3(g, b), w * lam[t], w * mu[t])
                wp.atomic_add(values, slots[t, 4 * a + b], block)
                wp.atomic_add(values, slots[t, 4 * b + a], wp.transpose(block))

    return stiffness_p1


def _stiffness_p2(law: ElasticLaw, stiffness_block: Any) -> Any:
    @wp.kernel(module=law.energy_and_stress.module)
    def stiffness_p2(
        points: Vectors,
        elements: IntRows,
        quadrature: Barycentric,
        lam: Doubles,
        mu: Doubles,
        slots: IntRows,
        values: Blocks,
    ):
        t = wp.tid()
        g = gradients(points, elements, t)
        w = wp.float64(1.0) / (wp.float64(24.0) * six_volumes(points, elements, t))
        for n in range(quadrature.shape[0]):
            d = gradients_p2(g, quadrature[n])
            for a in range(elements.shape[1]):
                p = row10(d, a)
                for b in range(a, elements.shape[1]):
                    block = stiffness_block(p, row10(d, b), w * lam[t], w * mu[t])
                    wp.atomic_add(values, slots[t, 10 * a + b], block)
                    if b > a:
                        wp.atomic_add(values, slots[t, 10 * b + a], wp.transpose(block))

    return stiffness_p2


# Warp kernels of tets with a grain: stress S = C : E of a stiffness tensor of every tet.
#
# ``finite``: E is Green's strain and P = F S, which leaves turns of any size alone (St Venant and
# Kirchhoff); else E is the small strain and P = S.

vec6d = wp.types.vector(length=6, dtype=wp.float64)
mat66d = wp.types.matrix(shape=(6, 6), dtype=wp.float64)
mat63d = wp.types.matrix(shape=(6, 3), dtype=wp.float64)
HALF_ROOT = wp.constant(wp.float64(0.7071067811865476))


@wp.func
def strain_vector(H: wp.mat33d, finite: bool) -> vec6d:
    """Strain of the displacement gradient H in Mandel's notation."""
    A = H + wp.transpose(H)
    if finite:
        A += wp.transpose(H) * H
    e = vec6d()
    for c in range(3):
        e[c] = wp.float64(0.5) * A[c, c]
        e[3 + c] = HALF_ROOT * A[(c + 1) % 3, (c + 2) % 3]
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
    """Strain, in Mandel's notation, of displacements along x, y, z with the shape gradient p."""
    B = mat63d()
    for c in range(3):
        a = (c + 1) % 3
        b = (c + 2) % 3
        B[c, c] = p[c]
        B[3 + c, a] = HALF_ROOT * p[b]
        B[3 + c, b] = HALF_ROOT * p[a]
    return B


@wp.kernel
def grain_response(
    points: Vectors,
    elements: IntRows,
    quadrature: Barycentric,
    tensor: wp.array(dtype=mat66d),
    finite: bool,
    u: Vectors,
    energy: Doubles,
    force: Vectors,
):
    """Add E : C : E / 2 of every tet, and P along the shape gradients."""
    t = wp.tid()
    g, w = weighted_gradients(points, elements, t, quadrature.shape[0])
    C = w * tensor[t]
    total = wp.float64(0.0)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        e = strain_vector(H, finite)
        s = C * e
        P = tensor_of(s)
        if finite:
            P += H * P
        total += wp.float64(0.5) * wp.dot(s, e)
        for a in range(elements.shape[1]):
            wp.atomic_add(force, elements[t, a], P * row10(d, a))
    energy[t] += total


@wp.kernel
def grain_tangent(
    points: Vectors,
    elements: IntRows,
    quadrature: Barycentric,
    tensor: wp.array(dtype=mat66d),
    u: Vectors,
    projected: bool,
    slots: IntRows,
    values: Blocks,
):
    """Add the finite one's (p . S q) I + F B_p^T C B_q F^T of every pair of shape gradients.

    ``projected``: of S its positive part alone, so that no tet has a negative one.
    """
    t = wp.tid()
    g, w = weighted_gradients(points, elements, t, quadrature.shape[0])
    C = w * tensor[t]
    size = elements.shape[1]
    eye = wp.identity(n=3, dtype=wp.float64)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        F = H + eye
        S = tensor_of(C * strain_vector(H, True))
        if projected:
            S = positive_part(S)
        for b in range(size):
            q = row10(d, b)
            CB = C * strain_columns(q) * wp.transpose(F)
            for a in range(size):
                p = row10(d, a)
                block = F * (wp.transpose(strain_columns(p)) * CB) + wp.dot(p, S * q) * eye
                wp.atomic_add(values, slots[t, size * a + b], block)


@wp.kernel
def anisotropic_stiffness(
    points: Vectors,
    elements: IntRows,
    quadrature: Barycentric,
    tensor: wp.array(dtype=mat66d),
    slots: IntRows,
    values: Blocks,
):
    """Add the tangent of small strains."""
    t = wp.tid()
    g, w = weighted_gradients(points, elements, t, quadrature.shape[0])
    size = elements.shape[1]
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        for b in range(size):
            S = (w * tensor[t]) * strain_columns(row10(d, b))
            for a in range(size):
                block = wp.transpose(strain_columns(row10(d, a))) * S
                wp.atomic_add(values, slots[t, size * a + b], block)


# Viscous stress P = F S of the change D of Green's strain: S = 2 mu D + lam (tr D) I.
#
# ``along`` is the displacement that the strain changed from, or with ``rate`` the velocity: then D
# is the rate of strain sym(F^T grad v). Neither changes with a turn of the body.


@wp.func
def strain_change(H: wp.mat33d, G: wp.mat33d, rate: bool) -> wp.mat33d:
    """Green's strain of H less that of G; or its rate at H with the gradient G of the velocity."""
    D = H - G
    A = D + wp.float64(0.5) * (wp.transpose(H) * D + wp.transpose(D) * G)
    if rate:
        A = G + wp.transpose(H) * G
    return wp.float64(0.5) * (A + wp.transpose(A))


@wp.func
def viscous_stress(D: wp.mat33d, lam: wp.float64, mu: wp.float64) -> wp.mat33d:
    return wp.float64(2.0) * mu * D + lam * wp.trace(D) * wp.identity(n=3, dtype=wp.float64)


@wp.kernel
def stress(H: Blocks, G: Blocks, rate: bool, lam: Doubles, mu: Doubles, P: Blocks):
    i = wp.tid()
    S = viscous_stress(strain_change(H[i], G[i], rate), lam[i], mu[i])
    P[i] = S + H[i] * S


@wp.kernel
def energy_and_force(
    points: Vectors,
    elements: IntRows,
    quadrature: Barycentric,
    lam: Doubles,
    mu: Doubles,
    scale: wp.float64,
    u: Vectors,
    along: Vectors,
    rate: bool,
    energy: Doubles,
    force: Vectors,
):
    """S : D / 2 of every tet, the potential of P in a step; add P along the shape gradients."""
    t = wp.tid()
    g, volume = weighted_gradients(points, elements, t, quadrature.shape[0])
    w = scale * volume
    total = wp.float64(0.0)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        D = strain_change(H, gradient_at(d, elements, along, t), rate)
        S = viscous_stress(D, w * lam[t], w * mu[t])
        P = S + H * S
        total += wp.float64(0.5) * wp.ddot(S, D)
        for a in range(elements.shape[1]):
            wp.atomic_add(force, elements[t, a], P * row10(d, a))
    energy[t] = total


@wp.kernel
def tangent(
    points: Vectors,
    elements: IntRows,
    quadrature: Barycentric,
    lam: Doubles,
    mu: Doubles,
    scale: wp.float64,
    u: Vectors,
    along: Vectors,
    projected: bool,
    slots: IntRows,
    values: Blocks,
):
    """Add (p . S q) I + F C(p, q) F^T of every pair of shape gradients, C of Hooke's law.

    ``projected``: of S its positive part alone, so that no tet has a negative one.
    """
    t = wp.tid()
    g, volume = weighted_gradients(points, elements, t, quadrature.shape[0])
    w = scale * volume
    size = elements.shape[1]
    eye = wp.identity(n=3, dtype=wp.float64)
    for n in range(quadrature.shape[0]):
        d = shape_gradients(g, elements, quadrature[n])
        H = gradient_at(d, elements, u, t)
        D = strain_change(H, gradient_at(d, elements, along, t), False)
        S = viscous_stress(D, w * lam[t], w * mu[t])
        if projected:
            S = positive_part(S)
        F = H + eye
        for b in range(size):
            q = row10(d, b)
            for a in range(size):
                p = row10(d, a)
                C = stiffness_block(p, q, w * lam[t], w * mu[t])
                block = wp.dot(p, S * q) * eye + F * C * wp.transpose(F)
                wp.atomic_add(values, slots[t, size * a + b], block)
