"""Errors of predicted masses, as NeRF2Physics and AutoPhyX table 2 define them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError


class MassErrors(NamedTuple):
    """Means over the objects: lower is better for the first three, 1 is best for the last.

    ``ALDE`` |ln m - ln m'| [1], ``ADE`` |m - m'| [kg], ``ARE`` |m - m'| / m [1], ``MnRE``
    min(m / m', m' / m) [1].
    """

    ALDE: float
    ADE: float
    ARE: float
    MnRE: float


def mass_errors(
    truth: Float[np.ndarray, "objects"], predicted: Float[np.ndarray, "objects"]
) -> MassErrors:
    """Compare predicted masses [kg] with the true ones."""
    if not len(truth) or (truth <= 0).any() or (predicted <= 0).any():
        raise InputError(
            f"masses must be positive and at least one, got {truth.tolist()} and "
            f"{predicted.tolist()} kg"
        )
    off = np.abs(truth - predicted)
    ratio = truth / predicted
    return MassErrors(
        ALDE=float(np.abs(np.log(ratio)).mean()),
        ADE=float(off.mean()),
        ARE=float((off / truth).mean()),
        MnRE=float(np.minimum(ratio, 1 / ratio).mean()),
    )
