"""How a part is built: solid, a wall around something, or nobody knows; and what it then weighs."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from ..fem.errors import InputError
from ..fem.note import Note
from ..fem.table import Material, MaterialTable, Span
from .text.parts import name_words, stem

Form = Literal["solid", "walls in its shape", "shell", "unknown"]
SHAPED: Form = "walls in its shape"

# Of the volume of its hull: a closed surface with less has its walls in its shape (a tube with a
# wall of a tenth of its radius has .19, an I-beam .14; a bottle's outside .8, two boxes of a car
# .75).
IN_ITS_SHAPE = 0.5
# Of the smallest side of the part: walls of hollow things of no known kind (a table tennis ball
# has 1 %, a boule or a tennis ball 8 %, a bucket 1 %).
ANY_WALL = Span(0.01, 0.1)
# Full, but not to the brim, and the brim is not the top: of the room inside.
FULL = Span(0.9, 1.0)
EMPTY = Span(0.0, 0.0)  # air
WATER = 1000.0  # kg/m^3: what a container may be full of
# What is cast, moulded, rolled or blown may be hollow; stone, wood, food and foam are taken as
# they look unless their name says that they are hollow.
HOLLOWED = frozenset({"metal", "plastic", "glass-ceramic", "elastomer", "hard elastomer"})
_SOLID, _HOLLOW = frozenset({"solid", "massive"}), frozenset({"hollow", "inflated", "inflatable"})


@dataclass(frozen=True)
class Construction:
    """How a part is built.

    part: Its name.
    form: Solid, with walls in its very shape, a shell, or unknown: then taken as solid.
    wall: Thickness of the wall [m], as an interval; None of a solid.
    inside: Mean density of what the wall holds [kg/m^3], 0 for air.
    filling: Row of the table that it is full of, or "".
    why: What decided.
    source: Where the interval is from.
    room_for: Density [kg/m^3] of what may be inside though nothing says so: of an interval of
        masses.
    """

    part: str
    form: Form
    why: str
    wall: Span | None = None
    inside: Span = EMPTY
    filling: str = ""
    source: str = ""
    room_for: float = 0.0

    @property
    def thickness(self) -> float:
        """The wall that is taken [m]: the middle of its interval."""
        return middle(self.wall) if self.wall else 0.0

    @property
    def sentence(self) -> str:
        """What it is taken as, and why, in words."""
        if self.form != "shell" or self.wall is None:
            taken = "solid" if self.form == "unknown" else self.form
            return f"taken as {taken}: {self.why}"
        full = "full of" if self.inside.min else Note("construction.half_full")
        held = f" {full} {self.filling}" if self.filling else ""
        held = held or (f" around {middle(self.inside):.3g} kg/m3" if self.inside.max else "")
        ends = " to ".join(dict.fromkeys(f"{1e3 * end:.2g}" for end in self.wall))
        return Note("construction.taken_wall", ends=ends, held=held, why=self.why)


@dataclass(frozen=True)
class ThingWords:
    """What the names of a part and the text say that it is.

    heads: Of its name, its other labels, the text and the name of the whole: stems up to the head.
    said: Stems of what the text says that it is.
    """

    heads: tuple[tuple[str, ...], ...]
    said: frozenset[str] = frozenset()

    @classmethod
    def of(
        cls, names: Sequence[str], *, thing: Sequence[str] = (), object_name: str = ""
    ) -> ThingWords:
        """Return the words of a part.

        names: Its name, then all other words the asset has for it.
        thing, object_name: What the text says that the object is, and what the asset is called: of
            the main part only.
        """
        said = tuple(stem(word) for word in thing)
        heads = [*map(head_of_name, names), said, head_of_name(object_name)]
        return cls(tuple(filter(None, heads)), frozenset(said))

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Kinds of the first name that has any."""
        return next((found for head in self.heads if (found := kinds_named(head))), ())

    def usual_material(self) -> tuple[str, str] | None:
        """Kind of a thing so called, and the row of the table that it is usually made of."""
        return next(((kind.name, kind.material) for kind in self.kinds if kind.material), None)


