"""A proposal: the range of matter of every part of an object, and what must hold between parts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from ....fem.errors import InputError, UsageError
from ....fem.mpm.materials import MaterialClass
from ....fem.table import FIELDS, NU_CAP, Band, MaterialValue, Span
from ..constraints import always_holds

# E [Pa] from the softest gel to beyond diamond, rho [kg/m^3] from aerogel to beyond osmium.
_BOUNDS = {"E": (1e1, 2e12), "nu": (0.0, NU_CAP), "rho": (0.5, 3e4)}
_MOST_CONSTRAINTS = 60  # two fields of all pairs of six parts


class End(StrEnum):
    """An end of a range."""

    SOFT = "soft"
    STIFF = "stiff"


@dataclass(frozen=True)
class PartRange:
    """What a part may be made of.

    Parameters
    ----------
    band
        [min, max] of E [Pa], nu [1] and rho [kg/m^3].
    matter
        Class at the soft end, and at the stiff one.
    text
        What the part is called.
    synonyms
        Words that a segmentation by pictures may find it by.
    told
        Whether the name states the matter: then the range is that of one row of the table.
    rigid
        Ends at which it is simulated as rigid, because its waves are too fast to follow.
    even_rho
        Whether the dial leaves its density alone, at the geometric mean.
    """

    band: Band
    matter: tuple[MaterialClass, MaterialClass] = (MaterialClass.JELLY, MaterialClass.JELLY)
    text: str = ""
    synonyms: tuple[str, ...] = ()
    told: bool = False
    rigid: tuple[End, ...] = ()
    even_rho: bool = False

    def value(self, end: End) -> MaterialValue:
        """Return E [Pa], nu [1] and rho [kg/m^3] at an end."""
        side = 0 if end == End.SOFT else 1
        rho = math.sqrt(self.band.rho.min * self.band.rho.max)
        return MaterialValue(
            self.band.E[side], self.band.nu[side], rho if self.even_rho else self.band.rho[side]
        )

    def with_end(self, end: End, E: float) -> PartRange:
        """Return it with one end of E [Pa] moved, never beyond the other."""
        low, high = self.band.E
        moved = Span(min(E, high), high) if end == End.SOFT else Span(low, max(E, low))
        return replace(self, band=self.band._replace(E=moved))

    def document(self) -> dict[str, Any]:
        """Plain data, as ``range_from`` reads it."""
        return {
            "text": self.text,
            **{name: list(getattr(self.band, name)) for name in FIELDS},
            "class": [kind.name.lower() for kind in self.matter],
            "synonyms": list(self.synonyms),
            "told": self.told,
            "rigid": [str(end) for end in self.rigid],
            "even_rho": self.even_rho,
        }


@dataclass(frozen=True)
class Proposal:
    """Ranges by part, and constraints such as "pot.E > soil.E" that every sample must meet."""

    parts: Mapping[str, PartRange]
    constraints: tuple[str, ...] = ()

    @property
    def bands(self) -> dict[str, Band]:
        """Ranges of E [Pa], nu [1] and rho [kg/m^3] by part."""
        return {name: part.band for name, part in self.parts.items()}

    def broken(self) -> list[str]:
        """Return the constraints that a sample of the ranges may break, or that cannot be read."""
        return [line for line in self.constraints if not _met(line, self.bands)]

    def with_part(self, name: str, part: PartRange) -> Proposal:
        """Return it with one part changed."""
        return replace(self, parts={**self.parts, name: part})

    def document(self) -> dict[str, Any]:
        """Plain data, as ``proposal_from`` reads it."""
        parts = {name: part.document() for name, part in self.parts.items()}
        return {"parts": parts, "constraints": list(self.constraints)}


def _met(constraint: str, bands: Mapping[str, Band]) -> bool:
    try:
        return always_holds(constraint, bands)
    except UsageError:
        return False


def proposal_from(document: Any, parts: Sequence[str]) -> Proposal:
    """Check a proposal of unknown quality, of a model or a person, for an object with ``parts``.

    Nothing is repaired and nothing in it is run. Raises ``InputError`` where it lacks a part, or a
    range is empty or outside of what matter can be.
    """
    given = document.get("parts") if isinstance(document, Mapping) else None
    if not isinstance(given, Mapping) or set(given) != set(parts):
        raise InputError(f"ranges for {sorted(map(str, given or ()))}, wanted {sorted(parts)}")
    lines = document.get("constraints") or []
    if not isinstance(lines, list) or len(lines) > _MOST_CONSTRAINTS:
        raise InputError(f"constraints: wanted a list of at most {_MOST_CONSTRAINTS} lines")
    ranges = {name: range_from(name, given[name]) for name in parts}
    return Proposal(ranges, tuple(map(str, lines)))


def range_from(name: str, given: Any) -> PartRange:
    """Check the range of one part; ``InputError`` where it is none."""
    if not isinstance(given, Mapping):
        raise InputError(f"{name}: no range")
    band = Band(*(_span(name, field, given.get(field)) for field in FIELDS))
    try:
        classes = given.get("class", "jelly")
        pair = [classes, classes] if isinstance(classes, str) else classes
        soft, stiff = (MaterialClass[str(kind).upper()] for kind in pair)
        rigid = tuple(End(end) for end in given.get("rigid", ()))
    except (KeyError, TypeError, ValueError) as error:
        known = ", ".join(kind.name.lower() for kind in MaterialClass)
        raise InputError(
            f"{name}: {error} is not known; class is one or two of {known}, rigid soft or stiff"
        ) from error
    synonyms = given.get("synonyms", ())
    if not isinstance(synonyms, list | tuple):
        raise InputError(f"{name}: synonyms: wanted a list of words")
    return PartRange(
        band=band, matter=(soft, stiff), text=str(given.get("text", name)),
        synonyms=tuple(map(str, synonyms)), told=given.get("told") is True, rigid=rigid,
        even_rho=given.get("even_rho") is True,
    )  # fmt: skip


def _span(part: str, field: str, given: Any) -> Span:
    try:
        low, high = map(float, given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{part}: {field} = {given!r}: wanted [min, max]") from error
    least, most = _BOUNDS[field]
    if not least <= low <= high <= most:  # a NaN is outside too
        raise InputError(
            f"{part}: {field} = [{low:g}, {high:g}]: wanted min <= max inside {least:g} .. {most:g}"
        )
    return Span(low, high)
