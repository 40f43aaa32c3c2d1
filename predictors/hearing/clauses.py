"""What a sentence says: its clauses, each a material or a level of some parts."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import NamedTuple

from ..language.clauses import Clause, Sentence
from . import words
from .vocabulary import stem

# AutoPhyX 3.3: "This is a [object name]." leaves every part at the mean of its range.
_TEMPLATE = re.compile(r"((this|it) is |an image of )?an? [\w -]{1,40}\.?", re.IGNORECASE)


@dataclass(frozen=True)
class HeardClause:
    """One statement of a sentence.

    Parameters
    ----------
    text
        Its words, without those that say nothing.
    material
        A name of the table's row that it names, or None.
    parts
        Stems of the words for the parts it speaks of, in order.
    level
        "soft", "stiff", "dense" or "light" where an adjective says so.
    written
        All words from its first to its last as they were written: "extremely" is no filler for a
        network. ``text`` where its words stand apart in the sentence.
    phrase
        The words that name the row, which the table need not have: "PP". "" without a material.
    """

    text: str
    material: str | None = None
    parts: tuple[str, ...] = ()
    level: str | None = None
    written: str = field(default="", compare=False)
    phrase: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not self.written:
            object.__setattr__(self, "written", self.text)
        if not self.phrase:
            object.__setattr__(self, "phrase", self.material or "")

    @classmethod
    def of(cls, clause: Clause) -> HeardClause:
        """Return a clause as a network hears it: its telling words, stems of its subject."""
        raw = re.findall(r"[\w'-]+", clause.text)
        text = " ".join(word for word in raw if word.lower() not in words.FILLERS)
        parts = tuple(stem(word) for name in clause.subject.names for word in name)
        if clause.subject.scope == "rest":
            parts = ("everything",)
        degrees = ((clause.stiffness, "soft", "stiff"), (clause.density, "light", "dense"))
        levels = [low if n < 3 else high for n, low, high in degrees if n is not None and n != 3]
        return cls(
            text or clause.text, clause.material, parts,
            next(iter(levels), None), clause.text, clause.phrase,
        )  # fmt: skip


class HeardSentence(NamedTuple):
    """A text, read once: every later stage takes its clauses and not its characters."""

    text: str
    clauses: tuple[HeardClause, ...]

    @classmethod
    def of(cls, sentence: Sentence) -> HeardSentence:
        """Return a sentence as a network hears it: without words that nobody understood."""
        known = (c for c in sentence.clauses if c.material or not c.unknown)
        return cls(sentence.text, tuple(HeardClause.of(clause) for clause in known))

    @property
    def stated(self) -> tuple[HeardClause, ...]:
        """Its clauses; none where it only says what the object is."""
        says = any(clause.material or clause.level for clause in self.clauses)
        return self.clauses if says or not _TEMPLATE.fullmatch(self.text.strip()) else ()
