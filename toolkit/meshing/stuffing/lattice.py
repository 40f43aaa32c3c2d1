"""A body-centred cubic lattice of tets: nodes with coordinates all even or all odd.

Each tet has a long edge between two odd nodes A, B and one between two even nodes C, D; the other
four are short, sqrt(3)/2 of it. Lengths are in long edges, the lattice's unit.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

MOST_NODES = 6_000_000  # 1 GB of distances and labels on the way
# Edges of a tet A, B, C, D as pairs of corners; the first two are the long ones.
EDGES = ((0, 1), (2, 3), (0, 2), (0, 3), (1, 2), (1, 3))
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))  # corners of the square that an odd edge pierces


class Lattice(NamedTuple):
    """``cells`` (3,) cubes of unit edge from ``origin`` (3,) on; the even nodes count first."""

    origin: np.ndarray
    cells: np.ndarray

    @property
    def even_count(self) -> int:
        """Nodes at the corners of the cubes."""
        return int((self.cells + 1).prod())

    @property
    def node_count(self) -> int:
        """Even nodes, and odd ones in the middles of the cubes."""
        return self.even_count + int(self.cells.prod())

    def nodes(self) -> Float[np.ndarray, "nodes 3"]:
        """Positions of all nodes."""
        even, odd = (
            np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
            for counts in (self.cells + 1, self.cells)
        )
        return self.origin + np.concatenate([even, odd + 0.5])

    def together(self, some: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
        """Number of the group of each of some nodes, linked by long edges between them."""
        from scipy.ndimage import label

        wanted = np.zeros(self.node_count, dtype=bool)
        wanted[some] = True
        even, odd = np.split(wanted, [self.even_count])
        groups: Any = label  # its stubs know no pair
        first, count = groups(even.reshape(self.cells + 1))
        second, _ = groups(odd.reshape(self.cells))
        return np.concatenate([first.reshape(-1), second.reshape(-1) + count])[some]


class LatticeTets(NamedTuple):
    """``corners`` (tets, 4): A, B, C, D; those ``mirrored`` (tets,) are negatively oriented."""

    corners: np.ndarray
    mirrored: np.ndarray


def lattice_around(bounds: Float[np.ndarray, "2 3"]) -> Lattice:
    """Lattice with planes on the lower faces of a box, and a cube beyond it on every side."""
    lo, hi = bounds
    cells = np.ceil(np.round(hi - lo, 9)).astype(int) + 2
    return Lattice(lo - 1.0, cells)


def tets_around(lattice: Lattice, wanted: Bool[np.ndarray, "nodes"]) -> LatticeTets:
    """Tets that have a wanted node, in an order that depends on nothing else."""
    even = np.arange(lattice.even_count, dtype=np.int32).reshape(lattice.cells + 1)
    odd = np.arange(lattice.even_count, lattice.node_count, dtype=np.int32)
    odd = odd.reshape(lattice.cells)
    corners, mirrored = [], []
    for axis, side in product(range(3), range(4)):
        family, count = _family(axis, side), lattice.cells - np.eye(3, dtype=int)[axis]
        four = [
            nodes[tuple(slice(s, s + n) for s, n in zip(step, count, strict=True))].reshape(-1)
            for nodes, step in zip((odd, odd, even, even), family.steps, strict=True)
        ]
        here = np.flatnonzero(np.logical_or.reduce([wanted[nodes] for nodes in four]))
        corners.append(np.stack([nodes[here] for nodes in four], axis=1))
        mirrored.append(np.full(len(here), family.mirrored))
    return LatticeTets(np.concatenate(corners), np.concatenate(mirrored))


class _Family(NamedTuple):
    """Translates of one tet: ``steps`` (4, 3) of A, B, C, D from the first cell."""

    steps: np.ndarray
    mirrored: bool


@cache
def _family(axis: int, side: int) -> _Family:
    """Return the tets of the odd edges along ``axis`` at one side of the squares they pierce.

    A and B are swapped where needed, so that A exceeds C in an even number of coordinates.
    """
    odd, even = np.zeros((2, 3), int), np.zeros((2, 3), int)
    odd[1, axis] = even[:, axis] = 1
    even[:, [(axis + 1) % 3, (axis + 2) % 3]] = _SQUARE[side], _SQUARE[(side + 1) % 4]
    if ((odd[0] + 0.5 > even[0]).sum() % 2) == 1:
        odd = odd[::-1]
    steps = np.concatenate([odd, even])
    a, *others = np.concatenate([odd + 0.5, even])
    return _Family(steps, bool(np.linalg.det(np.array(others) - a) < 0))


def edges_of(
    tets: Int[np.ndarray, "tets 4"], node_count: int
) -> tuple[Int[np.ndarray, "edges 2"], Int[np.ndarray, "tets 6"]]:
    """All edges once each, and the edges of every tet in the order of ``EDGES``."""
    i, j = (np.concatenate([tets[:, edge[k]] for edge in EDGES]).astype(np.int64) for k in (0, 1))
    key = np.minimum(i, j) * node_count + np.maximum(i, j)
    unique, inverse = np.unique(key, return_inverse=True)
    ends = np.stack([unique // node_count, unique % node_count], axis=1)
    return ends, inverse.reshape(6, -1).T
