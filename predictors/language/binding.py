"""Which clauses speak of which part of an asset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from ..vocabulary.lexicon import (
    Phrase,
    known_parts,
    part_name_words,
    part_words,
    places,
    positions,
    words,
)  # fmt: skip
from .clauses import Clause, Sentence

How = Literal["name", "label", "synonym", "rest", "whole"]
GENERAL: tuple[How, ...] = ("rest", "whole")  # not by a word for the part
# Of one word: what the part itself is called, its last word before the others; what else the asset
# calls it; another word for the same; a word inside another ("top" in "tabletop").
HEAD, WORD, LABEL, SYNONYM, INSIDE = 5, 4, 3, 2, 1
_SHORTEST_INSIDE = 4  # letters: "leg" is inside "legend"


class BoundPart(NamedTuple):
    """Indices of the clauses that speak of a part, the most specific first, and how each does."""

    clauses: tuple[int, ...] = ()
    how: tuple[How, ...] = ()


@dataclass(frozen=True)
class Bound:
    """A sentence, and which of its clauses speak of every part.

    Parameters
    ----------
    sentence
        What was read.
    parts
        One for each part of the asset.
    unbound
        Indices of clauses that speak of no part of it.
    """

    sentence: Sentence
    parts: tuple[BoundPart, ...]
    unbound: tuple[int, ...]


class _Match(NamedTuple):
    """How well a clause fits a part: the kind of its head's match, words matched, its index."""

    tier: int
    words: int
    clause: int


def bind(sentence: Sentence, labels: Sequence[Sequence[str]]) -> Bound:
    """Say which clauses speak of which part.

    Parameters
    ----------
    sentence
        What was read.
    labels
        For each part its name, then all other words that the asset has for it.
    """
    clauses = sentence.clauses
    parts = [_Part(tuple(names)) for names in labels]
    matches: list[list[_Match]] = [[] for _ in parts]
    lost = []
    for k, clause in enumerate(clauses):
        if clause.subject.scope != "parts" or _is_other(clause):
            continue
        found = {i: m for name in clause.subject.names for i, m in _fits(name, parts, k)}
        for i, match in found.items():
            if not _is_excepted(i, parts, clause):
                matches[i].append(match)
        lost += [] if found else [k]
    for k, clause in enumerate(clauses):
        if _is_other(clause):
            found = [i for i, _ in _fits(clause.subject.names[0][1:], parts, k) if not matches[i]]
            for i in found:
                matches[i].append(_Match(HEAD, 1, k))
            lost += [] if found else [k]
    whole, rest, lost = _general(clauses, lost, matches, parts)
    bound = []
    for i, found in enumerate(matches):
        own = sorted(found, key=lambda m: (-m.words, -m.tier, m.clause))
        naming = [m for m in own if clauses[m.clause].material]
        # "the back of the seat" is not what "the seat" speaks of.
        own = [m for m in own if m not in naming or m.words == naming[0].words]
        ks = [m.clause for m in own]
        how: list[How] = []
        how.extend(_how(m.tier) for m in own)
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
    kept = {k for k, clause in enumerate(clauses) if _only_excludes(clause)}  # "no plastic"
    left = sorted({*lost, *whole, *rest} - taken - idle - kept)
    counted = tuple(_counted(clause, k, bound) for k, clause in enumerate(clauses))
    return Bound(replace(sentence, clauses=counted), tuple(bound), tuple(left))


def _counted(clause: Clause, k: int, bound: Sequence[BoundPart]) -> Clause:
    """A clause, with a doubt where it speaks of fewer parts than are called so: "3 of the legs"."""
    said, there = clause.subject.count, sum(k in part.clauses for part in bound)
    if said is None or said >= there or there == 1:
        return clause
    doubt = f"{said or 'some'} of {there} such parts are spoken of, and not which: all have it"
    return replace(clause, doubts=(*clause.doubts, doubt))


def _is_other(clause: Clause) -> bool:
    return clause.subject.scope == "parts" and clause.subject.names[0][:1] == ("other",)


def _only_excludes(clause: Clause) -> bool:
    whole = clause.subject.scope != "parts"
    return whole and not replace(clause, excluded=()).says_matter


