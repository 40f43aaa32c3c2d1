"""What "soft" or "heavy" mean where no material is named: bands of E and rho, and rows in them."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from typing import get_args

from ...fem.scene.materials import Material, MaterialValue, Span
from ..hearing.levels import SHARES
from ..language.clauses import Degree

# E [Pa] by degree. After the chart of E and rho of Ashby, Materials Selection in Mechanical
# Design, fig. 4.3: gels and the softest foams; soft foams and the softest rubbers; rubbers,
# leather, corks, flexible polymers; polymers, woods, glass, concrete; metals and ceramics.
STIFFNESS: dict[Degree, Span] = {
    1: Span(1e3, 1e5),
    2: Span(1e4, 1e6),
    3: Span(1e6, 1e9),
    4: Span(1e9, 1e11),
    5: Span(5e10, 6e11),
}
# rho [kg/m^3] by degree, the same chart: foams; cork, balsa and woods that float well; woods and
# polymers; glass, stone and light metals; heavy metals.
DENSITY: dict[Degree, Span] = {
    1: Span(5, 150),
    2: Span(50, 700),
    3: Span(500, 1500),
    4: Span(1500, 9000),
    5: Span(7000, 20000),
}
# What is said to be flexible, floppy or pliable: rubbers, fabrics, films, and thin stiffer matter.
FLEXIBLE = Span(1e5, 1e8)
NEARLY = 1.5  # as light as the lightest that is as stiff: aluminium beside carbon fibre
# Place of a degree in the logarithmic range of E or rho of a row that is named.
PLACE: dict[Degree, float] = dict(zip(get_args(Degree), SHARES, strict=True))
WATER = 1000.0  # [kg/m^3]
# Words for behaviour -> the categories that behave so, by what each is known for (Ashby, fig. 4.7:
# fracture toughness; elastomers return what they take up).
BEHAVING: dict[str, frozenset[str]] = {
    "brittle": frozenset({"glass-ceramic", "stone"}),
    "tough": frozenset({"metal", "composite", "plastic"}),
    "bouncy": frozenset({"elastomer"}),
}


def shared_span(a: Span, b: Span) -> Span | None:
    """Return what two ranges share, None for nothing."""
    low, high = max(a.min, b.min), min(a.max, b.max)
    return Span(low, high) if low <= high else None


def behaves(row: Material, character: Iterable[str]) -> bool:
    """Whether a row is known to behave as all these words say; unknown words hold for all."""
    for word in character:
        if word == "floats" and row.rho.min >= WATER:
            return False
        if word == "sinks" and row.rho.max <= WATER:
            return False
        if word in BEHAVING and row.category not in BEHAVING[word]:
            return False
    return True


def rows_at(
    rows: Iterable[Material],
    *,
    stiffness: Degree | None,
    density: Degree | None,
    character: Collection[str] = (),
    excluded: Collection[str] = (),
) -> list[Material]:
    """Rows that can be as stiff and heavy, and behave, as said; less what is ruled out.

    Where no matter is both, as "very stiff and very light", the stiff ones that come nearest.
    """
    left = [
        row
        for row in rows
        if not {row.name, row.category} & set(excluded) and behaves(row, character)
    ]
    E, rho = stiffness_band(stiffness, character), DENSITY.get(density) if density else None
    stiff = [row for row in left if E is None or shared_span(row.E, _core(E))]
    if rho is None or not stiff:
        return stiff
    apart = {row.name: _apart(row.rho, rho) for row in stiff}
    least = min(apart.values())
    return [row for row in stiff if apart[row.name] <= least + math.log(NEARLY)]


def stiffness_band(stiffness: Degree | None, character: Collection[str]) -> Span | None:
    """E [Pa] that a degree means: what is flexible is thin or rubbery, not always soft."""
    if stiffness is None:
        return None
    return FLEXIBLE if "flexible" in character and stiffness < 3 else STIFFNESS[stiffness]


def value_at(
    row: Material,
    *,
    stiffness: Degree | None,
    density: Degree | None,
    character: Collection[str] = (),
    absolute: bool,
) -> MaterialValue:
    """Value of a row at degrees: within its range, or as near to the ``absolute`` bands' middle."""
    value = row.value(0.5)
    band = stiffness_band(stiffness, character)
    if stiffness is not None and band is not None:
        value = value._replace(E=_near(row.E, band) if absolute else _placed(row.E, stiffness))
    if density is not None:
        near = _near(row.rho, DENSITY[density])
        value = value._replace(rho=near if absolute else _placed(row.rho, density))
    return value


def _near(span: Span, band: Span) -> float:
    """Return what of a range lies nearest to the middle of a band."""
    return min(span.max, max(span.min, math.sqrt(band.min * band.max)))


def _core(band: Span) -> Span:
    """Return the middle half of a band, in logarithms: what is meant, not what is just possible."""
    quarter = (band.max / band.min) ** 0.25
    return Span(band.min * quarter, band.max / quarter)


def _apart(span: Span, band: Span) -> float:
    """Return the logarithmic distance of two ranges, 0 where they meet."""
    return max(0.0, math.log(band.min / span.max), math.log(span.min / band.max))


def _placed(span: Span, degree: Degree) -> float:
    return span.min ** (1 - PLACE[degree]) * span.max ** PLACE[degree]
