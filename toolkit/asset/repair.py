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
    Triangles,
    coherent_patches,
    crossing_pairs,
    edge_components,
    winding_numbers,
)

# Holes: loops of rim edges that caps close, unless they are the rim of a sheet or a seam.

# A boundary loop closed by a fan of more than this share of its component's area is the rim of a
# sheet (1 for a flat one, 0.8 for a quilt on a bed, 0.71 for one folded by 90 degrees, 0.5 for a
# half sphere, 0.2 for a lidless box).
HOLE_SHARE = 0.69
# In the plane of a hole the winding number is a whole number and a half; where another piece goes
# on from the rim it is a whole one, but for this much. A cap would then cut that piece off.
CRISP, SEAM_SHARE = 0.15, 0.75
SMALL = 0.05  # of its area: the cap of a smaller hole cuts off nothing that matters
BENT = 0.98  # of the area of its fan: a loop that a smaller cap closes is not flat


class Closed(NamedTuple):
    """A surface with caps, and how many ``holes`` and ``faces`` those are."""

    surface: Surface
    holes: int = 0
    faces: int = 0


class _Loops(NamedTuple):
    """Of each rim edge its ``loop``; of each loop the ``centre`` (n, 3) [m] and ``fan`` [m^2]."""

    loop: np.ndarray
    centre: np.ndarray
    fan: np.ndarray


def close_holes(
    surface: Surface,
    edges: Int[np.ndarray, "rim 2"],
    owner: Int[np.ndarray, "rim"],
    *,
    largest: float = HOLE_SHARE,
    joint: bool = False,
) -> Closed:
    """Close loops of rim edges, except the rims of sheets.

    With a fan around their centre, or the cap of least area where they are bent. ``owner`` is the
    face that each directed edge is of, ``largest`` the share of its component's area that a fan may
    have. With ``joint``, a loop stays open too where the components enclose it together: it is a
    seam between them.
    """
    if not len(edges):
        return Closed(surface)
    loops = _loops(surface, edges, owner)
    mine = np.zeros(len(loops.centre))
    mine[loops.loop] = component_areas(surface)[surface.component[owner]]
    share = loops.fan / mine
    fill = share <= HOLE_SHARE
    if largest > HOLE_SHARE:  # but never a flat sheet onto itself
        thick = np.zeros(len(share), dtype=bool)
        thick[loops.loop] = bulky_components(surface)[surface.component[owner]]
        fill |= thick & (share <= largest)
    if joint and (fill & (share > SMALL)).any():
        fill &= (share <= SMALL) | ~_seams(surface, edges, loops)
    # Caps of the loops to `fill` that are one bent cycle: a fan would cut through the body
    caps = {}
    length = np.bincount(loops.loop)
    for loop in np.flatnonzero(fill & (length > 3) & (length <= MOST_EDGES)):
        points = cycle(edges[loops.loop == loop])
        if points is not None:
            cap = least_area_cap(surface.points[points])
            if cap.area < BENT * loops.fan[loop]:
                caps[int(loop)] = points[cap.faces][:, ::-1]
    fan = fill.copy()
    fan[list(caps)] = False
    edge = fan[loops.loop]
    centre = len(surface.points) + (np.cumsum(fan) - 1)[loops.loop[edge]]
    first = np.unique(loops.loop, return_index=True)[1]
    added = [np.column_stack([edges[edge][:, ::-1], centre]), *caps.values()]
    part = surface.part[owner]
    parts = [part[edge], *(np.full(len(c), part[first[i]]) for i, c in caps.items())]
    faces = np.concatenate([surface.faces, *added])
    closed = Surface(
        np.concatenate([surface.points, loops.centre[fan]]),
        faces,
        np.concatenate([surface.part, *parts]),
        edge_components(faces),
    )
    return Closed(closed, int(fill.sum()), len(faces) - len(surface.faces))


