"""What words settle: the rows of the table that a text, options and the asset's own names name.

Words of the table decide first; where none is found, the row nearest in meaning is taken and said
to be a guess: whoever predicts may know better. A part has one material.
"""

from __future__ import annotations

import difflib
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from ...fem.errors import UsageError
from ...fem.scene.materials import (
    Material,
    MaterialTable,
    MaterialValue,
    key,
    load_contents,
    load_table,
)
from ..encoders.protocol import TextEncoder
from ..hearing.binding import NamedPart
from ..hearing.clauses import HeardClause
from ..hearing.vocabulary import stem, vocabulary_of
from ..language.binding import GENERAL, Bound, BoundPart
from ..language.clauses import Clause, Sentence, Subject
from ..language.reader import parse
from ..prediction import PartChoice
from ..vocabulary.lexicon import words
from ..vocabulary.part_names import parts_called
from .allotment import allot
from .comparison import with_relations
from .decision import Decider, PartStatement
from .kernel import RowKernel
from .numbers import as_stated

_WHOLE = Subject("whole")


class WordChoices(NamedTuple):
    """A choice for every part, and what the user should know of how the words were taken."""

    choices: list[PartChoice]
    warnings: tuple[str, ...]


@lru_cache(maxsize=4)
def lookup_of(table: MaterialTable) -> Lookup:
    """Return the lookup of a table, with all that it has embedded before."""
    return Lookup(table=table)


