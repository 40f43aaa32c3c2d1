"""What words settle: the rows of the table that a text, options and the asset's own names name.

Words of the table decide first; where none is found, the row nearest in meaning is taken and said
to be a guess: whoever predicts may know better. A part has one material.
"""

from __future__ import annotations

import difflib
import math
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from typing import ClassVar, NamedTuple, get_args

import numpy as np
from jaxtyping import Float

from ...fem.errors import UsageError
from ...fem.note import Note
from ...fem.table import (
    FIELDS,
    Material,
    MaterialTable,
    MaterialValue,
    Span,
    key,
    load_bulks,
    load_contents,
    load_table,
)
from ..appearance.features import Appearance
from ..asset import UpAxis
from ..encoders import TextEncoder
from ..field import Normalisation
from ..grid import PartVoxels
from ..prediction import PartChoice, Prediction
from ..text.clauses import GENERAL, Bound, Clause, Degree, Sentence, Subject, bind, names_object
from ..text.english import words
from ..text.numerals import Comparison, Measure, Quantity
from ..text.parts import LISTS, STRUCTURE, NamedPart, parts_called, stem, vocabulary_of
from ..text.reader import parse
from .numbers import as_stated, may_have, row_by_numbers, rubber_of, with_numbers
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
        within: Callable[[int, float], float] | None = None,
    ) -> WordChoices:
        """Choose the material of every part as far as words go.

        part_labels: For each part its name, then all other words the asset has for it.
        bound: What the user says of the object, and of which part.
        overrides, materials, values: For single parts: free text, the exact name of a material of
            the table, and numbers for E [Pa], nu [1], rho [kg/m^3].
        alpha: Place of E in its range, 0 (soft) to 1 (stiff); None follows words such as "soft".
        volumes: Of the parts [m^3]: of those that no word tells apart, the larger is spoken of
            first.
        within: Share of a part's volume, by its number, at most so deep [m] below its surface.
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
        for i, (part, said) in enumerate(zip(parts, statements, strict=True)):
            choice, more = self._decider.decide(
                part,
                said,
                alpha=alpha,
                volume=of_all[said],
                within=None if within is None else partial(within, i),
            )
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
        return WordChoices(choices, _grouped([*warnings, *more]))

    def of_clause(self, part: str, clause: Clause, why: str) -> PartChoice:
        """Choose for a part the material that a clause names, soft or stiff as its level says."""
        return self._decider.of_clause(part, clause, why)

    def _statements(
        self, parts: Sequence[NamedPart], bound: Bound, overrides: Mapping[str, str]
    ) -> tuple[list[PartStatement], list[str]]:
        """What is said of each part: by name, of all of them, by an option, or by elimination."""
        sentence = bound.sentence
        told = {line for part in bound.parts for k in part.clauses
                for line in sentence.clauses[k].doubts}  # fmt: skip
        named = [any(sentence.clauses[k].material and how not in GENERAL
                     for k, how in zip(part.clauses, part.how, strict=True))
                 for part in bound.parts]  # fmt: skip
        warnings = (*sentence.notes, *_unread(sentence, idle=all(named)))
        warnings = [note for note in warnings if note not in told]
        # A matter or a number by itself behind what is said of parts, which it may change
        for k in bound.unbound:
            clause, before = sentence.clauses[k], sentence.clauses[k - 1] if k else None
            says = clause.subject.scope == "none" and (clause.material or clause.numbers)
            says = says and clause.text  # "like they did" has no words of its own
            between = sentence.text[before.span[1] : clause.span[0]] if before else "."
            of = [p.name for p, b in zip(parts, bound.parts, strict=True) if k - 1 in b.clauses]
            if says and of and not re.search(r"[.;\n]\s", between):
                warnings.append(_of_parts(Note("resolve.left_out", word=clause.text), of))
        if of := [parts[i].name for i in bound.mute if bound.parts[i].clauses]:
            warnings.append(_of_parts(Note("resolve.mute_text"), of))
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
                Note("resolve.part", name=name, line=line) for line in (*said.notes, *_unread(said))
            ]
        # What every part's name is against speaks of nothing else than these parts.
        if all(map(self._decider.keeps_name, parts, statements)):
            statements = [replace(said, whole=False) for said in statements]
        return statements, warnings


def _grouped(lines: Sequence[str]) -> tuple[str, ...]:
    """Lines that say the same of several parts as one."""
    out: dict[str, list[str]] = {}  # what is said -> the parts that it is said of
    for line in dict.fromkeys(lines):
        told = line.values if isinstance(line, Note) and line.kind == "resolve.of_part" else {}
        out.setdefault(told.get("said", line), []).extend(told.get("names", ()))
    return tuple(_of_parts(said, names) if names else said for said, names in out.items())


def _of_parts(said: str, names: Sequence[str]) -> Note:
    """What is ``said`` of the parts of these names."""
    parts = f"part{'s' * (len(names) > 1)} {', '.join(map(repr, names))}"
    return Note("resolve.of_part", parts=parts, names=tuple(names), said=said)


def _unread(sentence: Sentence, *, idle: bool = False) -> Iterator[str]:
    """What no clause took and none tells of; ``idle`` where every part has its own matter."""
    noted = {*sentence.notes, *(line for clause in sentence.clauses for line in clause.doubts)}
    left = [word for word in sentence.unread if not any(repr(word) in line for line in noted)]
    if left:
        words = ", ".join(map(repr, left))
        yield Note("resolve.idle_text" if idle else "resolve.understood_text", words=words)


def _index(name: str, parts: Sequence[NamedPart]) -> int:
    """Index of the part called ``name``, whatever the case; else an error that lists the parts."""
    names = [part.name for part in parts]
    if name in names:
        return names.index(name)
    alike = [i for i, other in enumerate(names) if key(other) == key(name)]
    if len(alike) == 1:
        return alike[0]
    near = difflib.get_close_matches(key(name), [key(other) for other in names], n=1)
    hint = Note("resolve.you_mean", near=near[0]) if near else ""
    raise UsageError("resolve.asset_part", name=name, names=", ".join(names), hint=hint)


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
        naming,
        [parts[i] for i in free],
        similarity=kernel.similarity,
        category=lambda phrase: table.exact(phrase).category,
    )
    for i, k in zip(free, given, strict=True):
        if k is not None:
            out[i] = PartStatement((naming[k],), borrowed=True)
    # One statement about a thing of one part is about it: "the finger is TPU" of finray.stl
    alone = len(parts) == len(lost) == len(naming) == 1
    return [replace(s, open=(s.borrowed or not s.clauses) and not alone) for s in out]


# In the assignment of clauses that no word binds, against a cosine of 0 .. .6 between words:
# steel goes to what the asset calls metal, and not to what it calls plastic.
SAME_KIND, OTHER_KIND = 0.5, -0.2
MAIN = 1.0  # of two clauses for one part, the frame's
VOLUME, NAME_ORDER = 0.05, 1e-6  # between equals, the first clause takes the largest part


def allocate(
    clauses: Sequence[Clause],
    parts: Sequence[NamedPart],
    *,
    similarity: Callable[[list[str], list[str]], np.ndarray],
    category: Callable[[str], str],
) -> list[int | None]:
    """Give each clause one part that no word bound, so that all fit best together.

    ``similarity`` is the cosine of two lists of texts, ``category`` the kind of a material phrase.
    Returns the clause of each part, None for the parts that are left over.
    """
    from scipy.optimize import linear_sum_assignment

    bound: list[int | None] = [None] * len(parts)
    if not clauses or not parts:
        return bound
    nouns = [" ".join(clause.parts) or clause.told for clause in clauses]
    score = similarity(nouns, [part.spoken for part in parts]).astype(np.float64)
    total = sum(part.volume for part in parts) or 1.0
    kind_of_part = [category(part.material) if part.material else "" for part in parts]
    by_name = sorted(range(len(parts)), key=lambda i: parts[i].name)
    for k, clause in enumerate(clauses):
        first = (len(clauses) - k) / len(clauses)
        said = {*clause.parts}
        usual = [each["of"] for each in LISTS["usual"] if said & {*each["nouns"].split()}]
        score[k] += MAIN * bool(said & STRUCTURE)
        for rank, i in enumerate(by_name):
            if kind := kind_of_part[i]:  # of the material that the asset itself names
                same = clause.material is not None and kind == category(clause.material)
                score[k, i] += (SAME_KIND if same else OTHER_KIND) + max(
                    (weights.get(kind, 0.0) for weights in usual), default=0.0
                )
            score[k, i] += first * (VOLUME * parts[i].volume / total - NAME_ORDER * rank)
    for k, i in zip(*linear_sum_assignment(score, maximize=True), strict=True):
        bound[i] = int(k)
    return bound


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
    relations = [  # "heavier stuff, tungsten" is not beside another part
        [r for r in said if r.exact or r.other or not named[i]] for i, said in enumerate(relations)
    ]

    def compared(i: int, relation: Comparison) -> list[int]:
        """Parts that one is beside; itself in "web 6061-T6, 10 % stiffer": than its matter is."""
        found = called(relation.other) if relation.other else range(len(out))
        own = relation.exact and named[i] and 0.5 < relation.factor < 2  # no multiple of another
        own = own and (not relation.other or [*found] == [i])
        return [i] if own else [k for k in found if k != i]

    others = [[compared(i, r) for r in comparisons] for i, comparisons in enumerate(relations)]
    waiting = {i: None for i, said in enumerate(relations) if said}  # in order
    while waiting:
        ready = [i for i in waiting if not any({*waiting} & {*ks} - {i} for ks in others[i])]
        if not ready:
            names = ", ".join(repr(out[i].part) for i in waiting)
            notes.append(Note("resolve.parts_compared", names=names))
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
                    other = " ".join(relation.other)
                    notes.append(Note("resolve.part_compared", part=out[i].part, other=other))
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
        how = Note("resolve.times_exact", **numbers, name=reference.name)
    else:
        how = Note("resolve.times_more_or_less", **numbers, name=reference.name)
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


# What the words about one part settle: a row of the table, or what is known without one.
#
# In this order: the material that is named; what the asset's own name says; a kind of matter; how
# stiff or heavy it is said to be; what lies nearest in meaning. Numbers win over all of them.

# What an everyday part is made of if neither the text nor its name says more.
COMMON = "wood steel plastic glass ceramic fabric leather rubber stone paper".split()
ALSO_COMMON = ("foam", "soft foam", "concrete", "felt")  # where a level or a kind is said
_WIDE_KINDS = ("metal", "glass-ceramic", "stone", "composite")  # of which no row is usual
_SPOKEN_DEGREE: dict[Degree, tuple[str, ...]] = {
    1: ("soft", "flexible", "very soft"), 2: ("soft", "flexible"), 3: (),
    4: ("hard", "rigid", "stiff"), 5: ("hard", "rigid", "stiff"),
}  # fmt: skip
_HEARD_DEGREE: dict[str | None, Degree] = {"soft": 2, "stiff": 4}  # of what a network hears


@dataclass(frozen=True)
class PartStatement:
    """All that the clauses say of one part, the most specific first.

    clauses: The clauses that speak of it.
    borrowed: Whether they speak of all parts, of what nothing else names, or of a part that the
        asset does not have and that this one is taken for.
    whole: Whether they speak of the object: the asset's own word for a part says more.
    open: Whether a predictor that sees the shape may know better, since the text names parts that
        the asset does not have.
    override: The text of an option that is about this part alone.
    spoken: Whether the text has a word of the part's name.
    """

    clauses: tuple[Clause, ...] = ()
    borrowed: bool = False
    whole: bool = False
    open: bool = False
    override: str = ""
    spoken: bool = False

    @property
    def naming(self) -> Clause | None:
        """The clause that names a material."""
        return next((clause for clause in self.clauses if clause.material), None)

    @property
    def unknown(self) -> Clause | None:
        """The clause that names something unknown, where none names a material that is known."""
        found = next((clause for clause in self.clauses if clause.unknown), None)
        return found if self.naming in (None, found) else None

    def first(self, name: str):
        """Return the first of the clauses' fields of this name that says something."""
        return next((getattr(c, name) for c in self.clauses if getattr(c, name)), None)

    @property
    def kind(self) -> str | None:
        """The kind of matter that is said without a name."""
        bare = (c.kind for c in self.clauses if c.kind and not c.material)
        return next(bare, None)

    def all(self, name: str) -> tuple:
        """Return what all clauses have in a field of this name."""
        return tuple(item for clause in self.clauses for item in getattr(clause, name))

    @property
    def numbers(self) -> tuple[Quantity, ...]:
        """Numbers of each measure that are said of the most specific subject that has any."""
        of: dict[Measure, tuple] = {}
        return tuple(
            number for clause in self.clauses for number in clause.numbers
            if of.setdefault(number.measure, clause.subject.names) == clause.subject.names
        )  # fmt: skip

    @property
    def deciding(self) -> Clause | None:
        """The clause that says most: it names, or else says anything of the matter."""
        saying = (clause for clause in self.clauses if clause.says_matter)
        return self.naming or next(saying, None)


