"""Drafts of clauses: what is said of one subject while a text is read, and what it becomes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, takewhile
from operator import itemgetter
from typing import Any

from ...fem.scene.materials import Material
from ..lexemes.lexeme import Lexed, Lexeme
from ..quantities.quantity import Blend, Comparison, Quantity
from ..vocabulary.lexicon import SHORT, Phrase, ReaderLexicon, known_parts, places, words
from .clauses import Clause, Scope, Subject
from .groups import Mention

SURE, MENDED = 1.0, 0.8  # certainty: as it stands; with something mended, guessed or left out
_BESIDE = 12  # letters between a state and its matter: "rusty galvanised steel"
_LISTS = ("character", "numbers", "comparisons")  # fields that a clause has from its draft
_SAME = ("phrase", "kind", "coating", "filling", "blend")
_SAYS = ("material", "unknown", "excluded", "levels", *_LISTS, "coating", "filling", "blend")
_NAMING = ("word", "part", "digits", "told", "sign", "hyphen", "idle", "size", "empty")


@dataclass(eq=False)
class Draft:
    """A clause in the making: its subject and what was said of it up to here."""

    scope: Scope = "none"
    names: list[Phrase] = field(default_factory=list)
    exceptions: list[Phrase] = field(default_factory=list)
    named: bool = False  # a part of the asset is called so
    count: int | None = None  # how many of its kind, 0 for some
    holds: bool = False  # it has parts, by what is said: "a bookcase with ..."
    mixed: bool = False  # numbers or strange words stand beside its name
    own: bool = False  # its matter is but what its name says: "bones", "glass"
    article: bool = False  # "a", "the", "its" stands before it
    material: Material | None = None
    phrase: str = ""
    kind: str | None = None
    unknown: str = ""
    excluded: list[str] = field(default_factory=list)
    levels: dict[str, Any] = field(default_factory=dict)
    character: list[str] = field(default_factory=list)
    numbers: list[Quantity] = field(default_factory=list)
    comparisons: list[Comparison] = field(default_factory=list)
    coating: str | None = None
    filling: str | None = None
    blend: Blend | None = None
    same: Phrase | None = None  # the other part whose matter it has; () for the one before
    left: list[str] = field(default_factory=list)  # words that say a matter and were not taken
    notes: list[str] = field(default_factory=list)  # on numbers beside it that are not used
    loose: list[str] = field(default_factory=list)  # nouns before its matter
    lexemes: list[Lexeme] = field(default_factory=list)

    def take(self, mention: Mention, lexicon: ReaderLexicon) -> None:
        """Take what a mention says."""
        value = mention.value
        if isinstance(value, Material):
            kind = lexicon.kinds.get(" ".join(mention.lexeme.words))
            if mention.kind in ("coating", "filling"):
                setattr(self, mention.kind, value.name)
            elif self.material is None or self.kind:
                self.material, self.kind, self.phrase = value, kind, mention.lexeme.text
        elif isinstance(value, Comparison):
            self.comparisons.append(value)
        elif isinstance(value, Quantity):
            self.numbers.append(value)
        elif isinstance(value, Blend):
            self.blend = value
        elif isinstance(value, tuple):
            role, level = value
            bends = mention.lexeme.text.lower() in words()["bending"]["words"]
            self.character += [level] if role == "character" else ["flexible"] if bends else []
            if role != "character":
                self.levels.setdefault(role, level)
        elif mention.kind == "unknown":
            self.unknown = f"{self.unknown} {mention.lexeme.text}".strip()
        elif mention.kind == "left":
            self.left.append(mention.lexeme.text)

    def add(self, other: Draft, *, instead: bool = False) -> None:
        """Take what another says of the same; its matter ``instead`` of the own."""
        if other.material and self.material and not (self.kind or self.own or instead):
            self.left += [other.phrase] if other.material is not self.material else []
        elif other.material:
            self.material, self.kind, self.phrase = other.material, other.kind, other.phrase
            self.own = other.own
        for name in ("excluded", "character", "numbers", "comparisons", "left"):
            getattr(self, name).extend(getattr(other, name))
        self.left += other.loose
        self.levels = {**other.levels, **self.levels}
        for name in ("coating", "filling", "blend", "unknown"):
            setattr(self, name, getattr(self, name) or getattr(other, name))
        self.same = other.same if self.same is None else self.same

    def rule_out(self, lexicon: ReaderLexicon) -> None:
        """Turn what is said into what is not: "not steel" and none of its kin, "not soft"."""
        if self.material:
            self.excluded += (
                [self.kind] if self.kind else lexicon.family(self.material, self.phrase)
            )
        self.levels = {k: 2 if v > 3 else 4 for k, v in self.levels.items()}
        self.material, self.kind, self.phrase, self.character, self.unknown = None, None, "", [], ""

    def like(self, other: Draft) -> None:
        """Take the matter of another; its own kind must not be against it."""
        if self.kind and self.material and other.material:
            if other.material.category != self.material.category:
                return
        elif self.material:
            return
        self.material, self.phrase, self.kind = other.material, other.phrase, other.kind
        self.levels = {**other.levels, **self.levels}
        own = {"mass", *(q.measure for q in self.numbers)}
        self.numbers += [q for q in other.numbers if q.measure not in own]
        self.blend, self.unknown = self.blend or other.blend, self.unknown or other.unknown

    @property
    def says(self) -> bool:
        """Whether anything was said."""
        return self.same is not None or any(getattr(self, name) for name in _SAYS)

    @property
    def said(self) -> list[str]:
        """All words that were said of it, without plurals."""
        return [word for x in self.lexemes for word in x.words]

    def compare_with(self, part: Phrase) -> None:
        """Say which part the last comparison is with."""
        if self.comparisons:
            self.comparisons[-1] = replace(self.comparisons[-1], other=part)


def settle(drafts: list[Draft], lexed: Lexed) -> None:
    """Give drafts that are "the same as" others the matter of these."""
    for i, draft in enumerate(drafts):
        if draft.same is None:
            continue
        before = [*reversed(drafts[:i]), *drafts[i + 1 :]]
        others = [d for d in before if d.material or d.levels or d.numbers]
        head = draft.same[-1:]
        called = [d for d in others if any(name[-1:] == head for name in d.names)]
        alike = called if head else others[:1]
        if not alike and draft.material and head:  # "the lid is oak like the box"
            draft.names.append(draft.same)
        elif not alike:
            who = " ".join(draft.same) or "what came before"
            lexed.notes.append(f"'the same as {who}': nothing is said of it")
        for other in alike:
            draft.like(other)


def take_strange(draft: Draft, lexemes: Sequence[Lexeme]) -> None:
    """Take for an unknown matter what may be one of a mute part: "horsehair tail", "pin QT-500"."""
    ordinary, start = known_parts() | places(), draft.lexemes[0].start
    before = [
        noun for noun, part in pairwise(draft.lexemes)
        if part.part and not noun.part and (noun.role, noun.tag) == ("word", "NN")
        and not {*noun.words} & ordinary
    ]  # fmt: skip
    here = takewhile(lambda x: x.role in _NAMING, (x for x in lexemes if x.start >= start))
    last = max(x.start for x in draft.lexemes if x.part)
    codes = [x for x in here if x.is_code or (x.start > last and x.is_name and not x.part)]
    draft.unknown = " ".join(dict.fromkeys(x.text for x in (*before, *codes)))
    if draft.unknown:
        draft.names = [tuple(w for x in draft.lexemes if x.part for w in x.words)]


def is_mixed(run: Sequence[Lexeme]) -> bool:
    """Whether more than a part's name stands in a run, as an unread matter after it does."""
    last = max((x.start for x in run if x.part), default=sys.maxsize)
    return any(x.is_code or (x.start > last and x.is_name) for x in run)


