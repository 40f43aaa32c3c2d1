"""The material table: [min, max] of E, nu, rho of everyday materials, with sources and bands.

Tables beside it know of some rows, by their names, strength, grain, colour and flow.
"""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal, NamedTuple, cast, get_args

import numpy as np

from .errors import InputError, UsageError
from .note import Note

DATA = Path(__file__).parent / "data"
TABLE_PATH, CONTENTS_PATH = DATA / "materials.csv", DATA / "contents.csv"
# A displacement-based element locks as nu -> .5, where lam is infinite; .495 keeps lam < 100 mu.
NU_CAP = 0.495
FIELDS = ("E", "nu", "rho")
_COLUMNS = {
    "E": ("E_min_Pa", "E_max_Pa"),
    "nu": ("nu_min", "nu_max"),
    "rho": ("rho_min", "rho_max"),
}


class MaterialValue(NamedTuple):
    """One value of E [Pa], nu [1] and rho [kg/m^3]."""

    E: float
    nu: float
    rho: float


class Span(NamedTuple):
    """Lowest and highest value of a quantity, in its SI unit."""

    min: float
    max: float


# Name and category of a matter of which nothing is known but its numbers.
AS_STATED = "as stated"


class Band(NamedTuple):
    """What is physically possible in a category: E [Pa], nu [1], rho [kg/m^3]."""

    E: Span
    nu: Span
    rho: Span


def _records(path: str | Path) -> list[dict[str, str]]:
    """Records of a table in CSV, by the names of its columns."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except OSError as error:
        raise InputError("table.cannot_read", error=error) from error


def _span(record: Mapping[str, str], low: str, high: str) -> Span:
    return Span(float(record[low]), float(record[high]))


# Set by hand from what such matter can be, not from the rows, and so narrow that no row survives a
# slip of a factor 1000 (GPa for MPa, g/cm^3 for kg/m^3): one global band would let rubber at 1 GPa
# through.
# Examples: indium to tungsten carbide, aerated concrete to jade, fat to cheese, wood across its
# grain to snakewood along it, fluorinated rubber as the densest elastomer, horn as soft bone,
# polyethylene fibres as the lightest composite.
CATEGORIES: Mapping[str, Band] = {
    record["name"]: Band(*(_span(record, *_COLUMNS[field]) for field in FIELDS))
    for record in _records(DATA / "categories.csv")
}


@dataclass(frozen=True)
class Material:
    """A row of the table.

    name, category: Its unique name and the key of its band in ``CATEGORIES``.
    E, nu, rho: [min, max] of Young's modulus [Pa], Poisson's ratio [1] and density [kg/m^3].
    source, note: Where the numbers come from, and what to know about them.
    aliases: Everyday words that mean this row ("steel" is carbon steel).
    estimated: Those of E, nu, rho that are engineering estimates, without a source.
    grade: A grade, a species or another special kind ("AISI 304", "snakewood"): taken where it is
        named, never by nearness.
    """

    name: str
    category: str
    E: Span
    nu: Span
    rho: Span
    source: str
    note: str = ""
    aliases: tuple[str, ...] = ()
    estimated: tuple[str, ...] = ()
    grade: bool = False

    def value(self, alpha: float = 0.5) -> MaterialValue:
        """Return E [Pa], nu [1], rho [kg/m^3]; ``alpha`` moves E from soft (0) to stiff (1).

        E is taken within [min, max] in log space (.5 is the geometric mean), rho is the geometric
        mean of its range and nu the arithmetic mean, capped at ``NU_CAP``.
        """
        if not 0 <= alpha <= 1:
            raise UsageError("table.alpha_must", alpha=alpha)
        E = self.E.min ** (1 - alpha) * self.E.max**alpha
        nu = min((self.nu.min + self.nu.max) / 2, NU_CAP)
        return MaterialValue(E, nu, (self.rho.min * self.rho.max) ** 0.5)


def material_of_values(value: MaterialValue) -> Material:
    """Row of a matter that is known by its ``value`` alone: no kind, and no strength."""
    E, nu, rho = (Span(number, number) for number in value)
    return Material(AS_STATED, AS_STATED, E, nu, rho, source=AS_STATED)


def outside_band(category: str, E: float, nu: float, rho: float) -> list[str]:
    """Return one sentence for each of E [Pa], nu [1], rho [kg/m^3] outside the category's band."""
    band = CATEGORIES.get(category)
    if band is None:  # what is only stated may be of any
        if category != AS_STATED:
            names = ", ".join(CATEGORIES)
            raise UsageError("table.unknown_category", category=category, categories=names)
        spans = zip(*CATEGORIES.values(), strict=True)
        band = Band(*(Span(min(s.min for s in of), max(s.max for s in of)) for of in spans))
    complaints = []
    for field, value, (low, high) in zip(FIELDS, (E, nu, rho), band, strict=True):
        limit = "nu < 0.5 and " if field == "nu" and value >= 0.5 else ""
        if limit or not low <= value <= high:  # a NaN is outside too
            unit = {"E": "Pa", "nu": "1", "rho": "kg/m^3"}[field]
            complaints.append(
                Note(
                    "table.outside_wanted",
                    field=field,
                    value=value,
                    unit=unit,
                    category=category,
                    limit=limit,
                    low=low,
                    high=high,
                )
            )
    return complaints


