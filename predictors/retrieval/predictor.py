"""The retrieval predictor: a sentence and the asset's own names against the material table.

Nothing is trained. Words of the table decide first; where none is found, a softmax(cosine / .1)
kernel over sentence embeddings of the table's rows picks one (NeRF2Physics, Zhai et al. 2024,
without its language model). A part has one material.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from ...fem.errors import UsageError
from ...fem.scene.materials import Material, MaterialTable, key, load_table
from ..field import MaterialField
from ..language import words
from ..language.binding import NamedPart, assign, bind, homeless, is_whole, nouns_of, overlap
from ..language.clauses import Clause, parse
from ..language.vocabulary import Vocabulary
from ..prediction import PartChoice, fill
from ..predictor import TextEncoder
from ..voxels import PartVoxels

KERNEL_WIDTH = 0.1  # of the softmax over cosines: NeRF2Physics' temperature
# Below this cosine a part's name says nothing of its material: measured on 30 part names, where
# "rug" has .74 with carpet, "mattress" .49 with memory foam, but "leg" .38 with meat.
MEANINGFUL = 0.45
_OF_ALL = "whole sentence:"  # why: a clause that speaks of no part
# What an everyday part is made of if neither the text nor its name says more.
COMMON = "wood steel plastic glass ceramic fabric leather rubber stone paper".split()


@dataclass(frozen=True)
class _Pick:
    """A phrase or a row, before the level of stiffness is applied."""

    row: Material
    why: str
    phrase: str = ""
    weight: float = 1.0
    level: str | None = None
    told: bool = True


class RetrievalPredictor:
    """Chooses one material a part from the table; keeps the table's embeddings between calls."""

    name = "retrieval"

    def __init__(
        self, *, table: MaterialTable | None = None, encoder: TextEncoder | None = None
    ) -> None:
        self.table = table or load_table()
        self._given_encoder = encoder
        self._vocabulary = Vocabulary(self.table.phrases)
        self._seen: dict[str, np.ndarray] = {}  # embeddings: parts often share their words

    @cached_property
    def encoder(self) -> TextEncoder:
        """The text encoder, loaded when the words of the table do not suffice."""
        from ..encoders.minilm import MiniLM

        return self._given_encoder or MiniLM()

    @cached_property
    def _embeddings(self) -> Float[np.ndarray, "rows dim"]:
        return self.encoder.text([_description(row) for row in self.table])

    def predict(
        self,
        parts: PartVoxels,
        text: str,
        *,
        alpha: float | None = None,
        overrides: Mapping[str, str] | None = None,
        materials: Mapping[str, str] | None = None,
    ) -> MaterialField:
        """Return the field of the chosen materials on the cells of ``parts``."""
        choices = self.choose(
            parts.part_labels,
            text,
            overrides=overrides,
            materials=materials,
            alpha=alpha,
            part_volumes=parts.volumes,
        )
        return fill(parts, choices, alpha=alpha)

    def choose(
        self,
        part_labels: Sequence[Sequence[str]],
        text: str,
        *,
        overrides: Mapping[str, str] | None = None,
        materials: Mapping[str, str] | None = None,
        alpha: float | None = None,
        part_volumes: Sequence[float] | None = None,
    ) -> list[PartChoice]:
        """Choose the material of every part.

        Parameters
        ----------
        part_labels
            For each part its name, then all other words the asset has for it.
        text
            What the user says of the object.
        overrides, materials
            For single parts: free text, and the exact name of a material of the table.
        alpha
            Place of E in its range, 0 (soft) to 1 (stiff); None follows words such as "soft".
        part_volumes
            Volumes [m^3]: of parts that no word tells apart, the larger is spoken of first.
        """
        volumes = part_volumes or [0.0] * len(part_labels)
        parts = [
            NamedPart.of(labels, self._vocabulary, volume)
            for labels, volume in zip(part_labels, volumes, strict=True)
        ]
        picks = self._from_text(parts, parse(text, self._vocabulary))
        for name, free in (overrides or {}).items():
            i = _index(name, parts)
            (pick,) = self._from_text(parts[i : i + 1], self._as_whole(free))
            picks[i] = replace(pick, why=f"override: {free!r}", told=True)
        for name, exact in (materials or {}).items():
            picks[_index(name, parts)] = _Pick(self.table.exact(exact), "override")
        return [
            self._choice(part.name, pick, alpha) for part, pick in zip(parts, picks, strict=True)
        ]

    def clauses(self, text: str) -> list[Clause]:
        """Clauses of a text, read with the words of the table."""
        return parse(text, self._vocabulary)

    def homeless(self, part_labels: Sequence[Sequence[str]], text: str) -> list[int]:
        """Which of the clauses speak of a part that none of the asset's is called after."""
        clauses = self.clauses(text)
        parts = [NamedPart.of(labels, self._vocabulary, 0.0) for labels in part_labels]
        return homeless(clauses, overlap(clauses, parts))

    def of_clause(self, part: str, clause: Clause, why: str) -> PartChoice:
        """Choose for a part what a clause names."""
        return self._choice(part, self._named(clause, why), None)

    def _as_whole(self, free: str) -> list[Clause]:
        """Clauses of a text that is about one part only: the first material counts."""
        clauses = parse(free, self._vocabulary)
        named = [clause for clause in clauses if clause.material]
        level = next((clause.level for clause in clauses if clause.level), None)
        if named:
            return [Clause(free, named[0].material, (), level)]
        return [Clause(free, None, ("everything",), level)]

    def _from_text(self, parts: list[NamedPart], clauses: list[Clause]) -> list[_Pick]:
        """Pick by clause, by the part's own names, by the whole sentence, or by the kernel."""
        score = overlap(clauses, parts)
        bound, lost = bind(score), homeless(clauses, score)
        named = [k for k, clause in enumerate(clauses) if clause.material]
        rest = [k for k in named if set(nouns_of(clauses[k])) & words.REST]
        free = [k for k in named if k not in bound and k not in rest]
        rows = {self._row(clauses[k]).name for k in named}
        if len(rows) == 1 and len(free) == len(named) and all(is_whole(clauses[k]) for k in free):
            rest, free = free, []  # "oak cube": one material for everything
        open_parts = [i for i, k in enumerate(bound) if k is None or not clauses[k].material]
        if free:
            given = assign(
                [clauses[k] for k in free],
                [parts[i] for i in open_parts],
                similarity=self._similarity,
                category=lambda phrase: self.table.exact(phrase).category,
            )
            for i, k in zip(open_parts, given, strict=True):
                bound[i] = bound[i] if k is None else free[k]
        whole = [k for k in free if set(clauses[k].parts) <= words.OBJECTS | words.STRUCTURE]
        picks = [
            self._pick(part, None if k is None else clauses[k], clauses, rest[:1], whole[:1])
            for part, k in zip(parts, bound, strict=True)
        ]
        if not lost:
            return picks
        # "the legs are steel" of a chair in one piece: what holds for all of it is open again.
        return [
            replace(pick, told=False)
            if pick.why.startswith(_OF_ALL)
            or k in lost
            or (k is not None and set(nouns_of(clauses[k])) <= words.OBJECTS)
            else pick
            for pick, k in zip(picks, bound, strict=True)
        ]

    def _pick(
        self,
        part: NamedPart,
        clause: Clause | None,
        clauses: list[Clause],
        rest: list[int],
        whole: list[int],
    ) -> _Pick:
        level = clause.level if clause else None
        if clause and clause.material:
            return self._named(clause, f"text: {clause.text!r}")
        for k in rest:
            return self._named(clauses[k], f"{_OF_ALL} {clauses[k].text!r}", level)
        if part.material:
            why = f"name: {part.material_label!r}"
            return _Pick(self.table.exact(part.material), why, part.material, level=level)
        for k in whole:
            return self._named(clauses[k], f"{_OF_ALL} {clauses[k].text!r}", level)
        said = clause or next((c for c in clauses if not (c.material or c.level)), None)
        return self._nearest(part, said, [c for c in clauses if c.material])

    def _named(self, clause: Clause, why: str, level: str | None = None) -> _Pick:
        return _Pick(self._row(clause), why, clause.material or "", level=clause.level or level)

    def _row(self, clause: Clause) -> Material:
        return self.table.exact(clause.material or "")

    def _nearest(self, part: NamedPart, said: Clause | None, named: list[Clause]) -> _Pick:
        """Pick by embedding: from all rows, the text's own, or the common ones if all are far."""
        level = said.level if said else None
        query = f"{part.spoken} {said.text if said else ''}".strip()
        cosine = self._embeddings @ self._embed([query])[0]
        why = f"nearest to {query!r}"
        if cosine.max() < MEANINGFUL:
            if named:
                near = self._similarity([query], [clause.text for clause in named])[0]
                clause = named[int(np.argmax(near))]
                pick = self._named(clause, f"{_OF_ALL} {clause.text!r}", level)
                return replace(pick, told=False)
            common = {self.table.exact(word).name for word in COMMON}
            cosine = np.where([row.name in common for row in self.table], cosine, -np.inf)
        weight = np.exp((cosine - cosine.max()) / KERNEL_WIDTH)
        best = int(np.argmax(weight))
        share = float(weight[best] / weight.sum())
        told = level is None and bool(cosine.max() >= MEANINGFUL)
        return _Pick(self.table.rows[best], why, "", share, level, told)

    def _similarity(self, left: list[str], right: list[str]) -> np.ndarray:
        return self._embed(left) @ self._embed(right).T

    def _embed(self, texts: list[str]) -> np.ndarray:
        new = [text for text in dict.fromkeys(texts) if text not in self._seen]
        if new:
            self._seen.update(zip(new, self.encoder.text(new), strict=True))
        return np.stack([self._seen[text] for text in texts])

    def _choice(self, part: str, pick: _Pick, alpha: float | None) -> PartChoice:
        """Apply the level: the family's own row ("soft foam"), else a place in the row's range."""
        row, level = pick.row, pick.level
        if level and not set(pick.phrase.split()) & set(words.LEVEL_OF):
            names = (f"{word} {pick.phrase}" for word in words.ALIAS_OF_LEVEL[level])
            family = next((self.table.phrases[n] for n in names if n in self.table.phrases), None)
            row, level = (family, None) if family else (row, level)
        else:
            level = None
        place = words.ALPHA_OF_LEVEL.get(level or "", 0.5) if alpha is None else alpha
        return PartChoice(part, row, row.value(place), pick.weight, place, pick.why, pick.told)


