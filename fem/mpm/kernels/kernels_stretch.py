# type: ignore  (warp code: its types are warp's, not Python's)
"""Warp functions of stretches: eigenvectors, logarithm and exponential of 3 x 3 tensors.

Made for a precision. Displacement gradients H = F - I are stored, so that small strains keep their
digits in single precision. ``wp.svd3`` loses half of its digits and takes three times as long.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp


class StretchFunctions(NamedTuple):
    """Functions of warp on tensors of one precision."""

    volume_change: Any
    eigen: Any
    hencky: Any
    exponential: Any
    symmetric: Any
    root: Any
    positive: Any


@cache
def stretch_functions(real: Any) -> StretchFunctions:
    """Functions of tensors of ``real`` numbers: wp.float32 or wp.float64."""
    eigen, symmetric = _spectral(real)
    hencky, exponential = _logarithm(real, eigen, symmetric), _exponential(real, eigen, symmetric)
    volume_change, root, positive = _near_identity(real)
    return StretchFunctions(volume_change, eigen, hencky, exponential, symmetric, root, positive)


def _near_identity(real: Any) -> tuple[Any, Any, Any]:
    mat33 = wp.types.matrix(shape=(3, 3), dtype=real)

    @wp.func
    def volume_change(H: mat33):
        """J - 1 of F = I + H, exact for small H."""
        minors = (
            H[0, 0] * H[1, 1] - H[0, 1] * H[1, 0]
            + H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1]
            + H[0, 0] * H[2, 2] - H[0, 2] * H[2, 0]
        )  # fmt: skip
        return wp.trace(H) + minors + wp.determinant(H)

    @wp.func
    def root(X: mat33):
        """sqrt(I + X) - I of a symmetric X of a norm below 0.08."""
        X2 = X * X
        X3 = X2 * X
        eye = wp.identity(n=3, dtype=real)
        low = eye + real(1.25) * X + real(0.375) * X2 + real(0.015625) * X3
        top = real(0.5) * X + real(0.5) * X2 + real(0.09375) * X3
        return top * wp.inverse(low)

    @wp.func
    def positive(S: mat33):
        """Whether a symmetric tensor is positive definite (Sylvester)."""
        minor = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
        return S[0, 0] > real(0.0) and minor > real(0.0) and wp.determinant(S) > real(0.0)

    return volume_change, root, positive


def _spectral(real: Any) -> tuple[Any, Any]:
    """Eigenvectors by Jacobi's method, and what they make of values."""
    vec3 = wp.types.vector(length=3, dtype=real)
    mat33 = wp.types.matrix(shape=(3, 3), dtype=real)
    double = real is wp.float64
    tiny = wp.constant(real(1e-300 if double else 1e-30))
    digits = wp.constant(real(1e-15 if double else 1e-7))

    @wp.func
    def turn(A: mat33, V: mat33, p: int, q: int, r: int):
        """One rotation of Jacobi's method in the plane of p and q."""
        off = A[p, q]
        if wp.abs(off) > tiny:
            theta = (A[q, q] - A[p, p]) / (real(2.0) * off)
            t = real(1.0) / (wp.abs(theta) + wp.sqrt(theta * theta + real(1.0)))
            if theta < real(0.0):
                t = -t
            c = real(1.0) / wp.sqrt(t * t + real(1.0))
            s = t * c
            A[p, p] = A[p, p] - t * off
            A[q, q] = A[q, q] + t * off
            A[p, q] = real(0.0)
            A[q, p] = real(0.0)
            u = A[r, p]
            v = A[r, q]
            A[r, p] = c * u - s * v
            A[p, r] = A[r, p]
            A[r, q] = s * u + c * v
            A[q, r] = A[r, q]
            for i in range(3):
                u = V[i, p]
                v = V[i, q]
                V[i, p] = c * u - s * v
                V[i, q] = s * u + c * v
        return A, V

    @wp.func
    def eigen(S: mat33):
        """Eigenvectors, in columns, and eigenvalues of a symmetric tensor."""
        A = real(0.5) * (S + wp.transpose(S))
        V = wp.identity(n=3, dtype=real)
        for _ in range(10):
            size = wp.abs(A[0, 0]) + wp.abs(A[1, 1]) + wp.abs(A[2, 2])
            if wp.abs(A[0, 1]) + wp.abs(A[0, 2]) + wp.abs(A[1, 2]) <= digits * size:
                break
            A, V = turn(A, V, 0, 1, 2)
            A, V = turn(A, V, 0, 2, 1)
            A, V = turn(A, V, 1, 2, 0)
        return V, vec3(A[0, 0], A[1, 1], A[2, 2])

    @wp.func
    def symmetric(V: mat33, d: vec3):
        """V diag(d) V^T."""
        return V * wp.diag(d) * wp.transpose(V)

    return eigen, symmetric


def _logarithm(real: Any, eigen: Any, symmetric: Any) -> Any:
    mat33 = wp.types.matrix(shape=(3, 3), dtype=real)
    near = wp.constant(real(0.04))  # squared norm to which Pade's approximant errs by 6e-11
    least = wp.constant(real((1e-15 if real is wp.float64 else 1e-7) - 1.0))

    @wp.func
    def hencky(H: mat33):
        """Logarithmic strain 1/2 log F F^T."""
        X = H + wp.transpose(H) + H * wp.transpose(H)
        eye = wp.identity(n=3, dtype=real)
        out = mat33()
        if wp.ddot(X, X) < near:
            X2 = X * X
            X3 = X2 * X
            X4 = X2 * X2
            top = X + real(1.5) * X2 + real(260.0 / 420.0) * X3 + real(25.0 / 420.0) * X4
            low = eye + real(2.0) * X + real(540.0 / 420.0) * X2
            low = low + real(120.0 / 420.0) * X3 + real(6.0 / 420.0) * X4
            out = real(0.5) * top * wp.inverse(low)
        else:
            V, d = eigen(X)
            for i in range(3):
                d[i] = real(0.5) * wp.log(real(1.0) + wp.max(d[i], least))
            out = symmetric(V, d)
        return out

    return hencky


def _exponential(real: Any, eigen: Any, symmetric: Any) -> Any:
    mat33 = wp.types.matrix(shape=(3, 3), dtype=real)
    near = wp.constant(real(0.01))  # squared norm to which Pade's approximant errs by 1e-12
    nearest = wp.constant(real(1e-6))  # and the series of three terms by 4e-14

    @wp.func
    def exponential(S: mat33):
        """exp(S) - I of a symmetric tensor."""
        eye = wp.identity(n=3, dtype=real)
        out = mat33()
        n2 = wp.ddot(S, S)
        if n2 < nearest:
            S2 = S * S
            out = S + real(0.5) * S2 + real(1.0 / 6.0) * (S2 * S)
        elif n2 < near:
            S2 = S * S
            odd = real(0.5) * S + real(1.0 / 120.0) * (S2 * S)
            out = real(2.0) * wp.inverse(eye + real(0.1) * S2 - odd) * odd
        else:
            V, d = eigen(S)
            for i in range(3):
                d[i] = wp.exp(d[i]) - real(1.0)
            out = symmetric(V, d)
        return out

    return exponential
