"""Sites of contact: the places of a surface that keep out of an obstacle.

Where faces are small against the obstacle these are the nodes. A face that is large against it
gets a lattice of further places, so close together that the obstacle cannot slip between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..discrete.forces import edge_nodes
from ..discrete.space import Space
from ..scene.boundary import face_areas
from ..scene.mesh import TetMesh
from ..scene.obstacles import Obstacle, obstacle_size

# Places on a face are apart by at most this share of the obstacle's size: a ball of radius R that
# sits between three of them is s^2 / 6 R = R / 100 inside the face.
SPACING = 0.25
# Most places along the edge of a face: smaller obstacles are refused.
MOST_CELLS = 64


class Sites(NamedTuple):
    """Places ``rest`` (n, 3) [m] that move with the shares (n, k) of their ``nodes`` (n, k).

    ``weight`` (n,) [J] is stiffness times area times thickness.
    """

    nodes: Int[np.ndarray, "n k"]
    share: Float[np.ndarray, "n k"]
    rest: Float[np.ndarray, "n 3"]
    weight: Float[np.ndarray, "n"]

    @property
    def alone(self) -> bool:
        """Whether every place is a node, and no node is there twice."""
        return self.nodes.shape[1] == 1

    def moved(self, u: np.ndarray) -> Float[np.ndarray, "n 3"]:
        """Value of the nodal field ``u`` (nodes, 3) at the places."""
        if self.alone:
            return u[self.nodes[:, 0]]
        return np.einsum("nk,nkd->nd", self.share, u[self.nodes])

    def spread(self, values: Float[np.ndarray, "n 3"], out: np.ndarray) -> None:
        """Add ``values`` at the places to the nodes of ``out`` (nodes, 3)."""
        if self.alone:
            out[self.nodes[:, 0]] += values
        else:
            np.add.at(out, self.nodes, self.share[:, :, None] * values[:, None])

    def spread_blocks(
        self, blocks: Float[np.ndarray, "n 3 3"], diagonal: np.ndarray, pairs: list
    ) -> None:
        """Add ``blocks`` to the ``diagonal`` (nodes, 3, 3), or couplings to ``pairs``."""
        if self.alone:
            diagonal[self.nodes[:, 0]] += blocks
            return
        near = np.flatnonzero(np.abs(blocks).max(axis=(1, 2)) > 0)
        if not near.size:
            return
        nodes, share = self.nodes[near], self.share[near]
        i, j = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
        both = share[:, :, None] * share[:, None, :]
        pairs.append((i, j, both[..., None, None] * blocks[near, None, None]))


class _Group(NamedTuple):
    """Faces with the same lattice: ``nodes`` (faces, k), ``stiffness`` (faces,) [J].

    A place is as stiff as a corner of the face: few of them carry what presses a flat face.
    """

    nodes: np.ndarray
    stiffness: np.ndarray
    share: np.ndarray


class SurfaceSites:
    """Sites of a body against one obstacle.

    Parameters
    ----------
    mesh, space
        The body and its nodes.
    stiffness
        Barrier stiffness times thickness at every node [J/m^2], shape (nodes,).
    obstacle
        What it shall keep out of.
    """

    def __init__(
        self,
        mesh: TetMesh,
        space: Space,
        stiffness: Float[np.ndarray, "nodes"],
        obstacle: Obstacle,
    ) -> None:
        self.obstacle, self.rest = obstacle, space.nodes
        faces = mesh.boundary.faces
        self.corners = np.unique(faces)
        areas = face_areas(mesh.points, faces)
        corners = mesh.points[faces]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        nodes = faces
        if space.order == 2:
            nodes = np.hstack([faces, edge_nodes(space, faces[:, [[0, 1], [1, 2], [2, 0]]])])
        wanted = np.maximum(longest / (SPACING * obstacle_size(obstacle)), space.order)
        cells = np.minimum(2 ** np.ceil(np.log2(wanted)), MOST_CELLS).astype(int)
        plain = cells == space.order
        self.too_large = nodes[wanted > 2 * MOST_CELLS]
        self.nodal = _nodal(nodes[plain], areas[plain], stiffness, space)
        self.groups = []
        for count in np.unique(cells[~plain]).tolist():
            own = cells == count
            mean = stiffness[faces[own]].mean(axis=1)
            lattice = face_lattice(count, nodes.shape[1])
            self.groups.append(_Group(nodes[own], mean * areas[own] / 3, lattice))

    def near(self, u: np.ndarray, shift: np.ndarray, margin: float) -> Iterator[Sites]:
        """Sites of the displaced body, all that are closer than ``margin`` [m] among them.

        ``shift`` (3,) [m] is how far the obstacle has moved.
        """
        if len(self.nodal.nodes):
            yield self.nodal
        for group in self.groups:
            close = self._close(group.nodes, u, shift, margin)
            if close.size:
                yield self._lattice(group, close)

    def touches_too_large(self, u: np.ndarray, shift: np.ndarray, margin: float) -> bool:
        """Whether the obstacle is near a face with too few places for it to be kept out."""
        return bool(self._close(self.too_large, u, shift, margin).size)

    def _close(self, faces: np.ndarray, u: np.ndarray, shift: np.ndarray, margin: float):
        """Indices of all ``faces`` (faces, k) that are closer than ``margin``, and of more."""
        corners = self.rest[faces] + u[faces]
        centre = corners.mean(axis=1)
        reach = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        # A curved face leaves the ball around its nodes by less than its reach.
        return np.flatnonzero(self.obstacle.distance(centre - shift).gap < margin + 2 * reach)

    def _lattice(self, group: _Group, faces: np.ndarray) -> Sites:
        places = len(group.share)
        nodes = np.repeat(group.nodes[faces], places, axis=0)
        share = np.tile(group.share, (len(faces), 1))
        rest = np.einsum("nk,nkd->nd", share, self.rest[nodes])
        return Sites(nodes, share, rest, np.repeat(group.stiffness[faces], places))


def face_lattice(cells: int, nodes: int) -> Float[np.ndarray, "places nodes"]:
    """Shares of the 3 or 6 ``nodes`` of a triangle in its places, ``cells`` along an edge."""
    i, j = (k.ravel() for k in np.indices((cells + 1, cells + 1)))
    b = np.stack([i, j, cells - i - j], axis=1)[i + j <= cells] / cells
    return np.hstack([b * (2 * b - 1), 4 * b * np.roll(b, -1, axis=1)]) if nodes == 6 else b


def _nodal(nodes: np.ndarray, areas: np.ndarray, stiffness: np.ndarray, space: Space) -> Sites:
    """Nodes of faces that need no more places, each with its share of their area."""
    share = np.array([1 / 3] * 3 if space.order == 1 else [1 / 12] * 3 + [1 / 4] * 3)
    area = np.zeros(len(space.nodes))
    np.add.at(area, nodes, areas[:, None] * share)
    ids = np.flatnonzero(area > 0)
    ones = np.ones((len(ids), 1))
    return Sites(ids[:, None], ones, space.nodes[ids], stiffness[ids] * area[ids])
