"""Rows of the table by nearness in meaning: softmax(cosine / .1) over sentence embeddings.

After NeRF2Physics (Zhai et al. 2024), without its language model.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.scene.materials import Material, MaterialTable
from ..encoders.protocol import TextEncoder
from .row_vectors import kept_vectors, row_text

KERNEL_WIDTH = 0.1  # of the softmax over cosines: NeRF2Physics' temperature


class Nearest(NamedTuple):
    """The row nearest to a query, and its share of the kernel's weight."""

    row: Material
    share: float


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

    def cosines(self, query: str) -> Float[np.ndarray, "rows"]:
        """Cosine of a query with each of ``rows``."""
        return self._embedded_rows @ self._embed([query])[0]

    def nearest(
        self, cosines: Float[np.ndarray, "rows"], *, among: Collection[str] | None = None
    ) -> Nearest:
        """Return the row with the largest cosine, of those named ``among`` if given."""
        if among is not None:
            cosines = np.where([row.name in among for row in self.rows], cosines, -np.inf)
        weight = np.exp((cosines - cosines.max()) / KERNEL_WIDTH)
        best = int(np.argmax(weight))
        return Nearest(self.rows[best], float(weight[best] / weight.sum()))

    def similarity(self, left: list[str], right: list[str]) -> Float[np.ndarray, "left right"]:
        """Cosines of two lists of texts."""
        return self._embed(left) @ self._embed(right).T

    def _embed(self, texts: list[str]) -> Float[np.ndarray, "n dim"]:
        new = [text for text in dict.fromkeys(texts) if text not in self._embedded]
        if new:
            self._embedded.update(zip(new, self.encoder.text(new), strict=True))
        return np.stack([self._embedded[text] for text in texts])