def key(name: str) -> str:
    """Return a name as it is compared: lower case, one space, hyphens as spaces."""
    return " ".join(name.replace("-", " ").replace("_", " ").lower().split())


class MaterialTable:
    """The rows of a table, found by name or alias whatever the case and the spaces."""

    def __init__(self, rows: tuple[Material, ...]) -> None:
        self.rows = rows
        self.phrases: dict[str, Material] = {}
        for row in rows:
            # Reject swapped limits and values outside the category's band
            name = row.name
            for field in FIELDS:
                low, high = getattr(row, field)
                if not low <= high:
                    raise InputError(
                        "table.material_min", name=name, field=field, low=low, high=high
                    )
            # Rubber's nu may touch .5, the incompressible limit; the value taken is below it.
            nu_max = min(row.nu.max, NU_CAP) if row.nu.max == 0.5 else row.nu.max
            for end in ((row.E.min, row.nu.min, row.rho.min), (row.E.max, nu_max, row.rho.max)):
                complaints = outside_band(row.category, *end)
                if complaints:
                    raise InputError(f"material {name!r}: {'; '.join(complaints)}")
            for phrase in map(key, (name, *row.aliases)):
                if phrase in self.phrases:
                    other = self.phrases[phrase].name
                    raise InputError("table.names_materials", name=phrase, other=other, name_2=name)
                self.phrases[phrase] = row

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Material]:
        return iter(self.rows)

    @property
    def categories(self) -> Mapping[str, Band]:
        """Bands of E [Pa], nu [1], rho [kg/m^3] by category."""
        return CATEGORIES

    def exact(self, name: str) -> Material:
        """Return the row of a name or alias; an unknown one is a ``UsageError`` with a hint."""
        if key(name) in self.phrases:
            return self.phrases[key(name)]
        near = ", ".join(map(repr, self.near(name)))
        hint = Note("table.you_mean", near=near) if near else Note("table.try_simpler")
        raise UsageError("table.material_table", name=name, hint=hint)

    def near(self, name: str) -> list[str]:
        """Return up to three names and aliases that are spelled nearly so, the nearest first."""
        return difflib.get_close_matches(key(name), self.phrases, n=3, cutoff=0.6)

    def search(self, query: str = "") -> list[Material]:
        """Rows whose name, aliases or category hold every word of the query, best match first."""
        words = key(query)

        whole = re.compile(rf"\b{re.escape(words)}\b")

        def rank(row: Material) -> int:
            names = [key(row.name), *map(key, row.aliases)]
            found = (words in names, whole.search(names[0]), whole.search(text(row)), True)
            return next(i for i, there in enumerate(found) if there)

        def text(row: Material) -> str:
            return key(" ".join([row.name, row.category, *row.aliases]))

        rows = (row for row in self.rows if all(word in text(row) for word in words.split()))
        return sorted(rows, key=rank)  # equals stay in the table's order


