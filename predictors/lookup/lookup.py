"""What words settle: the rows of the table that a text, options and the asset's own names name.

Words of the table decide first; where none is found, the row nearest in meaning is settled if it is
near, and else only the likeliest: whoever predicts may know better. A part has one material.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fem.errors import UsageError
from ...fem.scene.materials import Material, MaterialTable, key, load_table
from ..encoders.protocol import TextEncoder
from ..hearing import words
from ..hearing.binding import (
    NamedPart,
    allocate,
    bind,
    is_whole,
    nouns_of,
    overlap,
    unbound_clauses,
)
from ..hearing.clauses import HeardClause, HeardSentence
from ..hearing.parser import listen
from ..hearing.vocabulary import vocabulary_of
from ..prediction import PartChoice
from .kernel import RowKernel

# Below this cosine a part's name says nothing of its material: measured on 30 part names, where
# "rug" has .74 with carpet, "mattress" .49 with memory foam, but "leg" .38 with meat.
MEANINGFUL = 0.45
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
    settled: bool = True
    clause: HeardClause | None = None
    borrowed: bool = False


class Lookup:
    """Chooses one row a part; keeps what it has embedded between calls."""

    def __init__(
        self, *, table: MaterialTable | None = None, encoder: TextEncoder | None = None
    ) -> None:
        self.table = table or load_table()
        self.kernel = RowKernel(self.table, encoder)
        self._vocabulary = vocabulary_of(self.table)

    def choose(
        self,
        part_labels: Sequence[Sequence[str]],
        sentence: HeardSentence,
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
        sentence
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
        picks = self._from_clauses(parts, sentence.clauses)
        for name, free in (overrides or {}).items():
            i, said = _index(name, parts), self._as_whole(free)
            (pick,) = self._from_clauses(parts[i : i + 1], [said])
            why = f"override: {free!r}"
            picks[i] = replace(pick, why=why, settled=True, clause=said, borrowed=False)
        for name, exact in (materials or {}).items():
            picks[_index(name, parts)] = _Pick(self.table.exact(exact), "override")
        return [
            self._choice(part.name, pick, alpha) for part, pick in zip(parts, picks, strict=True)
        ]

    def of_clause(self, part: str, clause: HeardClause, why: str) -> PartChoice:
        """Choose for a part what a clause names."""
        return self._choice(part, self._named(clause, why), None)

    def _as_whole(self, free: str) -> HeardClause:
        """Read a text that is about one part only: the first material counts."""
        clauses = listen(free, self.table).clauses
        named = [clause for clause in clauses if clause.material]
        level = next((clause.level for clause in clauses if clause.level), None)
        if named:
            return HeardClause(free, named[0].material, (), level)
        return HeardClause(free, None, ("everything",), level)

    def _from_clauses(self, parts: list[NamedPart], clauses: Sequence[HeardClause]) -> list[_Pick]:
        """Pick by clause, by the part's own names, by the whole sentence, or by the kernel."""
        named = [k for k, clause in enumerate(clauses) if clause.material]
        rows = {self._row(clauses[k]).name for k in named}
        score = overlap(clauses, parts)
        bound, lost = bind(score), unbound_clauses(clauses, score)
        rest = [k for k in named if set(nouns_of(clauses[k])) & words.REST]
        free = [k for k in named if k not in bound and k not in rest]
        if len(rows) == 1 and len(free) == len(named) and all(is_whole(clauses[k]) for k in free):
            rest, free = free, []  # "oak cube": one material for everything
        open_parts = [i for i, k in enumerate(bound) if k is None or not clauses[k].material]
        if free:
            given = allocate(
                [clauses[k] for k in free],
                [parts[i] for i in open_parts],
                similarity=self.kernel.similarity,
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
            replace(pick, settled=False)
            if pick.borrowed
            or k in lost
            or (k is not None and set(nouns_of(clauses[k])) <= words.OBJECTS)
            else pick
            for pick, k in zip(picks, bound, strict=True)
        ]

    def _pick(
        self,
        part: NamedPart,
        clause: HeardClause | None,
        clauses: Sequence[HeardClause],
        rest: list[int],
        whole: list[int],
    ) -> _Pick:
        level = clause.level if clause else None
        if clause and clause.material:
            return self._named(clause, f"text: {clause.text!r}")
        for k in rest:
            return self._borrowed(clauses[k], level)
        if part.material:
            why = f"name: {part.material_label!r}"
            return _Pick(self.table.exact(part.material), why, part.material, level=level)
        for k in whole:
            return self._borrowed(clauses[k], level)
        said = clause or next((c for c in clauses if not (c.material or c.level)), None)
        return self._nearest(part, said, [c for c in clauses if c.material])

    def _named(self, clause: HeardClause, why: str) -> _Pick:
        material = clause.material or ""
        return _Pick(self._row(clause), why, material, level=clause.level, clause=clause)

    def _borrowed(self, clause: HeardClause, level: str | None) -> _Pick:
        """Pick what the text says of no part, as stiff as it says of this one."""
        pick = self._named(clause, f"whole sentence: {clause.text!r}")
        return replace(pick, level=pick.level or level, borrowed=True)

    def _row(self, clause: HeardClause) -> Material:
        return self.table.exact(clause.material or "")

    def _nearest(
        self, part: NamedPart, said: HeardClause | None, named: list[HeardClause]
    ) -> _Pick:
        """Pick by meaning: from all rows, the text's own, or the common ones if all are far."""
        level = said.level if said else None
        query = f"{part.spoken} {said.text if said else ''}".strip()
        cosines = self.kernel.cosines(query)
        meaningful = bool(cosines.max() >= MEANINGFUL)
        if named and not meaningful:
            near = self.kernel.similarity([query], [clause.text for clause in named])[0]
            return replace(self._borrowed(named[int(np.argmax(near))], level), settled=False)
        common = None if meaningful else {self.table.exact(word).name for word in COMMON}
        row, share = self.kernel.nearest(cosines, among=common)
        settled = meaningful and level is None
        return _Pick(row, f"nearest to {query!r}", weight=share, level=level, settled=settled)

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
        return PartChoice(
            part, row, row.value(place), pick.weight, place, pick.why, pick.settled, pick.clause,
            pick.borrowed,
        )  # fmt: skip


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
