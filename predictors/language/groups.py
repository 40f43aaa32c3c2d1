"""Groups of words between connectors: a part, what is said of one, or both, in either order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any, Literal

from ...fem.scene.materials import Material
from ..lexemes.lexeme import Lexeme
from ..lexemes.treatments import implied, is_hue, puts_hue
from ..quantities.number_words import counted_by
from ..vocabulary.lexicon import Phrase, ReaderLexicon, known_parts, places, words

_SAYING = ("material", "level", "number", "unknown")
# Roles of words that a part may be called by all the same: "cover", "core", "body".
_SMALL = "character empty attributes coating idle look factors fill vague coat".split()
Kind = Literal["part", "modifier", "material", "level", "number", "coating", "filling", "unknown",
               "left", "kin"]  # fmt: skip


@dataclass(frozen=True)
class Mention:
    """A lexeme in its group: what it is for the statement, and what it says."""

    kind: Kind
    lexeme: Lexeme
    value: Any = None  # a Material, Quantity, Blend or Comparison; a level with its role

    @property
    def says(self) -> bool:
        """Whether it says something of a part, and is none."""
        return self.kind not in ("part", "modifier")


@dataclass
class Group:
    """A part and what is said of it in the same breath; either may be missing."""

    part: Phrase = ()
    values: list[Mention] = field(default_factory=list)
    lexemes: list[Lexeme] = field(default_factory=list)
    named: bool = False  # a part of the asset has this head
    part_first: bool = False  # "hull teak"
    own: bool = False  # what is said of it is its name alone: "bones"

    @property
    def modifiers(self) -> list[str]:
        """Nouns before a material that may make another of it: "polymer clay"."""
        start = next((m.lexeme.start for m in self.values), 0)
        nouns = (x for x in self.lexemes if x.role == "word" and x.tag in ("NN", "NNP"))
        return [] if self.named else [x.text for x in nouns if x.end < start]

    @property
    def count(self) -> int | None:
        """How many of a kind are spoken of, 0 for "some": "three legs"."""
        before = takewhile(lambda x: not x.part, self.lexemes)
        return next((n for n in map(counted_by, (x.text for x in before)) if n is not None), None)

    @property
    def is_thing(self) -> bool:
        """Whether its noun is introduced as the thing that the text is about: "a bookcase"."""
        return any(x.text.lower() in ("a", "an") for x in self.lexemes)


def groups_of(
    run: Sequence[Lexeme], lexicon: ReaderLexicon, *, owes: bool, opens: bool
) -> list[Group]:
    """Cut a run of words into groups.

    ``owes`` says that a subject waits for its material, ``opens`` that the run is itself a subject:
    a word for a part and for a material is the material there, and the part here.
    """
    mentions = _one_material(_mentions(list(run), owes=owes), lexicon)
    if not any(m.kind == "material" for m in mentions):
        mentions = [Mention("material", *found) for found in implied(run, lexicon)] + mentions
    if opens:
        mentions = [replace(m, value=None) if m.kind == "part" else m for m in mentions]
    return _paired(_blocks(mentions))


def _mentions(run: list[Lexeme], *, owes: bool) -> list[Mention]:
    """Say of every lexeme what it is for the statement; coats and looks take what names them."""
    out: list[Mention] = []
    degree, fake = "", False
    for i, lexeme in enumerate(run):
        small = lexeme.part or (len(lexeme.words) == 1 and {*lexeme.words} & places())
        role = "word" if small and lexeme.role in _SMALL else lexeme.role
        if role == "degree":
            degree = lexeme.value
        elif role == "fake":
            fake = True
        elif role == "material" and lexeme.names and len(lexeme.words) > 1:
            # "cardboard box" of a part "box", "spring steel" of a spring: the phrase names the
            # matter, one word of it the part.
            out.append(Mention("material", replace(lexeme, part=False), lexeme.value))
            out.append(Mention("part", replace(lexeme, words=lexeme.names)))
        elif role == "material":
            out.append(_material(lexeme, run, i, owes=owes, fake=fake))
            fake = False
        elif role == "coat" and puts_hue(lexeme, [m.value for m in out[-1:]], run[i + 1 : i + 2]):
            fake = True
        elif role in ("coat", "coating", "look", "attributes", "fill"):
            _dress(out, lexeme, role, last=i + 1 == len(run))
        elif role == "density" and lexeme.text.lower() == "light" and is_hue(run[i + 1 : i + 2]):
            continue  # "light oak", "light grey"
        elif role in ("stiffness", "density", "character"):
            out.append(Mention("level", lexeme, (role, _scaled(lexeme.value, degree))))
            degree = ""
        elif role in ("number", "compare"):
            out.append(Mention("number", lexeme, lexeme.value))
        elif role in ("word", "part"):
            out.append(_word(lexeme, run, i))
        elif counted_by(lexeme.text) is not None and not _hyphened(run, i):
            out.append(Mention("modifier", replace(lexeme, words=())))  # "three legs"
        elif role == "empty" and not any(m.kind in _SAYING for m in out[-2:]):
            out.append(Mention("part" if i + 1 == len(run) else "modifier", lexeme))
    return out


def _scaled(level: int | str, degree: str) -> int | str:
    """Move a level outwards where the degree is high: "very soft"."""
    if not isinstance(level, int) or degree != "more":
        return level
    return max(1, level - 1) if level < 3 else min(5, level + 1)


def _material(lexeme: Lexeme, run: list[Lexeme], i: int, *, owes: bool, fake: bool) -> Mention:
    """A material, or the part that is called after one: "loose soil", "the glass is sapphire"."""
    others = any(x.role == "material" for x in run if x is not lexeme)
    alone = not any(x.role == "word" for x in run if x is not lexeme)
    owes = owes and not any(x.text.lower() == "the" for x in run[:i])
    if lexeme.part and not owes and (others or alone or run[-1] is lexeme):
        return Mention("part", lexeme, None if others else lexeme.value)
    return Mention("coating" if fake else "material", lexeme, lexeme.value)


def _word(lexeme: Lexeme, run: list[Lexeme], i: int) -> Mention:
    """A part's word, a modifier, or a name that nobody knows beside a part of the asset."""
    plain = replace(lexeme, words=())
    after = next((x for x in run[i + 1 :] if x.role != "hyphen"), None)
    if not lexeme.part and {*lexeme.words} & places():
        if after and (after.part or {*after.words} & places()):
            return Mention("modifier", lexeme)  # "back left leg", "back-left leg"
        if i and run[i - 1].role == "material" and {*lexeme.words} & known_parts():
            return Mention("part", lexeme)  # "a leather back", whatever its tag
    strange = not lexeme.known
    compound = _hyphened(run, i) and i + 1 < len(run)
    if not lexeme.part and (compound or (strange and lexeme.text.lower().endswith("ed"))):
        return Mention("modifier", plain)  # "hot-dip", "rotomoulded"
    if lexeme.part or strange or lexeme.tag.startswith(("NN", "FW", "XX", "ADD")):
        others = [x for x in run if x is not lexeme]
        beside = any(x.part for x in others) and not any(x.role == "material" for x in others)
        return Mention("unknown" if strange and beside else "part", lexeme)
    is_adjective = lexeme.tag.startswith(("JJ", "CD", "V", "RP"))
    return Mention("modifier", lexeme if is_adjective else plain)