def _loops(surface: Surface, edges: np.ndarray, owner: np.ndarray) -> _Loops:
    """Rim edges that hang together; where loops of two components touch, each has its own."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    node = surface.component[owner][:, None] * len(surface.points) + edges
    node = np.unique(node, return_inverse=True)[1].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(edges)), tuple(node.T)), shape=(node.max() + 1,) * 2)
    loop = connected_components(graph, directed=False)[1][node[:, 0]]
    start = surface.points[edges[:, 0]]
    sums = np.stack([np.bincount(loop, weights=start[:, k]) for k in range(3)], axis=1)
    centre = sums / np.bincount(loop)[:, None]
    a, b = (surface.points[edges[:, i]] - centre[loop] for i in (0, 1))
    return _Loops(
        loop, centre, np.bincount(loop, weights=np.linalg.norm(np.cross(a, b), axis=1) / 2)
    )


def _seams(surface: Surface, edges: np.ndarray, loops: _Loops) -> Bool[np.ndarray, "loops"]:
    """Loops on whose fan the whole surface has whole winding numbers: others go on from there."""
    fan = surface.points[edges].sum(axis=1) + loops.centre[loops.loop]
    where = np.concatenate([fan / 3, loops.centre])
    winding = winding_numbers(surface.points, surface.faces, where)
    crisp = np.abs(winding - np.round(winding)) < CRISP
    loop = np.concatenate([loops.loop, np.arange(len(loops.centre))])
    return np.bincount(loop, weights=crisp) >= SEAM_SHARE * np.bincount(loop)


# Vertices that are one, and faces that repeat others: what exporters tear and double.

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
    points: Places, owner: Int[np.ndarray, "n"], tolerance: float
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
    # Of the regions of paired faces, those with more rim edges on odd numbers of other faces
    edge = face_edges(surface.faces).edge.reshape(-1, 3)
    others = np.bincount(edge[~paired].reshape(-1), minlength=edge.max() + 1)[edge[paired]]
    region = edge_components(surface.faces[paired])
    odd, even = others % 2 == 1, (others > 0) & (others % 2 == 0)
    surplus = np.bincount(region, weights=odd.sum(axis=1) - even.sum(axis=1))
    two_sided[paired] |= surplus[region] > 0
    first = np.zeros(len(group), dtype=bool)
    first[np.unique(2 * group + np.where(two_sided, 0, side), return_index=True)[1]] = True
    return first, paired & ~two_sided


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
    # What stays open, non-manifold or crossing after repair
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
    surface, removed = clean(surface, within_parts=True)
    is_open = open_components(surface)[surface.component]
    closed, pool = subset(surface, ~is_open), subset(surface, is_open)
    pool, seams = weld(pool, tolerance, within_parts=False)
    pool, doubled = clean(pool, within_parts=False)
    faces = np.concatenate([closed.faces, pool.faces + len(closed.points)])
    points = np.concatenate([closed.points, pool.points])
    surface, turned = _orient(
        Surface(points, faces, np.concatenate([closed.part, pool.part]), edge_components(faces)),
        joint=joint,
    )
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
    # Turn the components whose volume is negative, unless they are cavities of their part
    surface = oriented
    volumes = component_volumes(surface)
    bulky = bulky_components(surface)
    first = np.unique(surface.component, return_index=True)[1]
    inside_out = np.bincount(surface.part[first], weights=np.where(bulky, volumes, 0)) < 0
    turn = inside_out[surface.part[first]][surface.component]
    surface = surface._replace(faces=_turned(surface.faces, turn))
    volumes = component_volumes(surface)
    is_open = open_components(surface)
    inverted = (volumes < 0) & (bulky | ~is_open)
    # Which inverted components lie inside the rest of their part: they are holes in its solid
    cavity = np.zeros(len(inverted), dtype=bool)
    for part in np.unique(surface.part[inverted[surface.component]]):
        mine = surface.part == part
        faces = surface.faces[mine]
        component = surface.component[mine]
        candidates = np.unique(component[inverted[component]])
        probes = np.array([_inside(surface.points, faces[component == c]) for c in candidates])
        winding = winding_numbers(surface.points, faces, probes)
        cavity[candidates] = winding > -0.5
    inverted &= ~cavity
    oriented = surface._replace(faces=_turned(surface.faces, inverted[surface.component]))
    if joint:
        oriented = _as_seen(oriented)
    flipped = face_orientation(oriented.faces) != face_orientation(given)
    return oriented, RepairReport(flipped_faces=int(flipped.sum()), loose_faces=int(loose.sum()))


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


def _capped(points: np.ndarray, faces: Faces) -> Triangles:
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


def _inside(points: np.ndarray, faces: np.ndarray) -> Float[np.ndarray, "3"]:
    """Point just below the largest face of an inverted shell, on the side it encloses."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    best = length.argmax()
    size = np.ptp(points[faces].reshape(-1, 3), axis=0).max()
    return (a + b + c)[best] / 3 + CAVITY_DEPTH * size * normal[best] / length[best]


# Caps: triangles of least area across a loop that does not lie in a plane.

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


class Sides(NamedTuple):
    """Of each patch: whether ``below`` and ``above`` its faces is inside the surface."""

    below: np.ndarray
    above: np.ndarray


class SeenShares(NamedTuple):
    """Of each patch: the share of directions that points ``below`` and ``above`` it see out in."""

    below: np.ndarray
    above: np.ndarray


def patch_sides(points: Points, faces: Faces, patch: Int[np.ndarray, "asked"]) -> Sides:
    """Ask on both sides of the largest faces of every patch for inside.

    ``patch`` numbers, from 0, those of the first faces; the others only bound.
    """
    below, above, patch = _probed(points, faces, patch)
    times = _faces_by_edge(faces)
    inside = _inside_hull if bool(((times > 1) & (times % 2 == 1)).any()) else _orientation_inside
    return Sides(inside(below, faces, patch), inside(above, faces, patch))


