"""Kinds of things: their walls if they are hollow, what is in them, the words that name them.

A thing is what the head of its name says: a bottle opener is no bottle, an object no box. So a
kind's words must end the name ("water_bottle_02"), or the first noun phrase of a sentence ("an
empty steel can", but not "the legs can bend").
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from ...fem.errors import InputError
from ...fem.scene.materials import Material, MaterialTable, Span
from ..hearing.vocabulary import name_words, stem

PATH = Path(__file__).parents[2] / "fem" / "data" / "walls.csv"
_GENERIC = frozenset({"drink", "beverage", "food"})  # words for anything that one may hold
# Behind the head of a name: what modellers append to it.
_TAIL = frozenset(
    "mesh geo geometry obj object model body main outer outside shell low high poly lowpoly "
    "highpoly lod final new old copy version default material mat texture empty full closed "
    "v a b c d e l r s m x xl".split()
)


Hollow = Literal["always", "often", "never"]


@dataclass(frozen=True)
class Kind:
    """A kind of thing: ``wall`` [m], mean density ``inside`` [kg/m^3], and the usual ``material``.

    Only of materials of ``category``, where one is given; ``words`` are stems, phrase by phrase. It
    ``holds`` something, as a bottle does, or stands for itself, as a ball.
    """

    name: str
    words: tuple[tuple[str, ...], ...]
    wall: Span
    inside: Span
    hollow: Hollow
    category: str
    material: str
    source: str
    holds: bool = False


@lru_cache(maxsize=1)
def load_kinds() -> tuple[Kind, ...]:
    """Return the rows of ``walls.csv``."""
    with PATH.open(encoding="utf-8", newline="") as file:
        return tuple(_read(row, line) for line, row in enumerate(csv.DictReader(file), 2))


def _read(row: dict[str, Any], line: int) -> Kind:
    wall = Span(float(row["wall_min_m"] or 0), float(row["wall_max_m"] or 0))
    inside = Span(float(row["inside_min_kg_m3"]), float(row["inside_max_kg_m3"]))
    walled = row["hollow"] != "never"
    if row["hollow"] not in get_args(Hollow) or walled != (0 < wall.min <= wall.max):
        raise InputError(f"{PATH.name}, line {line}: wanted 0 < min <= max of a wall, if any")
    return Kind(
        name=row["name"],
        words=tuple(tuple(map(stem, words.split())) for words in row["words"].split(";")),
        wall=wall,
        inside=inside,
        hollow=row["hollow"],
        category=row["category"],
        material=row["material"],
        source=row["source"],
        holds=row["holds"] == "yes",
    )


@lru_cache(maxsize=4096)  # parts often share their words
def kinds_named(stems: tuple[str, ...]) -> tuple[Kind, ...]:
    """Kinds whose words end ``stems``: those with the most words, one for each category."""
    best = 0
    found: list[Kind] = []
    for kind in load_kinds():
        length = max((_ending(words, stems) for words in kind.words), default=0)
        if length > best:
            best, found = length, []
        if length and length == best:
            found.append(kind)
    return tuple(found)


def _ending(words: Sequence[str], stems: Sequence[str]) -> int:
    """Number of ``words`` if ``stems`` end with them, also where a name writes two as one."""
    tail = tuple(stems[-len(words) :])
    joined = len(words) > 1 and stems[-1:] == ["".join(words)]
    split = len(words) == 1 and len(stems) > 1 and words[0] == stems[-2] + stems[-1]
    return len(words) if tail == tuple(words) or joined or split else 0


def head_of_name(name: str) -> tuple[str, ...]:
    """Stems of a part's, node's or file's name, up to its head: without what modellers append."""
    stems = name_words(name)
    while len(stems) > 1 and stems[-1] in _TAIL:
        stems.pop()
    return tuple(stems)


def content_named(stems: Sequence[str], contents: MaterialTable) -> Material | None:
    """What stands before the head of a name that is called after it: of "milk carton", milk."""
    before = stems[-2] if len(stems) > 1 else ""
    return None if before in _GENERIC else contents.phrases.get(before)


def middle(span: Span) -> float:
    """Geometric mean of a span; of one that begins at 0 its arithmetic mean."""
    return float(np.sqrt(span.min * span.max)) if span.min > 0 else (span.min + span.max) / 2
