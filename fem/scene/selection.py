"""Places of a mesh in words: their points, and how much of every face of the surface is in them."""

from __future__ import annotations

import difflib
import fnmatch
import re
from collections.abc import Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..errors import UsageError
from ..mesh import TetMesh, cross, face_areas, face_normals, outer_faces
from ..note import Note
from .loads import WHOLE

AXES = "xyz"
METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1.0, "km": 1e3, "in": 0.0254}
# Places reach this fraction of the diagonal further: `plane:z<0` means the face at z = 0 too, and
# coordinates written as text lose their last digits.
TOUCH = 1e-6
# A smaller share of a face is round-off of a place that ends at its edge.
SLIVER = 1e-9


class Selection(NamedTuple):
    """A place of a mesh.

    ``words`` are those of the user, ``axes`` the directions that a support there holds, a subset of
    (0, 1, 2); ``points`` are the ids of the mesh points in it, ``faces`` (faces, 3) those of the
    surface that lie in it, and ``parts`` (faces, 6) how much of each, as ``Traction`` has it: none
    of what only touches it. ``beyond`` is how far it goes on past its points, within tets [m].
    """

    words: str
    axes: tuple[int, ...]
    points: Int[np.ndarray, "points"]
    faces: Int[np.ndarray, "faces 3"]
    parts: Float[np.ndarray, "faces 6"]
    beyond: float = 0.0


def select(mesh: TetMesh, words: str, *, surface: bool = False) -> Selection:
    """Find the place that ``words`` mean; positions are in metres.

    Its faces are those of the outer surface; after ``inside:`` those of cavities, and its points
    the points of these. Where ``surface`` is wanted it may lie within a face, without any point.

    Raises UsageError: Where the words are not understood or nothing of the mesh lies there: it
        names the nearest part and the box of the mesh.
    """
    # Directions stand after the last colon; a part may be called 'lid:x'
    place, axes = words.removeprefix("inside:"), (0, 1, 2)
    before, _, last = place.rpartition(":")
    is_part = place.startswith("part:") and place[len("part:") :] in mesh.region_names
    if not is_part and last and re.fullmatch("x?y?z?", last) and (":" in before or before == "all"):
        place, axes = before, tuple(AXES.index(axis) for axis in last)
    boundary, outer = mesh.boundary, outer_faces(mesh)
    mine = ~outer if words.startswith("inside:") else outer
    if not mine.any():
        raise UsageError("selection.no_cavity", words=words)
    faces, owner = boundary.faces[mine], boundary.tet[mine]
    used = np.unique(mesh.tets if mine is outer else faces)
    kind, _, rest = place.partition(":")
    if kind == "part":
        inside = np.isin(mesh.region, _parts(mesh, words, rest))
        faces = faces[inside[owner]]
        ids = np.intersect1d(used, mesh.tets[inside])
        return Selection(words, axes, ids, faces, np.tile(WHOLE, (len(faces), 1)))
    # Half-spaces (normal, level), or a ball
    planes: list[tuple[np.ndarray, float]] = []
    ball: tuple[np.ndarray, float] | None = None
    if kind == "box":
        corners = lengths(rest, 6, words).reshape(2, 3)
        upper, lower = corners.max(axis=0), -corners.min(axis=0)
        planes = [*zip(np.eye(3), upper, strict=True), *zip(-np.eye(3), lower, strict=True)]
    elif kind == "plane":
        axis, sign, level = half_space(rest, words)
        planes = [(sign * np.eye(3)[axis], sign * level)]
    elif kind == "near":
        *centre, radius = lengths(rest, 4, words)
        if not radius > 0:
            raise UsageError("selection.radius_wanted", words=words, radius=radius)
        ball = np.array(centre), radius
    elif kind != "all":
        forms = Note("selection.part_name")
        raise UsageError("selection.place_called", words=words, kind=kind, forms=forms)
    elif rest:
        raise UsageError("selection.wanted_all", words=words)
    x, touch = mesh.points, TOUCH * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    away = np.zeros(len(x))
    for normal, level in planes:
        away = np.hypot(away, np.maximum(x @ normal - level, 0.0))
    if ball is not None:
        away = np.maximum(np.linalg.norm(x - ball[0], axis=1) - ball[1], 0.0)
    ids = used[away[used] <= touch]
    # A place is convex: a face whose corners are in it is in it as a whole, others are cut
    parts = np.outer(np.all(np.isin(faces, ids), axis=1), WHOLE)
    if surface and ((planes or ball) and (cut := np.flatnonzero(parts.sum(axis=1) == 0)).size):
        corners = x[faces[cut]]
        inside = _in_planes(corners, planes, touch) if ball is None else _in_ball(corners, *ball)
        parts[cut] = inside
    some = parts.sum(axis=1) > SLIVER
    if not (ids.size or (surface and some.any())):
        nearest = used[np.argmin(away[used])]
        place = ", ".join(f"{x:.4g}" for x in mesh.points[nearest])
        raise UsageError(
            "selection.point_mesh",
            words=words,
            place=place,
            region_names=mesh.region_names[mesh.region[(mesh.tets == nearest).any(axis=1)][0]],
            away=away[nearest],
            around=_around(mesh),
        )
    if surface and not some.any():  # a line or a point: the faces that touch it, none of them in it
        some = np.isin(faces, ids).any(axis=1)
    depth = [level - x @ normal for normal, level in planes]
    if ball is not None:
        depth = [ball[1] - np.linalg.norm(x - ball[0], axis=1)]
    beyond = _beyond(mesh.tets, np.isin(np.arange(len(x)), ids), depth, touch)
    return Selection(words, axes, ids, faces[some], parts[some], beyond)


