"""Fewer triangles for the engine: edges collapsed while the surface stays where it was.

fTetWild has a simplification of its own that asks its envelope about every edge: on a scan of 5,000
triangles it takes two thirds of the whole time and removes a tenth of them. It is worth its time
only where ``decimated`` has to leave many triangles alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int

from .triangles import Triangles, closest, collapsed, edge_components

FEWEST = 1000  # triangles: with fewer the engine's time goes into the tets
SMALL = 200  # triangles: a component with fewer might collapse to nothing, and hardly matters
# Share of the triangles that each step keeps: halves as long as they are near enough, then less.
STEPS = (0.5, 0.8)
# Triangles left alone from which fTetWild's own simplification pays: a non-manifold pig of 18,000
# takes 56 s with it and more than 200 s without, an elephant of 5,800 takes 41 s and 36 s.
MANY = 10_000
STUCK = 0.95  # a step that keeps more than this share has found nothing more to collapse


class Decimated(NamedTuple):
    """A surface with fewer triangles, and how many of them were ``left_alone`` as they came."""

    surface: Triangles
    left_alone: int


def decimated(surface: Triangles, tolerance: float) -> Decimated:
    """Collapse edges of a coherently wound surface that then is within ``tolerance`` [m] of itself.

    Distances are taken both ways at vertices and middles of triangles. Small
    components, those with non-manifold edges, and those that share a point with another one are
    left alone: where parts touch, both keep the very same wall.
    """
    free = _free_faces(surface)
    left_alone = int((~free).sum())
    if free.sum() <= FEWEST:
        return Decimated(surface, left_alone)
    given = coarse = _compact(surface.points, surface.faces[free])
    for step in STEPS:
        while len(coarse.faces) > FEWEST:
            tried = collapsed(coarse, int(step * len(coarse.faces)))
            if len(tried.faces) > STUCK * len(coarse.faces) or _apart(given, tried) > tolerance:
                break
            coarse = tried
    rest = _compact(surface.points, surface.faces[~free])
    joined = Triangles(
        np.concatenate([rest.points, coarse.points]),
        np.concatenate([rest.faces, coarse.faces + len(rest.points)]),
    )
    return Decimated(joined, left_alone)


def _free_faces(surface: Triangles) -> Bool[np.ndarray, "faces"]:
    """Faces of components that are large, manifold, coherently wound and touch no other one."""
    faces, component = surface.faces, edge_components(surface.faces)
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, edge, times = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    bad = times[edge.reshape(-1)].reshape(-1, 3).max(axis=1, initial=0) > 1
    place = np.unique(surface.points, axis=0, return_inverse=True)[1].reshape(-1)
    owners = np.unique(np.column_stack([place[faces.reshape(-1)], np.repeat(component, 3)]), axis=0)
    shared = np.flatnonzero(np.bincount(owners[:, 0]) > 1)
    bad |= np.isin(place[faces], shared).any(axis=1)
    bad |= np.bincount(component)[component] < SMALL
    return ~np.isin(component, component[bad])


def _compact(points: np.ndarray, faces: Int[np.ndarray, "faces 3"]) -> Triangles:
    used, index = np.unique(faces, return_inverse=True)
    return Triangles(points[used], index.reshape(-1, 3))


def _apart(one: Triangles, other: Triangles) -> float:
    """Largest distance [m] between two surfaces, either way."""
    return max(_distance(one, other), _distance(other, one))


def _distance(start: Triangles, end: Triangles) -> float:
    where = np.concatenate([start.points, start.points[start.faces].mean(axis=1)])
    return float(closest(where, *end).distance.max(initial=0))