def choose_materials(
    part_labels: Sequence[Sequence[str]],
    text: str,
    *,
    table: MaterialTable | None = None,
    encoder: TextEncoder | None = None,
    overrides: Mapping[str, str] | None = None,
    materials: Mapping[str, str] | None = None,
    alpha: float | None = None,
    part_volumes: Sequence[float] | None = None,
) -> list[PartChoice]:
    """Choose the material of every part, as ``RetrievalPredictor.choose`` does, once."""
    return RetrievalPredictor(table=table, encoder=encoder).choose(
        part_labels,
        text,
        overrides=overrides,
        materials=materials,
        alpha=alpha,
        part_volumes=part_volumes,
    )


def _description(row: Material) -> str:
    """Return what is embedded of a row: its name without the small print, and an everyday word."""
    return ", ".join([re.sub(r"\s*\(.*\)", "", row.name), *row.aliases[:2]])


def _index(name: str, parts: Sequence[NamedPart]) -> int:
    """Index of the part called ``name``, whatever the case; else an error that lists the parts."""
    names = [part.name for part in parts]
    if name in names:
        return names.index(name)
    alike = [i for i, other in enumerate(names) if key(other) == key(name)]
    if len(alike) == 1:
        return alike[0]
    near = difflib.get_close_matches(key(name), [key(other) for other in names], n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise UsageError(f"the asset has no part {name!r}: its parts are {', '.join(names)}{hint}")
