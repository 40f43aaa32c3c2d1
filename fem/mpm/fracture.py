"""Fracture of jelly by Rankine's criterion: the energy of a crack is spread over a band."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

# A crack is this many spacings wide: 0.88 to 0.94 of the fracture energy is spent at 10 and at 20
# cells, wherever between the nodes it opens; with 1.75 or less two may open. Where a bar stores
# more energy than its crack needs, waves open others: up to 1.5 times as much is spent.
BAND = 1.8
# Tensile strengths of particles differ by this share (standard deviation), for no body is perfect.
SCATTER = 0.1
# G_f E / (l_c f_t^2) at least: below one half the stress would snap back.
LEAST = 1 / 1.9


class CrackBand(NamedTuple):
    """Strength ``tension`` f_t [Pa], ``softening`` H_s [1], where the strength is ``lowered``."""

    tension: np.ndarray
    softening: np.ndarray
    lowered: np.ndarray


def crack_band(tension, energy: float, E, spacing: float) -> CrackBand:
    """Softening after f_t: sigma = f_t exp(-H_s (k - 1)) spends G_f over the band l_c.

    ``tension`` f_t [Pa] and ``E`` [Pa] are arrays, ``energy`` G_f [J/m^2]: 1/H_s = G_f E / (l_c
    f_t^2) - 1/2. Where that is not positive (the cells are too large for so brittle a matter), f_t
    is lowered to sqrt(1.9 G_f E / l_c).
    """
    tension, E = np.broadcast_arrays(np.asarray(tension, dtype=float), np.asarray(E, dtype=float))
    width = BAND * spacing
    most = np.sqrt(energy * E / (width * LEAST))
    lowered = tension > most
    strength = np.where(lowered, most, tension)
    return CrackBand(strength, 1 / (energy * E / (width * strength**2) - 0.5), lowered)


def without_cracks(
    F: Float[np.ndarray, "n 3 3"], q: Float[np.ndarray, "n"], softening: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n 3 3"]:
    """Deformation gradients of the matter beside its cracks, whose opening is no stretch of it.

    Of a stretch stays what damage ``q`` (largest sigma_1 / f_t) left of its stress; what is pressed
    together stays so.
    """
    torn = q > 1
    keep = np.exp(-softening[torn] * (q[torn] - 1)) / q[torn]
    left, s, right = np.linalg.svd(F[torn])
    s = np.where(s > 1, 1 + keep[:, None] * (s - 1), s)
    whole = F.copy()
    whole[torn] = (left * s[:, None]) @ right
    return whole


def scattered(tension: float, count: int, seed: int) -> np.ndarray:
    """Tensile strengths [Pa] of ``count`` particles around ``tension``, by ``seed``."""
    share = SCATTER * np.random.default_rng(seed).standard_normal(count)
    return tension * np.clip(1 + share, 0.5, 1.5)
