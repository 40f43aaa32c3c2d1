"""The text-first grammar: a clause is written first, and its numbers follow from what it says.

A clause speaks of a part, of two parts, of the whole object or of all matter of a kind; it names a
material of the table or a level of stiffness or weight. One frame in five, one wording in five and
one part/material pair in ten are held out of training.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from enum import IntEnum
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ...fem.table import Material, MaterialValue, load_table
from ...fem.table import key as key_of
from ...predictors.text.parts import KINDS, kind_of
from . import frames
from .frames import split_frames
from .objects import CATEGORIES, HELD_OUT, category_names
from .parts import LEVELS, Level, PartKind, material_at_level, part_kinds, spoken
from .shapes import Solid
from .wordings import adjective, sentence, wordings

HELD_OUT_PAIRS = 10  # part/material pairs: one in ten
WATER = 950.0  # kg/m^3: what floats is at most this dense, what sinks at least 1.1 times


class Role(IntEnum):
    """What a clause speaks of; ``key`` of a clause is an index into the list in brackets."""

    PART = 0  # one part [part kinds]
    PAIR = 1  # two parts [part pairs]
    WHOLE = 2  # the object [0, or 1 + category that it names]
    KIND = 3  # all matter of a kind [language.kinds.KINDS]
    OBJECT = 4  # what the object is: the default template [category]
    NAME = 5  # no sentence but the asset's own name of a part [part kinds]


class Phrase(NamedTuple):
    """A clause with what it asks for: the value of a material, or a level (index), or neither.

    ``value`` is E [Pa], nu [1], rho [kg/m^3].
    """

    text: str
    role: Role
    key: int
    level: int = -1
    value: MaterialValue | None = None


def is_held_out_pair(part: str, material: str) -> bool:
    """Whether a part is never called by this material in training; a fixed hash decides."""
    return zlib.crc32(f"{part}/{material}".encode()) % HELD_OUT_PAIRS == 0


@lru_cache(maxsize=1)
def _unseen() -> frozenset[str]:
    return frozenset(w for kind in part_kinds().values() if kind.held_out for w in kind.words)


def _is_seen(name: str) -> bool:
    """Whether a material's name holds no word of a part that is held out: "sailcloth"."""
    return _unseen().isdisjoint(name.split())


def spoken_names(material: Material) -> list[str]:
    """Return the words for a row of the table that mean this row and no other."""
    name = material.name.split(" (")[0]
    names = [*material.aliases, *([] if "," in name or "/" in name else [name])]
    phrases = load_table().phrases
    names = [word for word in dict.fromkeys(names) if _is_seen(word)]
    known = [word for word in names if phrases.get(key_of(word)) is material]
    return known or [name]


@lru_cache(maxsize=1)
def part_pairs() -> list[tuple[int, int]]:
    """Pairs of part kinds that occur together in some category, as sorted indices."""
    numbers = {name: i for i, name in enumerate(part_kinds())}
    pairs = set()
    for build in {**CATEGORIES, **HELD_OUT}.values():
        solid: Solid = build(np.random.default_rng(0))
        pairs |= set(combinations(sorted(numbers[part] for part in solid.parts), 2))
    return sorted(pairs)


def level_value(kind: PartKind, level: Level) -> MaterialValue:
    """Return E [Pa], nu [1], rho [kg/m^3] of a kind of part at a level."""
    shares = {"stiffness": level.stiffness, "density": level.density, "nu": level.nu}
    value = kind.value(**{name: share for name, share in shares.items() if share is not None})
    if level.floats is None:
        return value
    low, high = kind.rho_range
    if level.floats:
        high = min(high, WATER)
    else:
        low = max(low, 1.1 * WATER)
    # A range wholly on the wrong side of water: the nearest density that does as it is told.
    low, high = (high, high) if level.floats and low > high else (low, max(low, high))
    return value._replace(rho=(low * high) ** 0.5)


