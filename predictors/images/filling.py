"""The inside of a voxelised surface: enclosure, even-odd parity, nearest-surface features.

After AutoPhyX 3.1 and PhysGaussian: a cell is a candidate where the surface encloses it in the six
directions of the axes (condition 1), and inside where rays to infinity cross the surface an odd
number of times (condition 2). A ray that grazes the surface is miscounted, so the verdicts of all
empty cells that hang together are pooled where they (nearly) agree.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, cast

import numpy as np
from jaxtyping import Bool, Int

from ...fem.errors import InputError

Direction = Literal["-x", "+x", "-y", "+y", "-z", "+z"]
DIRECTIONS: tuple[Direction, ...] = ("-x", "+x", "-y", "+y", "-z", "+z")
Parity = Literal["all", "one"]
# Share of a connected region's cells with the same verdict from which all of it follows them. In
# between the region leaks (a scan with a hole), and every cell keeps its own verdict.
SETTLED_OUT, SETTLED_IN = 0.2, 0.5


class Filled(NamedTuple):
    """A solid: ``occupied`` (nx, ny, nz) is the surface and what it holds.

    ``enclosed`` and ``odd`` are the verdicts of conditions 1 and 2 on every empty cell; ``leaky``
    counts the cells in regions whose verdicts disagree.
    """

    occupied: np.ndarray
    enclosed: np.ndarray
    odd: np.ndarray
    leaky: int


def fill(
    surface: Bool[np.ndarray, "nx ny nz"],
    *,
    parity: Parity = "all",
    ray: Direction = "+x",
    open_side: Direction | None = None,
    pool: bool = True,
) -> Filled:
    """Fill what a surface encloses.

    Parameters
    ----------
    surface
        Cells that the surface touches, shape (nx, ny, nz).
    parity
        ``all``: the rays of every direction must cross the surface an odd number of times
        (AutoPhyX); ``one``: only that of ``ray`` (PhysGaussian).
    open_side
        A direction that neither condition looks in: the open top of a scan.
    pool
        Whether cells that hang together share one verdict where they (nearly) agree.
    """
    directions: list[Direction] = [d for d in DIRECTIONS if d != open_side]
    crossings = {d: _crossings(surface, d) for d in directions}
    enclosed = ~surface & np.all([count > 0 for count in crossings.values()], axis=0)
    counted = directions if parity == "all" else [ray]
    if ray == open_side and parity == "one":
        raise InputError(f"the ray {ray} leaves through the open side: choose another direction")
    odd = ~surface & np.all([crossings[d] % 2 == 1 for d in counted], axis=0)
    inside, leaky = enclosed & odd, 0
    if pool:
        inside, leaky = _pooled(~surface, inside)
    return Filled(surface | inside, enclosed, odd, leaky)


def nearest_known(
    cells: Int[np.ndarray, "n 3"],
    known: Bool[np.ndarray, "n"],
    *,
    label: Int[np.ndarray, "n"] | None = None,
) -> Int[np.ndarray, "n"]:
    """For each cell the row of the nearest one that is known; itself if it is.

    With labels, one of its own label where that label has any, so that a hidden trunk takes after
    the trunk and not after the leaves before it.
    """
    from scipy.spatial import KDTree

    if not known.any():
        raise InputError("no cell of the surface is known: nothing to take features from")
    label = np.zeros(len(cells), dtype=np.int64) if label is None else label
    own = np.isin(label, np.unique(label[known]))
    row = np.arange(len(cells))
    for value in [*np.unique(label[own]), None]:
        asking = ~known & (~own if value is None else label == value)
        sources = np.flatnonzero(known & (value is None or label == value))
        if asking.any():
            row[asking] = sources[KDTree(cells[sources]).query(cells[asking])[1]]
    return row


def _crossings(
    surface: Bool[np.ndarray, "nx ny nz"], direction: Direction
) -> Int[np.ndarray, "nx ny nz"]:
    """How often a ray from each cell enters the surface on its way to infinity."""
    axis = "xyz".index(direction[1])
    along = np.moveaxis(surface, axis, 0)
    along = along if direction[0] == "+" else along[::-1]
    entered = np.zeros(along.shape, dtype=np.int32)
    entered[:-1] = along[1:] & ~along[:-1]  # at cell i: the step to i + 1 enters
    count = entered[::-1].cumsum(axis=0, dtype=np.int32)[::-1]
    return np.moveaxis(count if direction[0] == "+" else count[::-1], 0, axis)


def _pooled(
    empty: Bool[np.ndarray, "nx ny nz"], inside: Bool[np.ndarray, "nx ny nz"]
) -> tuple[Bool[np.ndarray, "nx ny nz"], int]:
    """One verdict for each region of empty cells that share faces, where they (nearly) agree.

    The region that reaches the border of the grid is never inside as a whole.
    """
    from scipy.ndimage import label

    region, count = cast(tuple[np.ndarray, int], label(empty))
    size = np.bincount(region.ravel(), minlength=count + 1)
    share = np.bincount(region.ravel(), weights=inside.ravel(), minlength=count + 1)
    share = share / np.maximum(size, 1)
    border = np.zeros(count + 1, dtype=bool)
    for axis in range(3):
        for end in (0, -1):
            border[np.unique(region.take(end, axis=axis))] = True
    settled_in, settled_out = (share >= SETTLED_IN) & ~border, share <= SETTLED_OUT
    leaky = ~settled_in & ~settled_out
    leaky[0] = settled_in[0] = False
    return settled_in[region] | (leaky[region] & inside), int(size[leaky].sum())