class Decider:
    """Decides one part at a time; keeps the table's embeddings."""

    def __init__(self, table: MaterialTable, kernel: RowKernel) -> None:
        self.table, self.kernel = table, kernel

    def prepare(self, parts: Sequence[NamedPart], statements: Sequence[PartStatement]) -> None:
        """Embed in one go what is asked of the parts that no word of the table names."""
        unnamed = (
            (part, words)
            for part, words in zip(parts, statements, strict=True)
            if words.naming is None and not part.material
        )
        self.kernel.embed([_query(part, words) for part, words in unnamed])

    def decide(
        self,
        part: NamedPart,
        statement: PartStatement,
        *,
        alpha: float | None,
        volume: float,
        within: Callable[[float], float] | None = None,
    ) -> tuple[PartChoice, tuple[str, ...]]:
        """Return the choice for a part of which so much is said, and what to warn of.

        ``volume`` [m^3] is that of all parts of which the same is said.
        """
        choice = self._row_of(part, statement)
        row = row_by_numbers(
            choice.row, self.table, statement.numbers, statement.first("stiffness")
        )
        bulk, heaped = load_bulks().get(row.name), []
        # A body far thicker than a leaf is of many: within a leaf's depth lies less than half of it
        if bulk and within and within(bulk.piece) < 0.5:
            heaped = [Note("resolve.bulk", name=row.name, piece=1e3 * bulk.piece, bulk=bulk.name)]
            row = self.table.exact(bulk.name)
        choice = replace(choice, row=row)
        if statement.override:
            choice = replace(choice, why=f"override: {statement.override!r}", settled=True)
        # E and rho where they are said to be: in the row's range, or absolutely
        stiffness, density = statement.first("stiffness"), statement.first("density")
        if (
            statement.naming
            and choice.row.name != self.table.exact(statement.naming.material or "").name
        ):
            stiffness = None  # "soft foam" is a row of its own
        value = value_at(
            choice.row, stiffness=stiffness, density=density, character=statement.all("character"),
            absolute=statement.naming is None and choice.guessed,
        )  # fmt: skip
        swims, water = [], statement.all("character")
        if statement.naming and "sinks" in water and value.rho <= WATER:
            swims = [Note("resolve.sinks", rho=SUNK * WATER, name=choice.row.name, own=value.rho)]
            value = value._replace(rho=SUNK * WATER)
        if statement.naming and "floats" in water and value.rho >= WATER:
            swims = [Note("resolve.floats", rho=WATER / SUNK, name=choice.row.name, own=value.rho)]
            value = value._replace(rho=WATER / SUNK)
        place = PLACE[stiffness] if stiffness else 0.5
        if alpha is not None:
            place, value = alpha, value._replace(E=choice.row.value(alpha).E)
        choice = replace(choice, value=value, alpha=place)
        measured = {number.measure for number in statement.numbers}
        stated = {"E", "rho"} <= measured  # a name says no more of these
        value, derivation, warnings, exact = with_numbers(
            part.name, choice.row, choice.value, statement.numbers,
            blend=statement.first("blend"), volume=volume, within=within,
            named=statement.naming is not None or (part.material is not None and not stated),
        )  # fmt: skip
        derivation = (*heaped, *swims, *derivation)
        choice = replace(choice, value=value, derivation=derivation, exact=exact)
        if derivation and not statement.open:
            choice = replace(choice, settled=True)
        if {*FIELDS} <= {*exact}:  # and not contradicted: "E = 1 GPa, E = 2 GPa"
            choice = as_stated(choice)
        # Sentences about what was said of a part and could not be taken as it stands
        notes = []
        named = dict.fromkeys(clause.material for clause in statement.clauses if clause.material)
        first, *others = named or [""]
        one = self.table.exact(first) if others else None
        if one and not all(_is_nearly(one, self.table.exact(name)) for name in others):
            both, left = " and ".join(map(repr, named)), ", ".join(map(repr, others))
            values = {"name": part.name, "named": both, "first": first, "others": left}
            notes.append(Note("resolve.part_text", **values))
        doubts = dict.fromkeys(statement.all("doubts"))
        notes += [_of_parts(doubt, [part.name]) for doubt in doubts]
        unknown = None if choice.row in [*load_contents()] else statement.unknown
        return replace(choice, unknown=unknown), (*notes, *warnings)

    def of_clause(self, part: str, clause: Clause, why: str) -> PartChoice:
        """Choose for a part what a clause names, a predictor having found the part for it."""
        degree, named = _HEARD_DEGREE.get(clause.level), self.table.exact(clause.material or "")
        row = self._named(clause.phrase, named.name, degree)
        stiffness = degree if row is named else None
        value = value_at(row, stiffness=stiffness, density=None, absolute=False)
        return PartChoice(part, row, value, 1.0, PLACE[stiffness or 3], why)

    def _row_of(self, part: NamedPart, statement: PartStatement) -> PartChoice:
        """Choose the row, at the middle of its ranges."""
        naming, deciding = statement.naming, statement.deciding
        contents = load_contents().phrases.get(part.spoken)
        if contents and not part.material and (statement.whole or not statement.clauses):
            return _choice(part, contents, f"name: {part.name!r}")
        label = self.table.exact(part.material) if part.material else None
        if naming is not None and not self.keeps_name(part, statement):
            material = naming.material or ""
            row = self._named(naming.phrase or material, material, statement.first("stiffness"))
            why = (
                f"whole sentence: {naming.text!r}"
                if statement.borrowed
                else f"text: {naming.text!r}"
            )
            choice = _choice(
                part, row, why, clause=naming, settled=not statement.open,
                guessed=bool(naming.unknown),
            )  # fmt: skip
            # "The chair is beech": so are its legs.
            of_object = statement.whole and not statement.spoken and names_object(naming)
            doubts = _kind_taken(part, statement, row)
            return replace(choice, borrowed=statement.borrowed and not of_object, doubts=doubts)
        # Called after what it holds: a butter dish is not of butter.
        containers, own = words()["containers"], part.name_words
        if (
            label and part.material_label == part.name and len(own) > 1
            and label.category in containers["matter"] and own[-1] in containers["words"]
        ):  # fmt: skip
            bare = " ".join(part.name_words[-1:])
            part, label = replace(part, name_words=(bare,), material=None), None
        ruled_out = label and (
            {label.name, label.category} & set(statement.all("excluded"))
            or statement.kind not in (None, label.category)
            or not behaves(label, statement.all("character"))
        )
        if label and not ruled_out:
            why = f"name: {part.material_label!r}"
            doubts = _kind_taken(part, statement, label)
            if statement.whole and naming and naming.material != label.name:
                wins = Note("resolve.name_wins", name=label.name, material=naming.material)
                doubts = (*doubts, _of_parts(wins, [part.name]))
            known = statement.unknown is None
            return _choice(part, label, why, clause=deciding, settled=known, doubts=doubts)
        coating = statement.first("coating")
        if coating and key(coating) in self.table.phrases and not label:
            row = self.table.exact(coating)
            doubt = Note("resolve.part_only", name=part.name, name_2=row.name)
            return _choice(
                part, row, Note("resolve.covers", coating=coating), guessed=True, doubts=(doubt,)
            )
        words_for = statement.unknown.unknown if statement.unknown else ""
        if loose := load_contents().phrases.get(key(words_for)):  # "the filling is sawdust"
            return _choice(part, loose, f"text: {words_for!r}", clause=deciding)
        level = statement.first("stiffness") or statement.first("density")
        if deciding is None or (statement.unknown is not None and not level):
            # Choose the row nearest in meaning to the part's name; the common ones if all are far
            query = _query(part, statement)
            common = {self.table.exact(word).name for word in COMMON}
            near = self.kernel.nearest(query, common=common)
            return _choice(
                part, near.row, f"nearest to {query!r}", weight=near.share, clause=deciding,
                settled=near.meaningful and not (statement.open or statement.unknown), guessed=True,
            )  # fmt: skip
        return self._among(part, statement, deciding)

    def keeps_name(self, part: NamedPart, statement: PartStatement) -> bool:
        """Whether a part's own name says more of it than what is said of the whole.

        "Beech", said of the whole, is against an ash_leg, and not against a glass_top.
        """
        if not (statement.whole and statement.naming):
            return False
        if not part.material:
            return part.spoken in load_contents().phrases
        named, label = (
            self.table.exact(statement.naming.material or ""),
            self.table.exact(part.material),
        )
        if part.material == "stone" and named.category in ("stone", "glass-ceramic"):
            return False  # of a ring: "two sapphires"
        return named is label or named.category != label.category

    def _named(self, words: str, material: str, degree: Degree | None) -> Material:
        """Return the row that words name, or its soft or hard relative where one is said."""
        for adjective in _SPOKEN_DEGREE[degree] if degree else ():
            row = self.table.phrases.get(f"{adjective} {words}".lower())
            if row is not None:
                return row
        return self.table.exact(material)

    def _among(self, part: NamedPart, statement: PartStatement, deciding: Clause) -> PartChoice:
        """Choose the row nearest in meaning of those that can be as is said, without a name."""
        rows = rows_at(
            self.kernel.rows,
            stiffness=statement.first("stiffness"), density=statement.first("density"),
            character=statement.all("character"), excluded=statement.all("excluded"),
        )  # fmt: skip
        fitting = [row for row in rows if statement.kind in (None, row.category)]
        rows = fitting or self.kernel.rows
        rubber = None if statement.kind else rubber_of(self.table.rows, statement.numbers)
        if rubber is not None:
            return _choice(part, rubber, deciding.text, clause=deciding, guessed=True)
        rows = [row for row in rows if may_have(row, statement.numbers)] or rows
        usual = {self.table.exact(word).name for word in (*COMMON, *ALSO_COMMON)}
        names = {row.name for row in rows}
        common = names & usual or names
        near = self.kernel.nearest(_query(part, statement), among=names, common=common)
        doubt = Note(
            "resolve.part_material", name=part.name, text=deciding.text, name_2=near.row.name
        )
        return _choice(
            part, near.row, Note("resolve.nearest_meaning", text=deciding.text), clause=deciding,
            weight=near.share, guessed=True, settled=not statement.open,
            doubts=() if fitting else (doubt,),
        )  # fmt: skip


