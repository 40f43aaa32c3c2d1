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

from ...fem.mesh import area_vectors
from ...predictors.asset import Part
from .surface import (
    Surface,
    boundary_edges,
    bulky_components,
    component_areas,
    component_volumes,
    equal_rows,
    face_edges,
    face_orientation,
    open_components,
    subset,
    unbalanced_edges,
)
from .triangles import (
    Faces,
    Places,
    Points,
    coherent_patches,
    crossing_pairs,
    edge_components,
    linked_groups,
    winding_numbers,
)

# Vertices closer than this share of the diagonal are one: coordinates of float32, or printed with
# six decimals for a model of a few metres, differ by less.
WELD_REL = 1e-6
# A boundary loop closed by a fan of more than this share of its component's area is the rim of a
# sheet (1 for a flat one, 0.8 for a quilt on a bed, 0.71 for one folded by 90 degrees, 0.5 for a
# half sphere, 0.2 for a lidless box).
HOLE_SHARE = 0.69
MOST_CROSSED = 100_000  # triangles: crossings are told, not needed; foliage has millions of them


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
    start: tuple[Surface, RepairReport] | None = None,
) -> tuple[Surface, RepairReport]:
    """Weld, clean, orient and close the surfaces of all parts.

    Components that stay open within their part are welded to those of the other parts: a closed
    surface cut up by material becomes one component again, and every face keeps its part.

    parts: The parts of an asset, in metres.
    weld_rel: Vertices closer than this share of the diagonal are merged.
    closing: How what stays open is closed.
    start: What ``oriented`` gives of them, if that is known.
    """
    surface, changed = start or oriented(parts, weld_rel=weld_rel, joint=closing.joint)
    if not closing.whole:
        edges, owner = unbalanced_edges(surface)
        surface, holes, caps = close_holes(
            surface, edges, owner, largest=closing.largest, joint=closing.joint
        )
        changed += RepairReport(closed_holes=holes, added_faces=caps)
    count = face_edges(surface.faces).count
    many = len(surface.faces) > MOST_CROSSED
    return surface, changed + RepairReport(
        open_edges=int((count == 1).sum()),
        non_manifold_edges=int((count > 2).sum()),
        crossing_faces=None if many else len(crossing_pairs(surface.points, surface.faces)),
    )


def oriented(
    parts: Sequence[Part], *, weld_rel: float = WELD_REL, joint: bool = False
) -> tuple[Surface, RepairReport]:
    """Weld, clean and orient the surfaces of all parts; nothing is added. Arguments as above."""
    surface = stacked(parts)
    tolerance = weld_rel * float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    surface, welded = weld(surface, tolerance, within_parts=True)
    surface, null, repeated, walls = clean(surface, within_parts=True)
    is_open = open_components(surface)[surface.component]
    closed, pool = subset(surface, ~is_open), subset(surface, is_open)
    pool, seams = weld(pool, tolerance, within_parts=False)
    pool, null_seams, repeated_seams, _ = clean(pool, within_parts=False)
    faces = np.concatenate([closed.faces, pool.faces + len(closed.points)])
    points = np.concatenate([closed.points, pool.points])
    part = np.concatenate([closed.part, pool.part])
    surface, flipped, loose = orient(
        Surface(points, faces, part, edge_components(faces)), joint=joint
    )
    return surface, RepairReport(
        merged_vertices=welded + seams,
        null_faces=null + null_seams,
        duplicate_faces=repeated + repeated_seams,
        flipped_faces=flipped,
        loose_faces=walls + loose,
    )


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


