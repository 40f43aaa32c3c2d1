"""How alike two pictures are: PSNR, and SSIM after Wang et al. 2004."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError

# Errors below half a grey level of eight bits are nothing that a picture file could hold.
FINEST = (0.5 / 255) ** 2
SIGMA, REACH = 1.5, 5  # of the Gaussian window [pixels]: 11 x 11
K1, K2 = 0.01, 0.03  # Wang's constants, of the range of the values


class ImageSimilarity(NamedTuple):
    """PSNR [dB], at most 54.2 (half a grey level of 255), and SSIM, 1 for the same picture."""

    psnr: float
    ssim: float


def image_similarity(
    found: Float[np.ndarray, "height width channels"],
    truth: Float[np.ndarray, "height width channels"],
) -> ImageSimilarity:
    """Compare two pictures with values in [0, 1]; SSIM is the mean over pixels and channels."""
    if found.shape != truth.shape or min(found.shape[:2]) <= 2 * REACH:
        raise InputError(
            f"pictures of {found.shape} and {truth.shape}: wanted one shape, sides > {2 * REACH}"
        )
    return ImageSimilarity(psnr(found, truth), ssim(found, truth))


def psnr(found: Float[np.ndarray, "*n"], truth: Float[np.ndarray, "*n"]) -> float:
    """Peak signal-to-noise ratio [dB] of values in [0, 1]: -10 log10 of the mean squared error."""
    error = float(np.mean((found.astype(np.float64) - truth) ** 2))
    return float(-10 * np.log10(max(error, FINEST)))


def ssim(
    found: Float[np.ndarray, "height width channels"],
    truth: Float[np.ndarray, "height width channels"],
) -> float:
    """Structural similarity of values in [0, 1], where the window lies inside the picture."""
    a, b = found.astype(np.float64), truth.astype(np.float64)
    mean_a, mean_b = _smooth(a), _smooth(b)
    spread_a, spread_b = _smooth(a * a) - mean_a**2, _smooth(b * b) - mean_b**2
    common = _smooth(a * b) - mean_a * mean_b
    brightness = (2 * mean_a * mean_b + K1**2) / (mean_a**2 + mean_b**2 + K1**2)
    structure = (2 * common + K2**2) / (spread_a + spread_b + K2**2)
    return float((brightness * structure)[REACH:-REACH, REACH:-REACH].mean())


def _smooth(picture: np.ndarray) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    return gaussian_filter(picture, (SIGMA, SIGMA, 0), radius=(REACH, REACH, 0))