def _beyond(
    tets: Int[np.ndarray, "tets 4"],
    inside: Bool[np.ndarray, "points"],
    depth: Sequence[Float[np.ndarray, "points"]],
    touch: float,
) -> float:
    """How far a place goes on past the points ``inside`` along edges that leave it [m].

    ``depth`` of the points below every border [m], negative beyond it.
    """
    ends = tets[:, list(permutations(range(4), 2))].reshape(-1, 2)
    start, end = ends[inside[ends[:, 0]] & ~inside[ends[:, 1]]].T
    if not (len(start) and len(depth)):
        return 0.0
    below = np.maximum(depth, 0.0)[:, start]
    over = np.maximum(-np.array(depth)[:, end], 0.0)
    leaves = np.where(over > touch, below / (below + np.maximum(over, touch)), np.inf)
    first = leaves.argmin(axis=0)  # of the borders on the way, from which it is so deep
    return float(below[first, np.arange(len(start))].max())


def _parts_of(
    corners: Float[np.ndarray, "n 3 3"],
    pieces: Float[np.ndarray, "pieces 3 3"],
    owner: Int[np.ndarray, "pieces"],
) -> Float[np.ndarray, "n 6"]:
    """Integrals of the quadratic functions of triangles over ``pieces`` of them, over their areas.

    The middles of the edges of a piece integrate them exactly.
    """
    middles = (pieces + np.roll(pieces, -1, axis=1)) / 2
    own = corners[owner]
    ways = np.stack([own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]], axis=2)
    across = np.linalg.pinv(ways) @ (middles - own[:, :1]).swapaxes(1, 2)
    L = np.stack([1 - across.sum(axis=1), across[:, 0], across[:, 1]], axis=2)
    N = np.concatenate([L * (2 * L - 1), 4 * L * np.roll(L, -1, axis=2)], axis=2).mean(axis=1)
    sizes = np.linalg.norm(
        np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1
    )
    wholes = np.linalg.norm(np.cross(*np.moveaxis(ways, 2, 0)), axis=1)
    each = N * (sizes / wholes)[:, None]
    return np.stack([np.bincount(owner, column, len(corners)) for column in each.T], axis=1)


def _in_planes(
    corners: Float[np.ndarray, "n 3 3"], planes: list[tuple[np.ndarray, float]], touch: float
) -> Float[np.ndarray, "n 6"]:
    """``_parts_of`` triangles in the half-spaces, cut by one after the other."""
    pieces, owner = corners, np.arange(len(corners))
    for normal, level in planes:
        beyond = pieces @ normal - level
        beyond[np.abs(beyond) <= touch] = 0.0
        count = (beyond > 0).sum(axis=1)
        kept = [(pieces[count == 0], owner[count == 0])]
        for outside in (1, 2):
            rows = np.flatnonzero(count == outside)
            # The corner that is alone on its side first, and where its edges meet the plane
            lone = np.argmax((beyond[rows] > 0) == (outside == 1), axis=1)
            order = (lone[:, None] + np.arange(3)) % 3
            (a, b, c), height = (
                np.moveaxis(pieces[rows[:, None], order], 1, 0),
                beyond[rows[:, None], order].T[..., None],
            )
            ab = a + height[0] / (height[0] - height[1]) * (b - a)
            ac = a + height[0] / (height[0] - height[2]) * (c - a)
            for made in ((ab, b, c), (ab, c, ac)) if outside == 1 else ((a, ab, ac),):
                kept.append((np.stack(made, axis=1), owner[rows]))
        pieces, owner = (np.concatenate(group) for group in zip(*kept, strict=True))
    return _parts_of(corners, pieces, owner)


# A face that a ball cuts is laid out with so many triangles along an edge.
CELLS = 24