def unread_lexemes(
    drafts: Sequence[Draft], lexed: Lexed, dropped: Sequence[Lexeme]
) -> tuple[Lexeme, ...]:
    """Materials, numbers and strange words that no clause took."""
    # A strange word is taken where it is told with its clause; as a mere name it is not.
    taken = [
        x for draft in drafts for x in draft.lexemes
        if x.text in draft.unknown
        or ((x.known or x.part or x.role != "word" or draft.material) and not x.is_measure)
    ]  # fmt: skip
    taken += dropped
    spoken = {word for draft in drafts for name in draft.names for word in name}
    return tuple(
        x for x in lexed.lexemes
        if (x.role in ("number", "told", "material") or not x.known or x.is_measure)
        and not any(y.start <= x.start < y.end for y in taken)
        and not (x.part and set(x.words) <= spoken)  # "the soil is moist soil"
    )  # fmt: skip


def tell(unread: Sequence[Lexeme], drafts: Sequence[Draft], lexemes: Sequence[Lexeme]) -> None:
    """Tell what is unread with the statement that it stands in or after, else with the next."""
    begins = [(min(x.start for x in d.lexemes), d) for d in drafts if d.lexemes]
    begins.sort(key=itemgetter(0))
    stops = [x.start for x in lexemes if x.role == "stop"]
    for lexeme in unread:
        start = max((at for at in stops if at < lexeme.start), default=-1)
        end = min((at for at in stops if at > lexeme.start), default=sys.maxsize)
        near = [(at, d) for at, d in begins if start < at < end]
        before = [d for at, d in near if at <= lexeme.start]
        for draft in before[-1:] or [d for _, d in near[:1]]:
            draft.notes += [lexeme.note] if lexeme.note else []
            draft.left += [] if lexeme.note else [lexeme.text]


