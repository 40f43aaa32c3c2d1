"""Separate non-manifold edges and vertices of a tet mesh's boundary by doubling nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.boundary import boundary_faces
from ..surfaces.rows import face_edges
from .quality import corner_nodes, vertex_count

# Each round splits edges that share no tet; a mesh that needs more rounds is not one of ours.
MAX_ROUNDS = 50


class Separated(NamedTuple):
    """A mesh whose pieces no longer hang together by bare edges or vertices.

    ``origin`` (tets,) is the tet of the given mesh that each tet lies in; ``split_edges`` and
    ``doubled_points`` count what was done.
    """

    points: Float[np.ndarray, "points 3"]
    tets: Int[np.ndarray, "tets 4"]
    origin: Int[np.ndarray, "tets"]
    split_edges: int
    doubled_points: int


def separate(points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"]) -> Separated:
    """Double the nodes where tets meet without sharing a face, so that the boundary is manifold.

    A vertex where the tets form several face-connected groups gets a node for each. An edge with
    several groups around it, whose ends hang together elsewhere, first gets a point in its middle,
    which then is doubled in the same way. Points that no tet uses are dropped.
    """
    origin = np.arange(len(tets))
    split = doubled = 0
    for _ in range(MAX_ROUNDS):
        used = vertex_count(tets)
        tets, old = corner_nodes(tets)
        points = points[old]
        doubled += len(old) - used
        bad = bare_edges(tets)
        if not len(bad):
            break
        chosen = _independent(bad, tets)
        split += len(chosen)
        points, tets, parent = _halve(points, tets, chosen)
        origin = origin[parent]
    return Separated(points, tets.astype(np.int32), origin, split, doubled)


def bare_edges(tets: np.ndarray) -> np.ndarray:
    """Edges (n, 2) with more than two faces of the boundary: several groups of tets around them."""
    faces = boundary_faces(tets).faces
    directed, edge, count = face_edges(faces)
    first = np.unique(edge, return_index=True)[1]
    return np.sort(directed[first], axis=1)[count != 2]


def _independent(edges: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """A subset of ``edges`` of which no tet has two."""
    taken = np.zeros(len(tets), dtype=bool)
    chosen = []
    for edge in edges:
        around = np.isin(tets, edge).sum(axis=1) == 2
        if not taken[around].any():
            taken |= around
            chosen.append(edge)
    return np.array(chosen)


def _halve(points, tets, edges) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Put a point in the middle of each edge; returns points, tets and each tet's parent."""
    middle = len(points) + np.arange(len(edges))
    points = np.concatenate([points, points[edges].mean(axis=1)])
    halves, parents = [], []
    for (u, v), m in zip(edges, middle, strict=True):
        around = np.flatnonzero(np.isin(tets, (u, v)).sum(axis=1) == 2)
        halves += [np.where(tets[around] == u, m, tets[around])]
        halves += [np.where(tets[around] == v, m, tets[around])]
        parents += [around, around]
    cut, halves = np.concatenate(parents), np.concatenate(halves)
    keep = np.setdiff1d(np.arange(len(tets)), cut)
    return points, np.concatenate([tets[keep], halves]), np.concatenate([keep, cut])
