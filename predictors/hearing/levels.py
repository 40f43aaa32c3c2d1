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


# Place in the logarithmic range of a row, from "very soft" to "very stiff": halves of its halves,
# and nearly its ends.
SHARES = (0.04, 0.25, 0.5, 0.75, 0.96)

LEVELS: dict[str, Level] = {
    **{
        said: Level(stiffness=share)
        for said, share in zip(
            ("very soft", "soft", "medium", "stiff", "very stiff"), SHARES, strict=True
        )
    },
    "brittle": Level(stiffness=0.85, nu=0.1),
    **{
        said: Level(density=share)
        for said, share in zip(
            ("very light", "light", "average weight", "dense", "very dense"), SHARES, strict=True
        )
    },
    "floats": Level(floats=True),
    "sinks": Level(floats=False),
}


def material_at_level(row: Material, level: Level) -> MaterialValue:
    """Return E [Pa], nu [1], rho [kg/m^3] of a row, E and rho moved within its own ranges."""
    value = row.value(0.5 if level.stiffness is None else level.stiffness)
    share = 0.5 if level.density is None else level.density
    return value._replace(rho=row.rho.min ** (1 - share) * row.rho.max**share)