def _in_ball(
    corners: Float[np.ndarray, "n 3 3"], centre: np.ndarray, radius: float
) -> Float[np.ndarray, "n 6"]:
    """``_parts_of`` triangles in a ball: in area exact, where it is by the cells inside.

    Each edge makes a triangle with the middle of the disc in which the ball cuts the plane; what is
    beyond the disc of that is a sector's.
    """
    ids = np.arange(3 * len(corners)).reshape(-1, 3)
    normal = face_normals(corners.reshape(-1, 3), ids)
    from_centre = corners - centre
    height = np.einsum("nki,ni->nk", from_centre, normal).mean(axis=1)
    square = np.maximum(radius**2 - height**2, 0.0)[:, None]
    a = from_centre - height[:, None, None] * normal[:, None]
    edge = np.roll(a, -1, axis=1) - a

    def dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.einsum("nki,nki->nk", u, v)

    def turn(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Twice the signed area of the triangle of two vectors."""
        rows = (np.moveaxis(w, -1, 0) for w in (u, v))
        return np.einsum("ink,ni->nk", np.stack(cross(*rows)), normal)

    # Where the line of the edge is in the disc, as shares of the edge; none: at its start
    length, along = dot(edge, edge), dot(a, edge)
    inside = along**2 - length * (dot(a, a) - square)
    reach = np.sqrt(np.maximum(inside, 0.0))
    start, end = (np.clip((sign * reach - along) / length, 0.0, 1.0) for sign in (-1, 1))
    start, end = np.where(inside > 0, start, 0.0), np.where(inside > 0, end, 0.0)
    u, v, b = (a + share[..., None] * edge for share in (start, end, np.ones_like(start)))
    sectors = sum(np.arctan2(turn(p, q), dot(p, q)) for p, q in ((a, u), (v, b)))
    areas = np.abs((square * sectors + turn(u, v)).sum(axis=1)) / 2
    met = np.flatnonzero(areas > 0)
    i, j = np.divmod(np.arange(CELLS**2), CELLS)
    i, j = i[(up := i + j < CELLS)], j[up]
    at = np.stack([i, j], axis=1)[:, None] + np.array([[0, 0], [1, 0], [0, 1]])
    down = np.stack([i, j], axis=1)[i + j < CELLS - 1, None] + np.array([[1, 1], [0, 1], [1, 0]])
    at = np.concatenate([at, down]) / CELLS
    cells = np.concatenate([1 - at.sum(axis=2, keepdims=True), at], axis=2) @ corners[met, None]
    away = np.linalg.norm(cells.mean(axis=2) - centre, axis=2)
    inside = away <= np.maximum(radius, away.min(axis=1))[:, None]
    parts = np.zeros((len(corners), 6))
    parts[met] = _parts_of(corners[met], cells[inside], np.nonzero(inside)[0])
    whole = face_areas(corners.reshape(-1, 3), ids)
    sizes = parts.sum(axis=1)
    return parts * (areas / whole / np.where(sizes > 0, sizes, 1.0))[:, None]


def _parts(mesh: TetMesh, words: str, name: str) -> list[int]:
    """Regions of the part called ``name``, whatever its case; of several, as in 'leg*', 'a,b'."""
    folded = {known.casefold(): known for known in mesh.region_names}
    part = name if name in mesh.region_names else folded.get(name.casefold())
    if part is None and "," in name:
        return [region for one in name.split(",") for region in _parts(mesh, words, one.strip())]
    if part is None and (group := fnmatch.filter(folded, name.casefold())):
        found = [mesh.region_names.index(folded[one]) for one in group]
        if held := [region for region in found if (mesh.region == region).any()]:
            return held
    if part is None:
        near = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.5)
        hint = Note("selection.you_mean", region_names=folded[near[0]]) if near else ""
        raise UsageError("selection.such_part", words=words, hint=hint, around=_around(mesh))
    region = mesh.region_names.index(part)
    if not (mesh.region == region).any():
        raise UsageError("selection.part_tets", words=words, around=_around(mesh))
    return [region]


def lengths(text: str, count: int, words: str) -> np.ndarray:
    """As ``numbers``, of lengths [m]: each may have a unit, as in '75mm,.2'."""
    units = "|".join(sorted(METRES, key=len, reverse=True))
    found = [re.fullmatch(rf"\s*(.*?)\s*({units})?\s*", part) for part in text.split(",")]
    scale = np.array([METRES[match[2] or "m"] for match in found if match])
    plain = ",".join(match[1] for match in found if match)
    return numbers(plain, count, words) * scale


def numbers(text: str, count: int, words: str) -> np.ndarray:
    """``count`` finite numbers with commas between them; ``UsageError`` naming ``words`` else."""
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        form = "a number" if count == 1 else Note("selection.numbers_commas", count=count)
        raise UsageError(f"{words!r}: {text!r} is not {form}")
    return values


def half_space(text: str, words: str) -> tuple[int, float, float]:
    """Axis, sign and level [m] of 'z<0.01': where sign * x[axis] is below sign * level.

    ``UsageError`` naming ``words`` where it is something else.
    """
    match = re.fullmatch(r"\s*([xyz])\s*([<>])=?(.+)", text)
    if match is None:
        raise UsageError("selection.wanted_plane", words=words)
    sign = 1.0 if match[2] == "<" else -1.0
    return AXES.index(match[1]), sign, float(lengths(match[3], 1, words)[0])


def _around(mesh: TetMesh, most: int = 8) -> str:
    names = ", ".join(mesh.region_names[:most])
    more = f" and {len(mesh.region_names) - most} more" if len(mesh.region_names) > most else ""
    spans = zip(AXES, *mesh.bounds, strict=True)
    box = ", ".join(f"{axis} {lo:.4g} to {hi:.4g}" for axis, lo, hi in spans)
    return Note("selection.parts_mesh", names=names, more=more, box=box)
