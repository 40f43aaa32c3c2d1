"""The background grid: where it lies, how fine it is, which of its nodes are near particles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..errors import InputError

# Held nodes of a plane clamp lie this share of a spacing inside the body: at the clamp itself they
# make it longer by 0.15 spacings (hanging bars of 8 to 32 cells).
CLAMP_OFFSET = 0.16
# Nodes around the room of the particles: their own weights, and a spacing of drift.
MARGIN = 4
# Nodes of a grid: 32 bytes each, two grids with two threads.
MOST_NODES = 30_000_000


class BackgroundGrid(NamedTuple):
    """Nodes ``spacing`` [m] apart from ``origin`` (3,) [m] on, ``shape`` (3,) of them."""

    origin: np.ndarray
    spacing: float
    shape: tuple[int, int, int]

    @property
    def count(self) -> int:
        """Number of nodes."""
        return int(np.prod(self.shape))

    def first_nodes(self, x: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n 3"]:
        """Lowest of the 27 nodes around every position [m]."""
        return np.floor((x - self.origin) / self.spacing - 0.5).astype(np.int64)

    def flat(self, nodes: Int[np.ndarray, "n 3"]) -> Int[np.ndarray, "n"]:
        """Number of every node."""
        return (nodes[:, 0] * self.shape[1] + nodes[:, 1]) * self.shape[2] + nodes[:, 2]

    def positions(self, numbers: Int[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of nodes by number."""
        found = np.stack(np.unravel_index(numbers, self.shape), axis=1)
        return self.origin + self.spacing * found

    def near(self, x: Float[np.ndarray, "n 3"], *, drift: int = 1) -> Int[np.ndarray, "nodes"]:
        """Numbers of the nodes that particles reach while they drift up to ``drift`` spacings."""
        mark = np.zeros(self.shape, dtype=bool)
        first = self.first_nodes(x)
        room = ((first >= 0) & (first < np.array(self.shape) - 2)).all(axis=1)
        mark.ravel()[self.flat(first[room])] = True
        for axis in range(3):
            mark = _widened(mark, axis, -drift, 2 + drift)
        return np.flatnonzero(mark)


def _widened(mark: Bool[np.ndarray, "x y z"], axis: int, low: int, high: int) -> np.ndarray:
    """Mark what lies ``low`` to ``high`` nodes further along an axis, too."""
    along = np.moveaxis(mark, axis, 0)
    wide = np.zeros_like(along)
    size = len(along)
    for shift in range(low, high + 1):
        wide[max(shift, 0) : size + min(shift, 0)] |= along[max(-shift, 0) : size - max(shift, 0)]
    return np.moveaxis(wide, 0, axis)


def grid_around(
    low: Sequence[float] | np.ndarray,
    high: Sequence[float] | np.ndarray,
    spacing: float,
    *,
    planes: dict[int, float] | None = None,
) -> BackgroundGrid:
    """Grid around the room from ``low`` to ``high`` [m] in which particles may move.

    ``planes`` are positions [m] by axis that a layer of nodes shall lie at.

    Raises
    ------
    InputError
        Where the room is not finite, or the grid would not fit into memory.
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if not (np.isfinite([*low, *high]).all() and (high >= low).all() and spacing > 0):
        raise InputError(f"grid from {low} to {high} every {spacing:g} m: wanted finite, growing")
    origin = low - MARGIN * spacing
    for axis, at in (planes or {}).items():
        origin[axis] = at - np.ceil((at - origin[axis]) / spacing - 1e-9) * spacing
    shape = np.ceil((high - origin) / spacing - 1e-9).astype(np.int64) + MARGIN + 1
    if np.prod(shape.astype(float)) > MOST_NODES:
        raise InputError(
            f"a grid of {'x'.join(map(str, shape))} nodes: wanted at most {MOST_NODES:,}; take a "
            "coarser grid, or a smaller room"
        )
    return BackgroundGrid(origin, float(spacing), (int(shape[0]), int(shape[1]), int(shape[2])))
