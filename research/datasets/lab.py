"""Colours of CIE L*a*b* on a screen."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ...predictors.appearance.surface import to_srgb

# White at D65 (CIE 15), and the rows that turn X, Y, Z to linear sRGB (IEC 61966-2-1).
D65 = (0.95047, 1.0, 1.08883)
LINEAR_OF_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314],
     [-0.9692660, 1.8760108, 0.0415560],
     [0.0556434, -0.2040259, 1.0572252]]
)  # fmt: skip


def srgb_of_lab(lab: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """SRGB in [0, 1], clipped, of CIE L*a*b* at D65 (CIE 15; IEC 61966-2-1)."""
    y = (lab[0] + 16) / 116
    f = np.array([y + lab[1] / 500, y, y - lab[2] / 200])
    xyz = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29)) * D65
    return to_srgb((LINEAR_OF_XYZ @ xyz).clip(0, 1))
