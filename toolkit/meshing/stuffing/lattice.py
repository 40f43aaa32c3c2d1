"""A body-centred cubic lattice of tets: nodes with coordinates all even or all odd.

Each tet has a long edge between two odd nodes A, B and one between two even nodes C, D; the other
four are short, sqrt(3)/2 of it. Lengths are in long edges, the lattice's unit.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.mesh import area_vectors
from ...asset.triangles import Faces, Places, Tets, Triangles

Offsets = Float[np.ndarray, "shells"]  # how far the surface of each shell is moved outward
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
            np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(
                -1, 3
            )
            for counts in (self.cells + 1, self.cells)
        )
        return self.origin + np.concatenate([even, odd + 0.5])  # type: ignore

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


def lattice_around(bounds: Float[np.ndarray, "2 3"]) -> Lattice:
    """Lattice with planes on the lower faces of a box, and a cube beyond it on every side."""
    lo, hi = bounds
    cells = np.ceil(np.round(hi - lo, 9)).astype(int) + 2
    return Lattice(lo - 1.0, cells)


def tets_around(
    lattice: Lattice, wanted: Bool[np.ndarray, "nodes"]
) -> tuple[Tets, Bool[np.ndarray, "tets"]]:
    """Corners A, B, C, D of tets that have a wanted node, and which are negatively oriented.

    Those of one kind are of the odd edges along an axis at one side of the squares they pierce.
    """
    even = np.arange(lattice.even_count, dtype=np.int32).reshape(lattice.cells + 1)
    odd = np.arange(lattice.even_count, lattice.node_count, dtype=np.int32)
    odd = odd.reshape(lattice.cells)
    corners, mirrored = [], []
    for axis, side in product(range(3), range(4)):
        # Steps of A, B and of C, D from the first cell
        ab, cd = np.zeros((2, 3), int), np.zeros((2, 3), int)
        ab[1, axis] = cd[:, axis] = 1
        cd[:, [(axis + 1) % 3, (axis + 2) % 3]] = _SQUARE[side], _SQUARE[(side + 1) % 4]
        if ((ab[0] + 0.5 > cd[0]).sum() % 2) == 1:  # A exceeds C in an even number of coordinates
            ab = ab[::-1]
        count = lattice.cells - np.eye(3, dtype=int)[axis]
        four = [
            nodes[tuple(slice(s, s + n) for s, n in zip(step, count, strict=True))].reshape(-1)
            for nodes, step in zip((odd, odd, even, even), (*ab, *cd), strict=True)
        ]
        here = np.flatnonzero(np.logical_or.reduce([wanted[nodes] for nodes in four]))
        corners.append(np.stack([nodes[here] for nodes in four], axis=1))
        a, *others = np.concatenate([ab + 0.5, cd])
        mirrored.append(np.full(len(here), np.linalg.det(np.array(others) - a) < 0))
    return np.concatenate(corners), np.concatenate(mirrored)


def edges_of(
    tets: Tets, node_count: int
) -> tuple[Int[np.ndarray, "edges 2"], Int[np.ndarray, "tets 6"]]:
    """All edges once each, and the edges of every tet in the order of ``EDGES``."""
    i, j = (np.concatenate([tets[:, edge[k]] for edge in EDGES]).astype(np.int64) for k in (0, 1))
    key = np.minimum(i, j) * node_count + np.maximum(i, j)
    unique, inverse = np.unique(key, return_inverse=True)
    ends = np.stack([unique // node_count, unique % node_count], axis=1)
    return ends, inverse.reshape(6, -1).T


# Sharp edges and corners of the input: found, and nodes of the mesh moved onto them.
#
# A lattice cuts them off by up to half an edge, and a beam without its edges bends a third more.

SHARP = np.radians(35.0)  # between the normals of two faces, and between two edges at a corner
SEEN = 0.5  # long edges: what faces one way so near together is visible or hidden together
SPACING = 0.2  # of the points on edges among which the nearest is looked for, in long edges


Visible = Callable[[Places, Places], np.ndarray]


class SharpFeatures(NamedTuple):
    """Sharp edges ``ends`` (n, 2, 3) with the mean ``normal`` (n, 3) of their faces; corners.

    ``corners`` (m, 3) with their ``corner_normals`` (m, 3).
    """

    ends: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    corner_normals: np.ndarray


def features_of(surface: Triangles) -> SharpFeatures:
    """Edges whose two faces meet sharply, and where these end, branch or turn sharply."""
    points, faces = surface
    area = area_vectors(points, faces)
    normal = _unit(area)
    proper = np.linalg.norm(area, axis=1) > 0
    edges, left, right = shared_edges(faces)
    cosine = np.einsum("ei,ei->e", normal[left], normal[right])
    sharp = (cosine < np.cos(SHARP)) & proper[left] & proper[right]
    edges, mean = edges[sharp], (normal[left] + normal[right])[sharp]
    # Vertices at which sharp edges end, branch, or go on in another direction
    count = np.bincount(edges.reshape(-1), minlength=len(points))
    total = np.zeros_like(points)  # of unit vectors along the edges: 0 where two go straight on
    along = _unit(points[edges[:, 1]] - points[edges[:, 0]])
    np.add.at(total, edges[:, 0], along)
    np.add.at(total, edges[:, 1], -along)
    bend = np.linalg.norm(total, axis=1) > 2 * np.sin(SHARP / 2)
    corner = np.flatnonzero((count == 1) | (count > 2) | ((count == 2) & bend))
    towards = np.zeros_like(points)
    for end in edges.T:
        np.add.at(towards, end, mean)
    return SharpFeatures(points[edges], _unit(mean), points[corner], _unit(towards[corner]))


def shared_edges(faces: Faces) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges (n, 2) of exactly two faces, and these."""
    from trimesh.graph import face_adjacency

    pairs, ends = face_adjacency(faces, return_edges=True)
    return ends, *pairs.T


