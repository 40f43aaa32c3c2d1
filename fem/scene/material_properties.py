"""What else is known of a row of the material table: how strong it is, its grain, its colour.

Rows are found by their name in the table; a row that no source speaks of has none.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np

from ..errors import InputError
from .materials import TABLE_PATH, Span

StrengthKind = Literal["yield", "ultimate", "crushing"]


@dataclass(frozen=True)
class Strength:
    """The stress at which a material gives way.

    Parameters
    ----------
    kind
        What happens there: ``yield`` (it stays bent: metals, tough plastics, foams), ``ultimate``
        (it breaks: wood, glass, rubber, laminates) or ``crushing`` (it breaks, and is used in
        compression: stone, concrete).
    tension
        Lowest and highest stress in tension [Pa]: soft to hard temper, poor to good quality. Of
        wood and of glass it is the modulus of rupture in bending, along the grain.
    compression
        The same in compression [Pa]; None where it is as strong as in tension.
    source
        Where the numbers come from.
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

    Parameters
    ----------
    ER, ET
        E across the grain, radial and tangential to the rings, over E along it [1].
    GLR, GLT, GRT
        Shear moduli over E along the grain [1].
    nu_LR, nu_LT, nu_RT
        Poisson's ratios [1]; the first letter is the direction of the stress.
    source
        Where the numbers come from.
    estimated
        Those of them that are engineering estimates.
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
        return OrthotropicConstants(
            E_L=E,
            E_R=E * self.ER,
            E_T=E * self.ET,
            G_LR=E * self.GLR,
            G_LT=E * self.GLT,
            G_RT=E * self.GRT,
            nu_LR=self.nu_LR,
            nu_LT=self.nu_LT,
            nu_RT=self.nu_RT,
        )


@dataclass(frozen=True)
class Colour:
    """The typical colour of a bare material, not painted: CIE L*a*b* of 1976 at D65.

    Parameters
    ----------
    L, a, b
        Lightness 0 to 100, green to red, blue to yellow [1].
    spread
        Standard deviation of the distance from it (CIE 1976 Delta E) [1]: 5 is a shade, 15 a
        species or a batch, above 30 it comes in all colours.
    source
        Where the colour comes from, or ``judgement``.
    """

    L: float
    a: float
    b: float
    spread: float
    source: str


@dataclass(frozen=True)
class Flow:
    """How a material flows, slides or breaks; None where that is not known.

    Parameters
    ----------
    yield_stress
        Lowest and highest stress at which a paste begins to flow [Pa].
    viscosity
        Of a liquid, or of a paste beyond its yield stress [Pa s].
    friction
        Angle of internal friction of grains [deg].
    fracture
        Energy of a crack [J/m^2].
    source, estimated
        Where the numbers come from, and which of them are estimates.
    """

    yield_stress: Span | None
    viscosity: Span | None
    friction: Span | None
    fracture: Span | None
    source: str
    estimated: tuple[str, ...] = ()


def _records(table: str) -> list[dict[str, str]]:
    """Records of a table beside the material table, by the names of its columns."""
    path = TABLE_PATH.with_name(f"{table}.csv")
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except OSError as error:
        raise InputError(f"cannot read the table of {table}: {error}") from error


@lru_cache(maxsize=1)
def load_strengths() -> Mapping[str, Strength]:
    """Return the strengths by the name of the row."""
    return {record["name"]: _strength(record) for record in _records("strength")}


def _strength(record: Mapping[str, str]) -> Strength:
    def span(side: str) -> Span:
        return Span(float(record[f"{side}_min_Pa"]), float(record[f"{side}_max_Pa"]))

    kind = next((known for known in get_args(StrengthKind) if known == record["kind"]), None)
    if kind is None:
        raise InputError(f"strength of {record['name']!r}: unknown kind {record['kind']!r}")
    brittle = bool(record["compression_min_Pa"])
    compression = span("compression") if brittle else None
    return Strength(kind, span("tension"), compression, record["source"])


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
        for record in _records("grain")
    }


@lru_cache(maxsize=1)
def load_colours() -> Mapping[str, Colour]:
    """Return the typical colours by the name of the row."""
    return {
        record["name"]: Colour(
            L=float(record["L"]),
            a=float(record["a"]),
            b=float(record["b"]),
            spread=float(record["spread"]),
            source=record["source"],
        )
        for record in _records("colour")
    }


@lru_cache(maxsize=1)
def load_flows() -> Mapping[str, Flow]:
    """Return how materials flow, slide or break by the name of the row, contents among them."""
    columns = ("yield_{}_Pa", "viscosity_{}_Pa_s", "friction_{}_deg", "fracture_{}_J_m2")
    found = {}
    for record in _records("flow"):
        ends = [(record[c.format("min")], record[c.format("max")]) for c in columns]
        spans = [Span(float(low), float(high)) if low else None for low, high in ends]
        estimated = tuple(record["estimated"].split())
        found[record["name"]] = Flow(*spans, source=record["source"], estimated=estimated)
    return found
