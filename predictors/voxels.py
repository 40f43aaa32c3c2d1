"""Voxels with part labels: the shape of an asset or a mesh on a grid, before any material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from ..fem.errors import InputError
from .grid import Grid


@dataclass(frozen=True, eq=False)
class PartVoxels:
    """Part of every cell of a grid: an index into ``part_names``, -1 outside.

    ``labels`` are all the words the asset has for each part (node, group and material names).
    """

    grid: Grid
    part: Int[np.ndarray, "nx ny nz"]
    part_names: tuple[str, ...]
    labels: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        if self.part.shape != self.grid.shape:
            raise InputError(f"part has shape {self.part.shape}, the grid {self.grid.shape}")
        if self.part.min() < -1 or self.part.max() >= len(self.part_names):
            raise InputError(
                f"part labels {self.part.min()}..{self.part.max()} with "
                f"{len(self.part_names)} part names: wanted -1 (outside) or an index"
            )
        if not self.labels:
            object.__setattr__(self, "labels", tuple((name,) for name in self.part_names))

    @property
    def occupied(self) -> Bool[np.ndarray, "nx ny nz"]:
        """Cells inside some part."""
        return self.part >= 0