def _doubts(draft: Draft, lexicon: ReaderLexicon) -> tuple[str, ...]:
    """What of a draft was guessed or left out."""
    strange = (
        x.text for x in draft.lexemes
        if x.role == "word" and not (x.known or x.part or x.text in draft.unknown)
        and not x.text.endswith("ed")  # a treatment that no dictionary has: "rotomoulded"
    )  # fmt: skip
    left = [*draft.left, *(strange if draft.material else ())]
    told = [f"{word!r} beside it is left out" for word in left]
    if draft.material:
        states = {*words()["states"]["words"]} - lexicon.row_words(draft.material)
        at = next((x.start for x in draft.lexemes if x.text == draft.phrase), 0)
        said = (
            x.text for x in draft.lexemes if x.text.lower() in states and 0 < at - x.end <= _BESIDE
        )
        told += [f"{word!r} is not used: its values are those of {draft.phrase}" for word in said]
    noted = [x.note for x in draft.lexemes if x.note]
    return tuple(dict.fromkeys([*noted, *draft.notes, *told]))


def clause_of(text: str, draft: Draft, lexicon: ReaderLexicon) -> Clause:
    """Return the clause that a draft has become."""
    start = min((x.start for x in draft.lexemes), default=0)
    end = max((x.end for x in draft.lexemes), default=0)
    names = tuple(dict.fromkeys(name for name in draft.names if name))
    liquid = lexicon.contents_called(draft.unknown.lower().split())
    meant = lexicon.meant(draft.unknown.lower()) if not (draft.material or liquid) else ()
    if meant and len(draft.unknown) > SHORT:
        draft.material, draft.phrase = lexicon.rows[meant], meant[0]
        draft.notes.append(f"read {draft.unknown!r} as {meant[0]!r}")
    heads, fired = {name[-1] for name in names}, words()["fired"]
    if draft.phrase.lower() in fired and heads & {*fired["things"]}:
        draft.material = lexicon.first_row([fired[draft.phrase.lower()]]) or draft.material
    unknown, doubts = "" if draft.material else draft.unknown, _doubts(draft, lexicon)
    scope = "none" if draft.scope == "parts" and not names else draft.scope
    same: dict[str, Any] = {name: getattr(draft, name) for name in _SAME}
    same |= {name: tuple(dict.fromkeys(getattr(draft, name))) for name in _LISTS}
    return Clause(
        text[start:end],
        (start, end),
        Subject(scope, names, tuple(draft.exceptions), draft.holds, draft.count),
        draft.material.name if draft.material else None,
        unknown=unknown,
        nearest=lexicon.nearest(unknown),
        stiffness=draft.levels.get("stiffness"),
        density=draft.levels.get("density"),
        excluded=tuple(x for x in draft.excluded if not draft.material or x != draft.material.name),
        doubts=doubts,
        certainty=MENDED if doubts else SURE,
        **same,
    )