def patch_views(points: Points, faces: Faces, patch: Int[np.ndarray, "asked"]) -> SeenShares:
    """Share of all directions that each side of every patch sees out; ``patch`` as above.

    After Takayama, Jacobson, Kavan and Sorkine-Hornung 2014, "A simple method for correcting facet
    orientations in polygon meshes based on ray casting".
    """
    below, above, patch = _probed(points, faces, patch)
    return SeenShares(
        *(
            np.bincount(patch, weights=np.mean(side == 0, axis=0)) / np.bincount(patch)
            for side in (below, above)
        )
    )


def _probed(
    points: Points, faces: Faces, patch: Int[np.ndarray, "asked"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Crossings below and above the largest faces of each patch, and the patch of each of them."""
    a, b, c = (points[faces[: len(patch), i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    order = np.lexsort([-area, patch])
    start = np.unique(patch[order], return_index=True)[1]
    asked = order[np.arange(len(order)) - start[patch[order]] < PROBES]
    step = normal[asked] / np.maximum(area[asked], np.finfo(float).tiny)[:, None]
    step *= DEPTH * np.ptp(points[faces].reshape(-1, 3), axis=0).max()
    middle = (a + b + c)[asked] / 3
    counts = crossings(points, faces, np.concatenate([middle - step, middle + step]))
    below, above = np.split(counts, 2, axis=1)
    return below, above, patch[asked]


def _faces_by_edge(faces: Faces) -> Int[np.ndarray, "edges"]:
    return face_edges(faces).count


def _orientation_inside(
    counts: Int[np.ndarray, "directions n"], faces: Faces, patch: Int[np.ndarray, "n"]
) -> Bool[np.ndarray, "patches"]:
    """Whether most points of each patch are inside: by the parity of a clear majority of rays.

    Else, near fins, by whether no ray leaves without crossing anything.
    """
    odd = np.mean(counts % 2, axis=0)
    agreed = np.maximum(odd, 1 - odd) >= MAJORITY
    inside = np.where(agreed, odd > 0.5, np.all(counts > 0, axis=0))
    return np.bincount(patch, weights=inside) > np.bincount(patch) / 2


def _inside_hull(
    counts: Int[np.ndarray, "directions n"], faces: Faces, patch: Int[np.ndarray, "n"]
) -> Bool[np.ndarray, "patches"]:
    """Whether each patch is enclosed: no ray leaves, but for a few through holes if there are any.

    The side of a patch is on one cell, so that one ray which leaves a closed surface tells.
    """
    stopped = np.bincount(patch, weights=np.mean(counts > 0, axis=0)) / np.bincount(patch)
    closed = _faces_by_edge(faces).min() > 1
    return stopped >= (1.0 if closed else MAJORITY)


def crossings(points, faces, where) -> Int[np.ndarray, "directions n"]:
    """How often each of ``DIRECTIONS`` rays from each point crosses the surface."""
    rays = _shot(points, faces, where)
    return np.bincount(rays.hit, minlength=DIRECTIONS * len(where)).reshape(DIRECTIONS, -1)


def enclosed_shares(points: Points, faces: Faces, where: Places) -> Float[np.ndarray, "n"]:
    """Share of all directions in which each point lies on the inner side of the surface.

    There a ray leaves it more often than it enters it, or the reverse where that is usual. The
    winding number is the mean of the difference: walls that overlap in some directions make up for
    others in which there are none.
    """
    rays = _shot(points, faces, where)
    corners = points[faces[rays.face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    way = np.sign(np.einsum("hi,hi->h", normal, _spread(DIRECTIONS)[rays.hit // len(where)]))
    net = np.bincount(rays.hit, weights=way, minlength=DIRECTIONS * len(where))
    net = net.reshape(DIRECTIONS, -1)
    return np.mean(net * np.sign(net.sum(axis=0)) > 0, axis=0)


class _Rays(NamedTuple):
    """Crossings: the ray that ``hit``, numbered direction * points + point, and which ``face``."""

    hit: np.ndarray
    face: np.ndarray


def _shot(points, faces, where) -> _Rays:
    """Where ``DIRECTIONS`` rays from each point cross the surface."""
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    # Embree computes in single precision: centred, at unit size.
    used, faces = np.unique(faces, return_inverse=True)
    corners, faces = points[used], faces.reshape(-1, 3)
    lo, hi = corners.min(axis=0), corners.max(axis=0)
    centre, scale = (lo + hi) / 2, (hi - lo).max()
    caster = RayMeshIntersector(
        trimesh.Trimesh((corners - centre) / scale, faces, process=False), scale_to_box=False
    )
    origins = np.tile((where - centre) / scale, (DIRECTIONS, 1))
    directions = np.repeat(_spread(DIRECTIONS), len(where), axis=0)
    found = caster.intersects_id(origins, directions, multiple_hits=True)
    return _Rays(np.asarray(found[1], np.int64), np.asarray(found[0], np.int64))


def _spread(count: int) -> Float[np.ndarray, "count 3"]:
    """Unit vectors spread evenly over the sphere along a golden spiral, none along an axis."""
    i = np.arange(count) + 0.5
    height, turn = 1 - 2 * i / count, i * np.pi * (1 + np.sqrt(5))
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
