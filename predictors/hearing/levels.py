"""Levels of stiffness and weight, and what they make of a material."""

from __future__ import annotations

from typing import NamedTuple

from ...fem.scene.materials import Material, MaterialValue


class Level(NamedTuple):
    """What a level asks for: shares of the ranges of E and rho (log) and nu, None where silent.

    ``floats`` puts rho below that of water (True) or above it (False).
    """

    stiffness: float | None = None
    density: float | None = None
    nu: float | None = None
    floats: bool | None = None


LEVELS: dict[str, Level] = {
    "very soft": Level(stiffness=0.04),
    "soft": Level(stiffness=0.25),
    "medium": Level(stiffness=0.5),
    "stiff": Level(stiffness=0.75),
    "very stiff": Level(stiffness=0.96),
    "brittle": Level(stiffness=0.85, nu=0.1),
    "very light": Level(density=0.04),
    "light": Level(density=0.25),
    "average weight": Level(density=0.5),
    "dense": Level(density=0.75),
    "very dense": Level(density=0.96),
    "floats": Level(floats=True),
    "sinks": Level(floats=False),
}


def material_at_level(row: Material, level: Level) -> MaterialValue:
    """Return E [Pa], nu [1], rho [kg/m^3] of a row, E and rho moved within its own ranges."""
    value = row.value(0.5 if level.stiffness is None else level.stiffness)
    share = 0.5 if level.density is None else level.density
    return value._replace(rho=row.rho.min ** (1 - share) * row.rho.max**share)
