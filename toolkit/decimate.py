"""Fewer triangles for the engine: edges collapsed while the surface stays where it was.

fTetWild has a simplification of its own that asks its envelope about every edge: on a scan of 5,000
triangles it takes two thirds of the whole time and removes a tenth of them. It is worth its time
only where ``decimated`` has to leave many triangles alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from .triangles import Triangles, closest, coherent_patches, collapsed, edge_components

FEWEST = 1000  # triangles: with fewer the engine's time goes into the tets
SMALL = 200  # triangles: a piece with fewer might collapse to nothing, and hardly matters
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
    """Collapse edges of a surface that then is within ``tolerance`` [m] of itself, piece by piece.

    A piece is a component, or where a large one has non-manifold edges what these part it into;
    distances are taken both ways at vertices and middles of triangles. Small pieces, those with
    non-manifold edges, and components that share a point with another one are left alone: where
    parts touch, both keep the very same wall.
    """
    piece = _pieces(surface)
    free = piece >= 0
    left_alone = int((~free).sum())
    if free.sum() <= FEWEST:
        return Decimated(surface, left_alone)
    given = coarse = _torn(surface, np.flatnonzero(free), piece[free])
    for step in STEPS:
        coarse = _collapsed(given, coarse, step, tolerance)
    rest = _compact(surface.points, surface.faces[~free])
    joined = Triangles(
        np.concatenate([rest.points, coarse.points]),
        np.concatenate([rest.faces, coarse.faces + len(rest.points)]),
    )
    return Decimated(joined, left_alone)


class Pieces(NamedTuple):
    """Triangles and the piece (faces,) that each belongs to; no point is in two pieces."""

    points: np.ndarray
    faces: np.ndarray
    piece: np.ndarray

    def only(self, which: Bool[np.ndarray, "pieces"]) -> Pieces:
        """Return some pieces, with their numbers."""
        mine = which[self.piece]
        return Pieces(*_compact(self.points, self.faces[mine]), self.piece[mine])


def _collapsed(given: Pieces, coarse: Pieces, step: float, tolerance: float) -> Pieces:
    """Keep the share ``step`` of the triangles again and again, of each piece while it may."""
    count = int(given.piece.max()) + 1
    active = np.ones(count, dtype=bool)
    while (now := coarse.only(active)).piece.size > FEWEST:
        fewer, birth = collapsed(Triangles(now.points, now.faces), int(step * len(now.faces)))
        tried = Pieces(*fewer, now.piece[birth])
        before, after = (np.bincount(p.piece, minlength=count) for p in (now, tried))
        active &= (after > 0) & (after <= STUCK * before)
        if not active.any():
            break
        tried = tried.only(active)
        active &= _apart(given.only(active), tried, count) <= tolerance
        done, better = coarse.only(~active), tried.only(active)
        coarse = Pieces(
            np.concatenate([done.points, better.points]),
            np.concatenate([done.faces, better.faces + len(done.points)]),
            np.concatenate([done.piece, better.piece]),
        )
    return coarse


def _pieces(surface: Triangles) -> Int[np.ndarray, "faces"]:
    """Piece of every face, numbered from 0 on, or -1 where it is left alone."""
    faces, component = surface.faces, edge_components(surface.faces)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge, times = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    bad = times[edge.reshape(-1)].reshape(-1, 3).max(axis=1, initial=0) > 2
    place = np.unique(surface.points, axis=0, return_inverse=True)[1].reshape(-1)
    owners = np.unique(np.column_stack([place[faces.reshape(-1)], np.repeat(component, 3)]), axis=0)
    shared = np.flatnonzero(np.bincount(owners[:, 0]) > 1)
    touching = np.isin(place[faces], shared).any(axis=1)
    piece = component.copy()
    cut = np.isin(component, component[bad])
    large = cut & (np.bincount(component)[component] > MANY)
    piece[large] = component.max(initial=0) + 1 + coherent_patches(faces[large]).patch
    alone = np.isin(component, component[touching]) | (cut & ~large)
    alone |= np.bincount(piece)[piece] < SMALL
    free = np.full(len(faces), -1)
    free[~alone] = np.unique(piece[~alone], return_inverse=True)[1].reshape(-1)
    return free


def _torn(
    surface: Triangles, which: Int[np.ndarray, "free"], piece: Int[np.ndarray, "free"]
) -> Pieces:
    """Join the faces ``which`` only where two of them share an edge: then they are a manifold."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    faces = surface.faces[which]
    start = np.arange(3 * len(faces)).reshape(-1, 3)
    side = np.stack([start, np.roll(start, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends = faces.reshape(-1)[side]
    side = np.take_along_axis(side, np.argsort(ends, axis=1), axis=1)
    _, edge, times = np.unique(np.sort(ends), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.reshape(-1), kind="stable")
    first = np.flatnonzero(times[edge.reshape(-1)[order]] == 2)[::2]
    one, other = side[order[first]].reshape(-1), side[order[first + 1]].reshape(-1)
    links = coo_matrix((np.ones(len(one)), (one, other)), shape=(start.size,) * 2)
    corner = connected_components(links, directed=False)[1]
    origin = faces.reshape(-1)[np.unique(corner, return_index=True)[1]]
    return Pieces(surface.points[origin], corner.reshape(-1, 3).astype(np.int64), piece)


def _compact(points: np.ndarray, faces: Int[np.ndarray, "faces 3"]) -> Triangles:
    used, index = np.unique(faces, return_inverse=True)
    return Triangles(points[used], index.reshape(-1, 3))


def _apart(one: Pieces, other: Pieces, count: int) -> Float[np.ndarray, "pieces"]:
    """Largest distance [m] of every piece between two surfaces, either way."""
    return np.maximum(_distance(one, other, count), _distance(other, one, count))


def _distance(start: Pieces, end: Pieces, count: int) -> Float[np.ndarray, "pieces"]:
    owner = np.zeros(len(start.points), np.int64)
    owner[start.faces] = start.piece[:, None]
    where = np.concatenate([start.points, start.points[start.faces].mean(axis=1)])
    largest = np.zeros(count)
    away = closest(where, end.points, end.faces).distance
    np.maximum.at(largest, np.concatenate([owner, start.piece]), away)
    return largest
