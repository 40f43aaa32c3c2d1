"""The voxel grid: cell-centred, cubic cells, metres. One definition for the whole project."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from ..fem.errors import InputError

# More cells than this is a request that no 24 GiB machine should try (2^28 float64 = 2 GiB).
MAX_CELLS = 2**28


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of cubic cells; the centre of cell ``i`` is ``lo + (i + 1/2) h``.

    Parameters
    ----------
    lo
        Lower corner [m] of cell (0, 0, 0), shape (3,).
    h
        Edge of a cell [m].
    shape
        Cells along x, y, z.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.predictors import Grid
    >>> Grid(np.zeros(3), 0.5, (2, 2, 2)).centers()[1, 0, 0].tolist()  # m
    [0.75, 0.25, 0.25]
    """

    lo: Float[np.ndarray, "3"]
    h: float
    shape: tuple[int, int, int]

    def __post_init__(self) -> None:
        lo = np.asarray(self.lo, dtype=np.float64)
        shape = tuple(map(int, self.shape))
        if lo.shape != (3,) or not np.isfinite(lo).all():
            raise InputError("grid.grid_corner", lo=lo)
        if not (np.isfinite(self.h) and self.h > 0):
            raise InputError("grid.grid_cell", h=self.h)
        if len(shape) != 3 or min(shape) < 1 or np.prod(shape, dtype=np.float64) > MAX_CELLS:
            raise InputError("grid.grid_shape", max_cells=MAX_CELLS, shape=shape)
        object.__setattr__(self, "lo", lo)
        object.__setattr__(self, "h", float(self.h))
        object.__setattr__(self, "shape", shape)

    @classmethod
    def around(cls, bounds, *, cells: int = 64, pad: int = 1) -> Grid:
        """Return the grid with ``cells`` along the longest side of ``bounds`` (2, 3) [m].

        ``pad`` empty cells are added on every side.
        """
        lo, hi = np.asarray(bounds, dtype=np.float64)
        size = hi - lo
        if not (np.isfinite(size).all() and (size >= 0).all() and size.max() > 0):
            raise InputError("grid.bounds_must", lo=lo, hi=hi)
        h = size.max() / cells
        counts = np.maximum(np.ceil(size / h - 1e-9), 1).astype(int)  # 1e-9: round-off of size / h
        slack = (counts * h - size) / 2
        nx, ny, nz = (int(n) for n in counts + 2 * pad)
        return cls(lo - slack - pad * h, h, (nx, ny, nz))

    @property
    def hi(self) -> Float[np.ndarray, "3"]:
        """Upper corner [m] of the last cell."""
        return self.lo + np.array(self.shape) * self.h

    def to_world(self, index: Shaped[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """World position [m] of a (fractional) cell index; integers give cell centres."""
        return self.lo + (np.asarray(index, dtype=np.float64) + 0.5) * self.h

    def to_index(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Fractional cell index of world positions [m]; cell centres give integers."""
        return (np.asarray(points, dtype=np.float64) - self.lo) / self.h - 0.5

    def cell_of(self, points: Float[np.ndarray, "*n 3"]) -> Shaped[np.ndarray, "*n 3"]:
        """Integer index of the cell that contains each point [m]; may lie outside the grid."""
        return np.floor((np.asarray(points, dtype=np.float64) - self.lo) / self.h).astype(np.int64)

    def contains(self, cells: Shaped[np.ndarray, "*n 3"]) -> Bool[np.ndarray, "*n"]:
        """Whether integer cell indices lie inside the grid."""
        return np.all((cells >= 0) & (cells < np.array(self.shape)), axis=-1)

    def centers(self) -> Float[np.ndarray, "nx ny nz 3"]:
        """Centres [m] of all cells."""
        return self.to_world(np.stack(np.meshgrid(*map(np.arange, self.shape), indexing="ij"), -1))


# The parts of an asset on a grid: what a predictor is given, and its cells as elements.


@dataclass(frozen=True, eq=False)
class PartVoxels:
    """Which part of the asset fills each cell of a grid.

    grid: The grid [m].
    part: Index into ``part_names`` of every cell, -1 outside the object, shape (nx, ny, nz).
    part_names: Unique names of the parts.
    labels: For each part, all words the asset has for it (node, group, material names); () for
        none.
    shapes: For each part the first one of its shape, by number; () where shapes were not compared.
    """

    grid: Grid
    part: Int[np.ndarray, "nx ny nz"]
    part_names: tuple[str, ...]
    labels: tuple[tuple[str, ...], ...] = ()
    shapes: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.part.shape != self.grid.shape:
            raise InputError("grid.part_shape", shape=self.part.shape, shape_2=self.grid.shape)
        if not self.labels:
            object.__setattr__(self, "labels", ((),) * len(self.part_names))
        if not self.shapes:
            object.__setattr__(self, "shapes", tuple(range(len(self.part_names))))
        names, low, high = len(self.part_names), int(self.part.min()), int(self.part.max())
        if len(self.labels) != names:
            raise InputError("grid.got_labels", count=len(self.labels), count_2=names)
        if len(self.shapes) != names:
            raise InputError("grid.got_shapes", count=len(self.shapes), count_2=names)
        if low < -1 or not 0 <= high < names:
            raise InputError("grid.part_indices", count=names - 1, low=low, high=high)

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