def _unit(vectors: Places) -> Places:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(length, np.finfo(float).tiny)


class FeatureFinder:
    """The features that can be seen: their corners, and the nearest points of their edges.

    ``visible`` says of places (n, 3) with a normal (n, 3) whether they lie on a surface of the
    mesh: what is hidden in other parts must not attract its nodes.
    """

    def __init__(self, features: SharpFeatures, visible: Visible) -> None:
        from scipy.spatial import KDTree

        shown = visible(features.corners, features.corner_normals)
        self.corners = features.corners[shown]
        self.start, self.end = features.ends[:, 0], features.ends[:, 1]
        length = np.linalg.norm(self.end - self.start, axis=1)
        count = np.maximum(np.ceil(length / SPACING), 1).astype(int)
        edge = np.repeat(np.arange(len(length)), count)
        rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        share = (rank + 0.5) / np.repeat(count, count)  # ends belong to other edges too
        where = self.start[edge] + share[:, None] * (self.end - self.start)[edge]
        normal = features.normals[edge]
        cell = np.column_stack([np.floor(where / SEEN).astype(int), normal > 0])
        _, first, group = np.unique(cell, axis=0, return_index=True, return_inverse=True)
        shown = visible(where[first], normal[first])[group.reshape(-1)]
        self.edge, self.tree = edge[shown], KDTree(where[shown]) if shown.any() else None

    def on_edges(self, where: Places, reach: float) -> tuple[Bool[np.ndarray, "n"], Places]:
        """Whether an edge is within ``reach`` of each place, and the nearest point of it."""
        if self.tree is None:
            return np.zeros(len(where), dtype=bool), where
        found, sample = self.tree.query(where, distance_upper_bound=reach + SPACING)
        none = ~np.isfinite(found)
        edge = self.edge[np.where(none, 0, sample)]
        along = self.end[edge] - self.start[edge]
        square = np.maximum(np.einsum("ni,ni->n", along, along), np.finfo(float).tiny)
        share = np.einsum("ni,ni->n", where - self.start[edge], along) / square
        point = self.start[edge] + np.clip(share, 0, 1)[:, None] * along
        distance = np.linalg.norm(point - where, axis=1)
        return ~none & (distance <= reach), point
