"""A thing in one piece cut into regions: of one look, connected, thick apart from thin.

Once by looks alone, as a scan allows, and once by the shells of the mesh too, which are often the
parts that somebody modelled. Regions, not cells, are what a clause is given to.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from jaxtyping import Float, Int

from ..matter import by_look

MOST = 48  # regions
LOOKS, LOOK_SPECK = 16, 0.004  # looks at most, and the fraction of the cells that one needs
SPECK = 0.003  # of the cells: a smaller region goes to its surroundings
# Of a thick region the core is what lies near cells of half its greatest depth: sqrt(3) times that
# depth, as the corner of a box does. It is a region of its own where the region is large, some
# cells deep, and neither all core nor hardly any.
LARGE, DEEP, OPENING, NEAR, CORE = 0.06, 3.0, 0.5, 3**0.5, (0.1, 0.99)
# Half of the 26 neighbours of a cell: each pair is met once.
_AHEAD = [step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0)]


def segment(
    cells: Int[np.ndarray, "n 3"],
    looks: Float[np.ndarray, "n look"],
    shell: Int[np.ndarray, "n"] | None = None,
) -> Int[np.ndarray, "n"]:
    """Return the region of every cell, from 0, the largest first.

    cells: Indices of a thing's cells on a grid.
    looks: Colour and finish of each, as ``matter.by_look`` takes them.
    shell: The connected surface that each belongs to, where a mesh tells.
    """
    label = by_look(looks, most=LOOKS, speck=LOOK_SPECK)
    if shell is not None:
        label = label * (int(shell.max()) + 1) + shell
    label = _thick_apart(cells, _connected(cells, label))
    return largest_first(_connected(cells, label))


def largest_first(label: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    """Labels numbered anew, from 0, that of most cells first."""
    order = np.argsort(-np.bincount(label), kind="stable")
    return np.argsort(order)[label]


def _connected(cells: Int[np.ndarray, "n 3"], label: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    """Connected components of equal labels; small ones go to the nearest that is kept."""
    from scipy.ndimage import distance_transform_edt
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    row, at = _padded(cells, np.arange(len(cells)))
    pairs = []
    for step in _AHEAD:
        there = row[tuple((cells - cells.min(axis=0) + 1 + step).T)]
        here = np.flatnonzero(there >= 0)
        here = here[label[here] == label[there[here]]]
        pairs.append((here, there[here]))
    i, j = np.concatenate(pairs, axis=1)
    graph = coo_matrix((np.ones(len(i), dtype=bool), (i, j)), shape=(len(cells),) * 2)
    _, found = connected_components(graph, directed=False)
    size = np.bincount(found)
    kept = np.argsort(-size, kind="stable")[:MOST]
    kept = kept[(size[kept] >= SPECK * len(cells)) | (np.arange(len(kept)) == 0)]
    good = np.isin(found, kept)
    if not good.all():
        far = np.ones(row.shape, dtype=bool)
        far[tuple(i[good] for i in at)] = False
        nearest = distance_transform_edt(far, return_distances=False, return_indices=True)
        found = found[row[tuple(axis[at] for axis in np.asarray(nearest))]]
    return np.unique(found, return_inverse=True)[1].ravel()


def _thick_apart(
    cells: Int[np.ndarray, "n 3"], label: Int[np.ndarray, "n"]
) -> Int[np.ndarray, "n"]:
    """Regions with the thick core of each cut off from what is thin."""
    from scipy.ndimage import distance_transform_edt

    out, count = label.copy(), int(label.max()) + 1
    for k in range(count):
        mine = np.flatnonzero(label == k)
        if len(mine) < LARGE * len(cells):
            continue
        row, at = _padded(cells[mine], np.arange(len(mine)))
        depth = np.asarray(distance_transform_edt(row >= 0))
        radius = OPENING * depth.max()
        if depth.max() < DEEP:
            continue
        core = np.asarray(distance_transform_edt(depth < radius))[at] <= NEAR * radius
        if CORE[0] < core.mean() < CORE[1]:
            out[mine[core]] = count
            count += 1
    return out


def _padded(
    cells: Int[np.ndarray, "n 3"], values: Int[np.ndarray, "n"]
) -> tuple[Int[np.ndarray, "x y z"], tuple[np.ndarray, ...]]:
    """Values on the cells' box with one empty cell (-1) on every side, and where each cell is."""
    at = tuple((cells - cells.min(axis=0) + 1).T)
    box = np.full(np.ptp(cells, axis=0) + 3, -1)
    box[at] = values
    return box, at