def _general(
    clauses: Sequence[Clause],
    lost: list[int],
    matches: Sequence[Sequence[_Match]],
    parts: Sequence[_Part],
) -> tuple[list[int], list[int], list[int]]:
    """Clauses about the whole, about the rest, and about parts that are not there."""
    rest = [k for k, c in enumerate(clauses) if c.subject.scope == "rest"]
    whole = [k for k, c in enumerate(clauses) if c.subject.scope == "whole"]
    unnamed = [k for k, c in enumerate(clauses) if c.subject.scope == "none"]

    def is_thing(k: int) -> bool:
        """Whether parts are called after what a clause names ("table_top"), or it has parts."""
        named = {i for i, found in enumerate(matches) for m in found if m.clause == k}
        heads = {name[-1] for name in clauses[k].subject.names}
        return clauses[k].subject.holds or not any(heads & set(parts[i].tail) for i in named)

    # A thing that has parts, or the only one that is spoken of, is the object.
    saying = [k for k, c in enumerate(clauses) if c.says_matter]
    things = [k for k in lost if _is_object(clauses[k], alone=len(saying) == 1)]
    only = [k for k in saying if len(saying) == 1 and k not in lost and is_thing(k)]
    whole += [k for k in things[:1] + only if k not in whole]
    if len(unnamed) == 1 or all(not clauses[k].material for k in unnamed):
        whole += [k for k in unnamed if k not in whole]
    else:
        lost = lost + unnamed
    return whole, rest, [k for k in lost if k not in whole]


def _is_object(clause: Clause, *, alone: bool) -> bool:
    heads = {name[-1] for name in clause.subject.names}
    thing = clause.subject.holds or alone or names_object(clause)
    return thing and not heads & known_parts()


def names_object(clause: Clause) -> bool:
    """Whether its subject is a word for a thing that has parts: "the chair"."""
    names = clause.subject.names
    return bool(names) and {name[-1] for name in names} <= {*part_words()["objects"]}


def _how(tier: int) -> How:
    return "name" if tier >= WORD else "label" if tier == LABEL else "synonym"


class _Part:
    """What an asset calls a part."""

    def __init__(self, names: Phrase) -> None:
        self.exact = {" ".join(names[0].lower().split())} if names else set()
        self.own = part_name_words(names[0]) if names else ()
        self.label = frozenset(word for name in names[1:] for word in part_name_words(name))
        sided = {w for group in (*part_words()["places"], *part_words()["looks"]) for w in group}
        nouns = [w for w in self.own if w.isalpha() and w not in sided and len(w) > 1]
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
        if min(len(word), len(self.head)) >= _SHORTEST_INSIDE and (
            self.head.endswith(word) or word.endswith(self.head)
        ):
            return INSIDE
        return 0


def _fits(name: Phrase, parts: Sequence[_Part], clause: int) -> list[tuple[int, _Match]]:
    """Parts that a name speaks of: the best kind of match, and of these the most words."""
    exact = [i for i, part in enumerate(parts) if name and name == part.own]
    sides, forms = positions(name[:-1]), words()["attributes"]["empty"]
    found: list[tuple[int, _Match]] = []
    for i, part in enumerate(parts):
        tier = part.tier(name[-1]) if name else 0
        if not tier and name[-1:] and name[-1] in forms:  # "the butt section" of a part "butt"
            tier = max((part.tier(word) for word in name[-2:-1]), default=0)
        if exact and i not in exact and any(word.isdigit() for word in name):
            continue
        against = any(part.sides.get(axis, side) != side for axis, side in sides.items())
        if tier and not against:
            matched = {w for w in name if w in part.own or w in part.label}
            matched |= {side for axis, side in sides.items() if part.sides.get(axis) == side}
            found.append((i, _Match(tier, len(matched), clause)))
    if not found:
        return []
    # "the corner post" is "post_corner" before any other post.
    called = [(i, m) for i, m in found if len(name) > 1 and {*name} <= {*parts[i].own}]
    found = called or found
    best = max(match.tier for _, match in found)
    siblings = _siblings(name, found, parts)
    found = [(i, match) for i, match in found if match.tier == best or i in siblings]
    most = max(match.words for _, match in found)
    found = [(i, match) for i, match in found if match.words == most]
    strict = {axis: side for axis, side in sides.items() if axis < len(part_words()["places"])}
    told = any(parts[i].sides.get(axis) == side for i, _ in found for axis, side in strict.items())
    # "front legs" of a chair whose legs bear numbers: nobody knows which those are.
    return [] if strict and not told and len(found) > 1 else found


def _siblings(name: Phrase, found: list[tuple[int, _Match]], parts: Sequence[_Part]) -> set[int]:
    """Parts that a noun names with their first word as others with their last: "sail_jib"."""
    counted = any(word.isdigit() for part in parts for word in part.own)
    first = {i for i, _ in found if parts[i].own[:1] == name[-1:] and len(parts[i].own) == 2}
    return first if not counted and any(m.tier == HEAD for i, m in found if i in first) else set()


def _is_excepted(i: int, parts: Sequence[_Part], clause: Clause) -> bool:
    return any(i == j for name in clause.subject.exceptions for j, _ in _fits(name, parts, 0))


def parts_called(words: Phrase, labels: Sequence[Sequence[str]]) -> list[int]:
    """Indices of the parts that words name."""
    return [i for i, _ in _fits(words, [_Part(tuple(names)) for names in labels], 0)]
