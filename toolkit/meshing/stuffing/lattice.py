"""A body-centred cubic lattice of tets: nodes with coordinates all even or all odd.

Each tet has a long edge between two odd nodes A, B and one between two even nodes C, D; the other
four are short, sqrt(3)/2 of it. Lengths are in long edges, the lattice's unit. Where each part ends
is told by the signed distances of all shells at its nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.mesh import area_vectors
from ...asset.solids import INSIDE, Shell, Solids
from ...asset.triangles import ClosestTo, Faces, Places, Tets, Triangles

Offsets = Float[np.ndarray, "shells"]  # how far the surface of each shell is moved outward
MOST_NODES = 6_000_000  # 1 GB of distances and labels on the way
# Edges of a tet A, B, C, D as pairs of corners; the first two are the long ones.
EDGES = ((0, 1), (2, 3), (0, 2), (0, 3), (1, 2), (1, 3))
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))  # corners of the square that an odd edge pierces


class Lattice(NamedTuple):
    """``cells`` (3,) cubes of unit edge from ``origin`` (3,) on; the even nodes count first."""

    origin: np.ndarray
    cells: np.ndarray

    @property
    def even_count(self) -> int:
        """Nodes at the corners of the cubes."""
        return int((self.cells + 1).prod())

    @property
    def node_count(self) -> int:
        """Even nodes, and odd ones in the middles of the cubes."""
        return self.even_count + int(self.cells.prod())

    def nodes(self) -> Float[np.ndarray, "nodes 3"]:
        """Positions of all nodes."""
        even, odd = (
            np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(
                -1, 3
            )
            for counts in (self.cells + 1, self.cells)
        )
        return self.origin + np.concatenate([even, odd + 0.5])  # type: ignore

    def together(self, some: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
        """Number of the group of each of some nodes, linked by long edges between them."""
        from scipy.ndimage import label

        wanted = np.zeros(self.node_count, dtype=bool)
        wanted[some] = True
        even, odd = np.split(wanted, [self.even_count])
        groups: Any = label  # its stubs know no pair
        first, count = groups(even.reshape(self.cells + 1))
        second, _ = groups(odd.reshape(self.cells))
        return np.concatenate([first.reshape(-1), second.reshape(-1) + count])[some]


def lattice_around(bounds: Float[np.ndarray, "2 3"]) -> Lattice:
    """Lattice with planes on the lower faces of a box, and a cube beyond it on every side."""
    lo, hi = bounds
    cells = np.ceil(np.round(hi - lo, 9)).astype(int) + 2
    return Lattice(lo - 1.0, cells)


def tets_around(
    lattice: Lattice, wanted: Bool[np.ndarray, "nodes"]
) -> tuple[Tets, Bool[np.ndarray, "tets"]]:
    """Corners A, B, C, D of tets that have a wanted node, and which are negatively oriented.

    Those of one kind are of the odd edges along an axis at one side of the squares they pierce.
    """
    even = np.arange(lattice.even_count, dtype=np.int32).reshape(lattice.cells + 1)
    odd = np.arange(lattice.even_count, lattice.node_count, dtype=np.int32)
    odd = odd.reshape(lattice.cells)
    corners, mirrored = [], []
    for axis, side in product(range(3), range(4)):
        # Steps of A, B and of C, D from the first cell
        ab, cd = np.zeros((2, 3), int), np.zeros((2, 3), int)
        ab[1, axis] = cd[:, axis] = 1
        cd[:, [(axis + 1) % 3, (axis + 2) % 3]] = _SQUARE[side], _SQUARE[(side + 1) % 4]
        if ((ab[0] + 0.5 > cd[0]).sum() % 2) == 1:  # A exceeds C in an even number of coordinates
            ab = ab[::-1]
        count = lattice.cells - np.eye(3, dtype=int)[axis]
        four = [
            nodes[tuple(slice(s, s + n) for s, n in zip(step, count, strict=True))].reshape(-1)
            for nodes, step in zip((odd, odd, even, even), (*ab, *cd), strict=True)
        ]
        here = np.flatnonzero(np.logical_or.reduce([wanted[nodes] for nodes in four]))
        corners.append(np.stack([nodes[here] for nodes in four], axis=1))
        a, *others = np.concatenate([ab + 0.5, cd])
        mirrored.append(np.full(len(here), np.linalg.det(np.array(others) - a) < 0))
    return np.concatenate(corners), np.concatenate(mirrored)


def edges_of(
    tets: Tets, node_count: int
) -> tuple[Int[np.ndarray, "edges 2"], Int[np.ndarray, "tets 6"]]:
    """All edges once each, and the edges of every tet in the order of ``EDGES``."""
    i, j = (np.concatenate([tets[:, edge[k]] for edge in EDGES]).astype(np.int64) for k in (0, 1))
    key = np.minimum(i, j) * node_count + np.maximum(i, j)
    unique, inverse = np.unique(key, return_inverse=True)
    ends = np.stack([unique // node_count, unique % node_count], axis=1)
    return ends, inverse.reshape(6, -1).T


# Sharp edges and corners of the input: found, and nodes of the mesh moved onto them.
#
# A lattice cuts them off by up to half an edge, and a beam without its edges bends a third more.

SHARP = np.radians(35.0)  # between the normals of two faces, and between two edges at a corner
SEEN = 0.5  # long edges: what faces one way so near together is visible or hidden together
SPACING = 0.2  # of the points on edges among which the nearest is looked for, in long edges


Visible = Callable[[Places, Places], np.ndarray]


class SharpFeatures(NamedTuple):
    """Sharp edges ``ends`` (n, 2, 3) with the mean ``normal`` (n, 3) of their faces; corners.

    ``corners`` (m, 3) with their ``corner_normals`` (m, 3).
    """

    ends: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    corner_normals: np.ndarray


def features_of(surface: Triangles) -> SharpFeatures:
    """Edges whose two faces meet sharply, and where these end, branch or turn sharply."""
    points, faces = surface
    area = area_vectors(points, faces)
    normal = _unit(area)
    proper = np.linalg.norm(area, axis=1) > 0
    edges, left, right = shared_edges(faces)
    cosine = np.einsum("ei,ei->e", normal[left], normal[right])
    sharp = (cosine < np.cos(SHARP)) & proper[left] & proper[right]
    edges, mean = edges[sharp], (normal[left] + normal[right])[sharp]
    # Vertices at which sharp edges end, branch, or go on in another direction
    count = np.bincount(edges.reshape(-1), minlength=len(points))
    total = np.zeros_like(points)  # of unit vectors along the edges: 0 where two go straight on
    along = _unit(points[edges[:, 1]] - points[edges[:, 0]])
    np.add.at(total, edges[:, 0], along)
    np.add.at(total, edges[:, 1], -along)
    bend = np.linalg.norm(total, axis=1) > 2 * np.sin(SHARP / 2)
    corner = np.flatnonzero((count == 1) | (count > 2) | ((count == 2) & bend))
    towards = np.zeros_like(points)
    for end in edges.T:
        np.add.at(towards, end, mean)
    return SharpFeatures(points[edges], _unit(mean), points[corner], _unit(towards[corner]))


def shared_edges(faces: Faces) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges (n, 2) of exactly two faces, and these."""
    from trimesh.graph import face_adjacency

    pairs, ends = face_adjacency(faces, return_edges=True)
    return ends, *pairs.T