def _query(part: NamedPart, statement: PartStatement) -> str:
    """Words to compare with the table's: what a part is called, and what is said of it."""
    if statement.unknown is None and statement.deciding is not None:
        return f"{part.spoken} {statement.deciding.text}".strip()
    first = next(iter(statement.clauses), None)
    text = first.text if first and not (first.unknown or first.filling) else ""
    return f"{part.spoken} {text}".strip()


def _choice(
    part: NamedPart,
    row: Material,
    why: str,
    *,
    clause: Clause | None = None,
    weight: float = 1.0,
    settled: bool = True,
    guessed: bool = False,
    doubts: tuple[str, ...] = (),
) -> PartChoice:
    return PartChoice(
        part.name, row, row.value(), weight, 0.5, why, settled=settled, clause=clause,
        guessed=guessed, doubts=doubts,
    )  # fmt: skip


def _is_nearly(one: Material, other: Material) -> bool:
    """Whether two rows differ by no more than grades do.

    In E by a tenth (of a metal) or a half, in rho by .05 or .15.
    """
    (a, _, b), (c, _, d) = one.value(), other.value()
    E, rho = (1.1, 1.05) if one.category == "metal" else (1.5, 1.15)
    near = max(a, c) < E * min(a, c) and max(b, d) < rho * min(b, d)
    return one.category == other.category and near