def row_of_record(record: Mapping[str, str], place: str) -> Material:
    """Return the row of a CSV's record; ``place`` says in errors where it stands."""

    def span(field: str) -> Span:
        columns = _COLUMNS[field]
        try:
            return _span(record, *columns)
        except (KeyError, TypeError, ValueError) as error:
            names = " and ".join(columns)
            raise InputError(
                "table.wanted_number", place=place, columns=names, error=error
            ) from error

    return Material(
        name=record["name"],
        category=record["category"],
        E=span("E"),
        nu=span("nu"),
        rho=span("rho"),
        source=record["source"],
        note=record.get("note") or "",
        aliases=tuple(filter(None, (record.get("aliases") or "").split(";"))),
        estimated=tuple((record.get("estimated") or "").split()),
        grade=record.get("grade") == "yes",
    )


@lru_cache(maxsize=4)
def load_table(path: str | Path | None = None) -> MaterialTable:
    """Materials with lowest and highest E [Pa], nu [1] and rho [kg/m^3], each with its source.

    Parameters
    ----------
    path
        A CSV with the columns of the packaged table; None: that one.

    Returns
    -------
    MaterialTable
        ``exact(name)`` is a row, ``search(words)`` those that match; ``value()`` of a row has one
        number each.

    Raises
    ------
    InputError
        Where the file cannot be read or a row is not valid.

    Examples
    --------
    >>> from autophyx_tet.fem import load_table
    >>> oak = load_table().exact("oak")
    >>> oak.category, oak.E[0] <= oak.value().E <= oak.E[1]
    ('wood', True)
    """
    records = _records(path or TABLE_PATH)
    missing = {"name", "category", "source"} - set(records[0] if records else ())
    if missing:
        names = ", ".join(sorted(missing))
        raise InputError("table.material_table_column", path=path, missing=names)
    lines = [Note("table.material_table_line", at=at) for at in range(2, len(records) + 2)]
    return MaterialTable(tuple(map(row_of_record, records, lines)))


def load_contents() -> MaterialTable:
    """Return what fills things: "coffee", "water", "books" as liquids and loose bulk.

    A table of its own, because as words of materials these would take "coffee table" and
    "water bottle": ask it for what stands after "full of" only.
    """
    return load_table(CONTENTS_PATH)


StrengthKind = Literal["yield", "ultimate", "crushing"]


@dataclass(frozen=True)
class Strength:
    """The stress at which a material gives way.

    kind: What happens there: ``yield`` (it stays bent: metals, tough plastics, foams), ``ultimate``
        (it breaks: wood, glass, rubber, laminates) or ``crushing`` (it breaks, and is used in
        compression: stone, concrete).
    tension: Lowest and highest stress in tension [Pa]: soft to hard temper, poor to good quality.
        Of wood and of glass it is the modulus of rupture in bending, along the grain.
    compression: The same in compression [Pa]; None where it is as strong as in tension.
    source: Where the numbers come from.
    """

    kind: StrengthKind
    tension: Span
    compression: Span | None
    source: str

    def limit(self, *, compression: bool = False) -> float:
        """Return the lowest stress [Pa] that may be too much, in tension or in compression."""
        return (self.compression or self.tension if compression else self.tension).min


class OrthotropicConstants(NamedTuple):
    """Elastic constants along L (grain), R (radial), T (tangential): E, G [Pa] and nu [1].

    ``nu_LR`` is the contraction along R under stress along L; nu_RL = nu_LR E_R / E_L. Of many
    solids each is an array.
    """

    E_L: float | np.ndarray
    E_R: float | np.ndarray
    E_T: float | np.ndarray
    G_LR: float | np.ndarray
    G_LT: float | np.ndarray
    G_RT: float | np.ndarray
    nu_LR: float | np.ndarray
    nu_LT: float | np.ndarray
    nu_RT: float | np.ndarray

    def times(self, factor: np.ndarray) -> OrthotropicConstants:
        """Constants of solids ``factor`` [1] times as stiff, one each."""
        ones = np.ones_like(factor)
        return OrthotropicConstants(*(c * factor for c in self[:6]), *(c * ones for c in self[6:]))