def _unit(vectors: Places) -> Places:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(length, np.finfo(float).tiny)


class FeatureFinder:
    """The features that can be seen: their corners, and the nearest points of their edges.

    ``visible`` says of places (n, 3) with a normal (n, 3) whether they lie on a surface of the
    mesh: what is hidden in other parts must not attract its nodes.
    """

    def __init__(self, features: SharpFeatures, visible: Visible) -> None:
        from scipy.spatial import KDTree

        shown = visible(features.corners, features.corner_normals)
        self.corners = features.corners[shown]
        self.start, self.end = features.ends[:, 0], features.ends[:, 1]
        length = np.linalg.norm(self.end - self.start, axis=1)
        count = np.maximum(np.ceil(length / SPACING), 1).astype(int)
        edge = np.repeat(np.arange(len(length)), count)
        rank = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        share = (rank + 0.5) / np.repeat(count, count)  # ends belong to other edges too
        where = self.start[edge] + share[:, None] * (self.end - self.start)[edge]
        normal = features.normals[edge]
        cell = np.column_stack([np.floor(where / SEEN).astype(int), normal > 0])
        _, first, group = np.unique(cell, axis=0, return_index=True, return_inverse=True)
        shown = visible(where[first], normal[first])[group.reshape(-1)]
        self.edge, self.tree = edge[shown], KDTree(where[shown]) if shown.any() else None

    def on_edges(self, where: Places, reach: float) -> tuple[Bool[np.ndarray, "n"], Places]:
        """Whether an edge is within ``reach`` of each place, and the nearest point of it."""
        if self.tree is None:
            return np.zeros(len(where), dtype=bool), where
        found, sample = self.tree.query(where, distance_upper_bound=reach + SPACING)
        none = ~np.isfinite(found)
        edge = self.edge[np.where(none, 0, sample)]
        along = self.end[edge] - self.start[edge]
        square = np.maximum(np.einsum("ni,ni->n", along, along), np.finfo(float).tiny)
        share = np.einsum("ni,ni->n", where - self.start[edge], along) / square
        point = self.start[edge] + np.clip(share, 0, 1)[:, None] * along
        distance = np.linalg.norm(point - where, axis=1)
        return ~none & (distance <= reach), point