def _kind_taken(part: NamedPart, statement: PartStatement, row: Material) -> tuple[str, ...]:
    """That a row stands for a kind of matter; generic rows span theirs."""
    naming = statement.naming
    if naming and naming.phrase.lower() in words()["implied"]:  # "galvanised" is steel
        return ()
    if naming and naming.kind and "generic" not in row.name and row.category in _WIDE_KINDS:
        kind = Note("resolve.kind_matter", phrase=naming.phrase)
        return (Note("resolve.part_taken", name=part.name, kind=kind, name_2=row.name),)
    return ()


# What "soft" or "heavy" mean where no material is named: bands of E and rho, and rows in them.

# E [Pa] by degree. After the chart of E and rho of Ashby, Materials Selection in Mechanical
# Design, fig. 4.3: gels and the softest foams; soft foams and the softest rubbers; rubbers,
# leather, corks, flexible polymers; polymers, woods, glass, concrete; metals and ceramics.
STIFFNESS: dict[Degree, Span] = {
    1: Span(1e3, 1e5),
    2: Span(1e4, 1e6),
    3: Span(1e6, 1e9),
    4: Span(1e9, 1e11),
    5: Span(5e10, 6e11),
}
# rho [kg/m^3] by degree, the same chart: foams; cork, balsa and woods that float well; woods and
# polymers; glass, stone and light metals; heavy metals.
DENSITY: dict[Degree, Span] = {
    1: Span(5, 150),
    2: Span(50, 700),
    3: Span(500, 1500),
    4: Span(1500, 9000),
    5: Span(7000, 20000),
}
# What is said to be flexible, floppy or pliable: rubbers, fabrics, films, and thin stiffer matter.
FLEXIBLE = Span(1e5, 1e8)
NEARLY = 1.5  # as light as the lightest that is as stiff: aluminium beside carbon fibre
# Place in the logarithmic range of E or rho of a row that is named, from "very soft" to "very
# stiff": halves of its halves, and nearly its ends.
SHARES = (0.04, 0.25, 0.5, 0.75, 0.96)
PLACE: dict[Degree, float] = dict(zip(get_args(Degree), SHARES, strict=True))
WATER = 1000.0  # [kg/m^3]
SUNK = 1.05  # of water's, what is said to sink weighs at least
# Words for behaviour -> the categories that behave so, by what each is known for (Ashby, fig. 4.7:
# fracture toughness; elastomers return what they take up).
BEHAVING: dict[str, frozenset[str]] = {
    "brittle": frozenset({"glass-ceramic", "stone"}),
    "tough": frozenset({"metal", "composite", "plastic"}),
    "bouncy": frozenset({"elastomer"}),
}