def weld(surface: Surface, tolerance: float, *, within_parts: bool) -> tuple[Surface, int]:
    """Merge vertices nearer than ``tolerance`` [m], of one part or of all; also how many went.

    Those in one cell of a grid are merged first, for there may be many, then the few across cells.
    """
    used, faces = np.unique(surface.faces.reshape(-1), return_inverse=True)
    points = surface.points[used]
    owner = np.zeros(len(used), np.int64)
    if within_parts:
        owner[faces] = np.repeat(surface.part, 3)
    cell = np.round((points - points.min(axis=0, initial=np.inf)) / tolerance).astype(np.int64)
    first, group, _ = equal_rows(np.column_stack([cell, owner]))
    if len(first):
        near = near_pairs(points[first], tolerance)
        near = near[owner[first][near[:, 0]] == owner[first][near[:, 1]]]
        label = linked_groups(len(first), *near.T)
        first, group = first[np.unique(label, return_index=True)[1]], label[group]
    faces = group[faces.reshape(-1)].reshape(-1, 3)
    welded = surface._replace(points=points[first], faces=faces, component=edge_components(faces))
    return welded, len(used) - len(first)


def near_pairs(points: Points, distance: float) -> Int[np.ndarray, "pairs 2"]:
    """Pairs of points nearer than that [m], some of them several times.

    Both are in one cell of at least one of eight grids of twice the width, shifted by half of it.
    A tree says the same, but to load SciPy's takes longer than to weld most files.
    """
    scaled = (points - points.min(axis=0)) / (2 * distance)
    pairs = [np.zeros((0, 2), np.int64)]
    for shift in np.ndindex(2, 2, 2):
        cell = np.floor(scaled + np.array(shift) / 2).astype(np.int64)
        key: Any = np.ravel_multi_index(tuple(cell.T), tuple(cell.max(axis=0) + 1))
        order = np.argsort(key, kind="stable")
        key, step = key[order], 1
        while (same := np.flatnonzero(key[step:] == key[:-step])).size:
            pairs.append(np.column_stack([order[same], order[same + step]]))
            step += 1
    found = np.concatenate(pairs)
    return found[np.linalg.norm(points[found[:, 0]] - points[found[:, 1]], axis=1) <= distance]


# Share of a component's faces in back-to-back pairs from which it is a surface exported twice.
TWO_SIDED_SHARE = 0.9