class Lookup:
    """Chooses one row a part; keeps what it has embedded between calls."""

    def __init__(
        self, *, table: MaterialTable | None = None, encoder: TextEncoder | None = None
    ) -> None:
        self.table = table or load_table()
        self.kernel = RowKernel(self.table, encoder)
        self._decider = Decider(self.table, self.kernel)

    def settle(
        self,
        part_labels: Sequence[Sequence[str]],
        bound: Bound,
        *,
        overrides: Mapping[str, str] | None = None,
        materials: Mapping[str, str] | None = None,
        values: Mapping[str, Mapping[str, float]] | None = None,
        alpha: float | None = None,
        volumes: Sequence[float] | None = None,
    ) -> WordChoices:
        """Choose the material of every part as far as words go.

        Parameters
        ----------
        part_labels
            For each part its name, then all other words the asset has for it.
        bound
            What the user says of the object, and of which part.
        overrides, materials, values
            For single parts: free text, the exact name of a material of the table, and numbers for
            E [Pa], nu [1], rho [kg/m^3].
        alpha
            Place of E in its range, 0 (soft) to 1 (stiff); None follows words such as "soft".
        volumes
            Of the parts [m^3]: of those that no word tells apart, the larger is spoken of first.
        """
        vocabulary = vocabulary_of(self.table)
        parts = [
            NamedPart.of(labels, vocabulary, volume)
            for labels, volume in zip(part_labels, volumes or [0.0] * len(part_labels), strict=True)
        ]
        statements, warnings = self._statements(parts, bound, overrides or {})
        of_all = defaultdict[PartStatement, float](float)  # a mass is that of all it is said of
        for part, said in zip(parts, statements, strict=True):
            of_all[said] += part.volume
        self._decider.prepare(parts, statements)
        choices = []
        for part, said in zip(parts, statements, strict=True):
            choice, told = self._decider.decide(part, said, alpha=alpha, volume=of_all[said])
            choices.append(choice)
            warnings += told
        choices, told = with_relations(
            choices,
            [said.all("comparisons") for said in statements],
            lambda words: parts_called(words, part_labels),
            self._row_called,
            named=[
                bool(part.material or said.naming)
                for part, said in zip(parts, statements, strict=True)
            ],
        )
        choices = self._overruled(choices, parts, materials or {}, values or {}, alpha)
        return WordChoices(choices, tuple(dict.fromkeys((*warnings, *told))))

    def of_clause(self, part: str, clause: HeardClause, why: str) -> PartChoice:
        """Choose for a part the material that a clause names, soft or stiff as its level says."""
        return self._decider.of_clause(part, clause, why)

    def _statements(
        self,
        parts: Sequence[NamedPart],
        bound: Bound,
        overrides: Mapping[str, str],
    ) -> tuple[list[PartStatement], list[str]]:
        """What is said of each part: by name, of all of them, by an option, or by elimination."""
        sentence = bound.sentence
        told = {line for part in bound.parts for k in part.clauses
                for line in sentence.clauses[k].doubts}  # fmt: skip
        warnings = [note for note in (*sentence.notes, *_unread(sentence)) if note not in told]
        lost = {k for k in bound.unbound if sentence.clauses[k].says_matter}
        whole = {
            (i, k)
            for i, part in enumerate(bound.parts)
            for k, how in zip(part.clauses, part.how, strict=True)
            if how == "whole" and sentence.clauses[k].subject.scope == "parts"
        }
        # "a steel frame with an oak seat" where nothing is called a seat, or where the asset has a
        # word for every part: the frame is a part too, and not the object.
        if any(sentence.clauses[k].material for k in lost) or all(
            parts[i].material for i, _ in whole
        ):
            lost |= {k for _, k in whole}
        spoken = {stem(word) for word in re.findall(r"[^\W\d_]+", sentence.text)}
        statements = [
            replace(said, spoken=bool(spoken & {*part.name_words}))
            for part, said in zip(
                parts, (_statement_of(sentence, part, lost) for part in bound.parts), strict=True
            )
        ]
        said = [sentence.clauses[k] for k in sorted(lost)]
        statements = allot(parts, statements, said, self.table, self.kernel)
        for name, free in overrides.items():
            i = _index(name, parts)
            said = parse(free, self.table, [parts[i].name])
            clauses = said.clauses or (Clause(free, (0, len(free)), _WHOLE),)
            statements[i] = PartStatement(clauses, override=free)
            warnings += [f"--part {name}: {line}" for line in (*said.notes, *_unread(said))]
        # What every part's name is against speaks of nothing else than these parts.
        if all(map(self._decider.keeps_name, parts, statements)):
            statements = [replace(said, whole=False) for said in statements]
        return statements, warnings

    def _row_called(self, words: Sequence[str]) -> Material | None:
        """The row of a matter, or of what fills things, that words name."""
        name = " ".join(words)
        return self.table.phrases.get(name) or load_contents().phrases.get(name)

    def _overruled(
        self,
        choices: list[PartChoice],
        parts: Sequence[NamedPart],
        materials: Mapping[str, str],
        values: Mapping[str, Mapping[str, float]],
        alpha: float | None,
    ) -> list[PartChoice]:
        """Take rows and numbers that options state exactly."""
        for name, exact in materials.items():
            i, row = _index(name, parts), self.table.exact(exact)
            place = 0.5 if alpha is None else alpha
            choices[i] = PartChoice(
                parts[i].name, row, row.value(place), 1.0, place, f"override: {exact!r}"
            )
        for name, numbers in values.items():
            i = _index(name, parts)
            value = MaterialValue(**(choices[i].value._asdict() | dict(numbers)))
            said = ", ".join(f"{key}={number:g}" for key, number in numbers.items())
            how = {"settled": True, "derivation": (f"{said} as set",)}
            exact = tuple(dict.fromkeys([*choices[i].exact, *numbers]))
            choices[i] = replace(choices[i], value=value, exact=exact, **how)
            if len(numbers) == len(value):
                choices[i] = as_stated(choices[i])
        return choices


def _statement_of(sentence: Sentence, part: BoundPart, lost: Collection[int]) -> PartStatement:
    """What is said of a part, less what is ``lost``."""
    bonds = [(k, how) for k, how in zip(part.clauses, part.how, strict=True) if k not in lost]
    ways = {how for _, how in bonds}
    clauses = tuple(sentence.clauses[k] for k, _ in bonds)
    naming = next((clause for clause in clauses if clause.material), None)
    return PartStatement(
        clauses,
        borrowed=ways <= {*GENERAL},
        whole=ways == {"whole"} and not (naming and _leaves_nothing_out(naming)),
    )


def _leaves_nothing_out(clause: Clause) -> bool:
    """Whether it says that it is of every part, as "it is steel" does not."""
    phrases = (*words()["roles"]["whole"], "whole", "entire")
    said = f" {' '.join(re.findall(r'[a-z]+', clause.text.lower()))} "
    return clause.subject.scope == "whole" and any(f" {phrase} " in said for phrase in phrases)


def _unread(sentence: Sentence) -> Iterator[str]:
    """What no clause took and none tells of."""
    told = {*sentence.notes, *(line for clause in sentence.clauses for line in clause.doubts)}
    left = [word for word in sentence.unread if not any(repr(word) in line for line in told)]
    if left:
        words = ", ".join(map(repr, left))
        yield f"not understood in the text, and not used: {words}"


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
