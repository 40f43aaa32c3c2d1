"""Nodes moved onto sharp edges and corners, as far as the tets around them stay good."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.scene.mesh import signed_volumes
from ..lattice_guarantees import BLUNTEST, SHARPEST
from ..quality import dihedral_cosines
from .cut import CutMesh
from .features import FeatureFinder

CORNER_REACH, CORNER_NODES = 0.9, 12  # long edges; how many nodes are tried for a corner
EDGE_REACHES = (0.175, 0.3, 0.65)  # long edges, the sure ones first


def snapped(mesh: CutMesh, features: FeatureFinder) -> tuple[CutMesh, Bool[np.ndarray, "points"]]:
    """Move nodes of the surfaces to ``features``; also which points lie on these then."""
    guard = Guard(mesh)
    taken = mesh.free.copy()
    _to_corners(guard, taken, features.corners)
    for reach in EDGE_REACHES:
        nodes = np.flatnonzero(~taken)
        found = features.on_edges(guard.points[nodes], reach)
        near = np.isfinite(found.distance)
        taken[guard.move(nodes[near], found.point[near])] = True
    return mesh._replace(points=guard.points), taken & ~mesh.free


def _to_corners(
    guard: Guard, taken: Bool[np.ndarray, "points"], corners: Float[np.ndarray, "corners 3"]
) -> None:
    """For each corner try the nearest nodes one after the other, until one may move there."""
    from scipy.spatial import KDTree

    nodes = np.flatnonzero(~taken)
    count = min(CORNER_NODES, len(nodes))
    if not (len(corners) and count):
        return
    ranks: Any = np.arange(1, count + 1)  # an array keeps the shape where there is one; stubs lag
    distance, index = KDTree(guard.points[nodes]).query(corners, k=ranks)
    open_ = np.ones(len(corners), dtype=bool)
    for distances, tried in zip(distance.T, nodes[index.T], strict=True):
        ask = np.flatnonzero(open_ & (distances < CORNER_REACH) & ~taken[tried])
        ask = ask[np.unique(tried[ask], return_index=True)[1]]
        moved = guard.move(tried[ask], corners[ask])
        taken[moved] = True
        open_[ask[np.isin(tried[ask], moved)]] = False


class Guard:
    """Points of a mesh that move only as far as no tet around them becomes bad."""

    def __init__(self, mesh: CutMesh) -> None:
        self.points = mesh.points.copy()
        self.tets = mesh.tets[~mesh.free[mesh.tets].all(axis=1)]
        _, sharp, blunt = _shape(self.points, self.tets)
        # Where a tet is worse than that already, it must not become worse still.
        self.sharpest = np.maximum(sharp, np.cos(np.radians(SHARPEST)))
        self.blunt = np.minimum(blunt, np.cos(np.radians(BLUNTEST)))

    def move(
        self, nodes: Int[np.ndarray, "n"], targets: Float[np.ndarray, "n 3"]
    ) -> Int[np.ndarray, "moved"]:
        """Move ``nodes`` to their ``targets``, and undo the longest move of each bad tet.

        Returns the nodes that stay moved.
        """
        there = self.points.copy()
        there[nodes] = targets
        length = np.zeros(len(there))
        length[nodes] = np.linalg.norm(targets - self.points[nodes], axis=1)
        on = np.zeros(len(there), dtype=bool)
        on[nodes] = True
        touched = asked = np.flatnonzero(on[self.tets].any(axis=1))
        while asked.size:
            tets = self.tets[asked]
            bad = self._bad(there, asked) & on[tets].any(axis=1)
            worst = tets[bad]
            moves = np.where(on[worst], length[worst], -1.0)
            undone = np.unique(worst[np.arange(len(worst)), moves.argmax(axis=1)])
            on[undone] = False
            there[undone] = self.points[undone]
            changed = np.zeros(len(there), dtype=bool)
            changed[undone] = True
            asked = touched[changed[self.tets[touched]].any(axis=1)]
        self.points = there
        return nodes[on[nodes]]

    def _bad(
        self, points: Float[np.ndarray, "points 3"], asked: Int[np.ndarray, "asked"]
    ) -> Bool[np.ndarray, "asked"]:
        volume, sharp, blunt = _shape(points, self.tets[asked])
        return (volume <= 0) | (sharp > self.sharpest[asked]) | (blunt < self.blunt[asked])


def _shape(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Volume, and the cosines of the sharpest and the bluntest dihedral angle, of every tet."""
    cosine = dihedral_cosines(points, tets)
    return signed_volumes(points, tets), cosine.max(axis=0), cosine.min(axis=0)