def construction_of(
    part: str,
    words: ThingWords,
    material: Material,
    *,
    hull_fraction: float = 1.0,
    smallest_side: float = 1.0,
    wall: float | None = None,
    solid: bool = False,
    filling: Material | None = None,
    in_mesh: bool = False,
    contents: MaterialTable | None = None,
) -> Construction:
    """Return how a part is built.

    part, words: Its name, and what it is called and said to be.
    material: What it is made of.
    hull_fraction, smallest_side: Its volume by that of its convex hull [1], the smallest side of
        its box [m].
    wall, solid, filling, in_mesh: What was said for certain: its wall [m], that it is solid, what
        it is full of; that the mesh has its walls already.
    contents: What things are called after that may hold it, "milk carton"; of no use to the full.
    """
    if solid or in_mesh:
        return Construction(part, SHAPED if in_mesh else "solid", "as told")
    inside = EMPTY
    if filling:
        inside = Span(FULL.min * filling.rho.min, FULL.max * filling.rho.max)
    name = filling.name if filling else ""
    if wall is not None:
        return Construction(part, "shell", "as told", Span(wall, wall), inside, name, "as told")
    if hull_fraction < IN_ITS_SHAPE:
        return Construction(
            part, SHAPED, Note("construction.hull_filled", hull_fraction=hull_fraction)
        )
    if words.said & _SOLID:
        return Construction(part, "solid", Note("construction.text_says"))
    # The kind for things of this material, else one for any, else the nearest there is
    kinds = words.kinds
    exact = [kind for kind in kinds if kind.category == material.category]
    kind = next(iter([*exact, *(kind for kind in kinds if not kind.category), *kinds]), None)
    empty = kind is not None and kind.holds and "empty" in words.said
    hollow = empty or bool(words.said & _HOLLOW)
    if kind and kind.hollow == "always" and not filling and kind.holds:
        # A container of which nothing says whether it is full: half, of what it is called after
        built = _shell(part, kind)
        if "empty" in words.said:
            return built
        # What stands before the head of a name that is called after it: of "milk carton", milk
        before = [head[-2] for head in words.heads if len(head) > 1 and kind in kinds_named(head)]
        rows = (contents.phrases.get(word) for word in before if contents and word not in _GENERIC)
        found = next(filter(None, rows), None)
        if found is None:
            return replace(built, room_for=WATER)
        most = FULL.max * found.rho.max
        return replace(built, inside=Span(0.0, most), filling=found.name)
    if kind and (kind.hollow == "always" or (kind.hollow == "often" and (hollow or filling))):
        shell = _shell(part, kind)
        return replace(shell, inside=inside, filling=name) if filling else shell
    any_wall = Span(*(share * smallest_side for share in ANY_WALL))
    if hollow or filling:
        why = Note("construction.said_full") if filling else Note("construction.said_hollow")
        guess = Note("construction.judgement_smallest")
        return Construction(part, "shell", why, any_wall, inside, name, guess)
    if kind and kind.hollow == "never":
        return Construction(part, "solid", f"the kind {kind.name!r}", source=kind.source)
    if kind:
        why = Note("construction.kind_hollow", name=kind.name)
        return Construction(part, "unknown", why, kind.wall, kind.inside, "", kind.source)
    if material.category in HOLLOWED:
        return Construction(part, "unknown", Note("construction.nothing_says"), any_wall)
    return Construction(part, "solid", Note("construction.taken_looks", name=material.name))


def _shell(part: str, kind: Kind) -> Construction:
    why = f"the kind {kind.name!r}"
    return Construction(part, "shell", why, kind.wall, kind.inside, source=kind.source)


# Masses as intervals: between the thinnest wall that is likely and a solid, where nobody knows.

SHAPE = 0.1  # of the volume of a drawn thing: its sizes are right to 3 %, its corners simplified
# What an everyday thing is made of if nothing says what.
ANYTHING = ("wood", "steel", "plastic", "ceramic", "rubber", "fabric")


