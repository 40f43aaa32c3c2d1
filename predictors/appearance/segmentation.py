"""Parts by words: every cell to the keyword nearest in meaning, and the most coherent set wins.

After AutoPhyX 3.3 and UniPixie A.1.1: several sets of keywords are tried on an object; where the
papers ask a vision-language model which segmentation is best, a numeric critic scores them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import UsageError
from ..encoders import Encoder

TINY = 0.01  # share of the cells below which a connected piece is a speck
TEMPERATURE = 0.1  # of the softmax that says how sure a cell is
FLAT = 1e-6  # spread of similarities below which they say nothing


@dataclass(frozen=True, eq=False)
class Coherence:
    """What the critic saw, each in [0, 1], best 1.

    ``whole``: share of the cells that lie in pieces larger than specks; ``compact``: share of
    neighbouring cells with one label; ``sure``: mean lead of the best keyword, as a probability
    over chance; ``used``: share of the keywords that got a part.
    """

    whole: float
    compact: float
    sure: float
    used: float

    @property
    def score(self) -> float:
        """Geometric mean: one fault is enough to lose."""
        return float((self.whole * self.compact * self.sure * self.used) ** 0.25)


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Labels (n,) of cells, indices into ``keywords``, and how coherent they are."""

    label: Int[np.ndarray, "n"]
    keywords: tuple[str, ...]
    coherence: Coherence

    def arrays(self) -> dict[str, np.ndarray]:
        """Labels and keywords as named arrays."""
        return {"label": self.label, "keywords": np.array(self.keywords, dtype=str)}

    def document(self) -> dict[str, Any]:
        """Voxels of every keyword, and the critic's score in [0, 1]."""
        count = np.bincount(self.label, minlength=len(self.keywords)).tolist()
        return {
            "voxels": dict(zip(self.keywords, count, strict=True)),
            "coherence": self.coherence.score,
        }


def segment(
    values: Float[np.ndarray, "n D"],
    cells: Int[np.ndarray, "n 3"],
    keywords: Sequence[str],
    encoder: Encoder,
) -> Segmentation:
    """Give every cell the keyword with the largest cosine, standardised over the object.

    values: Feature of every cell, shape (n, D).
    cells: Index of every cell, shape (n, 3).
    keywords: At least two words or phrases.
    encoder: The encoder that made the features.
    """
    from scipy.ndimage import label as connect

    if len(keywords) < 2:
        raise UsageError("segmentation.segmentation_needs", keywords=list(keywords))
    norm = np.linalg.norm(values, axis=1, keepdims=True)
    cosine = (values / np.maximum(norm, FLAT)) @ encoder.text(keywords).T
    # Without its mean a word that is near to everything would take all cells.
    relative = cosine - cosine.mean(axis=0)
    relative = relative / max(float(relative.std()), FLAT)
    label = relative.argmax(axis=1)
    low = cells.min(axis=0)
    grid = np.full(cells.max(axis=0) - low + 1, -1)
    at = tuple((cells - low).T)
    grid[at] = label
    whole = 0
    for word in np.unique(label):
        pieces, _ = cast(tuple[np.ndarray, int], connect(grid == word))
        sizes = np.bincount(pieces.ravel())[1:]
        whole += sizes[sizes >= TINY * len(label)].sum()
    same = pairs = 0
    for axis in range(3):
        a, b = (np.moveaxis(grid, axis, 0)[part] for part in (slice(1, None), slice(None, -1)))
        both = (a >= 0) & (b >= 0)
        pairs += both.sum()
        same += (both & (a == b)).sum()
    logits = (relative - relative.max(axis=1, keepdims=True)) / TEMPERATURE / relative.shape[1]
    best, chance = 1 / np.exp(logits).sum(axis=1), 1 / relative.shape[1]
    coherence = Coherence(
        whole=float(whole / len(label)),
        compact=float(same / max(pairs, 1)),
        sure=float((best.mean() - chance) / (1 - chance)),
        used=len(np.unique(label)) / relative.shape[1],
    )
    return Segmentation(label, tuple(keywords), coherence)


def best_segmentation(
    values: Float[np.ndarray, "n D"],
    cells: Int[np.ndarray, "n 3"],
    keyword_sets: Sequence[Sequence[str]],
    encoder: Encoder,
) -> Segmentation:
    """Segment with every set of keywords and return the most coherent result."""
    if not keyword_sets:
        raise UsageError("segmentation.segmentation_needs_least")
    tried = [segment(values, cells, keywords, encoder) for keywords in keyword_sets]
    return max(tried, key=lambda segmentation: segmentation.coherence.score)
