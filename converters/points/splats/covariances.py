"""Covariances of splats under a deformation: Sigma' = F Sigma F^T, as scales and rotations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

# Sweeps of Jacobi's method: six reach round-off from any start, and a rigid motion needs none.
SWEEPS = 8
PLANES = ((0, 1), (0, 2), (1, 2))
# Below this ratio of its stretches a tet is flat: F^T F has no digits left for the smallest.
FLAT = 1e-4


class Ellipsoids(NamedTuple):
    """Standard deviations ``sigmas`` (n, 3) [m] along the columns of ``axes`` (n, 3, 3)."""

    sigmas: np.ndarray
    axes: np.ndarray


class Polar(NamedTuple):
    """Factors of F = R U: ``rotation`` (n, 3, 3) and symmetric ``stretch`` (n, 3, 3)."""

    rotation: np.ndarray
    stretch: np.ndarray


def polar(F: Float[np.ndarray, "n 3 3"]) -> Polar:
    """Polar decomposition; the rotation is proper even where F turns a tet inside out."""
    squares, basis = _diagonalised(F.transpose(0, 2, 1) @ F)
    sizes = np.sqrt(np.maximum(squares, 0.0))
    flat = sizes.min(axis=1) < FLAT * sizes.max(axis=1)
    inverse = 1 / np.where(flat[:, None], 1.0, sizes)
    rotation = F @ _symmetric(basis, inverse)
    stretch = _symmetric(basis, sizes)
    odd = flat | (np.linalg.det(F) <= 0)
    if odd.any():
        rotation[odd], stretch[odd] = _proper(F[odd])
    return Polar(rotation, stretch)


def _proper(F: np.ndarray) -> Polar:
    """Polar decomposition by singular values, the smallest of them negative where det F is."""
    left, sizes, right = np.linalg.svd(F)
    flip = np.sign(np.linalg.det(left @ right))
    sizes[:, 2] *= flip
    left[:, :, 2] *= flip[:, None]
    return Polar(left @ right, right.transpose(0, 2, 1) @ (sizes[:, :, None] * right))


def _symmetric(basis: np.ndarray, values: np.ndarray) -> np.ndarray:
    return (basis * values[:, None, :]) @ basis.transpose(0, 2, 1)


def stretched(
    sigmas: Float[np.ndarray, "n 3"],
    axes: Float[np.ndarray, "n 3 3"],
    rotation: Float[np.ndarray, "n 3 3"],
    stretch: Float[np.ndarray, "n 3 3"],
) -> Ellipsoids:
    """Ellipsoids after F = ``rotation`` ``stretch``, each axis the one that it was before.

    Jacobi's method in the turned axes of the start: what does not stretch keeps its order and sign.
    """
    root = axes.transpose(0, 2, 1) @ stretch @ axes * sigmas[:, None, :]
    square, basis = _diagonalised(root @ root.transpose(0, 2, 1))
    return Ellipsoids(np.sqrt(np.maximum(square, 0.0)), rotation @ axes @ basis)


def _diagonalised(a: Float[np.ndarray, "n 3 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (n, 3) and eigenvectors (n, 3, 3) of symmetric matrices, near to the axes."""
    rows = np.ascontiguousarray(a.transpose(1, 2, 0))  # entry by entry: n lies innermost
    basis = np.zeros_like(rows)
    basis[[0, 1, 2], [0, 1, 2]] = 1.0
    size = np.einsum("iin->n", rows)
    for _ in range(SWEEPS):
        off = max(np.abs(rows[p, q] / np.where(size > 0, size, 1.0)).max() for p, q in PLANES)
        if off < np.finfo(float).eps:
            break
        for p, q in PLANES:
            _rotate(rows, basis, p, q)
    return np.einsum("iin->ni", rows), basis.transpose(2, 0, 1)


def _rotate(rows: np.ndarray, basis: np.ndarray, p: int, q: int) -> None:
    """One Jacobi rotation in the plane (p, q), in place (Golub & Van Loan, 8.5.2)."""
    r, off = 3 - p - q, rows[p, q].copy()
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        tau = (rows[q, q] - rows[p, p]) / (2 * off)
        t = np.where(off == 0, 0.0, np.where(tau < 0, -1.0, 1.0) / (np.abs(tau) + np.hypot(1, tau)))
    c = 1 / np.hypot(1.0, t)
    s = t * c
    rows[p, p] -= t * off
    rows[q, q] += t * off
    rows[p, q] = rows[q, p] = 0.0
    with_p, with_q = rows[r, p].copy(), rows[r, q].copy()
    rows[r, p] = rows[p, r] = c * with_p - s * with_q
    rows[r, q] = rows[q, r] = s * with_p + c * with_q
    first, second = basis[:, p].copy(), basis[:, q].copy()
    basis[:, p], basis[:, q] = c * first - s * second, s * first + c * second


def matrices_of(rotations: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotation matrices of unit quaternions wxyz."""
    w, x, y, z = rotations.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.array(rows).transpose(2, 0, 1))


def quaternions_of(matrices: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 4"]:
    """Unit quaternions wxyz of rotation matrices, by their largest component."""
    m = matrices
    trace = np.einsum("nii->n", m)
    squares = np.column_stack([trace, m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]])
    most = np.argmax(squares, axis=1)
    a, b, c = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    d, e, f = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    diagonal = 1 - trace[:, None] + 2 * np.einsum("nii->ni", m)
    options = np.array(
        [[1 + trace, a, b, c], [a, diagonal[:, 0], d, e], [b, d, diagonal[:, 1], f],
         [c, e, f, diagonal[:, 2]]]
    )  # fmt: skip
    chosen = options[most, :, np.arange(len(m))]
    return chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
