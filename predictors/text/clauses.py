"""What a sentence says: clauses, each about some parts, and the words that none of them took."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

from ...fem.note import Note
from .english import words
from .numerals import Blend, Comparison, Quantity
from .parts import (
    FILLERS,
    HEAD,
    LABEL,
    WORD,
    PartLabels,
    PartMatch,
    known_parts,
    part_labels,
    part_words,
    parts_named,
    stem,
)

# What a clause speaks of: parts by name, the object as a whole, what no other clause names, or
# nothing that it says ("oak" alone).
Scope = Literal["parts", "whole", "rest", "none"]
# How stiff or heavy a thing is said to be, from 1 (very soft, very light) to 5 (very stiff, very
# heavy); 3 is "medium".
Degree = Literal[1, 2, 3, 4, 5]


# AutoPhyX 3.3: "This is a [object name]." leaves every part at the mean of its range.
_TEMPLATE = re.compile(r"((this|it) is |an image of )?an? [\w -]{1,40}\.?", re.IGNORECASE)


@dataclass(frozen=True)
class Subject:
    """What a clause speaks of.

    scope: Parts, the whole, the rest, or nothing that is said.
    names: For each part that is spoken of the words that name it, its head last: ("front", "leg").
    exceptions: Parts that a whole or a rest leaves out: "all but the seat".
    holds: Whether it is said to have parts itself: "a bookcase with a plywood back".
    count: How many of the parts so called, 0 for "some"; None where it is not said.
    """

    scope: Scope
    names: tuple[tuple[str, ...], ...] = ()
    exceptions: tuple[tuple[str, ...], ...] = ()
    holds: bool = False
    count: int | None = None


@dataclass(frozen=True)
class Clause:
    """One statement of a sentence: what is said of one subject.

    text: Its words as they were written.
    span: First and one past last character of them in the sentence.
    subject: What it speaks of.
    material: Name of the row of the table that it names, or None.
    phrase: The words that name the row: "soft foam"; "" without a material.
    kind: Category of the table, where only that is named: "some kind of metal", "ceramic".
    unknown: Words that stand where a material is named and that no row answers to.
    nearest: Names of the rows that are written most like ``unknown``.
    excluded: Rows and categories that it rules out: "not metal".
    stiffness, density: How stiff and heavy it is said to be, or None; within the row's range where
        one is named.
    character: Words for behaviour, each a key of the table of characters: brittle, tough, bouncy,
        floats.
    numbers: What was said in numbers, SI.
    comparisons: Relations to other parts.
    coating, filling: Rows of what lies on it, and of what it is full of.
    blend: A second matter in it.
    doubts: What was guessed or left out in reading it, each a sentence without its subject.
    certainty: 1 where it was read as it stands; lower where spelling or structure was guessed.
    says_matter: Whether it says anything of a material: a name, a kind, a level, a number, a
        relation.
    """

    text: str
    span: tuple[int, int]
    subject: Subject
    material: str | None = None
    phrase: str = ""
    kind: str | None = None
    unknown: str = ""
    nearest: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    stiffness: Degree | None = None
    density: Degree | None = None
    character: tuple[str, ...] = ()
    numbers: tuple[Quantity, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    coating: str | None = None
    filling: str | None = None
    blend: Blend | None = None
    doubts: tuple[str, ...] = ()
    certainty: float = 1.0

    says_matter: bool = field(init=False, compare=False)

    def __post_init__(self) -> None:
        says = (
            self.material or self.kind or self.unknown or self.excluded or self.stiffness
            or self.density or self.character or self.numbers or self.comparisons
        )  # fmt: skip
        object.__setattr__(self, "says_matter", bool(says))

    # As a network hears it.

    @property
    def told(self) -> str:
        """Its words, without those that say nothing."""
        words = re.findall(r"[\w'-]+", self.text)
        return " ".join(word for word in words if word.lower() not in FILLERS) or self.text

    @property
    def parts(self) -> tuple[str, ...]:
        """Stems of the words for the parts that it speaks of, in order."""
        if self.subject.scope == "rest":
            return ("everything",)
        return tuple(stem(word) for name in self.subject.names for word in name)

    @property
    def level(self) -> str | None:
        """How it is, where an adjective says so: "soft", "stiff", "light" or "dense"."""
        degrees = ((self.stiffness, "soft", "stiff"), (self.density, "light", "dense"))
        levels = (low if n < 3 else high for n, low, high in degrees if n not in (None, 3))
        return next(levels, None)


Place = tuple[int, int]  # where words start and end


def over(a: Place, b: Place) -> bool:
    """Whether two places have a character in common."""
    return a[0] < b[1] and b[0] < a[1]


class Gloss(NamedTuple):
    """A text in English; the places of its words there, and then of the same words here."""

    text: str
    places: tuple[tuple[int, int, int, int], ...]


@dataclass(frozen=True)
class Sentence:
    """A text, read once: every later stage takes its clauses and not its characters.

    text: The text.
    clauses: What it says, in its order.
    unread: Words, or numbers with their units, that no clause took.
    notes: What the reader took upon itself, each a sentence for the user: a spelling that was
        mended, a language that is not English.
    thing: Words of its first noun phrase, without plurals: what it says that the object is.
    mute: Names of parts that it speaks of without a matter: "for the mast I have no idea yet".
    matters: Where words stand that name materials, whatever of.
    numbers: Where its numbers with units stand.
    gloss: The text in English, word by word, if it is of another language.
    """

    text: str
    clauses: tuple[Clause, ...] = ()
    unread: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    thing: tuple[str, ...] = ()
    mute: tuple[tuple[str, ...], ...] = ()
    matters: tuple[tuple[int, int], ...] = ()
    numbers: tuple[tuple[int, int], ...] = ()
    gloss: Gloss | None = None

    @property
    def language(self) -> str:
        """Name of the language that it was read as, "" of English."""
        notes = (note for note in self.notes if isinstance(note, Note))
        return next((n.values["language"] for n in notes if n.kind == "lexing.read_as"), "")

    @property
    def stated(self) -> tuple[Clause, ...]:
        """Clauses whose matter somebody knows; none where it only says what the object is."""
        known = tuple(c for c in self.clauses if c.material or not c.unknown)
        says = any(clause.material or clause.level for clause in known)
        return known if says or not _TEMPLATE.fullmatch(self.text.strip()) else ()


# Which clauses speak of which part of an asset.

How = Literal["name", "label", "synonym", "rest", "whole"]
_HOW: dict[int, How] = {HEAD: "name", WORD: "name", LABEL: "label"}
GENERAL: tuple[How, ...] = ("rest", "whole")  # not by a word for the part


class BoundPart(NamedTuple):
    """Indices of the clauses that speak of a part, the most specific first, and how each does."""

    clauses: tuple[int, ...] = ()
    how: tuple[How, ...] = ()


@dataclass(frozen=True)
class Bound:
    """A sentence, and which of its clauses speak of every part.

    sentence: What was read.
    parts: One for each part of the asset.
    unbound: Indices of clauses that speak of no part of it.
    mute: Indices of parts that it speaks of by name, and says no matter of.
    """

    sentence: Sentence
    parts: tuple[BoundPart, ...]
    unbound: tuple[int, ...]
    mute: tuple[int, ...] = ()

    @cached_property
    def named(self) -> frozenset[int]:
        """Indices of the clauses that speak of a part by a word for it."""
        bonds = (bond for part in self.parts for bond in zip(part.clauses, part.how, strict=True))
        return frozenset(k for k, how in bonds if how not in GENERAL)


def bind(sentence: Sentence, labels: Sequence[Sequence[str]]) -> Bound:
    """Say which clauses speak of which part.

    sentence: What was read.
    labels: For each part its name, then all other words that the asset has for it.
    """
    clauses = sentence.clauses
    parts = [part_labels(tuple(names)) for names in labels]
    matches: list[dict[int, PartMatch]] = [{} for _ in parts]
    for other in (False, True):  # "the other legs" are those that nothing else names
        for k, clause in enumerate(clauses):
            if (
                clause.subject.scope == "parts"
                and (clause.subject.names[0][:1] == ("other",)) == other
                and not _beside_it(clause)
            ):
                names = [name[1:] if other else name for name in clause.subject.names]
                for name in names[:1] if other else names:
                    for i, match in parts_named(name, parts).items():
                        if other and not matches[i]:
                            matches[i][k] = PartMatch(HEAD, 1)
                        elif not other and not _is_excepted(i, parts, clause):
                            matches[i][k] = match
    spoken = [sum(k in found for found in matches) for k in range(len(clauses))]
    lost = [k for k, c in enumerate(clauses) if c.subject.scope == "parts"]
    lost = [k for k in lost if not any(k in found for found in matches)]
    whole, rest, lost = _general(clauses, lost, matches, parts)
    bound = []
    for i, found in enumerate(matches):
        # The most words, of these the fewest parts: "link_1 to link_5: steel, link_4: brass"
        ks = sorted(found, key=lambda k: (-found[k].words, -found[k].tier, spoken[k], k))
        naming = [k for k in ks if clauses[k].material]
        ks = [k for k in ks if k not in naming or spoken[k] == spoken[naming[0]]]
        # "the back of the seat" is not what "the seat" speaks of.
        ks = [k for k in ks if k not in naming or found[k].words == found[naming[0]].words]
        how: list[How] = [_HOW.get(found[k].tier, "synonym") for k in ks]
        generals: tuple[tuple[list[int], How], ...] = ((rest, "rest"), (whole, "whole"))
        for general, name in generals:
            settled = any(clauses[k].material or clauses[k].unknown for k in ks)
            if settled or (name == "rest" and any(clauses[k].says_matter for k in ks)):
                continue
            new = [k for k in general if k not in ks and not _is_excepted(i, parts, clauses[k])]
            ks += new
            how.extend(name for _ in new)
        bound.append(BoundPart(tuple(ks), tuple(how)))
    taken = {k for part in bound for k in part.clauses}
    idle = {k for k in (*whole, *rest) if k in taken or not clauses[k].says_matter}
    excluding = {  # "no plastic"
        k for k, c in enumerate(clauses)
        if c.subject.scope != "parts" and not replace(c, excluded=()).says_matter
    }  # fmt: skip
    left = sorted({*lost, *whole, *rest} - taken - idle - excluding)
    counted = []
    for k, clause in enumerate(clauses):
        # A doubt where it speaks of fewer parts than are called so: "3 of the legs"
        count, there = clause.subject.count, sum(k in part.clauses for part in bound)
        if count is not None and count < there and there != 1:
            doubt = Note("clauses.such_parts", count=count or "some", there=there)
            clause = replace(clause, doubts=(*clause.doubts, doubt))
        if clause.material and count is None and there:
            before = (c for c in clauses[:k] if c.subject == clause.subject and c.material)
            first = next((c for c in before if c.material != clause.material), None)
            if first:
                at = (sentence.text.find(c.phrase, c.span[0]) for c in (first, clause))
                words = {"first": first.phrase, "second": clause.phrase}
                doubt = Note("reader.again", **words, at=tuple(at))
                clause = replace(clause, doubts=(*clause.doubts, doubt))
        counted.append(clause)
    named = {i for name in sentence.mute for i in parts_named(name, parts)}
    mute = sorted(i for i in named if {*bound[i].how} <= {*GENERAL})
    sentence = replace(sentence, clauses=tuple(counted))
    return Bound(sentence, tuple(bound), tuple(left), tuple(mute))


CORRECTION = re.compile(words()["hedges"]["correction"])
_REVISION = re.compile(r"(?i)\brev(?:ision|isión)?\.? ?([A-Z0-9]{1,2})(?=[ \d./()-]{0,14}:)")
_ALL = re.compile(r"(?i)(?:all|everything|the whole|alles|tout|toutes|todo|todas)\b")
_NOT_ALL = re.compile(r"(?i)\b(?:not (?:all|every)|nicht all|pas tou|no tod)")


def corrected(text: str, read: Callable[[str], Bound]) -> Bound:
    """A text as it is read, with what it says in a correction in place of what it said before.

    A part that the correction names with its matter has no other: "seat alu. Edit: seat is oak".
    """
    found = next((m for m in CORRECTION.finditer(text) if text[: m.start()].strip()), None)
    marks = [m.upper().rjust(2) for m in _REVISION.findall(text)]
    if found is None or marks != sorted(marks):  # of a list that begins with the latest
        return read(text)

    def says_all(clause: Clause) -> bool:
        """Whether a clause is of all parts: "all brass", "everything is steel"."""
        of_all = clause.subject.scope == "whole" or _ALL.match(clause.text)
        return bool(of_all and not _NOT_ALL.search(text))

    first, second = read(text[: found.start()]), corrected(text[found.end() :], read)
    start = len(first.sentence.text) + 1
    later = [
        replace(c, span=(c.span[0] + start, c.span[1] + start)) for c in second.sentence.clauses
    ]
    parts = list[BoundPart]()
    for old, new in zip(first.parts, second.parts, strict=True):
        own = [
            later[k] for k, how in zip(new.clauses, new.how, strict=True)
            if how not in GENERAL or says_all(later[k])
        ]  # fmt: skip
        unsure = any(
            getattr(d, "kind", "").startswith("tagger.") for clause in own for d in clause.doubts
        )
        said = any(c.material or c.kind or c.unknown for c in own)
        more = any(c.numbers or c.comparisons for c in own)
        anew = (said or more) and not (unsure and old.clauses)
        moved = tuple(k + len(first.sentence.clauses) for k in new.clauses)
        kept = BoundPart() if said else old  # "Edit: seat density 700 kg/m3" leaves it oak
        parts.append(BoundPart(moved + kept.clauses, new.how + kept.how) if anew else old)
    if parts == [*first.parts]:
        return read(text)
    one, two = first.sentence, second.sentence
    # Without what no longer speaks of any part: it is corrected
    count, clauses = len(one.clauses), (*one.clauses, *later)
    unbound = (*first.unbound, *(k + count for k in second.unbound))
    kept = {k: n for n, k in enumerate(sorted({*unbound, *(k for p in parts for k in p.clauses)}))}
    parts = [part._replace(clauses=tuple(kept[k] for k in part.clauses)) for part in parts]
    sentence = replace(
        one, text=f"{one.text} {two.text}", clauses=tuple(clauses[k] for k in kept), gloss=None,
        notes=tuple(dict.fromkeys((*one.notes, *two.notes))), unread=(*one.unread, *two.unread),
        mute=(*one.mute, *two.mute),
        matters=(*one.matters, *((a + start, b + start) for a, b in two.matters)),
        numbers=(*one.numbers, *((a + start, b + start) for a, b in two.numbers)),
    )  # fmt: skip
    return Bound(sentence, tuple(parts), tuple(kept[k] for k in unbound), first.mute)


_BESIDE = re.compile(r"(?i)\b(?:as|of|than)\s+(?:the\s+)?([^\W_]+)\W*$")


def _beside_it(clause: Clause) -> bool:
    """Whether what another is compared with was taken for the part: "twice the modulus of A"."""
    found = _BESIDE.search(clause.text) if clause.comparisons and not clause.material else None
    own = clause.comparisons and not clause.comparisons[0].other
    return bool(own and found and clause.subject.names[0][-1:] == (found[1].lower(),))


def _general(
    clauses: Sequence[Clause],
    lost: list[int],
    matches: Sequence[dict[int, PartMatch]],
    parts: Sequence[PartLabels],
) -> tuple[list[int], list[int], list[int]]:
    """Clauses about the whole, about the rest, and about parts that are not there."""
    rest, whole, unnamed = (
        [k for k, c in enumerate(clauses) if c.subject.scope == scope]
        for scope in ("rest", "whole", "none")
    )

    def is_thing(k: int) -> bool:
        """Whether parts are called after what a clause names ("table_top"), or it has parts."""
        named = [i for i, found in enumerate(matches) if k in found]
        heads = {name[-1] for name in clauses[k].subject.names}
        return clauses[k].subject.holds or not any(heads & set(parts[i].tail) for i in named)

    # A thing that has parts, or the only one that is spoken of, is the object.
    saying = [k for k, c in enumerate(clauses) if c.says_matter]
    things = [
        k for k in lost
        if (clauses[k].subject.holds or len(saying) == 1 or names_object(clauses[k]))
        and not {name[-1] for name in clauses[k].subject.names} & known_parts()
    ]  # fmt: skip
    only = [k for k in saying if len(saying) == 1 and k not in lost and is_thing(k)]
    whole += [k for k in things[:1] + only if k not in whole]
    # "Body steel, hard rubber; cap brass": a matter amid those of parts is hardly that of all else
    named = [k for k in saying if clauses[k].subject.scope == "parts" and clauses[k].material]
    amid = len(named) > 1 and all(named[0] < k < named[-1] for k in unnamed)
    if (len(unnamed) == 1 and not amid) or all(not clauses[k].material for k in unnamed):
        whole += [k for k in unnamed if k not in whole]
    else:
        lost = lost + unnamed
    return whole, rest, [k for k in lost if k not in whole]


def names_object(clause: Clause) -> bool:
    """Whether its subject is a word for a thing that has parts: "the chair"."""
    heads = {name[-1] for name in clause.subject.names}
    return bool(heads) and heads <= {*part_words()["objects"]}


def _is_excepted(i: int, parts: Sequence[PartLabels], clause: Clause) -> bool:
    return any(i in parts_named(name, parts) for name in clause.subject.exceptions)
