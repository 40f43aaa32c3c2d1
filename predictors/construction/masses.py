"""Masses as intervals: between the thinnest wall that is likely and a solid, where nobody knows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

from ...fem.scene.materials import Material
from .construction import Construction


class MassInterval(NamedTuple):
    """Lightest and heaviest mass [kg] that is likely."""

    low: float
    high: float


def mass_interval(
    construction: Construction,
    row: Material,
    *,
    rho: float,
    volume: float,
    wall_volume: Callable[[float], float],
) -> MassInterval:
    """Return the masses between which a part of this construction lies.

    Parameters
    ----------
    row, rho
        Its material, whose range counts, and the density taken [kg/m^3], which may lie outside.
    volume
        Its volume [m^3].
    wall_volume
        Gives the volume [m^3] of a wall [m].
    """
    densities = (min(row.rho.min, rho), max(row.rho.max, rho))
    solid = [density * volume for density in densities]
    if construction.wall is None:
        return MassInterval(*solid)
    shells = [
        density * wall_volume(wall) + inside * (volume - wall_volume(wall))
        for density, wall, inside in product(densities, construction.wall, construction.inside)
    ]
    heaviest = solid if construction.form == "unknown" else shells
    return MassInterval(min(shells), max(heaviest))