def behaves(row: Material, character: Iterable[str]) -> bool:
    """Whether a row is known to behave as all these words say; unknown words hold for all."""
    for word in character:
        if word == "floats" and row.rho.min >= WATER:
            return False
        if word == "sinks" and row.rho.max <= WATER:
            return False
        if word in BEHAVING and row.category not in BEHAVING[word]:
            return False
    return True


def rows_at(
    rows: Iterable[Material],
    *,
    stiffness: Degree | None,
    density: Degree | None,
    character: Collection[str] = (),
    excluded: Collection[str] = (),
) -> list[Material]:
    """Rows that can be as stiff and heavy, and behave, as said; less what is ruled out.

    Where no matter is both, as "very stiff and very light", the stiff ones that come nearest.
    """
    left = [
        row
        for row in rows
        if not {row.name, row.category} & set(excluded) and behaves(row, character)
    ]
    E, rho = stiffness_band(stiffness, character), DENSITY.get(density) if density else None
    if E is not None:  # the middle half, in logarithms: what is meant, not what is just possible
        quarter = (E.max / E.min) ** 0.25
        E = Span(E.min * quarter, E.max / quarter)
    stiff = [row for row in left if E is None or max(row.E.min, E.min) <= min(row.E.max, E.max)]
    if rho is None or not stiff:
        return stiff
    apart = {
        row.name: max(0.0, math.log(rho.min / row.rho.max), math.log(row.rho.min / rho.max))
        for row in stiff
    }
    least = min(apart.values())
    return [row for row in stiff if apart[row.name] <= least + math.log(NEARLY)]


