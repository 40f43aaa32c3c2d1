"""The material chosen for each part, and the field that follows from it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..fem.scene.materials import FIELDS, Material, MaterialValue
from .field import MaterialField, Ranges
from .voxels import PartVoxels


class Binding(NamedTuple):
    """What the network understood of one part: the clause that took most of it, and how surely.

    ``share`` of the part's cells follow the clause (None: the text does not speak of them);
    ``spread`` is the mean deviation of log10 E between views of the object from several sides.
    """

    clause: str | None
    share: float
    voxels: int
    spread: float


@dataclass(frozen=True)
class PartChoice:
    """The material of one part, and why.

    Parameters
    ----------
    part
        Name of the part.
    row
        The row of the table, or the one nearest to what the network found.
    value
        E [Pa], nu [1], rho [kg/m^3] at ``alpha``.
    weight
        1 for a word that names it, else its share in the kernel.
    alpha
        Place of E in the row's range, from soft (0) to stiff (1), in log space.
    why
        The clause or the label that decided.
    told
        Whether words settle it: the text's for this part or for all, an option's, or the asset's.
    binding
        What was understood of the part, where the network decided.
    learned
        Whether the values are the network's own, and no row's.
    """

    part: str
    row: Material
    value: MaterialValue
    weight: float
    alpha: float
    why: str
    told: bool = True
    binding: Binding | None = None
    learned: bool = False

    @property
    def material(self) -> str:
        """Name of the row in the table, "like" it for values of the network's own."""
        return f"like {self.row.name}" if self.learned else self.row.name

    @property
    def source(self) -> str:
        """Where the numbers come from."""
        return "FiLM network" if self.learned else self.row.source


def fill(
    parts: PartVoxels, choices: Sequence[PartChoice], *, alpha: float | None = None
) -> MaterialField:
    """Return the field that gives every cell the values and ranges of its part's material."""
    names = sorted({choice.material for choice in choices})
    cell = np.where(parts.occupied, parts.part, 0)

    def of_parts(values: Iterable) -> np.ndarray:
        return np.array(list(values))[cell]

    E, nu, rho = (of_parts(getattr(choice.value, name) for choice in choices) for name in FIELDS)
    ranges = [of_parts(tuple(getattr(choice.row, name)) for choice in choices) for name in FIELDS]
    material = of_parts(names.index(choice.material) for choice in choices)
    return MaterialField(
        grid=parts.grid,
        occupied=parts.occupied,
        E=E,
        nu=nu,
        rho=rho,
        part=parts.part,
        part_names=parts.part_names,
        material=np.where(parts.occupied, material, -1),
        material_names=tuple(names),
        ranges=Ranges(*ranges),
        alpha=alpha,
    )