def _hyphened(run: list[Lexeme], i: int) -> bool:
    return any(x.role == "hyphen" for x in run[max(i - 1, 0) : i + 2])


def _dress(out: list[Mention], lexeme: Lexeme, role: str, *, last: bool) -> None:
    """Turn the material before a coat, a look or "-filled" into what it is there for."""
    before = out[-1] if out else None
    if before is None:
        return
    close = lexeme.start - before.lexeme.end <= 1
    if before.kind == "material" and (role != "coat" or len(out) == 1 or not last):
        out[-1] = replace(before, kind="filling" if role == "fill" else "coating")
    elif not before.says and close and not before.lexeme.part:
        out.pop()  # "powder-coated"


def _one_material(mentions: list[Mention], lexicon: ReaderLexicon) -> list[Mention]:
    """Of materials side by side keep the one that is meant: "ABS plastic", "walnut MDF"."""
    out: list[Mention] = []
    for mention in mentions:
        last = next((m for m in reversed(out) if m.kind not in ("modifier", "level")), None)
        if mention.kind == "material" and last is not None and last.kind == "material":
            if lexicon.repeats(mention.value, mention.lexeme.words, last.value):
                out.append(replace(mention, kind="kin", value=None))
                continue
            # The later of two is the head; what the other says is told, but "steel St37".
            repeats = lexicon.repeats(last.value, last.lexeme.words, mention.value)
            kin = repeats or _is_like(last, mention)
            out[out.index(last)] = replace(last, kind="kin" if kin else "left", value=None)
        out.append(mention)
    return out


