"""Lattice tets warped and cut where regions meet: tets of one region each, conforming."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import combinations, product
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.mesh import signed_volumes
from ...asset.triangles import Points, Tets
from ..quality import dihedral_angles
from .lattice import EDGES, Lattice, Offsets, edges_of, tets_around

# A cut nearer than this share of an edge moves the node onto the surface. Labelle and Schewchuk,
# table 1: safe for dihedral angles of 10.7 to 164.8 degrees; just below, as equality is not.
SAFE_LONG, SAFE_SHORT = 0.24999, 0.41189
WILD = -1  # the region of a node on the surface
# Degrees; tets between nodes that all moved onto surfaces are outside the guarantee, and are kept
# where they are as good as what is inside it.
WILD_ANGLES = 10.8, 164.7


@runtime_checkable
class Regions(Protocol):
    """The nodes of a lattice, ``where`` (n, 3), and which region they and other places lie in."""

    where: np.ndarray

    def regions(self, offsets: Offsets) -> Int[np.ndarray, "n"]:
        """Region of every node, 0 outside, where surfaces are moved outward by offsets."""
        ...

    def region_at(self, where: Float[np.ndarray, "m 3"], offsets: Offsets) -> Int[np.ndarray, "m"]:
        """Region of other places."""
        ...

    def crossings(
        self,
        ends: Int[np.ndarray, "edges 2"],
        regions: Int[np.ndarray, "edges 2"],
        offsets: Offsets,
    ) -> Float[np.ndarray, "edges"]:
        """Share of each edge at which the ``regions`` of its ``ends`` meet."""
        ...


class CutMesh(NamedTuple):
    """``points`` (n, 3), positive ``tets`` (m, 4), the ``region`` (m,) of each.

    ``free`` (n,) are the points that are nodes of the lattice still, not on any surface.
    """

    points: np.ndarray
    tets: np.ndarray
    region: np.ndarray
    free: np.ndarray

    @property
    def volumes(self) -> Float[np.ndarray, "tets"]:
        """Volume of every tet."""
        return signed_volumes(self.points, self.tets)


class DividedTets(NamedTuple):
    """Tets of positive or, where ``mirrored``, negative orientation, each of one region."""

    tets: np.ndarray
    region: np.ndarray
    mirrored: np.ndarray


def cut(lattice: Lattice, field: Regions, offsets: Offsets) -> CutMesh:
    """Fill the regions with tets; the surface of each shell is moved outward by its offset."""
    nodes, region = field.where, field.regions(offsets)
    tets, mirrored = tets_around(lattice, region > 0)
    mixed = (region[tets] != region[tets[:, :1]]).any(axis=1)
    ends, edges = edges_of(tets[mixed], len(nodes))
    split = region[ends[:, 0]] != region[ends[:, 1]]
    share = np.full(len(ends), np.nan)
    share[split] = field.crossings(ends[split], region[ends[split]], offsets)
    points, wild = _warped(nodes, ends, share, lattice.even_count)
    region = np.where(wild, WILD, region)
    whole = DividedTets(tets[~mixed], region[tets[~mixed]].max(axis=1), mirrored[~mixed])
    a, b = region[ends].T
    cuts = np.flatnonzero((a != b) & (a != WILD) & (b != WILD))
    number = np.full(len(ends), -1)
    number[cuts] = len(nodes) + np.arange(len(cuts))
    start, end = nodes[ends[cuts, 0]], nodes[ends[cuts, 1]]
    points = np.concatenate([points, start + share[cuts, None] * (end - start)])
    local = np.concatenate([tets[mixed], number[edges]], axis=1)
    pieces, many = _divided(local, region[tets[mixed]], mirrored[mixed])
    kept = _wild_tets(lattice, field, points, wild, offsets)
    inner, points = junction_tets(local[many], region[tets[mixed][many]], points)
    # All pieces, positively oriented, on the points that they use
    pieces = [whole, *pieces, inner, kept]
    tets = np.concatenate([_positive(piece.tets, piece.mirrored) for piece in pieces])
    region = np.concatenate([piece.region for piece in pieces])
    inside = region > 0
    free = np.zeros(len(points), dtype=bool)
    free[: len(wild)] = ~wild
    return on_used(points, tets[inside], region[inside], free)


def on_used(
    points: Points, tets: Tets, region: Int[np.ndarray, "tets"], free: Bool[np.ndarray, "points"]
) -> CutMesh:
    """Return tets without the points that none of them uses."""
    used = np.zeros(len(points), dtype=bool)
    used[tets] = True
    tets = (np.cumsum(used) - 1).astype(np.int32)[tets]
    return CutMesh(points[used], tets, region, free[used])


def _warped(
    nodes: Float[np.ndarray, "nodes 3"],
    ends: Int[np.ndarray, "edges 2"],
    share: Float[np.ndarray, "edges"],
    even_count: int,
) -> tuple[Float[np.ndarray, "nodes 3"], Bool[np.ndarray, "nodes"]]:
    """Move nodes to the nearest cut that is too near, all at once; also which ones moved."""
    is_long = (ends[:, 0] < even_count) == (ends[:, 1] < even_count)
    safe = np.where(is_long, SAFE_LONG, SAFE_SHORT)
    length = np.where(is_long, 1.0, 0.75**0.5)
    close = [np.flatnonzero(s < safe) for s in (share, 1 - share)]  # no cut is NaN, never close
    node = np.concatenate([ends[c, k] for k, c in enumerate(close)])
    edge = np.concatenate(close)
    distance = np.concatenate([(share * length)[close[0]], ((1 - share) * length)[close[1]]])
    order = np.lexsort((distance, node))
    node, first = np.unique(node[order], return_index=True)
    edge = edge[order][first]
    start, end = nodes[ends[edge, 0]], nodes[ends[edge, 1]]
    moved = nodes.copy()
    moved[node] = start + share[edge, None] * (end - start)
    wild = np.zeros(len(nodes), dtype=bool)
    wild[node] = True
    return moved, wild


def _divided(
    local: Int[np.ndarray, "tets 10"], region: Tets, mirrored: Bool[np.ndarray, "tets"]
) -> tuple[list[DividedTets], Bool[np.ndarray, "tets"]]:
    """Cut the tets of one or two regions; say which have more."""
    high = region.max(axis=1)
    low = np.where(region == WILD, np.iinfo(region.dtype).max, region).min(axis=1)
    is_low, is_high = region == low[:, None], region == high[:, None]
    many = ~(is_low | is_high | (region == WILD)).all(axis=1)
    table, count = _table()
    pieces = []
    for mine, inside, other, asked in (
        (high, is_high, is_low & ~is_high, ~many & (high > 0)),
        (low, is_low, is_high, ~many & (low > 0) & (low < high)),
    ):
        asked = np.flatnonzero(asked)
        signs = np.where(inside[asked], 1, np.where(other[asked], -1, 0))
        code = (signs + 1) @ np.array([27, 9, 3, 1])  # the pattern's place in ``patterns``
        which, slot = np.nonzero(np.arange(table.shape[1]) < count[code][:, None])
        tets = np.take_along_axis(local[asked][which], table[code[which], slot], axis=1)
        pieces.append(DividedTets(tets, mine[asked][which], mirrored[asked][which]))
    return pieces, many


@cache
def _table() -> tuple[Int[np.ndarray, "81 3 4"], Int[np.ndarray, "81"]]:
    """The stencils of all patterns, and how many tets each has."""
    found = [stencil(pattern) for pattern in patterns()]
    count = np.array([len(tets) for tets in found])
    table = np.zeros((len(found), count.max(), 4), dtype=np.int64)
    for row, tets in zip(table, found, strict=True):
        row[: len(tets)] = np.array(tets).reshape(-1, 4)
    return table, count


def _wild_tets(
    lattice: Lattice,
    field: Regions,
    points: Points,
    wild: Bool[np.ndarray, "nodes"],
    offsets: Offsets,
) -> DividedTets:
    """Tets whose four nodes all moved onto surfaces: kept where they lie inside and are good.

    Without them a plate thinner than a long edge falls apart.
    """
    tets, mirrored = tets_around(lattice, wild)
    all_wild = wild[tets].all(axis=1)
    tets, mirrored = tets[all_wild], mirrored[all_wild]
    region = field.region_at(points[tets].mean(axis=1), offsets)
    volume = signed_volumes(points, tets) * np.where(mirrored, -1, 1)
    good = (region > 0) & (volume > 0)
    tets, region, mirrored = tets[good], region[good], mirrored[good]
    angle = dihedral_angles(points, _positive(tets, mirrored))
    good = (angle.min(axis=1) > WILD_ANGLES[0]) & (angle.max(axis=1) < WILD_ANGLES[1])
    return DividedTets(tets[good], region[good], mirrored[good])


def _positive(tets: Tets, mirrored: Bool[np.ndarray, "tets"]) -> np.ndarray:
    return np.where(mirrored[:, None], tets[:, [0, 1, 3, 2]], tets)


# Tets in which three or four regions meet: cones from a point in their middle.

FACES = ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2))
FACE_CENTRE, CENTRE = 10, 14  # after the corners and the cuts: points of the four faces and the tet


@cache
def cone(regions: tuple[int, ...]) -> tuple[tuple[tuple[int, ...], int], ...]:
    """Tets with their region for at least three regions at A, B, C, D, -1 on a surface.

    Each face is divided as its other tet divides it: where it has two regions by the rule of the
    stencils, where three around its centre.
    """
    out = []
    for number, face in enumerate(FACES):
        mine = [regions[i] for i in face]
        if min(mine) < 0:
            wild = face[mine.index(-1)]
            a, b = (i for i in face if i != wild)
            parts = [((end, CUT[a, b], wild), regions[end]) for end in (a, b)]
        elif len(set(mine)) == 3:
            centre = FACE_CENTRE + number
            pairs = ((i, j) for i in face for j in face if i != j)
            parts = [((i, CUT[i, j], centre), regions[i]) for i, j in pairs]
        else:
            tip = next(i for i in face if mine.count(regions[i]) == 1)
            a, b = (i for i in face if i != tip)
            parts = [((tip, CUT[tip, a], CUT[tip, b]), regions[tip])]
            parts += [(triangle, regions[a]) for triangle in cut_face(tip, a, b)]  # type: ignore
        out += [((*triangle, CENTRE), region) for triangle, region in parts]
    return tuple(out)


def junction_tets(
    local: Int[np.ndarray, "tets 10"], regions: Int[np.ndarray, "tets 4"], points: Points
) -> tuple[DividedTets, np.ndarray]:
    """Divide tets by their corners' ``regions``; also the points with those in the middles.

    ``local`` are the tets' points, -1 where none is. One is added in every face of three regions,
    one for both its tets, and one in every tet.
    """
    faces = np.full((len(local), 4), -1)
    corners = local[:, FACES]
    mine = np.sort(regions[:, FACES], axis=-1)
    three = (mine[..., 0] >= 0) & (np.diff(mine, axis=-1) > 0).all(axis=-1)
    found, number = np.unique(np.sort(corners[three], axis=-1), axis=0, return_inverse=True)
    faces[three] = len(points) + number.reshape(-1)
    cuts = np.stack([local[:, [CUT[a, b], CUT[b, c], CUT[a, c]]] for a, b, c in FACES], axis=1)
    middle = np.zeros((len(found), 3))
    middle[number.reshape(-1)] = points[cuts[three]].mean(axis=1)
    points = np.concatenate([points, middle])
    on = np.concatenate([regions < 0, local[:, 4:] >= 0], axis=1)
    weight = on / np.maximum(on.sum(axis=1), 1)[:, None]
    inner = np.einsum("tk,tki->ti", weight, points[local])
    local = np.column_stack([local, faces, len(points) + np.arange(len(local))])
    points = np.concatenate([points, inner])
    rows, group = np.unique(regions, axis=0, return_inverse=True)
    tets, region = [np.zeros((0, 4), np.int64)], [np.zeros(0, np.int64)]
    for number, row in enumerate(rows.tolist()):
        mine = local[group.reshape(-1) == number]
        for tet, inside in cone(tuple(row)):
            tets.append(mine[:, tet])
            region.append(np.full(len(mine), inside))
    found = np.concatenate(tets)
    mirrored = signed_volumes(points, found) < 0
    return DividedTets(found, np.concatenate(region), mirrored), points


# How a tet is divided by the signs of its four corners: one table for all 81 patterns.
#
# A corner is inside (+), outside (-) or on the surface (0); where two corners have opposite signs
# their edge is cut. Labelle and Shewchuk, "Isosurface stuffing" (SIGGRAPH 2007), section 3: where
# a face has two cuts, the diagonal of what they leave goes through the cut of a long edge, and
# where both are on short ones to the end of the long edge that the parity of the coordinates
# names, so that both tets at a face choose the same.

Pattern = tuple[int, ...]  # signs of A, B, C, D
Tet = tuple[int, ...]  # four points: 0 to 3 are the corners, 4 to 9 the cuts of the edges

CUT = {pair: 4 + k for k, edge in enumerate(EDGES) for pair in (edge, edge[::-1])}
LONG = (CUT[0, 1], CUT[2, 3])
# Of the faces at a long edge: its end that exceeds the tip in an even number of coordinates for
# odd edges, in an odd number for even ones. (Even on all faces, or odd, is one-sided: the tets
# inside and outside of a surface would choose other diagonals.)
END = {(0, 1, 2): 0, (0, 1, 3): 1, (2, 3, 0): 2, (2, 3, 1): 3}
# One tet of the lattice, A exceeding C in an even number of coordinates, positively oriented.
CORNERS = np.array([[0.5, 0.5, -0.5], [0.5, 0.5, 0.5], [0, 0, 0], [1, 0, 0]])
CORNERS = np.concatenate([CORNERS, [(CORNERS[i] + CORNERS[j]) / 2 for i, j in EDGES]])


def patterns() -> Iterator[Pattern]:
    """All 81 patterns of signs of A, B, C, D, in the order of their codes."""
    yield from product((-1, 0, 1), repeat=4)


@cache
def stencil(signs: Pattern) -> tuple[Tet, ...]:
    """Positively oriented tets that fill the inside of a tet with these signs of A, B, C, D."""
    inside, outside, surface = ([i for i in range(4) if signs[i] == s] for s in (1, -1, 0))
    if not inside:
        tets: list[Tet] = []
    elif not outside:
        tets = [(0, 1, 2, 3)]
    elif len(inside) == 1:
        tets = [(inside[0], *(CUT[inside[0], n] for n in outside), *surface)]
    elif len(inside) == 2 and surface:
        quad = cut_face(outside[0], inside[0], inside[1])
        tets = [(*triangle, *surface) for triangle in quad]
    elif len(inside) == 3:
        tets = _prism(inside, [CUT[p, outside[0]] for p in inside], outside, inside)
    else:
        one, two = ([p, *(CUT[p, n] for n in outside)] for p in inside)
        tets = _prism(one, two, outside, inside)
    # Of positive volume
    edges = [CORNERS[list(tet[1:])] - CORNERS[tet[0]] for tet in tets]
    return tuple(
        tet if np.linalg.det(edge) > 0 else (*tet[:2], tet[3], tet[2])
        for tet, edge in zip(tets, edges, strict=True)
    )


def face_diagonal(tip: int, first: int, second: int) -> set[int]:
    """Diagonal of the quadrilateral that cuts of both edges at ``tip`` leave of a face."""
    for end, other in ((first, second), (second, first)):
        if CUT[tip, end] in LONG:
            return {CUT[tip, end], other}
    end = END[min(first, second), max(first, second), tip]
    return {end, CUT[tip, second if end == first else first]}


def cut_face(tip: int, first: int, second: int) -> list[Tet]:
    """Return the two triangles of that quadrilateral."""
    near, far = CUT[tip, first], CUT[tip, second]
    if face_diagonal(tip, first, second) == {second, near}:
        return [(first, second, near), (second, near, far)]
    return [(first, second, far), (first, near, far)]


def _prism(
    top: Sequence[int], bottom: Sequence[int], outside: Sequence[int], inside: Sequence[int]
) -> list[Tet]:
    """Three tets of a prism that keep the diagonals of its cut faces; the fattest way."""
    fixed = [face_diagonal(tip, *ends) for tip in outside for ends in combinations(inside, 2)]
    sides = [(k, (k + 1) % 3) for k in range(3)]
    rims = [{s[i], s[j]} for s in (top, bottom) for i, j in sides]
    rims += [{top[k], bottom[k]} for k in range(3)]
    ways = []
    for leaning in product((False, True), repeat=3):
        diagonals = [
            {top[j], bottom[i]} if lean else {top[i], bottom[j]}
            for lean, (i, j) in zip(leaning, sides, strict=True)
        ]
        edges = [*rims, *diagonals]
        tets = [
            tet
            for tet in combinations([*top, *bottom], 4)
            if all(set(pair) in edges for pair in combinations(tet, 2))
        ]
        if len(tets) == 3 and all(diagonal in diagonals for diagonal in fixed):
            corners = CORNERS[tets]
            edges = corners[:, :, None] - corners[:, None]
            longest = np.linalg.norm(edges, axis=-1).max(axis=(1, 2))
            volume = np.abs(np.linalg.det(edges[:, 1:, 0]))
            ways.append((float((volume / longest**3).min()), tets))
    return max(ways)[1]  # type: ignore
