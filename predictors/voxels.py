"""The parts of an asset on a grid: what a predictor is given, and its cells as elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.errors import InputError
from ..fem.scene.box import box_mesh
from ..fem.scene.mesh import TetMesh
from .grid import Grid

TETS_PER_CELL = 6


@dataclass(frozen=True, eq=False)
class PartVoxels:
    """Which part of the asset fills each cell of a grid.

    Parameters
    ----------
    grid
        The grid [m].
    part
        Index into ``part_names`` of every cell, -1 outside the object, shape (nx, ny, nz).
    part_names
        Unique names of the parts.
    labels
        For each part, all words the asset has for it (node, group, material names); () for none.
    shapes
        For each part the first one of its shape, by number; () where shapes were not compared.
    """

    grid: Grid
    part: Int[np.ndarray, "nx ny nz"]
    part_names: tuple[str, ...]
    labels: tuple[tuple[str, ...], ...] = ()
    shapes: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.part.shape != self.grid.shape:
            raise InputError(f"part has shape {self.part.shape}, the grid {self.grid.shape}")
        if not self.labels:
            object.__setattr__(self, "labels", ((),) * len(self.part_names))
        if not self.shapes:
            object.__setattr__(self, "shapes", tuple(range(len(self.part_names))))
        if len(self.labels) != len(self.part_names):
            raise InputError(f"got labels for {len(self.labels)} of {len(self.part_names)} parts")
        if len(self.shapes) != len(self.part_names):
            raise InputError(f"got shapes for {len(self.shapes)} of {len(self.part_names)} parts")
        low, high = int(self.part.min()), int(self.part.max())
        if low < -1 or not 0 <= high < len(self.part_names):
            raise InputError(
                f"part indices must lie in -1 .. {len(self.part_names) - 1} with a cell inside, "
                f"got {low} .. {high}"
            )

    @property
    def occupied(self) -> Bool[np.ndarray, "nx ny nz"]:
        """Cells inside the object."""
        return self.part >= 0

    @property
    def part_labels(self) -> list[Sequence[str]]:
        """For each part its name, then its other labels."""
        return [(name, *labels) for name, labels in zip(self.part_names, self.labels, strict=True)]

    @property
    def volumes(self) -> list[float]:
        """Volume [m^3] of the cells of each part."""
        counts = np.bincount(self.part[self.occupied], minlength=len(self.part_names))
        return (counts * self.grid.h**3).tolist()


def pooled(
    values: Float[np.ndarray, "nx ny nz c"], part: Int[np.ndarray, "nx ny nz"]
) -> Float[np.ndarray, "nx ny nz c"]:
    """Mean of values over the cells of every part, 0 outside."""
    inside = part >= 0
    label = part[inside]
    count = np.bincount(label).clip(min=1)
    rows = np.stack(
        [np.bincount(label, weights=column) / count for column in values[inside].T], axis=-1
    )
    out = np.zeros_like(values)
    out[inside] = rows[label]
    return out


def voxel_mesh(occupied: Bool[np.ndarray, "x y z"]) -> TetMesh:
    """Six tets in every occupied cell, in C order; the grid's longest side is 1 m."""
    shape = np.array(occupied.shape)
    box = box_mesh((shape / shape.max()).tolist(), occupied.shape)
    tets = box.tets[np.repeat(occupied.ravel(), TETS_PER_CELL)]
    used, corner = np.unique(tets, return_inverse=True)
    return TetMesh.oriented(box.points[used], corner.reshape(-1, 4))


def blocks(values: np.ndarray, cells: int) -> np.ndarray:
    """Voxels (x, y, z, ...) by block (a, b, d, voxels, ...), at most ``cells`` blocks a side.

    Zeros, which are outside, fill what is missing to whole blocks.
    """
    size = -(-max(values.shape[:3]) // cells)
    rest_of = values.shape[3:]
    pad = [(0, -n % size) for n in values.shape[:3]] + [(0, 0)] * len(rest_of)
    values = np.pad(values, pad)
    a, b, d = (n // size for n in values.shape[:3])
    split = values.reshape(a, size, b, size, d, size, *rest_of)
    return np.moveaxis(split, (1, 3, 5), (3, 4, 5)).reshape(a, b, d, size**3, *rest_of)
