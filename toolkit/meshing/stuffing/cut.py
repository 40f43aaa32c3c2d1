"""Lattice tets warped and cut where regions meet: tets of one region each, conforming."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.scene.mesh import signed_volumes
from ..quality import dihedral_angles
from .junctions import junction_tets
from .lattice import Lattice, edges_of, tets_around
from .stencils import pattern_code, patterns, stencil

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

    def regions(self, offsets: Float[np.ndarray, "shells"]) -> Int[np.ndarray, "n"]:
        """Region of every node, 0 outside, where surfaces are moved outward by offsets."""
        ...

    def region_at(
        self, where: Float[np.ndarray, "m 3"], offsets: Float[np.ndarray, "shells"]
    ) -> Int[np.ndarray, "m"]:
        """Region of other places."""
        ...

    def crossings(
        self,
        ends: Int[np.ndarray, "edges 2"],
        regions: Int[np.ndarray, "edges 2"],
        offsets: Float[np.ndarray, "shells"],
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


def cut(lattice: Lattice, field: Regions, offsets: Float[np.ndarray, "shells"]) -> CutMesh:
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
    *inner, points = junction_tets(local[many], region[tets[mixed][many]], points)
    return _compact(points, wild, [whole, *pieces, DividedTets(*inner), kept])


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
    distance = np.concatenate([(s * length)[c] for s, c in zip((share, 1 - share), close,
                                                               strict=True)])  # fmt: skip
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
    local: Int[np.ndarray, "tets 10"],
    region: Int[np.ndarray, "tets 4"],
    mirrored: Bool[np.ndarray, "tets"],
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
        code = pattern_code(signs)
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
    points: Float[np.ndarray, "points 3"],
    wild: Bool[np.ndarray, "nodes"],
    offsets: Float[np.ndarray, "shells"],
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


def _positive(tets: Int[np.ndarray, "tets 4"], mirrored: Bool[np.ndarray, "tets"]) -> np.ndarray:
    return np.where(mirrored[:, None], tets[:, [0, 1, 3, 2]], tets)


def _compact(
    points: Float[np.ndarray, "points 3"],
    wild: Bool[np.ndarray, "nodes"],
    pieces: list[DividedTets],
) -> CutMesh:
    """All pieces, positively oriented, on the points that they use."""
    tets = np.concatenate([_positive(piece.tets, piece.mirrored) for piece in pieces])
    region = np.concatenate([piece.region for piece in pieces])
    inside = region > 0
    used = np.zeros(len(points), dtype=bool)
    used[tets[inside]] = True
    number = np.cumsum(used) - 1
    free = np.zeros(len(points), dtype=bool)
    free[: len(wild)] = ~wild
    tets = number[tets[inside]].astype(np.int32)
    return CutMesh(points[used], tets, region[inside], free[used])
