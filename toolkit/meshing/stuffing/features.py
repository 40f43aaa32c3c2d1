"""Sharp edges and corners of the input: found, and nodes of the mesh moved onto them.

A lattice cuts them off by up to half an edge, and a beam without its edges bends a third more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.scene.boundary import area_vectors
from ...surfaces.rows import face_edges
from ...surfaces.triangles import Triangles

SHARP = np.radians(35.0)  # between the normals of two faces, and between two edges at a corner
SEEN = 0.5  # long edges: what faces one way so near together is visible or hidden together
SPACING = 0.2  # of the points on edges among which the nearest is looked for, in long edges


Visible = Callable[[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]], np.ndarray]


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
    corner = _corners(points, edges)
    towards = np.zeros_like(points)
    for end in edges.T:
        np.add.at(towards, end, mean)
    return SharpFeatures(points[edges], _unit(mean), points[corner], _unit(towards[corner]))


def gathered_features(features: list[SharpFeatures]) -> SharpFeatures:
    """All features of several surfaces."""
    return SharpFeatures(*(np.concatenate(values) for values in zip(*features, strict=True)))


def shared_edges(faces: Int[np.ndarray, "faces 3"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges (n, 2) of exactly two faces, and these."""
    directed, edge, count = face_edges(faces)
    order = np.argsort(edge, kind="stable")
    two = (np.cumsum(count) - count)[count == 2]
    ends = np.sort(directed[order[two]], axis=1)
    return ends, order[two] // 3, order[two + 1] // 3


def _corners(
    points: Float[np.ndarray, "points 3"], edges: Int[np.ndarray, "edges 2"]
) -> Int[np.ndarray, "corners"]:
    """Vertices at which sharp edges end, branch, or go on in another direction."""
    count = np.bincount(edges.reshape(-1), minlength=len(points))
    total = np.zeros_like(points)  # of unit vectors along the edges: 0 where two go straight on
    along = _unit(points[edges[:, 1]] - points[edges[:, 0]])
    np.add.at(total, edges[:, 0], along)
    np.add.at(total, edges[:, 1], -along)
    bend = np.linalg.norm(total, axis=1) > 2 * np.sin(SHARP / 2)
    return np.flatnonzero((count == 1) | (count > 2) | ((count == 2) & bend))


def _unit(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(length, np.finfo(float).tiny)


def _asked_by_cell(
    visible: Visible, where: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Bool[np.ndarray, "n"]:
    """Ask one place for all in a cell of ``SEEN`` that look into the same octant.

    Finely rounded rims have thousands of edges in a long edge of the lattice.
    """
    cell = np.column_stack([np.floor(where / SEEN).astype(int), normal > 0])
    _, first, group = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    return visible(where[first], normal[first])[group.reshape(-1)]


class OnEdges(NamedTuple):
    """Nearest points of sharp edges: ``distance`` (n,), infinite where none is near, ``point``."""

    distance: np.ndarray
    point: np.ndarray


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
        shown = _asked_by_cell(visible, where, features.normals[edge])
        self.edge, self.tree = edge[shown], KDTree(where[shown]) if shown.any() else None

    def on_edges(self, where: Float[np.ndarray, "n 3"], reach: float) -> OnEdges:
        """Nearest points of edges within ``reach``."""
        if self.tree is None:
            return OnEdges(np.full(len(where), np.inf), where)
        found, sample = self.tree.query(where, distance_upper_bound=reach + SPACING)
        none = ~np.isfinite(found)
        edge = self.edge[np.where(none, 0, sample)]
        along = self.end[edge] - self.start[edge]
        square = np.maximum(np.einsum("ni,ni->n", along, along), np.finfo(float).tiny)
        share = np.einsum("ni,ni->n", where - self.start[edge], along) / square
        point = self.start[edge] + np.clip(share, 0, 1)[:, None] * along
        distance = np.linalg.norm(point - where, axis=1)
        return OnEdges(np.where(none | (distance > reach), np.inf, distance), point)
