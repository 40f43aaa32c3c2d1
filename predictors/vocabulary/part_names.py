"""Which parts of an asset a noun phrase names: "front legs" of leg_FL, leg_FR, leg_BL, leg_BR."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .lexicon import Phrase, known_parts, part_name_words, part_words, places, positions, words

# Of one word: what the part itself is called, its last word before the others; what else the asset
# calls it; another word for the same; a word inside another ("top" in "tabletop").
HEAD, WORD, LABEL, SYNONYM, INSIDE = 5, 4, 3, 2, 1
_SHORTEST_INSIDE = 4  # letters: "leg" is inside "legend"


class PartMatch(NamedTuple):
    """How well a phrase fits a part: the kind of its head's match, and how many words match."""

    tier: int
    words: int


class PartLabels:
    """What an asset calls a part: its name, then other words that it has for it."""

    def __init__(self, names: Phrase) -> None:
        self.own = part_name_words(names[0]) if names else ()
        self.label = frozenset(word for name in names[1:] for word in part_name_words(name))
        sided = {w for group in (*part_words()["places"], *part_words()["looks"]) for w in group}
        nouns = [w for w in self.own if w not in sided and len(w) > 1 and w.isalpha()]
        self.head = nouns[-1] if nouns else next(iter(self.own[-1:]), "")
        self.sides = positions(self.own)
        aside = places() - known_parts()  # the last word of "leg_left" is leg, of "table_top" top
        self.tail = [word for word in self.own if word.isalpha() and word not in aside][-1:]

    def tier(self, word: str) -> int:
        """How a word names this part, 0 where it does not."""
        if word == self.head:
            return HEAD
        if word in self.own:
            return WORD
        if word in self.label:
            return LABEL
        related = {w for group in part_words()["synonyms"] if word in group for w in group}
        if self.head in related or related & self.label:
            return SYNONYM
        long = min(len(word), len(self.head)) >= _SHORTEST_INSIDE
        return INSIDE if long and (self.head.endswith(word) or word.endswith(self.head)) else 0


def parts_named(name: Phrase, parts: Sequence[PartLabels]) -> dict[int, PartMatch]:
    """Parts that a name speaks of: the best kind of match, and of these the most words."""
    sides, forms = positions(name[:-1]), words()["attributes"]["empty"]
    found: dict[int, PartMatch] = {}
    for i, part in enumerate(parts if name else ()):
        tier = part.tier(name[-1])
        if not tier and name[-1] in forms:  # "the butt section" of a part "butt"
            tier = max((part.tier(word) for word in name[-2:-1]), default=0)
        against = any(part.sides.get(axis, side) != side for axis, side in sides.items())
        if tier and not against:
            matched = {w for w in name if w in part.own or w in part.label}
            matched |= {side for axis, side in sides.items() if part.sides.get(axis) == side}
            found[i] = PartMatch(tier, len(matched))
    # "the corner post" is "post_corner" before any other post.
    called = {i: m for i, m in found.items() if len(name) > 1 and {*name} <= {*parts[i].own}}
    found = called or found
    best, siblings = max((m.tier for m in found.values()), default=0), _siblings(name, found, parts)
    found = {i: m for i, m in found.items() if m.tier == best or i in siblings}
    most = max((m.words for m in found.values()), default=0)
    found = {i: m for i, m in found.items() if m.words == most}
    strict = {axis: side for axis, side in sides.items() if axis < len(part_words()["places"])}
    told = any(parts[i].sides.get(axis) == side for i in found for axis, side in strict.items())
    # "front legs" of a chair whose legs bear numbers: nobody knows which those are.
    return {} if strict and not told and len(found) > 1 else found


def _siblings(name: Phrase, found: dict[int, PartMatch], parts: Sequence[PartLabels]) -> set[int]:
    """Parts that a noun names with their first word as others with their last: "sail_jib"."""
    counted = any(word.isdigit() for part in parts for word in part.own)
    first = {i for i in found if parts[i].own[:1] == name[-1:] and len(parts[i].own) == 2}
    return first if not counted and any(found[i].tier == HEAD for i in first) else set()


def parts_called(words: Phrase, labels: Sequence[Sequence[str]]) -> list[int]:
    """Indices of the parts that words name."""
    return [*parts_named(words, [PartLabels(tuple(names)) for names in labels])]
