"""How often a share of the network's is right: said only where it was found to hold."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

SHIPPED = Path(__file__).parents[1] / "weights" / "film_certainty.json"

_LEAST = 1e-4  # of a share, for its log-odds: shares are means over cells and views


class Calibration(NamedTuple):
    """Certainty = logistic(slope log-odds(share) + offset), Platt (1999)."""

    slope: float
    offset: float

    def __call__(self, share: float) -> float:
        """Return how often an answer with such a share of a part is right."""
        return float(1 / (1 + np.exp(-(self.slope * log_odds(share) + self.offset))))


@dataclass(frozen=True)
class Certainty:
    """A calibration, and the spans of certainty in which other objects bore it out.

    ``benchmarks/reliability.py`` fits and checks it; the card of the weights shows both.
    """

    calibration: Calibration
    spans: tuple[tuple[float, float], ...] = ()

    @classmethod
    def load(cls, path: Path = SHIPPED) -> Certainty:
        """Return that of the shipped weights."""
        found = json.loads(path.read_text(encoding="utf-8"))
        calibration = Calibration(found["slope"], found["offset"])
        return cls(calibration, tuple((low, high) for low, high in found["spans"]))

    def of(self, share: float) -> float | None:
        """Return how often an answer with such a share is right, None where nobody knows."""
        certainty = self.calibration(share)
        known = any(low <= certainty <= high for low, high in self.spans)
        return certainty if known else None


def log_odds(share: np.ndarray | float) -> np.ndarray:
    """Return log(p / (1 - p)) of shares in [0, 1]."""
    share = np.asarray(np.clip(share, _LEAST, 1 - _LEAST))
    return np.asarray(np.log(share / (1 - share)))
