"""What words settle: the rows of the table that a text, options and the asset's own names name.

Words of the table decide first; where none is found, the row nearest in meaning is taken and said
to be a guess: whoever predicts may know better. A part has one material.
"""

from __future__ import annotations

import difflib
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import UsageError
from ...fem.note import Note
from ...fem.table import Material, MaterialTable, MaterialValue, key, load_contents, load_table
from ..appearance.features import Appearance
from ..asset import UpAxis
from ..encoders.registry import TextEncoder
from ..field import Normalisation
from ..grid import PartVoxels
from ..prediction import PartChoice, Prediction
from ..text.clauses import GENERAL, Bound, Clause, Sentence, Subject, bind
from ..text.hearing import EncodedClause, NamedPart, allocate, stem, vocabulary_of
from ..text.lexicon import parts_called, words
from ..text.numerals import Comparison
from ..text.reader import parse
from .decision import Decider, PartStatement
from .numbers import as_stated
from .similarity import RowKernel

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

        part_labels: For each part its name, then all other words the asset has for it.
        bound: What the user says of the object, and of which part.
        overrides, materials, values: For single parts: free text, the exact name of a material of
            the table, and numbers for E [Pa], nu [1], rho [kg/m^3].
        alpha: Place of E in its range, 0 (soft) to 1 (stiff); None follows words such as "soft".
        volumes: Of the parts [m^3]: of those that no word tells apart, the larger is spoken of
            first.
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
            choice, more = self._decider.decide(part, said, alpha=alpha, volume=of_all[said])
            choices.append(choice)
            warnings += more
        choices, more = with_relations(
            choices,
            [said.all("comparisons") for said in statements],
            lambda words: parts_called(words, part_labels),
            # The row of a matter, or of what fills things
            lambda words: (
                self.table.phrases.get(" ".join(words))
                or load_contents().phrases.get(" ".join(words))
            ),
            named=[
                bool(part.material or said.naming)
                for part, said in zip(parts, statements, strict=True)
            ],
        )
        # Rows and numbers that options state exactly
        for name, exact in (materials or {}).items():
            i, row = _index(name, parts), self.table.exact(exact)
            place = 0.5 if alpha is None else alpha
            choices[i] = PartChoice(
                parts[i].name, row, row.value(place), 1.0, place, f"override: {exact!r}"
            )
        for name, numbers in (values or {}).items():
            i = _index(name, parts)
            value = MaterialValue(**(choices[i].value._asdict() | dict(numbers)))
            stated = ", ".join(f"{key}={number:g}" for key, number in numbers.items())
            choices[i] = replace(
                choices[i], value=value, settled=True, derivation=(f"{stated} as set",),
                exact=tuple(dict.fromkeys([*choices[i].exact, *numbers])),
            )  # fmt: skip
            if len(numbers) == len(value):
                choices[i] = as_stated(choices[i])
        return WordChoices(choices, tuple(dict.fromkeys((*warnings, *more))))

    def of_clause(self, part: str, clause: EncodedClause, why: str) -> PartChoice:
        """Choose for a part the material that a clause names, soft or stiff as its level says."""
        return self._decider.of_clause(part, clause, why)

    def _statements(
        self, parts: Sequence[NamedPart], bound: Bound, overrides: Mapping[str, str]
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
        statements = []
        for part, bonds in zip(parts, bound.parts, strict=True):
            pairs = zip(bonds.clauses, bonds.how, strict=True)
            kept = {k: how for k, how in pairs if k not in lost}
            clauses, ways = tuple(sentence.clauses[k] for k in kept), {*kept.values()}
            naming = next((clause for clause in clauses if clause.material), None)
            # Said of every part, as "it is steel" is not, it leaves no name of a part more to say.
            text = "" if naming is None else " ".join(re.findall(r"[a-z]+", naming.text.lower()))
            phrases = (*words()["roles"]["whole"], "whole", "entire")
            every = naming is not None and naming.subject.scope == "whole"
            every = every and any(f" {phrase} " in f" {text} " for phrase in phrases)
            statements.append(
                PartStatement(
                    clauses, borrowed=ways <= {*GENERAL}, whole=ways == {"whole"} and not every,
                    spoken=bool(spoken & {*part.name_words}),
                )
            )  # fmt: skip
        left = [sentence.clauses[k] for k in sorted(lost)]
        statements = _allocated(parts, statements, left, self.table, self.kernel)
        for name, free in overrides.items():
            i = _index(name, parts)
            said = parse(free, self.table, [parts[i].name])
            clauses = said.clauses or (Clause(free, (0, len(free)), _WHOLE),)
            statements[i] = PartStatement(clauses, override=free)
            warnings += [
                Note("lookup.part", name=name, line=line) for line in (*said.notes, *_unread(said))
            ]
        # What every part's name is against speaks of nothing else than these parts.
        if all(map(self._decider.keeps_name, parts, statements)):
            statements = [replace(said, whole=False) for said in statements]
        return statements, warnings


def _unread(sentence: Sentence) -> Iterator[str]:
    """What no clause took and none tells of."""
    noted = {*sentence.notes, *(line for clause in sentence.clauses for line in clause.doubts)}
    left = [word for word in sentence.unread if not any(repr(word) in line for line in noted)]
    if left:
        words = ", ".join(map(repr, left))
        yield Note("lookup.understood_text", words=words)


def _index(name: str, parts: Sequence[NamedPart]) -> int:
    """Index of the part called ``name``, whatever the case; else an error that lists the parts."""
    names = [part.name for part in parts]
    if name in names:
        return names.index(name)
    alike = [i for i, other in enumerate(names) if key(other) == key(name)]
    if len(alike) == 1:
        return alike[0]
    near = difflib.get_close_matches(key(name), [key(other) for other in names], n=1)
    hint = Note("lookup.you_mean", near=near[0]) if near else ""
    raise UsageError("lookup.asset_part", name=name, names=", ".join(names), hint=hint)


# Clauses about parts that no part is called after: given to the parts that nothing speaks of.


def _allocated(
    parts: Sequence[NamedPart],
    statements: Sequence[PartStatement],
    lost: Sequence[Clause],
    table: MaterialTable,
    kernel: RowKernel,
) -> list[PartStatement]:
    """Return what is said of each part once the ``lost`` clauses are given out.

    They go to the parts without a word, so that all fit best together; this is a guess, which a
    predictor that sees shapes may better: all that was not said of a part by its name is open.
    """
    out = list(statements)
    naming = [clause for clause in lost if clause.material]
    free = [i for i, said in enumerate(out) if not said.clauses]
    if not lost:
        return out
    given = allocate(
        [EncodedClause.of(clause) for clause in naming],
        [parts[i] for i in free],
        similarity=kernel.similarity,
        category=lambda phrase: table.exact(phrase).category,
    )
    for i, k in zip(free, given, strict=True):
        if k is not None:
            out[i] = PartStatement((naming[k],), borrowed=True)
    return [replace(said, open=said.borrowed or not said.clauses) for said in out]


# Parts said to be stiffer or lighter than others: values that keep these relations.


class _Beside(NamedTuple):
    """What a part is compared with: a part with its row, or a row that it need not be of."""

    name: str
    value: MaterialValue
    row: Material | None


def with_relations(
    choices: Sequence[PartChoice],
    relations: Sequence[Sequence[Comparison]],
    parts_called: Callable[[tuple[str, ...]], Sequence[int]],
    row_called: Callable[[tuple[str, ...]], Material | None] = lambda _: None,
    *,
    named: Sequence[bool],
) -> tuple[list[PartChoice], list[str]]:
    """Return choices that keep what is said of parts beside each other, and what to warn of.

    choices: What is chosen for each part so far.
    relations: For each part what is said of it beside others.
    parts_called: Indices of the parts that words name.
    row_called: The row of a table that words name: "as dense as water", where no part is called so.
    named: Whether each part's material is said, or told by the asset: it then keeps its row.
    """
    out, notes, called = list(choices), [], cache(parts_called)
    others = [
        [
            [k for k in (called(r.other) if r.other else range(len(out))) if k != i]
            for r in comparisons
        ]
        for i, comparisons in enumerate(relations)
    ]
    waiting = {i: None for i, said in enumerate(relations) if said}  # in order
    while waiting:
        ready = [i for i in waiting if not any(k in waiting for ks in others[i] for k in ks)]
        if not ready:
            names = ", ".join(repr(out[i].part) for i in waiting)
            notes.append(Note("lookup.parts_compared", names=names))
            break
        for i in ready:
            for relation, found in zip(relations[i], others[i], strict=True):
                row = None if found else row_called(relation.other)
                if found:
                    beside = [_Beside(repr(out[k].part), out[k].value, out[k].row) for k in found]
                    out[i] = _related(out[i], relation, beside, named=named[i])
                elif row:
                    beside = [_Beside(row.name, row.value(), None)]
                    out[i] = _related(out[i], relation, beside, named=named[i])
                else:
                    notes.append(
                        Note(
                            "lookup.part_compared", part=out[i].part, other=" ".join(relation.other)
                        )
                    )
        for i in ready:
            del waiting[i]
    return out, notes


def _related(
    choice: PartChoice, relation: Comparison, others: Sequence[_Beside], *, named: bool
) -> PartChoice:
    """Return a choice that keeps one relation, by its own row if one is named."""
    measure, more = relation.measure, relation.factor >= 1
    values = [getattr(other.value, measure) for other in others]
    reference = others[values.index(max(values) if more else min(values))]
    wanted = relation.factor * getattr(reference.value, measure)
    if not named and reference.row:
        choice = replace(
            choice, row=reference.row, value=reference.value, doubts=(), settled=True, weight=1.0,
            guessed=not (relation.exact and choice.understood), network="",
        )  # fmt: skip
    own = getattr(choice.value, measure)
    if named and not relation.exact:  # no more than a word: a row that is named keeps its range
        span = getattr(choice.row, measure)
        wanted = min(max(wanted, span.min), span.max)
    if named and not relation.exact and ((own >= wanted) if more else (own <= wanted)):
        return choice
    numbers = {"measure": measure, "wanted": wanted, "factor": relation.factor}
    if relation.exact:
        how = Note("lookup.times_exact", **numbers, name=reference.name)
    else:
        how = Note("lookup.times_more_or_less", **numbers, name=reference.name)
    return replace(
        choice, value=choice.value._replace(**{measure: wanted}),
        derivation=(*choice.derivation, how),
    )  # fmt: skip


# Retrieval: the table's rows alone, by words and by nearness in meaning; nothing is trained.


class RetrievalPredictor:
    """Gives every part its likeliest row: the baseline, and the fallback of all others."""

    name: ClassVar[str] = "retrieval"
    takes_alpha: ClassVar[bool] = True
    takes_samples: ClassVar[bool] = False

    def __init__(
        self, *, table: MaterialTable | None = None, encoder: TextEncoder | None = None
    ) -> None:
        table = table or load_table()
        self.lookup = Lookup(table=table, encoder=encoder) if encoder else lookup_of(table)

    def predict(
        self,
        parts: PartVoxels,
        sentence: Sentence,
        *,
        choices: Sequence[PartChoice] | None = None,
        appearance: Callable[[], Appearance] | None = None,
        up: UpAxis = "z",
        alpha: float | None = None,
    ) -> Prediction:
        """Return the choices themselves; see ``Predictor``. What is seen is not asked for."""
        if choices is None:
            choices = self.lookup.settle(
                parts.part_labels, bind(sentence, parts.part_labels), alpha=alpha,
                volumes=parts.volumes,
            ).choices  # fmt: skip
        return Prediction.of(parts, choices, sentence, alpha=alpha)


# The row of a table that is nearest to values which a network found.


def nearest_row(
    table: MaterialTable,
    normalisation: Normalisation,
    values: Float[np.ndarray, "3"],
    *,
    grades: bool = True,
) -> Material:
    """Return the row nearest to normalised log E, nu, log rho; ``grades`` may be left out."""
    rows, known = _known_values(table, normalisation, grades)
    return rows[int(np.square(known - values).sum(axis=1).argmin())]


@lru_cache(maxsize=4)
def _known_values(
    table: MaterialTable, normalisation: Normalisation, grades: bool
) -> tuple[list[Material], Float[np.ndarray, "rows 3"]]:
    rows = [row for row in table if grades or not row.grade]
    return rows, np.array([normalisation.normalise(*row.value()) for row in rows])
