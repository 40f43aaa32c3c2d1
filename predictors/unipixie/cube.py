"""The cells of an asset as tokens on the network's cube: upright, in the middle, as in training."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from jaxtyping import Float, Int

from ..asset import UpAxis, upright
from ..voxels import PartVoxels

PAD = 1  # empty cells of the cube on either side of the longest


@dataclass(frozen=True, eq=False)
class Cube:
    """Tokens: what of one part lies in one cell of the cube.

    Parameters
    ----------
    cells
        Cells of the cube along a side.
    token
        Tokens of each occupied cell of the asset, in C order: several where the cube is finer.
    place
        Mean place of each token in [-1, 1], z up.
    part
        Part of each token.
    at, share
        Flat cell of the cube of each token, x the slowest, and its share of what lies there.
    """

    cells: int
    token: Int[np.ndarray, "m t"]
    place: Float[np.ndarray, "n 3"]
    part: Int[np.ndarray, "n"]
    at: Int[np.ndarray, "n"]
    share: Float[np.ndarray, "n"]

    @classmethod
    def of(cls, parts: PartVoxels, up: UpAxis, *, cells: int) -> Cube:
        """Put the occupied cells of ``parts`` on a cube of ``cells``."""
        points = upright(_points(parts, cells), up)
        low, high = points.min((0, 1)), points.max((0, 1))
        gap = parts.grid.h / round(points.shape[1] ** (1 / 3))
        half = (float((high - low).max()) + gap) / 2 * cells / (cells - 2 * PAD)
        place = (points - (low + high) / 2) / half
        x, y, z = np.moveaxis(((place + 1) / 2 * cells).astype(np.int64), -1, 0)
        label = parts.part[parts.occupied][:, None]
        pair = ((x * cells + y) * cells + z) * len(parts.part_names) + label
        pair, token = np.unique(pair, return_inverse=True)
        at, part = np.divmod(pair, len(parts.part_names))
        flat = token.reshape(-1)
        count = np.bincount(flat)
        there = np.bincount(at, weights=count)
        axes = (np.bincount(flat, axis) for axis in place.reshape(-1, 3).T)
        mean = np.stack(list(axes), 1) / count[:, None]
        return cls(cells, token.reshape(points.shape[:2]), mean, part, at, count / there[at])

    def tokens(self, values: Float[np.ndarray, "m c"]) -> Float[np.ndarray, "n c"]:
        """Means over each token's cells of values of the occupied cells."""
        flat, times = self.token.reshape(-1), self.token.shape[1]
        sums = (np.bincount(flat, np.repeat(column, times)) for column in values.T)
        return np.stack(list(sums), 1) / np.bincount(flat)[:, None]

    def back(self, values: Float[np.ndarray, "n c"]) -> Float[np.ndarray, "m c"]:
        """Bring values of tokens to the occupied cells."""
        return values[self.token].mean(axis=1)


def _points(parts: PartVoxels, cells: int) -> Float[np.ndarray, "m t 3"]:
    """Centres [m] of the occupied cells, divided until they are as small as the cube's."""
    centres = parts.grid.centers()[parts.occupied]
    longest = round(float(np.ptp(centres, axis=0).max()) / parts.grid.h) + 1
    times = ceil(cells / longest)
    line = ((np.arange(times) + 0.5) / times - 0.5) * parts.grid.h
    offsets = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
    return centres[:, None] + offsets