class MassInterval(NamedTuple):
    """Lightest and heaviest mass [kg] that is likely."""

    low: float
    high: float


def mass_interval(
    construction: Construction,
    densities: Span,
    *,
    volume: float,
    wall_volume: Callable[[float], float],
) -> MassInterval:
    """Return the masses between which a part of this construction lies.

    densities: Of its material [kg/m^3].
    volume: Its volume [m^3].
    wall_volume: Gives the volume [m^3] of a wall [m].
    """
    found = [density * volume for density in densities]
    if construction.wall is not None:
        held = (*construction.inside, max(construction.room_for, construction.inside.max))
        shells = [
            density * wall_volume(wall) + inside * (volume - wall_volume(wall))
            for density, wall, inside in product(densities, construction.wall, held)
        ]
        found = [*found, *shells] if construction.form == "unknown" else shells
    return MassInterval((1 - SHAPE) * min(found), (1 + SHAPE) * max(found))


def densities_of(row: Material, rho: float, *, guessed: bool, table: MaterialTable) -> Span:
    """Densities [kg/m^3] that a material may have: its row's, or anything's where it is a guess.

    ``rho`` is the one taken, which may lie outside its row's.
    """
    rows = [table.exact(name) for name in ANYTHING] if guessed else [row]
    low, high = min(row.rho.min for row in rows), max(row.rho.max for row in rows)
    return Span(min(low, rho), max(high, rho))


# Kinds of things: their walls if they are hollow, what is in them, the words that name them.
#
# A thing is what the head of its name says: a bottle opener is no bottle, an object no box. So a
# kind's words must end the name ("water_bottle_02"), or the first noun phrase of a sentence ("an
# empty steel can", but not "the legs can bend").

PATH = Path(__file__).parents[1] / "fem" / "data" / "walls.csv"
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
    kinds = []
    rows: list[dict[str, Any]] = list(csv.DictReader(PATH.read_text("utf-8").splitlines()))
    for line, row in enumerate(rows, 2):
        wall = Span(float(row["wall_min_m"] or 0), float(row["wall_max_m"] or 0))
        inside = Span(float(row["inside_min_kg_m3"]), float(row["inside_max_kg_m3"]))
        walled = row["hollow"] != "never"
        if row["hollow"] not in get_args(Hollow) or walled != (0 < wall.min <= wall.max):
            raise InputError("construction.line_wanted", name=PATH.name, line=line)
        words = tuple(tuple(map(stem, words.split())) for words in row["words"].split(";"))
        same = {name: row[name] for name in ("name", "hollow", "category", "material", "source")}
        holds = row["holds"] == "yes"
        kinds.append(Kind(words=words, wall=wall, inside=inside, holds=holds, **same))
    return tuple(kinds)


@lru_cache(maxsize=4096)  # parts often share their words
def kinds_named(stems: tuple[str, ...]) -> tuple[Kind, ...]:
    """Kinds whose words end ``stems``: those with the most words, one for each category."""
    best = 0
    found: list[Kind] = []
    for kind in load_kinds():
        length = 0  # of the words that end ``stems``, also where a name writes two as one
        for words in kind.words:
            joined = len(words) > 1 and stems[-1:] == ("".join(words),)
            split = len(words) == 1 and len(stems) > 1 and words[0] == stems[-2] + stems[-1]
            if stems[-len(words) :] == words or joined or split:
                length = max(length, len(words))
        if length > best:
            best, found = length, []
        if length and length == best:
            found.append(kind)
    return tuple(found)


def head_of_name(name: str) -> tuple[str, ...]:
    """Stems of a part's, node's or file's name, up to its head: without what modellers append."""
    stems = name_words(name)
    while len(stems) > 1 and stems[-1] in _TAIL:
        stems.pop()
    return tuple(stems)


def middle(span: Span) -> float:
    """Geometric mean of a span; of one that begins at 0 its arithmetic mean."""
    return float(np.sqrt(span.min * span.max)) if span.min > 0 else (span.min + span.max) / 2
