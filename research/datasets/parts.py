"""Kinds of parts and what they may be made of, and what "soft" or "heavy" make of a material."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from ...fem.table import NU_CAP, Material, MaterialValue, load_table
from ...predictors.resolve.resolve import SHARES, material_at
from ...predictors.text.english import DATA


@dataclass(frozen=True)
class PartKind:
    """A kind of part: its words and the rows of the table it may plausibly be made of."""

    name: str
    words: tuple[str, ...]
    materials: tuple[Material, ...]
    held_out: bool = False

    def value(
        self, *, stiffness: float = 0.5, density: float = 0.5, nu: float = 0.5
    ) -> MaterialValue:
        """Return E [Pa], nu [1], rho [kg/m^3] at places of the range that its materials span.

        E and rho move in log space; one half everywhere is the mean that unmentioned parts get.
        """
        E_low, E_high = (f(m.E[i] for m in self.materials) for i, f in enumerate((min, max)))
        rho_low, rho_high = (f(m.rho[i] for m in self.materials) for i, f in enumerate((min, max)))
        nus = [m.value().nu for m in self.materials]
        poisson = max(0.0, min(nus) + nu * (max(nus) - min(nus)))
        return MaterialValue(
            E_low ** (1 - stiffness) * E_high**stiffness,
            min(poisson, NU_CAP),
            rho_low ** (1 - density) * rho_high**density,
        )

    @property
    def rho_range(self) -> tuple[float, float]:
        """Lowest and highest density [kg/m^3] of its materials."""
        return min(m.rho.min for m in self.materials), max(m.rho.max for m in self.materials)


@lru_cache(maxsize=1)
def part_kinds() -> dict[str, PartKind]:
    """Every kind of part by name; the held-out ones last."""
    table, kinds = load_table(), {}
    tables = tomllib.loads((DATA / "part_kinds.toml").read_text(encoding="utf-8"))
    for section, rows in tables.items():
        for name, row in rows.items():
            words, materials = (
                tuple(item.strip() for item in side.split(",")) for side in row.split("|")
            )
            known = tuple(table.exact(material) for material in materials)
            kinds[name] = PartKind(name, words, known, section == "held_out")
    return kinds


def spoken(category: str) -> str:
    """Return the name of a category as people say it: "potted plant"."""
    return category.replace("_", " ")


class Level(NamedTuple):
    """What a level asks for: shares of the ranges of E and rho (log) and nu, None where silent.

    ``floats`` puts rho below that of water (True) or above it (False).
    """

    stiffness: float | None = None
    density: float | None = None
    nu: float | None = None
    floats: bool | None = None


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
    return material_at(row, stiffness=level.stiffness, density=level.density)