def _is(words: str) -> str:
    plural = words.endswith("s") and not words.endswith(("ss", "glasses"))
    return "are" if plural or words in ("leaves", "feet") else "is"


class Grammar:
    """Writes clauses; ``held_out`` chooses frames, wordings and pairs that training never sees."""

    def __init__(self, rng: np.random.Generator, *, held_out: bool = False) -> None:
        self.rng = rng
        self.held_out = held_out
        self.rows = [row for row in load_table() if _is_seen(spoken_names(row)[0])]
        self.kinds = list(part_kinds().values())
        self._frames = {
            role: split_frames(templates, held_out=held_out)
            for role, templates in (
                ("part", frames.PART),
                ("pair", frames.PAIR),
                ("whole", frames.WHOLE),
                ("kind", frames.KIND),
            )
        }
        self._wordings = {level: wordings(level, held_out=held_out) for level in LEVELS}

    def _pick(self, options: Sequence):
        return options[int(self.rng.integers(len(options)))]

    def _allowed(self, kind: PartKind) -> list[Material]:
        """Half of the time the part's plausible materials, else all; pairs as the split says."""
        rows = self.rows if self.rng.random() < 0.5 else kind.materials
        split = [r for r in rows if is_held_out_pair(kind.name, r.name) == self.held_out]
        return split or [
            r for r in self.rows if is_held_out_pair(kind.name, r.name) == self.held_out
        ]

    def part(self, key: int, material: Material | None = None) -> Phrase:
        """Return a clause that gives one part a material, one in six with a level of it."""
        kind = self.kinds[key]
        row = material or self._pick(self._allowed(kind))
        words, value = self._pick(spoken_names(row)), row.value()
        if self.rng.random() < 1 / 6:
            level = self._pick([name for name in LEVELS if LEVELS[name].floats is None])
            said = adjective(self._pick(self._wordings[level]))
            # "soft rubber" is a row of its own.
            if said and f"{said.split()[-1]} {words.lower()}" not in load_table().phrases:
                words, value = f"{said} {words}", material_at_level(row, LEVELS[level])
        p = self._pick(kind.words)
        text = self._pick(self._frames["part"]).format(p=p, m=words, **{"is": _is(p)})
        return Phrase(text, Role.PART, key, value=value)

    def part_level(self, key: int, level: str | None = None) -> Phrase:
        """Return a clause that gives one part a level of stiffness or weight."""
        level = level or self._pick(list(LEVELS))
        p, wording = self._pick(self.kinds[key].words), self._pick(self._wordings[level])
        said = adjective(wording)
        subject = self._pick(["the {p}", "the {p}", "its {p}", "whose {p}"]).format(p=p)
        text = sentence(subject, wording).replace(" is ", f" {_is(p)} ", 1)
        if said is not None and self.rng.random() < 0.5:
            text = self._pick(["{a} {p}", "a {a} {p}", "with a {a} {p}", "the {a} {p}"])
            text = text.format(a=said, p=p)
        return Phrase(text, Role.PART, key, level=list(LEVELS).index(level))

    def pair(self, key: int) -> Phrase:
        """Return a clause that gives two parts one material or one level."""
        first, second = (self.kinds[i] for i in part_pairs()[key])
        p, q = self._pick(first.words), self._pick(second.words)
        if self.rng.random() < 0.5:
            p, q = q, p
        if self.rng.random() < 0.3:
            level = self._pick(list(LEVELS))
            wording = self._pick(self._wordings[level])
            text = sentence(f"the {p} and the {q}", wording).replace(" is ", " are ", 1)
            return Phrase(text, Role.PAIR, key, level=list(LEVELS).index(level))
        row = self._pick(self._allowed(first))
        text = self._pick(self._frames["pair"])
        text = text.format(p=p, q=q, m=self._pick(spoken_names(row)))
        return Phrase(text, Role.PAIR, key, value=row.value())

    def _object(self, key: int) -> str:
        return spoken(category_names()[key - 1]) if key else self._pick(frames.GENERIC)

    def whole(self, key: int, material: Material | None = None) -> Phrase:
        """Return a clause that gives the whole object, or its rest, a material."""
        row = material or self._pick(self.rows)
        text = self._pick(self._frames["whole"])
        text = text.format(o=self._object(key), m=self._pick(spoken_names(row)))
        return Phrase(text, Role.WHOLE, key, value=row.value())

    def whole_level(self, key: int, level: str | None = None) -> Phrase:
        """Return a clause that gives the whole object a level."""
        level = level or self._pick(list(LEVELS))
        wording, name = self._pick(self._wordings[level]), self._object(key)
        subject = self._pick(["the {o}", "everything", "it", "this {o}", "the whole {o}"])
        said, text = adjective(wording), sentence(subject.format(o=name), wording)
        if said is not None and self.rng.random() < 0.5:
            text = self._pick(["a {a} {o}", "this is a {a} {o}", "{a} {o}"]).format(a=said, o=name)
        return Phrase(text, Role.WHOLE, key, level=list(LEVELS).index(level))

    def kind(self, key: int) -> Phrase:
        """Return a clause about all matter of a kind ("the wood is oak")."""
        word = KINDS[key]
        rows = [r for r in self.rows if word in (kind_of(r.name), kind_of(spoken_names(r)[0]))]
        row = self._pick(rows)
        if self.rng.random() < 0.3:
            said = self._pick(["{k}", "made of {k}", "{k} parts", "some {k}", "of {k}", "with {k}"])
            row = load_table().exact("leaf" if word == "plant" else word)
            return Phrase(said.format(k=word), Role.KIND, key, value=row.value())
        text = self._pick(self._frames["kind"]).format(k=word, m=self._pick(spoken_names(row)))
        return Phrase(text, Role.KIND, key, value=row.value())

    def name(self, key: int) -> Phrase:
        """Return a part as a modelling program calls it: "leg", "leg_steel" or "oak leg"."""
        kind = self.kinds[key]
        word = self._pick(kind.words)
        if self.rng.random() < 0.5:
            return Phrase(word, Role.NAME, key)
        row = self._pick(self._allowed(kind))
        said = self._pick(["{m} {p}", "{p} {m}", "{m}", "{p} mat {m}"])
        return Phrase(
            said.format(m=self._pick(spoken_names(row)), p=word), Role.NAME, key, value=row.value()
        )


