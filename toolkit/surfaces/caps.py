"""Caps: triangles of least area across a loop that does not lie in a plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

MOST_EDGES = 300  # of a loop: the search goes with their third power, 0.6 s
# Weight of a triangle's edges, squared, beside its area: of equal areas the better shapes.
SHAPE = 1e-4


class Cap(NamedTuple):
    """``faces`` (n - 2, 3) over the points of a loop, in its order, and their ``area`` [m^2]."""

    faces: np.ndarray
    area: float


def cycle(edges: Int[np.ndarray, "n 2"]) -> Int[np.ndarray, "n"] | None:
    """Points of directed edges in the order of the one loop that they are; None if they are not."""
    after = dict(edges.tolist())
    if len(after) < len(edges) or len(edges) < 3:
        return None
    order = [int(edges[0, 0])]
    while len(order) < len(edges) and after.get(order[-1], order[0]) != order[0]:
        order.append(after[order[-1]])
    closed = len(order) == len(edges) and after.get(order[-1]) == order[0]
    return np.array(order) if closed else None


def least_area_cap(loop: Float[np.ndarray, "n 3"]) -> Cap:
    """Triangulate a closed polygon in space [m] with the least area.

    By dynamic programming over its chords, after Barequet and Sharir 1995, "Filling gaps in the
    boundary of a polyhedron".
    """
    count = len(loop)
    cost, split = np.zeros((count, count)), np.zeros((count, count), np.int64)
    for span in range(2, count):
        first = np.arange(count - span)[:, None]
        last, middle = first + span, first + np.arange(1, span)
        p, q, r = loop[first], loop[middle], loop[last]
        area = np.linalg.norm(np.cross(q - p, r - p), axis=2) / 2
        edges = sum(np.sum(e * e, axis=2) for e in (q - p, r - q, r - p))
        total = cost[first, middle] + cost[middle, last] + area + SHAPE * edges
        best = total.argmin(axis=1)
        rows = np.arange(count - span)
        cost[rows, rows + span] = total[rows, best]
        split[rows, rows + span] = rows + 1 + best
    faces, open_chords = [], [(0, count - 1)]
    while open_chords:
        i, k = open_chords.pop()
        if k - i > 1:
            j = int(split[i, k])
            faces.append((i, j, k))
            open_chords += [(i, j), (j, k)]
    faces = np.array(faces)
    p, q, r = (loop[faces[:, i]] for i in range(3))
    return Cap(faces, float(np.linalg.norm(np.cross(q - p, r - p), axis=1).sum() / 2))