# Distances beyond are cut off: no edge is longer. Where both ends of one that enters a shell are
# that far from its faces it passes through a hole, and the winding number tells where.
REACH = 1.0
NUDGE = 1e-9  # in place of 0, which is neither inside nor outside
MARGIN = 2.0  # around a shell: an edge beyond its faces, and what an offset adds
# Radius of a bead: every place has a node within sqrt(5) / 4, so that one is inside by an eighth.
BEAD = 0.7
NOWHERE = np.zeros((0, 3))
BEAD_STEP = BEAD / 4  # edge of the boxes that its volume is counted in, to some percent

# Groups of some places, by number, that ways link on which every step is one of ``REACH`` at most.
Together = Callable[[Int[np.ndarray, "n"]], Int[np.ndarray, "n"]]


class Beads:
    """Balls around places (n, 3) where a lattice cuts apart what touches, added to a shell."""

    def __init__(self, where: Places) -> None:
        from scipy.spatial import KDTree

        self.where, self._tree = where, KDTree(where)

    def value(self, where: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m"]:
        """Signed distance, positive inside, cut off at ``REACH`` outside."""
        distance, _ = self._tree.query(where, distance_upper_bound=BEAD + REACH)
        return BEAD - np.minimum(distance, BEAD + REACH)

    def volume_outside(self, label: Callable[[np.ndarray], np.ndarray]) -> float:
        """Volume of the balls where ``label`` finds no region, to some percent."""
        reach = np.arange(-BEAD, BEAD + BEAD_STEP, BEAD_STEP)
        ball = np.stack(np.meshgrid(reach, reach, reach, indexing="ij"), axis=-1).reshape(-1, 3)
        boxes = np.round((self.where[:, None] + ball).reshape(-1, 3) / BEAD_STEP).astype(np.int64)
        middles = np.unique(boxes, axis=0) * BEAD_STEP
        middles = middles[self.value(middles) > 0]
        return float((label(middles) == 0).sum()) * BEAD_STEP**3


@dataclass(frozen=True, eq=False)
class ShellField:
    """One shell in lattice units; ``first`` is the region of the first of its ``parts``."""

    shell: Shell
    parts: np.ndarray
    first: int
    beads: Beads | None = None

    @classmethod
    def of(cls, shell: Shell, origin: np.ndarray, edge: float, first: int) -> ShellField:
        """Scale a shell, on its own points only."""
        used, faces = np.unique(shell.faces, return_inverse=True)
        hole = shell.cavity and Triangles((shell.cavity.points - origin) / edge, shell.cavity.faces)
        points = (shell.points[used] - origin) / edge
        own = replace(shell, points=points, faces=faces.reshape(-1, 3), cavity=hole)
        return cls(own, np.unique(shell.part), first)

    @cached_property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Box around it."""
        return np.stack([self.shell.points.min(axis=0), self.shell.points.max(axis=0)])

    def around(self, where: Places) -> Int[np.ndarray, "near"]:
        """Which places are in that box or so near to it that an edge may enter the shell."""
        lo, hi = self.bounds + np.array([[-MARGIN], [MARGIN]])
        return np.flatnonzero(((where >= lo) & (where <= hi)).all(axis=1))

    @cached_property
    def triangles(self) -> Triangles:
        """Faces of the shell and of its cavity."""
        hole = self.shell.cavity
        if hole is None:
            return Triangles(self.shell.points, self.shell.faces)
        faces = np.concatenate([self.shell.faces, hole.faces + len(self.shell.points)])
        return Triangles(np.concatenate([self.shell.points, hole.points]), faces)

    @cached_property
    def nearest(self) -> ClosestTo:
        """Nearest points of it."""
        return ClosestTo(*self.triangles)

    @cached_property
    def nearest_of_part(self) -> tuple[ClosestTo, ...]:
        """Nearest points of the faces of each part."""
        mine = [self.shell.faces[self.shell.part == part] for part in self.parts]
        return tuple(ClosestTo(self.shell.points, faces) for faces in mine)

    def value(self, where: Places, together: Together | None = None) -> Float[np.ndarray, "n"]:
        """Signed distance, positive inside, cut off at ``REACH``.

        Of places so far from a surface without rim one is asked for all that lie ``together``.
        """
        distance = np.minimum(self.nearest(where).distance, REACH)
        far = np.flatnonzero(distance >= REACH)
        if together is None or not self.shell.rimless or not len(far):
            winding = self._winding(where)
        else:
            _, first, group = np.unique(together(far), return_index=True, return_inverse=True)
            asked = np.concatenate([np.flatnonzero(distance < REACH), far[first]])
            winding = np.empty(len(where))
            winding[asked] = self._winding(where[asked])
            winding[far] = winding[far[first]][group.reshape(-1)]
        signed = np.where(winding > INSIDE, distance, -distance)
        hole = 2 * REACH * np.clip(winding - INSIDE, -INSIDE, INSIDE)
        out = np.where(distance < REACH, signed, hole)
        if self.beads is not None:
            out = np.maximum(out, self.beads.value(where))
        return np.where(np.abs(out) < NUDGE, NUDGE, out)

    def _winding(self, where: Places) -> Float[np.ndarray, "n"]:
        """How certainly places are inside: 1, outside 0."""
        winding = np.abs(self.shell.winding(where))
        if self.shell.winding_of_cavity is not None:
            winding = np.minimum(winding, 1 - self.shell.winding_of_cavity(where))
        return winding

    def region(self, where: Places) -> Int[np.ndarray, "n"]:
        """Region by the part of the nearest face."""
        if len(self.parts) == 1 or not len(where):
            return np.full(len(where), self.first, dtype=np.int32)
        hole = 0 if self.shell.cavity is None else len(self.shell.cavity.faces)
        part = np.concatenate([self.shell.part, np.tile(self.shell.part, 2)[:hole]])
        found = part[self.nearest(where).face]
        return (self.first + np.searchsorted(self.parts, found)).astype(np.int32)


class SolidField:
    """Regions of the nodes of a lattice: 0 outside, else a part of a shell.

    Where shells overlap the one that holds the smallest volume wins: the last of ``shells``.
    """

    def __init__(
        self, solids: Solids, *, origin: np.ndarray, edge: float, beads: Places = NOWHERE
    ) -> None:
        """Scale ``solids`` [m] so that a long ``edge`` [m] is one.

        ``beads`` [m] are around places where shells touch, of the larger one.
        """
        self.solids, self.edge = solids, edge
        shells, first = [], 1
        for shell in solids.largest_first:
            shells.append(ShellField.of(shell, origin, edge, first))
            first += len(shells[-1].parts)
        self.added = np.zeros(len(shells))  # volume of the beads of each, outside of all shells
        self.shells, at_rest = tuple(shells), np.zeros(len(shells))
        left = (beads - origin) / edge
        for rank, shell in enumerate(shells if len(beads) else ()):
            # Each has the beads that it is the first to be near to, and their volume
            mine = shell.nearest(left).distance < BEAD
            if mine.any():
                own, left = Beads(left[mine]), left[~mine]
                self.added[rank] = own.volume_outside(lambda at: self.region_at(at, at_rest))
                shells[rank] = replace(shell, beads=own)
        self.shells = tuple(shells)
        self.part = np.concatenate([[-1], *(shell.parts for shell in shells)])
        sizes = [len(shell.parts) for shell in shells]
        self.rank = np.concatenate([[-1], np.repeat(np.arange(len(shells)), sizes)])

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Box around all shells."""
        boxes = np.array([shell.bounds for shell in self.shells])
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def region_at(self, where: Places, offsets: Offsets) -> Int[np.ndarray, "n"]:
        """Region of each place, where the surface of each shell is moved outward by its offset."""
        out = np.zeros(len(where), dtype=np.int32)
        undecided = np.arange(len(where))
        for shell, offset in zip(reversed(self.shells), reversed(offsets), strict=True):
            asked = shell.around(where[undecided])
            places = undecided[asked]
            inside = shell.value(where[places]) + offset > 0
            out[places[inside]] = shell.region(where[places[inside]])
            undecided = np.delete(undecided, asked[inside])
        return out


class NodeField:
    """The shells' signed distances at ``where`` (n, 3), each near its shell only."""

    def __init__(self, field: SolidField, where: Places, together: Together | None = None) -> None:
        """Ask at all places; ``together`` numbers the groups of some that free ways link."""
        self.field, self.where = field, where
        self.near: list[np.ndarray] = []
        self.values: list[np.ndarray] = []
        self._regions: list[np.ndarray] = []
        for shell in field.shells:
            near = shell.around(where)
            value = shell.value(
                where[near], together and (lambda some, near=near: together(near[some]))
            )
            region = np.full(len(near), shell.first, dtype=np.int32)
            within = value > -REACH  # an offset may turn those around into inner ones
            region[within] = shell.region(where[near[within]])
            self.near.append(near)
            self.values.append(value)
            self._regions.append(region)

    def regions(self, offsets: Offsets) -> Int[np.ndarray, "n"]:
        """Region of every place, where the surface of each shell is moved outward by its offset."""
        out = np.zeros(len(self.where), dtype=np.int32)
        for near, value, region, offset in zip(
            self.near, self.values, self._regions, offsets, strict=True
        ):
            inside = value + offset > 0
            out[near[inside]] = region[inside]
        return out

    def region_at(self, where: Float[np.ndarray, "m 3"], offsets: Offsets) -> Int[np.ndarray, "m"]:
        """Region of other places."""
        return self.field.region_at(where, offsets)

    def crossings(
        self,
        ends: Int[np.ndarray, "edges 2"],
        regions: Int[np.ndarray, "edges 2"],
        offsets: Offsets,
    ) -> Float[np.ndarray, "edges"]:
        """Share of each edge, whose ``ends`` lie in two ``regions``, at which these meet.

        That is the surface of the smaller of two shells, and where both are parts of one shell
        what is as far from the faces of the one as from those of the other.
        """
        ranks = self.field.rank[regions]
        higher = ranks.max(axis=1)
        same = ranks[:, 0] == ranks[:, 1]
        out = np.full(len(ends), 0.5)
        for rank, offset in enumerate(offsets):
            mine = np.flatnonzero((higher == rank) & ~same)
            if mine.size:
                place = np.searchsorted(self.near[rank], ends[mine])
                out[mine] = _root(self.values[rank][place] + offset)
            mine = np.flatnonzero((higher == rank) & same)
            if mine.size:  # edges inside one shell, to where its two parts are equally far
                shell = self.field.shells[rank]
                nodes, place = np.unique(ends[mine], return_inverse=True)
                where, place = self.where[nodes], place.reshape(-1, 2)
                distance = np.stack([near(where).distance for near in shell.nearest_of_part])
                low, high = np.sort(regions[mine] - shell.first, axis=1).T[..., None]
                out[mine] = _root(distance[high, place] - distance[low, place])
        return out


def _root(values: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n"]:
    """Where a linear function with these values at 0 and 1 vanishes; the middle where nowhere."""
    start, end = values.T
    gap = start - end
    share = np.where(start * end <= 0, start / np.where(gap == 0, 1.0, gap), 0.5)
    return np.clip(np.where(gap == 0, 0.5, share), NUDGE, 1 - NUDGE)
