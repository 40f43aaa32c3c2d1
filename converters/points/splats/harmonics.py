"""Spherical harmonics of splats and how they turn: band by band, exactly."""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Float

# Bands above the constant one and their coefficients: 3DGS has up to 3, .spz up to 4.
BANDS = (3, 5, 7, 9)
COUNTS = tuple(int(count) for count in np.cumsum(BANDS))


def band_values(degree: int, directions: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n m"]:
    """Real harmonics of one ``degree`` (1 to 4) in unit ``directions``, in the order of 3DGS.

    Signs and order are those of Kerbl et al. (2023), gaussian-splatting/utils/sh_utils.py; the
    fourth band is that of PlenOctrees (Yu et al. 2021), of which the file is taken.
    """
    x, y, z = np.moveaxis(directions, -1, 0)
    xx, yy, zz = x * x, y * y, z * z
    if degree == 1:
        values = [-y, z, -x]
        factors = [0.4886025119029199] * 3
    elif degree == 2:
        values = [x * y, y * z, 2 * zz - xx - yy, x * z, xx - yy]
        factors = [1.0925484305920792, -1.0925484305920792, 0.31539156525252005,
                   -1.0925484305920792, 0.5462742152960396]  # fmt: skip
    elif degree == 3:
        values = [y * (3 * xx - yy), x * y * z, y * (4 * zz - xx - yy),
                  z * (2 * zz - 3 * xx - 3 * yy), x * (4 * zz - xx - yy), z * (xx - yy),
                  x * (xx - 3 * yy)]  # fmt: skip
        factors = [-0.5900435899266435, 2.890611442640554, -0.4570457994644658,
                   0.3731763325901154, -0.4570457994644658, 1.445305721320277,
                   -0.5900435899266435]  # fmt: skip
    else:
        values = [x * y * (xx - yy), y * z * (3 * xx - yy), x * y * (7 * zz - 1),
                  y * z * (7 * zz - 3), zz * (35 * zz - 30) + 3, x * z * (7 * zz - 3),
                  (xx - yy) * (7 * zz - 1), x * z * (xx - 3 * yy),
                  xx * (xx - 3 * yy) - yy * (3 * xx - yy)]  # fmt: skip
        factors = [2.5033429417967046, -1.7701307697799304, 0.9461746957575601,
                   -0.6690465435572892, 0.10578554691520431, -0.6690465435572892,
                   0.47308734787878004, -1.7701307697799304, 0.6258357354491761]  # fmt: skip
    return np.stack([f * v for f, v in zip(factors, values, strict=True)], axis=-1)


def band_rotations(
    degree: int, rotations: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n m m"]:
    """Matrices D that turn the coefficients of a band: Y(d) . D c = Y(R^T d) . c for all d.

    A band is closed under rotation, so 2 l + 1 directions decide: D = Y(P)^-1 Y(P R).
    """
    directions, inverse = _sampled(degree)
    return inverse @ band_values(degree, directions @ rotations)


def turned_harmonics(
    harmonics: Float[np.ndarray, "n channels k"],
    rotations: Float[np.ndarray, "r 3 3"],
    of: np.ndarray,
) -> Float[np.ndarray, "n channels k"]:
    """Coefficients above the constant one, turned by the rotation ``of`` every splat (n,)."""
    result, start = np.empty_like(harmonics), 0
    for degree, width in enumerate(BANDS, 1):
        if start >= harmonics.shape[2]:
            break
        band = slice(start, start + width)
        matrices = band_rotations(degree, rotations).astype(harmonics.dtype)
        result[:, :, band] = harmonics[:, :, band] @ matrices[of].transpose(0, 2, 1)
        start += width
    return result


@cache
def _sampled(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions that tell a band's functions apart, and the inverse of its values there.

    Of fifty draws with a fixed seed the best conditioned one.
    """
    rng = np.random.default_rng(0)
    draws = rng.normal(size=(50, BANDS[degree - 1], 3))
    draws /= np.linalg.norm(draws, axis=2, keepdims=True)
    best = min(draws, key=lambda d: np.linalg.cond(band_values(degree, d)))
    return best, np.linalg.inv(band_values(degree, best))
