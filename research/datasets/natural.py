"""Natural sentences about real objects in one piece, and what each of their clauses means.

``data/naturals*.toml`` hold them: written by several hands that saw the object, and neither a
network nor the reader. Of each sentence the clauses are on record: words for parts, words for a
material, and the material slots of the file that they mean.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Int

from ...fem.table import MaterialTable
from ...predictors.regions.division import of_matters, said_by
from ...predictors.text.one_piece import of_one_piece
from ...predictors.text.parts import name_words
from ...predictors.text.reader import read_sentence
from . import sweethome3d
from .one_piece import OnePiece

DATA = Path(__file__).parent / "data"
PARTS = "parts.toml"


class Meant(NamedTuple):
    """Words for parts, words for a material, and the slots that they speak of."""

    part: str
    material: str
    slots: tuple[str, ...]


class Natural(NamedTuple):
    """A sentence of a ``hand`` about the object of a source's catalogue with this number.

    Of the slots ``unsaid`` it is known that no clause speaks.
    """

    source: sweethome3d.Source
    number: int
    text: str
    clauses: tuple[Meant, ...]
    hand: str = ""
    unsaid: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Name of the object."""
        return f"{self.source}_{self.number:03d}"

    def clause_of(self, slots: Sequence[str]) -> Int[np.ndarray, "slots"]:
        """Clause that speaks of each slot, -1 where none does."""
        of = {slot: k for k, clause in enumerate(self.clauses) for slot in clause.slots}
        return np.array([of.get(slot, -1) for slot in slots], dtype=int)


def naturals(
    sources: Sequence[str], files: str = "naturals*.toml", folder: Path = DATA
) -> list[Natural]:
    """Return all sentences about objects of these sources; of ``PARTS`` what their parts are."""
    found = []
    for path in sorted(folder.glob(files)):
        for item in tomllib.loads(path.read_text(encoding="utf-8"))["objects"]:
            if item["source"] in sources:
                clauses = (
                    Meant(part, material, tuple(of)) for part, material, of in item["clauses"]
                )
                found.append(
                    Natural(
                        item["source"], int(item["id"]), item.get("sentence", ""), tuple(clauses),
                        item.get("hand", ""), tuple(item.get("unsaid", ())),
                    )
                )  # fmt: skip
    return found


def as_heard(natural: Natural, table: MaterialTable) -> tuple[Meant, ...]:
    """The clauses that the product hears of a sentence, and the slots that they mean.

    A clause means the slots of the one on record that it has the matter and words of, of none where
    it shares nothing with any.
    """
    labels = (("object",),)
    sentence = of_one_piece(read_sentence(natural.text, labels, table), labels, table).sentence
    heard = []
    for k in of_matters(sentence):
        said, text = said_by(sentence.clauses[k], sentence), sentence.clauses[k].text
        nouns, matters = {*name_words(said.part)}, {*name_words(f"{said.material} {text}")}

        def alike(meant: Meant, nouns: set[str] = nouns, matters: set[str] = matters) -> int:
            matter = len(matters & {*name_words(meant.material)}) or not meant.material
            return bool(matter) * (1 + 2 * len(nouns & {*name_words(meant.part)}))

        best = max(natural.clauses, key=alike)
        heard.append(Meant(said.part, said.material, best.slots if alike(best) else ()))
    return tuple(heard)


def one_pieces(
    sentences: Sequence[Natural], count: int | None = None
) -> Iterator[tuple[str, OnePiece]]:
    """Fetch and fill the first ``count`` objects that sentences speak of, or all; with keys."""
    from ...toolkit.asset.load import load_asset

    for one in islice({one.key: one for one in sentences}.values(), count):
        item = sweethome3d.catalog(one.source)[one.number]
        with tempfile.TemporaryDirectory() as folder:
            asset = load_asset(sweethome3d.extract(item, Path(folder)))
            yield one.key, OnePiece.of(asset, item.name)
