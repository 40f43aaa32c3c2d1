"""Repair a surface before it is tetrahedralised: weld, clean, orient, close; every change counted.

Non-manifold edges are left alone: the tetrahedraliser copes with them, and filters that remove them
delete faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...predictors.asset import Part
from .holes import HOLE_SHARE, close_holes
from .orientation import patch_sides, patch_views
from .rows import face_edges
from .surface import (
    Surface,
    boundary_edges,
    bulky_components,
    component_areas,
    component_volumes,
    face_orientation,
    open_components,
    subset,
    unbalanced_edges,
)
from .triangles import Triangles, coherent_patches, crossing_pairs, edge_components, winding_numbers
from .welding import WELD_REL, clean, weld

MOST_CROSSED = 100_000  # triangles: crossings are told, not needed; foliage has millions of them
# Open components of which each side's view is asked: foliage has thousands, and no inside.
MOST_SEEN = 500
CLEAR_VIEW = 0.2  # of all directions: sides that see out less differently are both in, or both out
# Depth, relative to a component's size, of the point that decides whether it is a cavity.
CAVITY_DEPTH = 1e-4


@dataclass(frozen=True)
class RepairReport:
    """How many things repair changed; 0 means that the input was clean in that respect.

    The last three are left as they are for the tetrahedraliser, which copes with them:
    ``crossing_faces`` counts pairs of triangles that cross or touch out of plane; it is None, not
    counted, on surfaces of more than ``MOST_CROSSED`` triangles.
    """

    merged_vertices: int = 0
    null_faces: int = 0
    duplicate_faces: int = 0
    flipped_faces: int = 0
    loose_faces: int = 0
    closed_holes: int = 0
    added_faces: int = 0
    open_edges: int = 0
    non_manifold_edges: int = 0
    crossing_faces: int | None = 0

    def __add__(self, other: RepairReport) -> RepairReport:
        both = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        total: dict[str, Any] = {k: None if None in v else sum(v) for k, v in both.items()}
        return RepairReport(**total)


class Closing(NamedTuple):
    """How open components are closed: each by itself, or ``joint`` with the others.

    Then the side of each that sees out is its outer one, and a rim from which others go on is no
    hole. ``largest`` is the share of a component's area up to which a cap closes a hole. As a
    ``whole`` they get no caps: what the winding number calls inside is closed where it is a half.
    """

    joint: bool = False
    largest: float = HOLE_SHARE
    whole: bool = False


def repair(
    parts: Sequence[Part],
    *,
    weld_rel: float = WELD_REL,
    closing: Closing = Closing(),  # noqa: B008 - a tuple does not change
) -> tuple[Surface, RepairReport]:
    """Weld, clean, orient and close the surfaces of all parts.

    Components that stay open within their part are welded to those of the other parts: a closed
    surface cut up by material becomes one component again, and every face keeps its part.

    Parameters
    ----------
    parts
        The parts of an asset, in metres.
    weld_rel
        Vertices closer than this share of the diagonal are merged.
    closing
        How what stays open is closed.
    """
    surface, changed = oriented(parts, weld_rel=weld_rel, joint=closing.joint)
    if not closing.whole:
        rim = unbalanced_edges(surface)
        how = {"largest": closing.largest, "joint": closing.joint}
        surface, closed_holes, added = close_holes(surface, *rim, **how)
        changed += RepairReport(closed_holes=closed_holes, added_faces=added)
    return surface, changed + _left_over(surface)


def oriented(
    parts: Sequence[Part], *, weld_rel: float = WELD_REL, joint: bool = False
) -> tuple[Surface, RepairReport]:
    """Weld, clean and orient the surfaces of all parts; nothing is added. Arguments as above."""
    surface = stacked(parts)
    tolerance = weld_rel * float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    surface, welded = weld(surface, tolerance, within_parts=True)
    surface, removed = clean(surface, within_parts=True)
    is_open = open_components(surface)[surface.component]
    closed, pool = subset(surface, ~is_open), subset(surface, is_open)
    pool, seams = weld(pool, tolerance, within_parts=False)
    pool, doubled = clean(pool, within_parts=False)
    surface, turned = _orient(_concatenated(closed, pool), joint=joint)
    report = RepairReport(
        merged_vertices=welded + seams,
        null_faces=removed.null + doubled.null,
        duplicate_faces=removed.duplicate + doubled.duplicate,
        loose_faces=removed.walls,
    )
    return surface, report + turned


def stacked(parts: Sequence[Part]) -> Surface:
    """Return the triangles of all parts as they are [m], in one component."""
    offsets = np.cumsum([0, *(len(part.mesh.vertices) for part in parts)])
    faces = [np.asarray(p.mesh.faces, np.int64) + o for p, o in zip(parts, offsets, strict=False)]
    return Surface(
        np.concatenate([np.asarray(part.mesh.vertices, np.float64) for part in parts]),
        np.concatenate(faces),
        np.repeat(np.arange(len(parts)), [len(f) for f in faces]),
        np.zeros(sum(map(len, faces)), np.int64),
    )


def _concatenated(a: Surface, b: Surface) -> Surface:
    faces = np.concatenate([a.faces, b.faces + len(a.points)])
    points = np.concatenate([a.points, b.points])
    return Surface(points, faces, np.concatenate([a.part, b.part]), edge_components(faces))


def _orient(surface: Surface, *, joint: bool) -> tuple[Surface, RepairReport]:
    """Orient every component coherently, and outward unless it is a cavity of its part."""
    if not len(surface.faces):
        return surface, RepairReport()
    coherent, patch = coherent_patches(surface.faces)
    faces = _majority(surface.faces, coherent, patch)
    faces, loose = _outward_patches(surface._replace(faces=faces), patch)
    given, oriented = surface.faces[~loose], subset(surface._replace(faces=faces), ~loose)
    if loose.any():  # what hung together by loose faces only may now be one patch
        faces = _majority(oriented.faces, *coherent_patches(oriented.faces))
        oriented = oriented._replace(faces=faces)
    oriented = _outward(oriented)
    if joint:
        oriented = _as_seen(oriented)
    flipped = face_orientation(oriented.faces) != face_orientation(given)
    return oriented, RepairReport(flipped_faces=int(flipped.sum()), loose_faces=int(loose.sum()))


def _outward(surface: Surface) -> Surface:
    """Turn the components whose volume is negative, unless they are cavities of their part."""
    volumes = component_volumes(surface)
    bulky = bulky_components(surface)
    first = np.unique(surface.component, return_index=True)[1]
    inside_out = np.bincount(surface.part[first], weights=np.where(bulky, volumes, 0)) < 0
    turn = inside_out[surface.part[first]][surface.component]
    surface = surface._replace(faces=_turned(surface.faces, turn))
    volumes = component_volumes(surface)
    is_open = open_components(surface)
    inverted = (volumes < 0) & (bulky | ~is_open)
    inverted &= ~_cavities(surface, inverted)
    return surface._replace(faces=_turned(surface.faces, inverted[surface.component]))


def _as_seen(surface: Surface) -> Surface:
    """Turn the open components that are seen from behind.

    A patch of a body has no volume of its own to tell: it may be concave. But one side of it sees
    out, and the other does not.
    """
    is_open = open_components(surface)
    if not 0 < is_open.sum() <= MOST_SEEN:
        return surface
    mine = is_open[surface.component]
    asked = np.unique(surface.component[mine], return_inverse=True)[1].reshape(-1)
    faces = np.concatenate([surface.faces[mine], surface.faces[~mine]])
    seen = patch_views(surface.points, faces, asked)
    turn = np.zeros_like(is_open)
    turn[is_open] = seen.below - seen.above > CLEAR_VIEW
    return surface._replace(faces=_turned(surface.faces, turn[surface.component]))


def _outward_patches(
    surface: Surface, patch: Int[np.ndarray, "faces"]
) -> tuple[np.ndarray, Bool[np.ndarray, "faces"]]:
    """Turn the patches that meet in non-manifold edges outward; find those that bound nothing.

    Of a component with several patches, those with inside or outside on both sides are fins and
    inner walls: they are loose, unless the whole component is such. In an open one they must also
    be the lesser part: else it is a sheet with pockets.
    """
    faces, loose = surface.faces.copy(), np.zeros(len(surface.faces), dtype=bool)
    pairs = np.unique(np.column_stack([surface.component, patch]), axis=0)
    several = np.flatnonzero(np.bincount(pairs[:, 0]) > 1)
    order = np.argsort(surface.component, kind="stable")
    bounds_of = np.searchsorted(surface.component[order], [several, several + 1])
    for start, end in bounds_of.T:
        mine = order[start:end]
        local = np.unique(patch[mine], return_inverse=True)[1].reshape(-1)
        capped = _capped(surface.points, faces[mine])
        sides = patch_sides(*capped, local)
        bounds = sides.below != sides.above
        if bounds.any() and _mostly(bounds[local], surface, mine):
            faces[mine] = _turned(faces[mine], (bounds & sides.above)[local])
            loose[mine] = ~bounds[local]
    return faces, loose


def _capped(points: np.ndarray, faces: Int[np.ndarray, "faces 3"]) -> Triangles:
    """Return the faces of one component, then caps of its holes: inside is what these enclose."""
    used, index = np.unique(faces, return_inverse=True)
    none = np.zeros(len(faces), np.int64)
    one = Surface(points[used], index.reshape(-1, 3), none, none)
    closed = close_holes(one, *boundary_edges(one)).surface
    return Triangles(closed.points, closed.faces)


def _mostly(
    bounds: Bool[np.ndarray, "mine"], surface: Surface, mine: Int[np.ndarray, "mine"]
) -> bool:
    """Whether of a component, its faces ``mine``, those that bound are the larger part by area."""
    one = Surface(surface.points, surface.faces[mine], surface.part[mine], bounds.astype(np.int64))
    area = np.append(component_areas(one), 0.0)
    whole = open_components(one._replace(component=np.zeros_like(one.component)))
    return not whole[0] or bool(area[1] >= area[0])


def _turned(faces: np.ndarray, which: Bool[np.ndarray, "faces"]) -> np.ndarray:
    return np.where(which[:, None], faces[:, ::-1], faces)


def _majority(before: np.ndarray, coherent: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """Of the two coherent orientations of a patch, the one most of its faces had."""
    changed = face_orientation(coherent) != face_orientation(before)
    share = np.bincount(patch, weights=changed) / np.maximum(np.bincount(patch), 1)
    return _turned(coherent, share[patch] > 0.5)


def _cavities(surface: Surface, inverted: Bool[np.ndarray, "components"]) -> np.ndarray:
    """Which inverted components lie inside the rest of their part: they are holes in its solid.

    Just inside such a shell the whole part has winding number 0; inside a stray inverted one -1.
    """
    cavity = np.zeros(len(inverted), dtype=bool)
    for part in np.unique(surface.part[inverted[surface.component]]):
        mine = surface.part == part
        faces = surface.faces[mine]
        component = surface.component[mine]
        candidates = np.unique(component[inverted[component]])
        probes = np.array([_inside(surface.points, faces[component == c]) for c in candidates])
        winding = winding_numbers(surface.points, faces, probes)
        cavity[candidates] = winding > -0.5
    return cavity


def _inside(points: np.ndarray, faces: np.ndarray) -> Float[np.ndarray, "3"]:
    """Point just below the largest face of an inverted shell, on the side it encloses."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    best = length.argmax()
    size = np.ptp(points[faces].reshape(-1, 3), axis=0).max()
    return (a + b + c)[best] / 3 + CAVITY_DEPTH * size * normal[best] / length[best]


def _left_over(surface: Surface) -> RepairReport:
    """What stays open, non-manifold or crossing after repair."""
    count = face_edges(surface.faces).count
    many = len(surface.faces) > MOST_CROSSED
    return RepairReport(
        open_edges=int((count == 1).sum()),
        non_manifold_edges=int((count > 2).sum()),
        crossing_faces=None if many else len(crossing_pairs(surface.points, surface.faces)),
    )