@dataclass(frozen=True)
class Grain:
    """Elastic ratios of a material with a grain or fibres, all relative to E along them.

    ER, ET: E across the grain, radial and tangential to the rings, over E along it [1].
    GLR, GLT, GRT: Shear moduli over E along the grain [1].
    nu_LR, nu_LT, nu_RT: Poisson's ratios [1]; the first letter is the direction of the stress.
    source: Where the numbers come from.
    estimated: Those of them that are engineering estimates.
    """

    ER: float
    ET: float
    GLR: float
    GLT: float
    GRT: float
    nu_LR: float
    nu_LT: float
    nu_RT: float
    source: str
    estimated: tuple[str, ...] = ()

    def constants(self, E: float) -> OrthotropicConstants:
        """Return the nine constants of a material with ``E`` [Pa] along its grain.

        The E of a wood's row is its apparent modulus in bending, shear included: about 10 % below
        the E_L of a pure pull (Wood Handbook, chapter 5).
        """
        moduli = (E, E * self.ER, E * self.ET, E * self.GLR, E * self.GLT, E * self.GRT)
        return OrthotropicConstants(*moduli, self.nu_LR, self.nu_LT, self.nu_RT)


@dataclass(frozen=True)
class CrossStrength:
    """Strengths of a material with a grain or fibres, beside those along them.

    tension, compression: Stress across the grain that it stands [Pa].
    shear: Shear stress that it stands along the grain [Pa].
    source: Where the numbers come from.
    estimated: Those of them that are estimates, by the row's own strengths along the grain and
        what is usual for its category.
    """

    tension: float
    compression: float
    shear: float
    source: str
    estimated: tuple[str, ...] = ()


@dataclass(frozen=True)
class Colour:
    """The typical colour of a bare material, not painted: CIE L*a*b* of 1976 at D65.

    L, a, b: Lightness 0 to 100, green to red, blue to yellow [1].
    spread: Standard deviation of the distance from it (CIE 1976 Delta E) [1]: 5 is a shade, 15 a
        species or a batch, above 30 it comes in all colours.
    source: Where the colour comes from, or ``judgement``.
    """

    L: float
    a: float
    b: float
    spread: float
    source: str


@dataclass(frozen=True)
class Flow:
    """How a material flows, slides or breaks; None where that is not known.

    yield_stress: Lowest and highest stress at which a paste begins to flow [Pa].
    viscosity: Of a liquid, or of a paste beyond its yield stress [Pa s].
    friction: Angle of internal friction of grains [deg].
    fracture: Energy of a crack [J/m^2].
    source, estimated: Where the numbers come from, and which of them are estimates.
    """

    yield_stress: Span | None
    viscosity: Span | None
    friction: Span | None
    fracture: Span | None
    source: str
    estimated: tuple[str, ...] = ()


@lru_cache(maxsize=1)
def load_strengths() -> Mapping[str, Strength]:
    """Return the strengths by the name of the row."""
    strengths = {}
    for record in _records(DATA / "strength.csv"):
        name, kind = record["name"], record["kind"]
        if kind not in get_args(StrengthKind):
            raise InputError("table.strength_unknown", record=name, record_2=kind)
        tension = _span(record, "tension_min_Pa", "tension_max_Pa")
        pressed = record["compression_min_Pa"]
        compression = _span(record, "compression_min_Pa", "compression_max_Pa") if pressed else None
        strengths[name] = Strength(cast(StrengthKind, kind), tension, compression, record["source"])
    return strengths


@lru_cache(maxsize=1)
def load_grains() -> Mapping[str, Grain]:
    """Return the grains by the name of the row: of woods and of laminates in one direction."""
    ratios = ("ER", "ET", "GLR", "GLT", "GRT", "nu_LR", "nu_LT", "nu_RT")
    return {
        record["name"]: Grain(
            **{ratio: float(record[ratio]) for ratio in ratios},
            source=record["source"],
            estimated=tuple(record["estimated"].split()),
        )
        for record in _records(DATA / "grain.csv")
    }


@lru_cache(maxsize=1)
def load_cross_strengths() -> Mapping[str, CrossStrength]:
    """Return strengths across the grain by the name of the row: of all that have a grain.

    What is not known is a share of the strength along the grain: the median of those of its
    category whose strengths are known, or of all.
    """
    sides, strengths, table = ("tension", "compression", "shear"), load_strengths(), load_table()
    records = {record["name"]: record for record in _records(DATA / "across.csv")}
    known = {
        (name, side): float(record[f"{side}_Pa"])
        for name, record in records.items()
        for side in sides
        if record[f"{side}_Pa"]
    }

    def along(name: str, side: str) -> float:
        return strengths[name].limit(compression=side != "tension")

    def usual(name: str, side: str) -> float:
        shares = {other: known[other, side] / along(other, side) for other in records
                  if (other, side) in known}  # fmt: skip
        category = table.exact(name).category
        alike = [x for other, x in shares.items() if table.exact(other).category == category]
        return float(np.median(alike or [*shares.values()])) * along(name, side)

    found = {}
    for name in load_grains().keys() & strengths.keys():
        values = [known.get((name, side)) or usual(name, side) for side in sides]
        estimated = tuple(side for side in sides if (name, side) not in known)
        source = records[name]["source"] if name in records else ""
        found[name] = CrossStrength(*values, source=source, estimated=estimated)
    return found


