"""Vertices that are one, and faces that repeat others: what exporters tear and double."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from .rows import equal_rows, face_edges
from .surface import Surface, face_orientation, subset
from .triangles import edge_components

# Vertices closer than this share of the diagonal are one: coordinates of float32, or printed with
# six decimals for a model of a few metres, differ by less.
WELD_REL = 1e-6
# Share of a component's faces in back-to-back pairs from which it is a surface exported twice.
TWO_SIDED_SHARE = 0.9


class Removed(NamedTuple):
    """Numbers of faces: without area, that repeat others, and in ``walls`` inside one solid."""

    null: int
    duplicate: int
    walls: int


def weld(surface: Surface, tolerance: float, *, within_parts: bool) -> tuple[Surface, int]:
    """Merge vertices nearer than ``tolerance`` [m], of one part or of all; also how many went."""
    faces = surface.faces.reshape(-1)
    used, faces = np.unique(faces, return_inverse=True)
    points = surface.points[used]
    owner = np.zeros(len(used), np.int64)
    if within_parts:
        owner[faces] = np.repeat(surface.part, 3)
    first, merged = _merged(points, owner, tolerance)
    faces = merged[faces.reshape(-1)].reshape(-1, 3)
    welded = surface._replace(points=points[first], faces=faces, component=edge_components(faces))
    return welded, len(used) - len(first)


def _merged(
    points: Float[np.ndarray, "n 3"], owner: Int[np.ndarray, "n"], tolerance: float
) -> tuple[Int[np.ndarray, "m"], Int[np.ndarray, "n"]]:
    """One of each group of near points of one owner, and the group (n,) of every point.

    Those in one cell of a grid are merged first, for there may be many, then the few across cells.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    cell = np.round((points - points.min(axis=0, initial=np.inf)) / tolerance).astype(np.int64)
    first, group, _ = equal_rows(np.column_stack([cell, owner]))
    if not len(first):
        return first, group
    near = KDTree(points[first]).query_pairs(tolerance, output_type="ndarray")
    near = near[owner[first][near[:, 0]] == owner[first][near[:, 1]]]
    links = coo_matrix((np.ones(len(near)), tuple(near.T)), shape=(len(first),) * 2)
    _, label = connected_components(links, directed=False)
    return first[np.unique(label, return_index=True)[1]], label[group]


def clean(surface: Surface, *, within_parts: bool) -> tuple[Surface, Removed]:
    """Drop faces without area, repeated ones, one side of sheets exported with their back faces.

    Of one part, both sides of the common wall of two touching solids go as well: its solids are
    one. Of different parts, both stay.
    """
    a, b, c = (surface.points[surface.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = max(np.linalg.norm(e, axis=1).max(initial=0) for e in (b - a, c - b, a - c))
    solid = area > (WELD_REL * longest) ** 2
    kept = subset(surface, solid)
    first, wall = _singled(kept, within_parts=within_parts)
    wall &= within_parts
    removed = Removed(int((~solid).sum()), int((~first & ~wall).sum()), int(wall.sum()))
    return subset(kept, first & ~wall), removed


def _singled(surface: Surface, *, within_parts: bool) -> tuple[np.ndarray, np.ndarray]:
    """The first of equal faces (faces,), and those in walls: back to back, but not of one sheet.

    The other walls of two touching solids go on from the rim of the common one two by two. Where a
    whole component consists of back-to-back pairs, or one single face goes on from the rim, it is
    one surface exported with its back faces, of which one side is enough.
    """
    if not len(surface.faces):
        return np.zeros(0, dtype=bool), np.zeros(0, dtype=bool)
    side = face_orientation(surface.faces).astype(int)
    owner = surface.part if within_parts else np.zeros_like(surface.part)
    key = np.column_stack([owner, np.sort(surface.faces, axis=1)])
    group = equal_rows(key).group
    has_side = np.zeros((group.max() + 1, 2), dtype=bool)
    has_side[group, side] = True
    paired = (has_side[:, 0] & has_side[:, 1])[group]
    share = np.bincount(surface.component, weights=paired) / np.bincount(surface.component)
    two_sided = share[surface.component] >= TWO_SIDED_SHARE
    two_sided[paired] |= _go_on_single(surface.faces, paired)
    first = np.zeros(len(group), dtype=bool)
    first[np.unique(2 * group + np.where(two_sided, 0, side), return_index=True)[1]] = True
    return first, paired & ~two_sided


def _go_on_single(
    faces: Int[np.ndarray, "faces 3"], paired: Bool[np.ndarray, "faces"]
) -> Bool[np.ndarray, "paired"]:
    """Of the regions of paired faces, those with more rim edges on odd numbers of other faces."""
    edge = face_edges(faces).edge.reshape(-1, 3)
    others = np.bincount(edge[~paired].reshape(-1), minlength=edge.max() + 1)[edge[paired]]
    region = edge_components(faces[paired])
    odd, even = others % 2 == 1, (others > 0) & (others % 2 == 0)
    surplus = np.bincount(region, weights=odd.sum(axis=1) - even.sum(axis=1))
    return surplus[region] > 0
