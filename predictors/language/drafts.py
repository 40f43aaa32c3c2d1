"""Drafts of clauses while a text is read, and the sentence that they become."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ...fem.scene.materials import Material
from .clauses import Blend, Clause, Comparison, Quantity, Scope, Sentence, Subject
from .groups import Mention
from .lexicon import Phrase, ReaderLexicon, words
from .lexing import Lexed, Lexeme

NEAREST = 3  # rows that are named beside an unknown material
SURE, MENDED = 1.0, 0.8  # certainty: as it stands; with something mended, guessed or left out


@dataclass(eq=False)
class Draft:
    """A clause in the making: its subject and what was said of it up to here."""

    scope: Scope
    names: list[Phrase] = field(default_factory=list)
    exceptions: list[Phrase] = field(default_factory=list)
    named: bool = False  # a part of the asset is called so
    holds: bool = False  # it has parts, by what is said: "a bookcase with ..."
    joins: Draft | None = None
    tight: bool = False  # its material stands before its name: "oak top"
    material: Material | None = None
    phrase: str = ""
    kind: str | None = None
    unknown: str = ""
    excluded: list[str] = field(default_factory=list)
    levels: dict[str, Any] = field(default_factory=dict)
    character: list[str] = field(default_factory=list)
    numbers: list[Quantity] = field(default_factory=list)
    comparisons: list[Comparison] = field(default_factory=list)
    becomes: bool = False  # what comes next takes the place of what was said
    coating: str | None = None
    filling: str | None = None
    blend: Blend | None = None
    condition: str = ""
    same: Phrase | None = None  # the other part whose matter it has; () for the one before
    left: list[str] = field(default_factory=list)  # words that say a matter and were not taken
    lexemes: list[Lexeme] = field(default_factory=list)

    def see(self, lexemes: Sequence[Lexeme]) -> None:
        """Count lexemes as words of this clause."""
        self.lexemes += lexemes
        said = (x.text.lower() for x in lexemes)
        conditions = words()["conditions"]["words"]
        self.condition = self.condition or next((w for w in said if w in conditions), "")

    def take(self, mention: Mention, lexicon: ReaderLexicon, *, negated: bool) -> None:
        """Take what a mention says, or rule it out."""
        value = mention.value
        if isinstance(value, Material):
            self._take_row(mention, value, lexicon, negated=negated)
        elif isinstance(value, Comparison):
            self.comparisons.append(value)
        elif isinstance(value, Quantity):
            self.numbers.append(value)
        elif isinstance(value, Blend):
            self.blend = value
        elif isinstance(value, tuple):
            self._take_level(*value, negated=negated)
        elif mention.kind == "unknown":
            self.unknown = f"{self.unknown} {mention.lexeme.text}".strip()
        elif mention.kind == "left":
            self.left.append(mention.lexeme.text)

    def compare_with(self, part: Phrase) -> None:
        """Say which part the last comparison is with."""
        if self.comparisons:
            self.comparisons[-1] = replace(self.comparisons[-1], other=part)

    def like(self, other: Draft) -> None:
        """Take the matter of another; its own kind must not be against it."""
        if self.kind and self.material and other.material:
            if other.material.category != self.material.category:
                return
        elif self.material:
            return
        self.material, self.phrase, self.kind = other.material, other.phrase, other.kind
        self.levels = {**other.levels, **self.levels}
        self.numbers = self.numbers or [q for q in other.numbers if q.measure != "mass"]
        self.blend = self.blend or other.blend
        self.unknown = self.unknown or other.unknown

    @property
    def says(self) -> bool:
        """Whether anything was said."""
        return bool(
            self.material or self.unknown or self.excluded or self.levels or self.character
            or self.numbers or self.comparisons or self.coating or self.filling or self.blend
            or self.same is not None
        )  # fmt: skip

    def _take_row(
        self, mention: Mention, row: Material, lexicon: ReaderLexicon, *, negated: bool
    ) -> None:
        kind = lexicon.kinds.get(" ".join(mention.lexeme.words))
        if mention.kind == "coating":
            self.coating = row.name
        elif mention.kind == "filling":
            self.filling = row.name
        elif negated:
            self.excluded.append(kind or row.name)
        elif self.material is None or self.kind or self.becomes:
            if self.becomes and self.material is not None:
                self.excluded.append(self.kind or self.material.name)
            self.becomes = False
            self.material, self.kind, self.phrase = row, kind, mention.lexeme.text

    def _take_level(self, role: str, level: Any, *, negated: bool) -> None:
        if role == "character":
            self.character += [] if negated else [level]
        else:
            self.levels.setdefault(role, (2 if level > 3 else 4) if negated else level)


def finished(
    text: str,
    drafts: Sequence[Draft],
    lexed: Lexed,
    lexicon: ReaderLexicon,
    seen: Sequence[Lexeme] = (),
) -> Sentence:
    """Return the sentence of a text: its drafts as clauses, and what no clause took.

    ``seen`` are lexemes that were read and say nothing of what is there: "looks like marble".
    """
    drafts = [draft for draft in drafts if draft.says]
    for i, draft in enumerate(drafts):
        if draft.same is None:
            continue
        others = [d for d in (*reversed(drafts[:i]), *drafts[i + 1 :]) if d.material or d.levels]
        head = draft.same[-1:]
        alike = (d for d in others if not head or any(name[-1:] == head for name in d.names))
        found = next(alike, None)
        if found is None:
            who = " ".join(draft.same) or "what came before"
            lexed.notes.append(f"'the same as {who}': nothing is said of it")
        else:
            draft.like(found)
    clauses = tuple(_clause(text, draft, lexicon) for draft in drafts)
    taken = [(x.start, x.end) for x in (*seen, *(x for draft in drafts for x in draft.lexemes))]
    spoken = {word for draft in drafts for name in draft.names for word in name}
    unread = tuple(
        x.text for x in lexed.lexemes
        if (x.role in ("number", "told", "material") or not x.known)
        and not any(start <= x.start < end for start, end in taken)
        and not (x.part and set(x.words) <= spoken)  # "the soil is moist soil"
    )  # fmt: skip
    return Sentence(text, clauses, unread, tuple(dict.fromkeys(lexed.notes)))


def _doubts(draft: Draft) -> tuple[str, ...]:
    """What of a draft was guessed or left out."""
    strange = (
        x.text for x in draft.lexemes
        if x.role == "word" and not (x.known or x.part or x.text in draft.unknown)
        and not x.text.endswith("ed")  # a treatment that no dictionary has: "rotomoulded"
    )  # fmt: skip
    left = [*draft.left, *(strange if draft.material else ())]
    told = [f"{word!r} beside it is left out" for word in left]
    return tuple(dict.fromkeys([*(x.note for x in draft.lexemes if x.note), *told]))


def _clause(text: str, draft: Draft, lexicon: ReaderLexicon) -> Clause:
    start = min((x.start for x in draft.lexemes), default=0)
    end = max((x.end for x in draft.lexemes), default=0)
    names = tuple(dict.fromkeys(name for name in draft.names if name))
    unknown = "" if draft.material else draft.unknown
    doubts = _doubts(draft)
    scope = "none" if draft.scope == "parts" and not names else draft.scope
    return Clause(
        text=text[start:end],
        span=(start, end),
        subject=Subject(scope, names, tuple(draft.exceptions), draft.holds),
        material=draft.material.name if draft.material else None,
        phrase=draft.phrase,
        kind=draft.kind,
        unknown=unknown,
        nearest=_nearest_rows(unknown, lexicon),
        excluded=tuple(draft.excluded),
        stiffness=draft.levels.get("stiffness"),
        density=draft.levels.get("density"),
        character=tuple(dict.fromkeys(draft.character)),
        numbers=tuple(draft.numbers),
        comparisons=tuple(draft.comparisons),
        coating=draft.coating,
        filling=draft.filling,
        blend=draft.blend,
        condition=draft.condition,
        doubts=doubts,
        certainty=MENDED if doubts else SURE,
    )


def _nearest_rows(word: str, lexicon: ReaderLexicon) -> tuple[str, ...]:
    """Names of the rows that are written most like a word."""
    from rapidfuzz.process import extract

    names = {" ".join(phrase): row.name for phrase, row in lexicon.rows.items()} if word else {}
    near = extract(word.lower(), list(names), limit=2 * NEAREST)
    return tuple(dict.fromkeys(names[name] for name, *_ in near))[:NEAREST]
