"""What a sentence says: clauses, each about some parts, and the words that none of them took."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from ..quantities.quantity import Blend, Comparison, Quantity

# What a clause speaks of: parts by name, the object as a whole, what no other clause names, or
# nothing that it says ("oak" alone).
Scope = Literal["parts", "whole", "rest", "none"]
# How stiff or heavy a thing is said to be, from 1 (very soft, very light) to 5 (very stiff, very
# heavy); 3 is "medium".
Degree = Literal[1, 2, 3, 4, 5]


@dataclass(frozen=True)
class Subject:
    """What a clause speaks of.

    Parameters
    ----------
    scope
        Parts, the whole, the rest, or nothing that is said.
    names
        For each part that is spoken of the words that name it, its head last: ("front", "leg").
    exceptions
        Parts that a whole or a rest leaves out: "all but the seat".
    holds
        Whether it is said to have parts itself: "a bookcase with a plywood back".
    count
        How many of the parts so called, 0 for "some"; None where it is not said.
    """

    scope: Scope
    names: tuple[tuple[str, ...], ...] = ()
    exceptions: tuple[tuple[str, ...], ...] = ()
    holds: bool = False
    count: int | None = None


@dataclass(frozen=True)
class Clause:
    """One statement of a sentence: what is said of one subject.

    Parameters
    ----------
    text
        Its words as they were written.
    span
        First and one past last character of them in the sentence.
    subject
        What it speaks of.
    material
        Name of the row of the table that it names, or None.
    phrase
        The words that name the row: "soft foam"; "" without a material.
    kind
        Category of the table, where only that is named: "some kind of metal", "ceramic".
    unknown
        Words that stand where a material is named and that no row answers to.
    nearest
        Names of the rows that are written most like ``unknown``.
    excluded
        Rows and categories that it rules out: "not metal".
    stiffness, density
        How stiff and heavy it is said to be, or None; within the row's range where one is named.
    character
        Words for behaviour, each a key of the table of characters: brittle, tough, bouncy, floats.
    numbers
        What was said in numbers, SI.
    comparisons
        Relations to other parts.
    coating, filling
        Rows of what lies on it, and of what it is full of.
    blend
        A second matter in it.
    doubts
        What was guessed or left out in reading it, each a sentence without its subject.
    certainty
        1 where it was read as it stands; lower where spelling or structure was guessed.
    says_matter
        Whether it says anything of a material: a name, a kind, a level, a number, a relation.
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


@dataclass(frozen=True)
class Sentence:
    """A text, read once: every later stage takes its clauses and not its characters.

    Parameters
    ----------
    text
        The text.
    clauses
        What it says, in its order.
    unread
        Words, or numbers with their units, that no clause took.
    notes
        What the reader took upon itself, each a sentence for the user: a spelling that was mended,
        a language that is not English.
    thing
        Words of its first noun phrase, without plurals: what it says that the object is.
    """

    text: str
    clauses: tuple[Clause, ...] = ()
    unread: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    thing: tuple[str, ...] = ()