def object_phrases(names: Sequence[str]) -> Iterator[Phrase]:
    """The default template and its like for objects of these names; the key is the index."""
    for key, name in enumerate(names):
        for frame in frames.OBJECT:
            yield Phrase(frame.format(o=spoken(name).lower()), Role.OBJECT, key)


def write_phrases(
    rng: np.random.Generator, *, per_part: int = 300, held_out: bool = False
) -> list[Phrase]:
    """Return the distinct clauses of training (or of the tests); ``per_part`` scales the corpus."""
    grammar, out = Grammar(rng, held_out=held_out), []
    seen_kinds = [i for i, kind in enumerate(grammar.kinds) if held_out or not kind.held_out]
    pairs = [i for i, pair in enumerate(part_pairs()) if set(pair) <= set(seen_kinds)]
    for key in seen_kinds:
        out += [grammar.part(key) for _ in range(int(per_part * 0.64))]
        out += [grammar.part_level(key) for _ in range(int(per_part * 0.36))]
        out += [grammar.name(key) for _ in range(per_part // 10)]
    for key in pairs:
        out += [grammar.pair(key) for _ in range(max(2, per_part // 25))]
    for key in range(1 + len(CATEGORIES)):
        count = per_part * 10 if key == 0 else per_part // 8
        out += [grammar.whole(key) for _ in range(count)]
        out += [grammar.whole_level(key) for _ in range(count // 4)]
    for key in range(len(KINDS)):
        out += [grammar.kind(key) for _ in range(per_part // 2)]
    return list(dict.fromkeys(out))