def stiffness_band(stiffness: Degree | None, character: Collection[str]) -> Span | None:
    """E [Pa] that a degree means: what is flexible is thin or rubbery, not always soft."""
    if stiffness is None:
        return None
    return FLEXIBLE if "flexible" in character and stiffness < 3 else STIFFNESS[stiffness]


def value_at(
    row: Material,
    *,
    stiffness: Degree | None,
    density: Degree | None,
    character: Collection[str] = (),
    absolute: bool,
) -> MaterialValue:
    """Value of a row at degrees: within its range, or as near to the ``absolute`` bands' middle."""
    value = row.value(0.5)
    band = stiffness_band(stiffness, character)
    if stiffness is not None and band is not None:
        value = value._replace(E=_near(row.E, band) if absolute else _placed(row.E, stiffness))
    if density is not None:
        near = _near(row.rho, DENSITY[density])
        value = value._replace(rho=near if absolute else _placed(row.rho, density))
    return value


def material_at(
    row: Material, *, stiffness: float | None = None, density: float | None = None
) -> MaterialValue:
    """Return E [Pa], nu [1], rho [kg/m^3] of a row at places [0, 1] of its ranges of E and rho."""
    value = row.value(0.5 if stiffness is None else stiffness)
    place = 0.5 if density is None else density
    return value._replace(rho=row.rho.min ** (1 - place) * row.rho.max**place)


def _near(span: Span, band: Span) -> float:
    """Return what of a range lies nearest to the middle of a band."""
    return min(span.max, max(span.min, math.sqrt(band.min * band.max)))


def _placed(span: Span, degree: Degree) -> float:
    return span.min ** (1 - PLACE[degree]) * span.max ** PLACE[degree]