def _is_like(said: Mention, after: Mention) -> bool:
    """Whether one of two only says more of the other: "beech ply", "music wire A228", a colour."""
    beside = after.lexeme.start - said.lexeme.end <= 1 and said.lexeme.dep != "punct"
    alike = said.value.category == after.value.category
    return (alike and beside) or said.lexeme.text.lower() in words()["hues"]["colours"]


def _blocks(mentions: list[Mention]) -> list[list[Mention]]:
    """Cut where parts and what is said of them alternate; modifiers go with what follows."""
    blocks: list[list[Mention]] = []
    waiting: list[Mention] = []
    for mention in mentions:
        if mention.kind == "modifier":
            waiting.append(mention)
            continue
        if blocks and blocks[-1][-1].says == mention.says:
            blocks[-1] += [*waiting, mention]
        else:
            blocks.append([*waiting, mention])
        waiting = []
    placed = not blocks and any(word in places() for m in waiting for word in m.lexeme.words)
    if placed or (waiting and waiting[-1].lexeme.part):
        blocks.append(waiting)  # "the second is pine"
    return blocks


def _paired(blocks: list[list[Mention]]) -> list[Group]:
    """Join each part with what is said of it, before it or after it."""
    says = [block[-1].says for block in blocks]
    if says == [False, True, False]:
        # "top beech ply" of a part "top"; "bench: oak slats" would have its colon.
        if not any(m.lexeme.part for m in blocks[2]):
            return [_group(blocks[0], blocks[1], part_first=True)]
        return [_group(blocks[0], []), _group(blocks[2], blocks[1])]
    part_first = bool(says) and not says[0]
    out: list[Group] = []
    while blocks:
        first, *blocks = blocks
        if blocks and first[-1].says != part_first:
            second, *blocks = blocks
            parts, values = (_up_to_name(first), second) if part_first else (second, first)
            out.append(_group(parts, values, part_first=part_first))
        else:
            out.append(_group([], first) if first[-1].says else _group(first, []))
    return out


def _up_to_name(parts: list[Mention]) -> list[Mention]:
    """Words up to the asset's own: "blade damascus steel" speaks of the blade."""
    named = [i for i, m in enumerate(parts) if m.lexeme.part]
    return parts[: named[-1] + 1] if named else parts


def _group(parts: list[Mention], values: list[Mention], *, part_first: bool = False) -> Group:
    nouns = [m for m in parts if m.kind == "part"]
    own = [replace(m, kind="material") for m in nouns if isinstance(m.value, Material)]
    return Group(
        part=tuple(word for m in parts for word in m.lexeme.words),
        values=[m for m in values if m.says] or own,
        lexemes=[m.lexeme for m in (*parts, *values)],
        named=any(m.lexeme.part for m in parts),
        part_first=part_first,
        own=bool(own) and not any(m.says for m in values),
    )
