"""How often a share of the network's is right: what it says of its certainty is calibrated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_LEAST = 1e-4  # of a share, for its log-odds: shares are means over cells and views


class Calibration(NamedTuple):
    """Certainty = logistic(slope log-odds(share) + offset), Platt (1999)."""

    slope: float
    offset: float

    def __call__(self, share: float) -> float:
        """Return how often an answer with such a share of a part is right."""
        return float(1 / (1 + np.exp(-(self.slope * log_odds(share) + self.offset))))


def log_odds(share: np.ndarray | float) -> np.ndarray:
    """Return log(p / (1 - p)) of shares in [0, 1]."""
    share = np.asarray(np.clip(share, _LEAST, 1 - _LEAST))
    return np.asarray(np.log(share / (1 - share)))
