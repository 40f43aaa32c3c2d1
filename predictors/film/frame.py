"""The grid that the FiLM network sees: the object's box upright, at the size of training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.up import UpAxis, half_turn
from ..voxels import PartVoxels

# Cells along the longest side in training; a grid with fewer or more than these is resampled.
TRAINED_CELLS, FEWEST_CELLS, MOST_CELLS = 62, 48, 64
# A thin object in a thinner grid would meet the deepest cells where training never put it: measured
# on two of them, the right clause fell from .99 to .4.
STEP = 64


@dataclass(frozen=True, eq=False)
class Frame:
    """The network's grid: the object's box, z up, resampled if need be, padded to its step.

    ``source`` holds, for every cell of the box, the cell of the upright grid behind it, as an index
    in C order; ``box`` the object's first cell and its number of cells along each upright axis.
    """

    axes: tuple[int, int, int]
    flip: tuple[int, ...]
    source: Int[np.ndarray, "x y z"]
    box: tuple[tuple[int, int], ...]
    inside: tuple[int, int, int]
    low: tuple[int, int, int]
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, parts: PartVoxels, up: UpAxis, *, step: int = STEP) -> Frame:
        """Frame of the occupied box of ``parts``, in the middle of a cube as in training."""
        axes, flip = {"z": ((0, 1, 2), ()), "y": ((0, 2, 1), (1,)), "x": ((2, 1, 0), (0,))}[up[-1]]
        turned = half_turn(up)
        flip = tuple(i for i in range(3) if (i in flip) != (turned[axes[i]] < 0))
        upright = np.flip(parts.part.transpose(axes), flip)
        sides = [np.flatnonzero((upright >= 0).any(axis=tuple({0, 1, 2} - {i}))) for i in range(3)]
        box = tuple((int(cells[0]), int(cells[-1] - cells[0] + 1)) for cells in sides)
        longest = max(size for _, size in box)
        scale = 1.0 if FEWEST_CELLS <= longest <= MOST_CELLS else TRAINED_CELLS / longest
        x, y, z = (max(1, round(size * scale)) for _, size in box)
        i, j, k = (-(-m // step) * step for m in (x, y, z))
        low = (i - x) // 2, (j - y) // 2, (k - z) // 2
        return cls(axes, flip, _source(upright, box, (x, y, z)), box, (x, y, z), low, (i, j, k))

    def forward(self, cells: np.ndarray, *, outside: float = 0) -> np.ndarray:
        """Bring an array over the cells (nx, ny, nz, ...) into the frame."""
        more = tuple(range(3, cells.ndim))
        upright = np.flip(cells.transpose((*self.axes, *more)), self.flip)
        out = np.full((*self.shape, *cells.shape[3:]), outside, dtype=cells.dtype)
        box = tuple(slice(a, a + m) for a, m in zip(self.low, self.inside, strict=True))
        out[box] = upright.reshape(-1, *cells.shape[3:])[self.source]
        return out

    def upright(
        self, cells: Int[np.ndarray, "n 3"], shape: tuple[int, ...]
    ) -> Int[np.ndarray, "n 3"]:
        """Indices of cells of a grid of ``shape`` on the same grid, z up."""
        turned = cells[:, self.axes]
        for axis in self.flip:
            turned[:, axis] = shape[self.axes[axis]] - 1 - turned[:, axis]
        return turned

    def back(self, values: np.ndarray, parts: PartVoxels) -> np.ndarray:
        """Bring an array of the frame (x, y, z, ...) back to the cells of ``parts``."""
        shape = [parts.grid.shape[axis] for axis in self.axes]
        index = [
            a + _scaled(np.arange(n) - first, count, m)
            for (first, count), m, a, n in zip(self.box, self.inside, self.low, shape, strict=True)
        ]
        upright = np.flip(values[np.ix_(*index)], self.flip)
        more = tuple(range(3, values.ndim))
        return np.ascontiguousarray(upright.transpose((*np.argsort(self.axes), *more)))

    def place(self, shape: tuple[int, int, int]) -> Float[np.ndarray, "3 x y z"]:
        """Return places in the object's box, the longest side from -1 to 1."""
        half = max(self.inside) / 2
        lines = [((np.arange(n) + 0.5) - n / 2) / half for n in shape]
        return np.stack(np.meshgrid(*lines, indexing="ij")).astype(np.float32)

    def inputs(self, part: np.ndarray, colours: np.ndarray | None) -> Float[np.ndarray, "8 x y z"]:
        """Input channels: occupancy, colour, its flag, place."""
        occupied = (part >= 0).astype(np.float32)
        colour, flag = np.zeros((*part.shape, 3), np.float32), np.zeros_like(occupied)
        if colours is not None:
            colour, flag = self.forward(colours.astype(np.float32)), occupied
        channels = [occupied[None], np.moveaxis(colour, -1, 0), flag[None], self.place(part.shape)]
        return np.concatenate(channels) * occupied


def _scaled(cells: Int[np.ndarray, "n"], count: int, wanted: int) -> Int[np.ndarray, "n"]:
    """Cell of ``wanted`` over a length at which the centre of each cell of ``count`` lies."""
    return ((cells + 0.5) * wanted / count).astype(np.int64).clip(0, wanted - 1)


def _source(
    upright: Int[np.ndarray, "nx ny nz"],
    box: Sequence[tuple[int, int]],
    inside: tuple[int, int, int],
) -> Int[np.ndarray, "x y z"]:
    """Cell behind each cell of the frame: the nearest, and none of the object is left out.

    Where several meet in one, matter wins over air, and of the parts the smallest.
    """
    nearest = [
        first + _scaled(np.arange(m), m, count)
        for (first, count), m in zip(box, inside, strict=True)
    ]
    source = np.ravel_multi_index(np.ix_(*nearest), upright.shape)
    if all(m >= count for (_, count), m in zip(box, inside, strict=True)):
        return source
    cells = np.argwhere(upright >= 0)
    label = upright[tuple(cells.T)]
    cells = cells[np.argsort(-np.bincount(label)[label], kind="stable")]
    at = (
        _scaled(cells[:, axis] - first, count, inside[axis])
        for axis, (first, count) in enumerate(box)
    )
    source[tuple(at)] = np.ravel_multi_index(tuple(cells.T), upright.shape)  # the last one stays
    return source