@lru_cache(maxsize=1)
def load_colours() -> Mapping[str, Colour]:
    """Return the typical colours by the name of the row."""
    return {
        record["name"]: Colour(
            *(float(record[column]) for column in ("L", "a", "b", "spread")),
            source=record["source"],
        )
        for record in _records(DATA / "colour.csv")
    }


@lru_cache(maxsize=1)
def load_flows() -> Mapping[str, Flow]:
    """Return how materials flow, slide or break by the name of the row, contents among them."""
    columns = ("yield_{}_Pa", "viscosity_{}_Pa_s", "friction_{}_deg", "fracture_{}_J_m2")
    flows = {}
    for record in _records(DATA / "flow.csv"):
        ends = [(record[c.format("min")], record[c.format("max")]) for c in columns]
        spans = [Span(float(low), float(high)) if low else None for low, high in ends]
        estimated = tuple(record["estimated"].split())
        flows[record["name"]] = Flow(*spans, source=record["source"], estimated=estimated)
    return flows


class Bulk(NamedTuple):
    """What many pieces and the air between them are: a row, and how thick a piece is [m]."""

    name: str
    piece: float


@lru_cache(maxsize=1)
def load_bulks() -> Mapping[str, Bulk]:
    """Return what is meant by a body far thicker than a piece of a row, by the row's name."""
    records = _records(DATA / "bulk.csv")
    return {r["name"]: Bulk(r["bulk"], float(r["piece_m"])) for r in records}


# Apparent material: a solid that weighs and bends as the wall and the filling that it stands for.
#
# A wall too thin for its own elements is smeared over the solid inside the same surface. With bars
# for the wall and its filling side by side, and J = integral of z^2 over the body about its
# centroid, z along its shortest principal axis:
#
# rho = phi rho_wall + (1 - phi) rho_inside      phi  = V_wall / V     mass kept E J = E_wall
# J_wall + E_inside J_inside        beta = J_wall / J     bending stiffness kept
#
# J is that of Euler and Bernoulli's E I = E integral of z^2 dA, taken over the body. For a plate
# of height h between skins t it gives the sandwich law beta = 1 - (1 - 2 t / h)^3, for a tube beta
# = 1 - (r / R)^4 (Roark's Formulas for Stress and Strain, ch. 8). What is not kept: stretching
# along the wall is stiffer than it is (by beta / phi <= 3), a dent in a wall is not seen at all.


@dataclass(frozen=True)
class WallShare:
    """The wall's share of a body: ``volume`` phi [1] and ``bending`` beta [1], both in (0, 1]."""

    volume: float
    bending: float

    def __post_init__(self) -> None:
        for name in ("volume", "bending"):
            value = getattr(self, name)
            if not 0 < value <= 1:
                raise InputError("table.walls_share", name=name, value=value)

    def stiffness(self, wall, inside: float):
        """Apparent E [Pa] of a wall and what it holds; ``wall`` may be an array of any shape."""
        return self.bending * wall + (1 - self.bending) * inside

    def density(self, wall, inside: float):
        """Apparent rho [kg/m^3] of a wall and what it holds; ``wall`` may be an array."""
        return self.volume * wall + (1 - self.volume) * inside


def apparent_material(
    wall: MaterialValue, share: WallShare, *, inside_rho: float = 0.0, inside_E: float = 0.0
) -> MaterialValue:
    """Return E [Pa], nu [1], rho [kg/m^3] of the solid that stands for a wall and its filling.

    ``inside_rho`` [kg/m^3] and ``inside_E`` [Pa] are those of what it holds, 0 for air.
    """
    return MaterialValue(
        share.stiffness(wall.E, inside_E), wall.nu, share.density(wall.rho, inside_rho)
    )
