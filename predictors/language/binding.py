"""Which clauses speak of which part of an asset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from ..vocabulary.lexicon import known_parts, part_words
from ..vocabulary.part_names import HEAD, LABEL, WORD, PartLabels, PartMatch, parts_named
from .clauses import Clause, Sentence

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
    parts = [PartLabels(tuple(names)) for names in labels]
    matches: list[dict[int, PartMatch]] = [{} for _ in parts]
    for other in (False, True):  # "the other legs" are those that nothing else names
        for k, clause in enumerate(clauses):
            if clause.subject.scope == "parts" and _is_other(clause) == other:
                for i, match in _spoken_of(clause, parts).items():
                    if not (other and matches[i]):
                        matches[i][k] = match
    lost = [k for k, c in enumerate(clauses) if c.subject.scope == "parts"]
    lost = [k for k in lost if not any(k in found for found in matches)]
    whole, rest, lost = _general(clauses, lost, matches, parts)
    bound = []
    for i, found in enumerate(matches):
        ks = sorted(found, key=lambda k: (-found[k].words, -found[k].tier, k))
        naming = [k for k in ks if clauses[k].material]
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
    return clause.subject.names[0][:1] == ("other",)


def _spoken_of(clause: Clause, parts: Sequence[PartLabels]) -> dict[int, PartMatch]:
    """Parts that a clause names, less its exceptions."""
    if _is_other(clause):
        return {i: PartMatch(HEAD, 1) for i in parts_named(clause.subject.names[0][1:], parts)}
    found = {i: m for name in clause.subject.names for i, m in parts_named(name, parts).items()}
    return {i: m for i, m in found.items() if not _is_excepted(i, parts, clause)}


def _only_excludes(clause: Clause) -> bool:
    whole = clause.subject.scope != "parts"
    return whole and not replace(clause, excluded=()).says_matter


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
    heads = {name[-1] for name in clause.subject.names}
    return bool(heads) and heads <= {*part_words()["objects"]}


def _is_excepted(i: int, parts: Sequence[PartLabels], clause: Clause) -> bool:
    return any(i in parts_named(name, parts) for name in clause.subject.exceptions)
