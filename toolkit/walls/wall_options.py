"""Options of walls: what closed parts are inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from ...fem.errors import UsageError
from ..options import Repeated, pairs

EVERY = "*"  # in place of a part's name


@dataclass(frozen=True)
class WallOptions:
    """What closed parts are inside: solid, or a wall around something."""

    wall: float | None = None
    """Wall [m] of every closed part; by default what its kind of thing has, else it is solid."""
    part_wall: Annotated[tuple[str, ...], Repeated] = ()
    """Wall [m] of one part, NAME=METRES, or NAME=solid; may be repeated."""
    fill: Annotated[tuple[str, ...], Repeated] = ()
    """What walls hold: MATERIAL, or NAME=MATERIAL for one part; may be repeated."""
    solid: bool = False
    """Closed parts are solid, whatever they are called."""
    held: Annotated[tuple[str, ...], tyro.conf.Suppress] = ()
    """Parts whose walls the mesh has by itself: what a conversion found."""
    contents: Annotated[tuple[str, ...], tyro.conf.Suppress] = ()
    """Material of parts that are what walls hold, NAME=MATERIAL: what a conversion made."""

    def geometry(self) -> dict[str, Any]:
        """Return what the tetrahedraliser makes of it: walls [m] of parts that hold nothing."""
        walls, full = self.by_part(), self.fillings()
        hollow = {name: wall for name, wall in walls.items() if wall and EVERY not in full}
        return {
            "wall": None if EVERY in full or self.solid else self.wall,
            "part_wall": hollow,
            "solid": (
                *full,
                *self.held,
                *pairs(self.contents),
                *(name for name, wall in walls.items() if wall is None),
            ),
        }

    def wall_of(self, part: str) -> float | None:
        """Return the wall [m] that is said of a part, None where it is solid or nothing is said."""
        return self.by_part().get(part, None if self.solid else self.wall)

    def filling_of(self, part: str) -> str | None:
        """Return the material that a part is said to be full of."""
        full = self.fillings()
        return full.get(part, full.get(EVERY))

    def by_part(self) -> dict[str, float | None]:
        """Return the walls [m] of single parts, None for solid ones."""
        walls = pairs(self.part_wall).items()
        return {name: None if said == "solid" else _metres(said) for name, said in walls}

    def fillings(self) -> dict[str, str]:
        """Return the material that each part is full of; ``EVERY`` stands for all."""
        return pairs([said if "=" in said else f"{EVERY}={said}" for said in self.fill])


def _metres(value: str) -> float:
    try:
        return float(value)
    except ValueError as error:
        raise UsageError(
            f"wanted a wall in metres, NAME=0.003, or NAME=solid, got {value!r}"
        ) from error
