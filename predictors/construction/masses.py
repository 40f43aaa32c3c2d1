"""Masses as intervals: between the thinnest wall that is likely and a solid, where nobody knows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

from ...fem.scene.materials import Material, MaterialTable, Span
from .construction import Construction

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

    Parameters
    ----------
    densities
        Of its material [kg/m^3].
    volume
        Its volume [m^3].
    wall_volume
        Gives the volume [m^3] of a wall [m].
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