def clean(surface: Surface, *, within_parts: bool) -> tuple[Surface, int, int, int]:
    """Drop faces without area, repeated ones, and walls inside one solid; also how many of each.

    Of one part, both sides of the common wall of two touching solids go: its solids are one. Of
    different parts, both stay. The other walls of the two solids go on from the rim of the common
    one two by two. Where a whole component consists of back-to-back pairs, or one single face goes
    on from the rim, it is one surface exported with its back faces, of which one side is enough.
    """
    a, b, c = (surface.points[surface.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = max(np.linalg.norm(e, axis=1).max(initial=0) for e in (b - a, c - b, a - c))
    solid = area > (WELD_REL * longest) ** 2
    null = int((~solid).sum())
    surface = subset(surface, solid)
    if not len(surface.faces):
        return surface, null, 0, 0
    side = face_orientation(surface.faces).astype(int)
    owner = surface.part if within_parts else np.zeros_like(surface.part)
    group = equal_rows(np.column_stack([owner, np.sort(surface.faces, axis=1)])).group
    has_side = np.zeros((group.max() + 1, 2), dtype=bool)
    has_side[group, side] = True
    paired = has_side[group].all(axis=1)
    share = np.bincount(surface.component, weights=paired) / np.bincount(surface.component)
    two_sided = share[surface.component] >= TWO_SIDED_SHARE
    # Of the regions of paired faces, those with more rim edges on odd numbers of other faces
    edge = face_edges(surface.faces).edge.reshape(-1, 3)
    others = np.bincount(edge[~paired].reshape(-1), minlength=edge.max() + 1)[edge[paired]]
    odd, even = others % 2 == 1, (others > 0) & (others % 2 == 0)
    region = edge_components(surface.faces[paired])
    surplus = np.bincount(region, weights=odd.sum(axis=1) - even.sum(axis=1))
    two_sided[paired] |= surplus[region] > 0
    first = np.zeros(len(group), dtype=bool)
    first[np.unique(2 * group + np.where(two_sided, 0, side), return_index=True)[1]] = True
    wall = paired & ~two_sided & within_parts
    kept = subset(surface, first & ~wall)
    return kept, null, int((~first & ~wall).sum()), int(wall.sum())


# Open components of which each side's view is asked: foliage has thousands, and no inside.
MOST_SEEN = 500
CLEAR_VIEW = 0.2  # of all directions: sides that see out less differently are both in, or both out
# Depth, relative to a component's size, of the point that decides whether it is a cavity.
CAVITY_DEPTH = 1e-4


def orient(surface: Surface, *, joint: bool) -> tuple[Surface, int, int]:
    """Orient every component coherently, and outward unless it is a cavity of its part.

    Fins and inner walls are dropped. With ``joint`` the open components are turned as they are
    seen. Also how many faces were turned, and dropped.
    """
    if not len(surface.faces):
        return surface, 0, 0
    coherent, patch = coherent_patches(surface.faces)
    faces = _as_most_were(surface.faces, coherent, patch)
    faces, loose = _patches_outward(surface._replace(faces=faces), patch)
    before, surface = surface.faces[~loose], subset(surface._replace(faces=faces), ~loose)
    if loose.any():  # what hung together by loose faces only may now be one patch
        faces = _as_most_were(surface.faces, *coherent_patches(surface.faces))
        surface = surface._replace(faces=faces)
    # Turn parts that are inside out as a whole, then components of negative volume
    bulky, is_open = bulky_components(surface), open_components(surface)
    part = surface.part[np.unique(surface.component, return_index=True)[1]]  # of each component
    volumes = component_volumes(surface)
    inside_out = (np.bincount(part, weights=np.where(bulky, volumes, 0)) < 0)[part]
    surface = _turned(surface, inside_out[surface.component])
    inverted = (component_volumes(surface) < 0) & (bulky | ~is_open)
    # but not those that lie inside the rest of their part: they are holes in its solid
    cavity = np.zeros(len(inverted), dtype=bool)
    for number in np.unique(surface.part[inverted[surface.component]]):
        mine = surface.part == number
        faces, component = surface.faces[mine], surface.component[mine]
        candidates = np.unique(component[inverted[component]])
        probes = []  # just below the largest face of each, on the side that it encloses
        for one in candidates:
            normal = area_vectors(surface.points, faces[component == one])
            length = np.linalg.norm(normal, axis=1)
            corners, best = surface.points[faces[component == one]], length.argmax()
            below = CAVITY_DEPTH * np.ptp(corners, axis=(0, 1)).max() * normal[best] / length[best]
            probes.append(corners[best].sum(axis=0) / 3 + below)
        cavity[candidates] = winding_numbers(surface.points, faces, np.array(probes)) > -0.5
    surface = _turned(surface, (inverted & ~cavity)[surface.component])
    if joint and 0 < is_open.sum() <= MOST_SEEN:
        # A patch of a body has no volume of its own to tell: it may be concave. But one side of
        # it sees out, and the other does not.
        mine = is_open[surface.component]
        faces = np.concatenate([surface.faces[mine], surface.faces[~mine]])
        patch = np.unique(surface.component[mine], return_inverse=True)[1].reshape(-1)
        below, above = patch_views(surface.points, faces, patch)
        turn = np.zeros_like(is_open)
        turn[is_open] = below - above > CLEAR_VIEW
        surface = _turned(surface, turn[surface.component])
    flipped = face_orientation(surface.faces) != face_orientation(before)
    return surface, int(flipped.sum()), int(loose.sum())


def _turned(surface: Surface, which: Bool[np.ndarray, "faces"]) -> Surface:
    return surface._replace(faces=np.where(which[:, None], surface.faces[:, ::-1], surface.faces))


def _as_most_were(before: np.ndarray, coherent: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """Of the two coherent orientations of a patch, the one most of its faces had."""
    changed = face_orientation(coherent) != face_orientation(before)
    share = np.bincount(patch, weights=changed) / np.maximum(np.bincount(patch), 1)
    return np.where((share[patch] > 0.5)[:, None], coherent[:, ::-1], coherent)


def _patches_outward(
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
    ends = np.searchsorted(surface.component[order], [several, several + 1])
    for mine in (order[start:end] for start, end in ends.T):
        local = np.unique(patch[mine], return_inverse=True)[1].reshape(-1)
        # Inside is what the component encloses together with caps of its holes
        used, index = np.unique(faces[mine], return_inverse=True)
        none = np.zeros(len(mine), np.int64)
        one = Surface(surface.points[used], index.reshape(-1, 3), none, none)
        rim, owner = boundary_edges(one)
        capped, *_ = close_holes(one, rim, owner)
        below, above = patch_sides(capped.points, capped.faces, local)
        bounds = below != above
        kept = bounds[local]
        area = component_areas(one._replace(component=kept.astype(np.int64)))
        if kept.any() and (not len(rim) or area[1] >= area[0]):
            turn = (bounds & above)[local]
            faces[mine] = np.where(turn[:, None], faces[mine][:, ::-1], faces[mine])
            loose[mine] = ~kept
    return faces, loose


# Holes: loops of rim edges that caps close, unless they are the rim of a sheet or a seam.

# In the plane of a hole the winding number is a whole number and a half; where another piece goes
# on from the rim it is a whole one, but for this much. A cap would then cut that piece off.
CRISP, SEAM_SHARE = 0.15, 0.75
SMALL = 0.05  # of its area: the cap of a smaller hole cuts off nothing that matters
BENT = 0.98  # of the area of its fan: a loop that a smaller cap closes is not flat
MOST_EDGES = 300  # of a bent loop: the search for its cap goes with their third power, 0.6 s
# Weight of a triangle's edges, squared, beside its area: of equal areas the better shapes.
SHAPE = 1e-4


def close_holes(
    surface: Surface,
    edges: Int[np.ndarray, "rim 2"],
    owner: Int[np.ndarray, "rim"],
    *,
    largest: float = HOLE_SHARE,
    joint: bool = False,
) -> tuple[Surface, int, int]:
    """Close loops of rim edges, except the rims of sheets; also how many, with how many faces.

    With a fan around their centre, or the cap of least area where they are bent. ``owner`` is the
    face that each directed edge is of, ``largest`` the share of its component's area that a fan may
    have. With ``joint``, a loop stays open too where the components enclose it together: it is a
    seam between them.
    """
    if not len(edges):
        return surface, 0, 0
    # Rim edges that hang together; where loops of two components touch, each has its own
    component = surface.component[owner]
    node = component[:, None] * len(surface.points) + edges
    node = np.unique(node, return_inverse=True)[1].reshape(-1, 2)
    loop = linked_groups(int(node.max()) + 1, *node.T)[node[:, 0]]
    length, start = np.bincount(loop), surface.points[edges[:, 0]]
    sums = [np.bincount(loop, weights=start[:, axis]) for axis in range(3)]
    centre = np.stack(sums, axis=1) / length[:, None]
    a, b = (surface.points[edges[:, i]] - centre[loop] for i in (0, 1))
    fans = np.bincount(loop, weights=np.linalg.norm(np.cross(a, b), axis=1) / 2)  # [m^2]
    mine = np.zeros(len(centre))
    mine[loop] = component_areas(surface)[component]
    share = fans / mine
    fill = share <= HOLE_SHARE
    if largest > HOLE_SHARE:  # but never a flat sheet onto itself
        thick = np.zeros(len(share), dtype=bool)
        thick[loop] = bulky_components(surface)[component]
        fill |= thick & (share <= largest)
    if joint and (fill & (share > SMALL)).any():
        # On the fan of a seam the whole surface has whole winding numbers: others go on from there
        middle = (surface.points[edges].sum(axis=1) + centre[loop]) / 3
        winding = winding_numbers(surface.points, surface.faces, np.concatenate([middle, centre]))
        crisp = np.abs(winding - np.round(winding)) < CRISP
        asked = np.concatenate([loop, np.arange(len(centre))])
        seam = np.bincount(asked, weights=crisp) >= SEAM_SHARE * np.bincount(asked)
        fill &= (share <= SMALL) | ~seam
    # Loops that are one bent cycle: a fan would cut through the body
    caps = {}
    for number in np.flatnonzero(fill & (length > 3) & (length <= MOST_EDGES)).tolist():
        points = cycle(edges[loop == number])
        if points is not None:
            cap = least_area_cap(surface.points[points])
            if cap.area < BENT * fans[number]:
                caps[number] = points[cap.faces][:, ::-1]
    fan = fill.copy()
    fan[list(caps)] = False
    edge = fan[loop]
    tip = len(surface.points) + (np.cumsum(fan) - 1)[loop[edge]]
    first = np.unique(loop, return_index=True)[1]
    part = surface.part[owner]
    parts = [part[edge], *(np.full(len(cap), part[first[i]]) for i, cap in caps.items())]
    added = [np.column_stack([edges[edge][:, ::-1], tip]), *caps.values()]
    faces = np.concatenate([surface.faces, *added])
    closed = Surface(
        np.concatenate([surface.points, centre[fan]]),
        faces,
        np.concatenate([surface.part, *parts]),
        edge_components(faces),
    )
    return closed, int(fill.sum()), len(faces) - len(surface.faces)


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


class Cap(NamedTuple):
    """``faces`` (n - 2, 3) over the points of a loop, in its order, and their ``area`` [m^2]."""

    faces: np.ndarray
    area: float


def least_area_cap(loop: Places) -> Cap:
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


# Which way out, where edges with more than two faces leave winding ambiguous: counting crossings.
#
# A ray crosses a closed surface an odd number of times from inside and an even number from
# outside, however the surface is wound; where it has fins or inner walls, the outside is what a
# ray leaves.

DIRECTIONS = 24  # rays from each point
MAJORITY = 0.75  # of the rays that must agree
DEPTH = 1e-5  # share of the size at which the sides of a face are probed
PROBES = 8  # faces of a patch that are asked, the largest ones


def patch_sides(
    points: Points, faces: Faces, patch: Int[np.ndarray, "asked"]
) -> tuple[np.ndarray, np.ndarray]:
    """Whether inside is below and above every patch, by the sides of its largest faces.

    ``patch`` numbers, from 0, those of the first faces; the others only bound.
    """
    below, above, patch = _crossed(points, faces, patch)
    count, times = np.bincount(patch), face_edges(faces).count

    def inside(crossed: Int[np.ndarray, "directions n"]) -> Bool[np.ndarray, "patches"]:
        leaves = crossed == 0
        if ((times > 1) & (times % 2 == 1)).any():
            # Parity says nothing. The side of a patch is on one cell, so that one ray which leaves
            # a closed surface tells; a few leave through holes if there are any.
            stopped = np.bincount(patch, weights=1 - np.mean(leaves, axis=0)) / count
            return stopped >= (1.0 if times.min() > 1 else MAJORITY)
        # The parity of a clear majority; else, near fins, whether no ray leaves
        odd = np.mean(crossed % 2, axis=0)
        agreed = np.maximum(odd, 1 - odd) >= MAJORITY
        within = np.where(agreed, odd > 0.5, ~leaves.any(axis=0))
        return np.bincount(patch, weights=within) > count / 2

    return inside(below), inside(above)


def patch_views(
    points: Points, faces: Faces, patch: Int[np.ndarray, "asked"]
) -> tuple[np.ndarray, np.ndarray]:
    """Share of all directions that each patch sees out in, below and above it; ``patch`` as above.

    After Takayama, Jacobson, Kavan and Sorkine-Hornung 2014, "A simple method for correcting facet
    orientations in polygon meshes based on ray casting".
    """
    below, above, patch = _crossed(points, faces, patch)
    below, above = (
        np.bincount(patch, weights=np.mean(side == 0, axis=0)) / np.bincount(patch)
        for side in (below, above)
    )
    return below, above


def _crossed(
    points: Points, faces: Faces, patch: Int[np.ndarray, "asked"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Crossings of rays from below and above the largest faces of each patch, and their patches."""
    normal = area_vectors(points, faces[: len(patch)])
    area = np.linalg.norm(normal, axis=1)
    order = np.lexsort([-area, patch])
    start = np.unique(patch[order], return_index=True)[1]
    asked = order[np.arange(len(order)) - start[patch[order]] < PROBES]
    step = normal[asked] / np.maximum(area[asked], np.finfo(float).tiny)[:, None]
    step *= DEPTH * np.ptp(points[faces].reshape(-1, 3), axis=0).max()
    middle = points[faces[asked]].sum(axis=1) / 3
    ray, _ = _cast(points, faces, np.concatenate([middle - step, middle + step]))
    count = np.bincount(ray, minlength=DIRECTIONS * 2 * len(asked)).reshape(DIRECTIONS, -1)
    below, above = np.split(count, 2, axis=1)
    return below, above, patch[asked]


def enclosed_fractions(points: Points, faces: Faces, where: Places) -> Float[np.ndarray, "n"]:
    """Share of all directions in which each point lies on the inner side of the surface.

    There a ray leaves it more often than it enters it, or the reverse where that is usual. The
    winding number is the mean of the difference: walls that overlap in some directions make up for
    others in which there are none.
    """
    ray, face = _cast(points, faces, where)
    normal = area_vectors(points, faces[face])
    way = np.sign(np.einsum("hi,hi->h", normal, _directions()[ray // len(where)]))
    net = np.bincount(ray, weights=way, minlength=DIRECTIONS * len(where)).reshape(DIRECTIONS, -1)
    return np.mean(net * np.sign(net.sum(axis=0)) > 0, axis=0)


# Of the size: how far behind a face its ray goes on. Embree computes in single precision; where it
# still finds the same face the ray goes on twice as far, again and again.
BEHIND = 1e-6
MOST_HITS = 100  # of one ray
EDGE_ON = 1e-5  # cosine of the angle between ray and normal: such a face ends the ray


def _cast(points: Points, faces: Faces, where: Places) -> tuple[np.ndarray, np.ndarray]:
    """Crossings of the surface: which ray, numbered direction * points + point, and which face."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    used, faces = np.unique(faces, return_inverse=True)
    corners, faces = points[used], faces.reshape(-1, 3)
    lo, hi = corners.min(axis=0), corners.max(axis=0)
    centre, scale = (lo + hi) / 2, (hi - lo).max()
    corners = (corners - centre) / scale
    scene = EmbreeScene()
    TriangleMesh(scene=scene, vertices=corners.astype(np.float32), indices=faces.astype(np.int32))
    normal = area_vectors(corners, faces)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    at = np.tile((where - centre) / scale, (DIRECTIONS, 1))
    way = np.repeat(_directions(), len(where), axis=0)
    live, last, step = np.arange(len(at)), np.full(len(at), -1), np.full(len(at), BEHIND)
    rays, hits = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for _ in range(MOST_HITS):
        face = scene.run(at[live].astype(np.float32), way[live].astype(np.float32))
        live, face = live[face >= 0], face[face >= 0]
        if not live.size:
            break
        again, cosine = face == last[live], np.einsum("ri,ri->r", normal[face], way[live])
        away = np.einsum("ri,ri->r", normal[face], corners[faces[face, 0]] - at[live])
        through = ~again & (np.abs(cosine) > EDGE_ON)
        away = np.divide(away, cosine, out=np.zeros_like(away), where=through)
        rays.append(live[through])
        hits.append(face[through])
        step[live] = np.where(again, 2 * step[live], BEHIND)
        at[live] += (away + step[live])[:, None] * way[live]
        last[live] = face
        live = live[again | through]
    return np.concatenate(rays), np.concatenate(hits).astype(np.int64)


def _directions() -> Float[np.ndarray, "directions 3"]:
    """Unit vectors spread evenly over the sphere along a golden spiral, none along an axis."""
    i = np.arange(DIRECTIONS) + 0.5
    height, turn = 1 - 2 * i / DIRECTIONS, i * np.pi * (1 + np.sqrt(5))
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
