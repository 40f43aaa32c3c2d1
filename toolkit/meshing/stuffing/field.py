"""Where each part ends: signed distances of all shells at the nodes of a lattice.

Lengths are in long edges of the lattice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from ...asset.solids import INSIDE, Shell, Solids
from ...asset.triangles import ClosestTo, Places, Triangles
from .lattice import Offsets

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
