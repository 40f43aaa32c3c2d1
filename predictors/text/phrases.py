"""The phrase network: which row of the table some words of matter mean.

"CuAl10Fe5Ni5-C", "checkerplate ally" and "madera de haya" share their letters with what the table,
the standards and the lists of other languages call alike; "shavings of cedar" and "wood chips"
share their sense. A phrase is the mean of the vectors of its runs of one to five letters, its words
and its shape (fastText: Bojanowski et al. 2017) beside its embedding by MiniLM, then one hidden
layer. ``autophyx-tet train phrases`` makes the weights.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import numpy as np
from jaxtyping import Float

from ...fem.table import Material
from ..encoders.minilm import MiniLM
from ..packed import STEP, unpacked

WEIGHTS = Path(__file__).parents[1] / "weights" / "phrases.safetensors"
BUCKETS = 2**14  # of the hash; the first stands for nothing
LONGEST_RUN = 5  # letters
SHAPE = 12  # signs: "CuAl10" is "AaAa00"
SENSE = 8.0  # length of an embedding beside the vectors of letters
ALIKE = (0.2, 0.06)  # differences in ln E and ln rho


def features(phrase: str) -> list[int]:
    """Places, in the table of vectors, of a phrase's runs of letters, words, pairs and shape.

    >>> features("oak ") == features("oak"), features("oak") == features("Oak")
    (True, False)
    """
    return [crc32(run.encode()) % (BUCKETS - 1) + 1 for run in _runs(" ".join(phrase.split()))]


def _runs(phrase: str) -> Iterator[str]:
    low = f" {phrase.lower()} "
    for length in range(1, LONGEST_RUN + 1):
        yield from (f"{length}{low[i : i + length]}" for i in range(len(low) - length + 1))
    words = re.findall(r"[^\W_]+", low)
    yield from (f"w{word}" for word in words)
    yield from (f"p{a} {b}" for a, b in pairwise(words))
    shape = re.sub(r"[a-z]", "a", re.sub(r"[A-Z]", "A", re.sub(r"\d", "0", phrase)))
    yield f"s{shape[:SHAPE]}"


def values_of(rows: Iterable[Material]) -> Float[np.ndarray, "rows 2"]:
    """Middles of ln E and ln rho of rows of the table."""
    pairs = [[np.log(x.min * x.max) / 2 for x in (row.E, row.rho)] for row in rows]
    return np.array(pairs, np.float32)


class Meant(NamedTuple):
    """The likeliest row of a phrase, "" for none, and the share of all rows like it."""

    row: str
    share: float


class PhraseNetwork:
    """Gives a phrase the name of a row of the table; ``path`` holds the weights."""

    def __init__(self, path: Path = WEIGHTS) -> None:
        from safetensors import safe_open

        self._encoder = MiniLM()
        self._shares = lru_cache(maxsize=4096)(self._shares_of)
        with safe_open(path, framework="np") as file:
            self.rows: list[str] = json.loads(file.metadata()["rows"])
            self._vectors = file.get_tensor("vectors"), file.get_tensor(f"vectors{STEP}")
            self._values = file.get_tensor("values")  # ln E and ln rho of the rows
            names = [name for name in file.keys() if name.startswith(("hidden", "out"))]
            layers = unpacked({name: file.get_tensor(name) for name in names})
            self._hidden = layers["hidden.w"], layers["hidden.b"]
            self._out = layers["out.w"], layers["out.b"]

    def meant(self, phrase: str) -> Meant:
        """The row that a phrase most likely means."""
        shares = self._shares(phrase)
        best = int(shares.argmax())
        share = self.share(phrase, self._values[[best]]) if self.rows[best] else shares[best]
        return Meant(self.rows[best], float(share))

    def share(self, phrase: str, values: Float[np.ndarray, "matters 2"]) -> float:
        """Share of the rows like matters of such ln E and ln rho among all that a phrase may mean.

        They need not be rows that it has learned.
        """
        alike = (np.abs(self._values[:, None] - values) < ALIKE).all(axis=2).any(axis=1)
        return float(self._shares(phrase)[alike].sum())

    def _shares_of(self, phrase: str) -> Float[np.ndarray, " rows"]:
        places = features(phrase)
        vectors, steps = self._vectors
        letters = (vectors[places] * steps[places]).mean(axis=0)
        x = np.concatenate([letters, SENSE * self._encoder.text([phrase])[0]])
        hidden = np.maximum(self._hidden[0] @ x + self._hidden[1], 0)
        logits = self._out[0] @ hidden + self._out[1]
        shares = np.exp(logits - logits.max())
        return shares / shares.sum()


@lru_cache(maxsize=1)
def load_phrases() -> PhraseNetwork:
    """The shipped network, read once."""
    return PhraseNetwork()
