"""What every predictor is: parts on a grid and a sentence in, a material field out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from .field import MaterialField
from .voxels import PartVoxels


@runtime_checkable
class Predictor(Protocol):
    """Predicts E [Pa], nu [1], rho [kg/m^3] on the occupied cells of ``parts``."""

    name: str

    def predict(self, parts: PartVoxels, text: str, *, alpha: float | None = None) -> MaterialField:
        """Return the field; ``alpha`` moves E from soft (0) to stiff (1) within its range."""
        ...


@runtime_checkable
class TextEncoder(Protocol):
    """Embeds sentences as unit vectors."""

    def text(self, sentences: Sequence[str]) -> np.ndarray:
        """Embedding of each sentence, shape (n, dim)."""
        ...
