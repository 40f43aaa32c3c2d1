"""Rows of the table by nearness in meaning: softmax(cosine / .1) over sentence embeddings.

After NeRF2Physics (Zhai et al. 2024), without its language model.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.table import Material, MaterialTable
from ..encoders import TextEncoder
from ..packed import unpacked

# Below this cosine a part's name says nothing of its material: measured on 30 part names, where
# "rug" has .74 with carpet, "mattress" .49 with memory foam, but "leg" .38 with meat.
MEANINGFUL = 0.45
KERNEL_WIDTH = 0.1  # of the softmax over cosines: NeRF2Physics' temperature


class Nearest(NamedTuple):
    """The row nearest to a query, its share of the kernel's weight, and whether it is near."""

    row: Material
    share: float
    meaningful: bool


class RowKernel:
    """Keeps the embeddings of a table's rows, and of the words it was asked about.

    A grade ("AISI 304", "snakewood") is no answer to a likeness: whoever means one names it.
    """

    def __init__(self, table: MaterialTable, encoder: TextEncoder | None = None) -> None:
        self.rows = tuple(row for row in table if not row.grade)
        self._given_encoder = encoder
        self._embedded: dict[str, np.ndarray] = {}  # parts often share their words

    @cached_property
    def encoder(self) -> TextEncoder:
        """The text encoder, loaded when the words of the table do not suffice."""
        from ..encoders.minilm import MiniLM

        return self._given_encoder or MiniLM()

    @cached_property
    def _embedded_rows(self) -> Float[np.ndarray, "rows dim"]:
        if self._given_encoder is None:
            self._embedded.update(kept_vectors())
        return self._embed([row_text(row) for row in self.rows])

    def nearest(
        self, query: str, *, among: Collection[str] | None = None, common: Collection[str] = ()
    ) -> Nearest:
        """Return the row nearest to a query.

        query: Words of a part and of what is said of it.
        among: Names of the rows that it may be; by default all.
        common: Names of those to choose from where none is near; may be none.
        """
        cosines = self._embedded_rows @ self._embed([query])[0]
        found = self._nearest(cosines, among)
        if found.meaningful or not common:
            return found
        return self._nearest(cosines, common)._replace(meaningful=False)

    def _nearest(
        self, cosines: Float[np.ndarray, "rows"], among: Collection[str] | None
    ) -> Nearest:
        if among is not None:
            cosines = np.where([row.name in among for row in self.rows], cosines, -np.inf)
        weight = np.exp((cosines - cosines.max()) / KERNEL_WIDTH)
        best = int(np.argmax(weight))
        share = float(weight[best] / weight.sum())
        return Nearest(self.rows[best], share, bool(cosines[best] >= MEANINGFUL))

    def embed(self, queries: Sequence[str]) -> None:
        """Embed queries in one go, for whoever asks for them one by one."""
        if queries:
            self._embed([*queries])

    def similarity(self, left: list[str], right: list[str]) -> Float[np.ndarray, "left right"]:
        """Cosines of two lists of texts."""
        return self._embed(left) @ self._embed(right).T

    def _embed(self, texts: list[str]) -> Float[np.ndarray, "n dim"]:
        new = [text for text in dict.fromkeys(texts) if text not in self._embedded]
        if new:
            self._embedded.update(zip(new, self.encoder.text(new), strict=True))
        return np.stack([self._embedded[text] for text in texts])


# Sentence embeddings of the table's rows, kept in a file: embedding them takes seconds a start.
#
# ``python -m autophyx_tet.research.row_vectors`` writes the file anew. A row that it
# lacks is embedded when it is asked for, so a table that has changed is slower, not wrong.

FILE = Path(__file__).resolve().parent.parent / "weights" / "row_vectors.safetensors"


def row_text(row: Material) -> str:
    """Return what is embedded of a row: its name without the small print, and an everyday word."""
    return ", ".join([re.sub(r"\s*\(.*\)", "", row.name), *row.aliases[:2]])


@cache
def kept_vectors() -> Mapping[str, np.ndarray]:
    """Unit vectors (384,) by text, of ``all-MiniLM-L6-v2``, kept as bytes."""
    from safetensors import safe_open

    with safe_open(FILE, framework="np") as file:
        texts = json.loads(file.metadata()["texts"])
        stored = {name: file.get_tensor(name) for name in file.keys()}
    return dict(zip(texts, unpacked(stored)["vectors"], strict=True))
