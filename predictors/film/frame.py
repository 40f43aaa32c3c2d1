"""The grid that the FiLM network sees: the object's box upright, at the size of training."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..asset import UpAxis
from ..voxels import PartVoxels

# Cells along the longest side in training; a grid far from it is resampled.
TRAINED_CELLS, FEWEST_CELLS = 62, 48
# A thin object in a thinner grid would meet the deepest cells where training never put it: measured
# on two of them, the right clause fell from .99 to .4.
STEP = 64


@dataclass(frozen=True, eq=False)
class Frame:
    """The network's grid: the object's box, z up, resampled if need be, padded to its step.

    ``source`` holds, for the three upright axes, the cell of the given grid behind each cell.
    """

    axes: tuple[int, int, int]
    flip: tuple[int, ...]
    source: tuple[np.ndarray, ...]
    inside: tuple[int, int, int]
    low: tuple[int, int, int]
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, parts: PartVoxels, up: UpAxis, *, step: int = STEP) -> Frame:
        """Frame of the occupied box of ``parts``, in the middle of a cube as in training."""
        axes, flip = {"z": ((0, 1, 2), ()), "y": ((0, 2, 1), (1,)), "x": ((2, 1, 0), (0,))}[up]
        upright = np.flip(parts.occupied.transpose(axes), flip)
        box = [np.flatnonzero(upright.any(axis=tuple({0, 1, 2} - {i}))) for i in range(3)]
        size = [int(cells[-1] - cells[0] + 1) for cells in box]
        longest = max(size)
        scale = 1.0 if FEWEST_CELLS <= longest <= TRAINED_CELLS else TRAINED_CELLS / longest
        inside = [max(1, round(n * scale)) for n in size]
        source = tuple(
            cells[0] + np.minimum((np.arange(m) + 0.5) * n / m, n - 1).astype(np.int64)
            for cells, n, m in zip(box, size, inside, strict=True)
        )
        shape = [-(-(m + 2) // step) * step for m in inside]
        low = [(s - m) // 2 for s, m in zip(shape, inside, strict=True)]
        return cls(axes, flip, source, *(tuple(x) for x in (inside, low, shape)))  # type: ignore

    def forward(self, cells: np.ndarray, *, outside: float = 0) -> np.ndarray:
        """Bring an array over the cells (nx, ny, nz, ...) into the frame."""
        more = tuple(range(3, cells.ndim))
        upright = np.flip(cells.transpose((*self.axes, *more)), self.flip)
        out = np.full((*self.shape, *cells.shape[3:]), outside, dtype=cells.dtype)
        box = tuple(slice(a, a + m) for a, m in zip(self.low, self.inside, strict=True))
        out[box] = upright[np.ix_(*self.source)]
        return out

    def back(self, values: np.ndarray, parts: PartVoxels) -> np.ndarray:
        """Bring an array of the frame (x, y, z, ...) back to the cells of ``parts``."""
        shape = [parts.grid.shape[axis] for axis in self.axes]
        index = []
        for cells, m, a, n in zip(self.source, self.inside, self.low, shape, strict=True):
            first, count = cells[0], cells[-1] - cells[0] + 1
            place = (np.arange(n) - first + 0.5) * m / count
            index.append(a + place.astype(np.int64).clip(0, m - 1))
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
