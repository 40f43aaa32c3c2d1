"""Volumes: how much of each shell is wanted, and offsets of the surfaces that give it.

Cutting loses volume where a body is thin or convex, up to all of a rod of one long edge. A surface
moved outward by the volume that lacks, over its area, gives it back. Lengths are in long edges.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ....fem.scene.boundary import face_areas
from ...surfaces.samples import Inside, inside
from ...surfaces.solids import Solids
from .cut import CutMesh
from .field import ShellField, SolidField

SAMPLES = 32_000  # in the boxes of all shells; one of one volume in three is known to .5 %
FEWEST = 2_000  # in the box of one shell of many
HIDDEN = 0.01  # of its volume: a shell that keeps less beside smaller ones keeps but noise
CLOSED = 0.05  # relative: a shell whose exact volume is that near to the sampled one is closed
# Relative errors of volume with which the first passes and the later ones are content.
PASSES, MOST_PASSES = 2, 9
GOOD, GOOD_ENOUGH = 0.002, 0.009
# The volume of a part much thinner than a long edge jumps: so many passes that misplace more than
# this share of what the best one does are the last ones.
PATIENCE, NO_LESS = 3, 0.9
FARTHEST = 0.35  # largest offset: labels are known within a long edge of the surfaces
STEEPEST = 3.0  # how many times more or less than its area a volume may grow with the offset
SHORT = 0.02  # a shorter step tells of the neighbours' steps, not of a shell's own


class Matched(NamedTuple):
    """A mesh made with ``offsets``, its volume by shell and the one wanted: 0 where none is."""

    mesh: CutMesh
    offsets: np.ndarray
    volumes: np.ndarray
    wanted: np.ndarray

    @property
    def errors(self) -> Float[np.ndarray, "shells"]:
        """Relative error of each shell's volume."""
        matters = self.wanted > 0
        return np.where(matters, self.volumes / np.where(matters, self.wanted, 1.0) - 1, 0.0)

    @property
    def error(self) -> float:
        """Largest relative error of a shell's volume."""
        return float(np.abs(self.errors).max())

    @property
    def misplaced(self) -> float:
        """Share of the wanted volume that is too much or too little, of all shells."""
        return float(np.abs(self.errors) @ self.wanted / self.wanted.sum())


def wanted_volumes(field: SolidField) -> Float[np.ndarray, "shells"]:
    """Volume of each shell without what smaller shells take of it; 0 where they take all."""
    own = own_volumes(field.solids) / field.edge**3
    return np.where(own > 0, own + field.added, 0.0)


@lru_cache(maxsize=1)  # one body is filled by several lattices
def own_volumes(solids: Solids) -> Float[np.ndarray, "shells"]:
    """Volume [m^3] of each shell, largest first, without what smaller ones take; 0 if it is all."""
    shells = [ShellField.of(one, solids.bounds[0], 1.0, 1) for one in solids.largest_first]
    rng = np.random.default_rng(0)
    count = max(SAMPLES // len(shells), FEWEST)
    held = [_samples(shell, count, rng) for shell in shells]
    whole = np.array([_volume(*pair) for pair in zip(shells, held, strict=True)])
    own = whole.copy()
    for rank, (where, _, cell, _) in enumerate(held):
        taken = cell * whole[rank] / max(cell.sum(), np.finfo(float).tiny)
        for higher in shells[rank + 1 :]:
            free = ~higher.shell.contains(where)
            where, taken = where[free], taken[free]
        for lower in range(rank):
            own[lower] -= taken[shells[lower].shell.contains(where)].sum()
    return np.where(own > HIDDEN * whole, own, 0.0)


def _samples(shell: ShellField, count: int, rng: np.random.Generator) -> Inside:
    """Random points inside one shell; their labels tell how many more bodies share each."""

    def label(where: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n"]:
        return shell.shell.depth(where) - 1

    crisp = shell.shell.rimless
    return inside(shell.triangles, label, shell.bounds, rng=rng, count=count, crisp=crisp)


def _volume(shell: ShellField, held: Inside) -> float:
    """Exact volume of a closed shell without what its bodies share, else the sampled one."""
    exact = shell.shell.volume - float(held.label @ held.cell)
    near = abs(exact - held.total) <= max(CLOSED, held.uncertainty) * held.total
    return exact if near else held.total


def matched(
    field: SolidField,
    wanted: Float[np.ndarray, "shells"],
    build: Callable[[Float[np.ndarray, "shells"]], CutMesh],
    offsets: Float[np.ndarray, "shells"] | None = None,
) -> Matched:
    """Build a mesh, and again with other offsets until the volumes are those ``wanted``.

    It begins with the ``offsets`` of a similar lattice, if there are some. The pass that misplaces
    the least volume counts: a bolt that no lattice holds does not decide over the seat.
    """
    idle = 0
    area = np.array([face_areas(*shell.triangles).sum() for shell in field.shells])
    search, best = Search(area), None
    offsets = np.zeros(len(area)) if offsets is None else offsets
    for number in range(MOST_PASSES):
        mesh = build(offsets)
        found = Matched(mesh, offsets, _volumes(field, mesh), wanted)
        if best is None or found.misplaced < NO_LESS * best.misplaced:
            idle = 0
        else:
            idle += 1
        if best is None or found.misplaced < best.misplaced:
            best = found
        if idle == PATIENCE or found.error < (GOOD if number < PASSES else GOOD_ENOUGH):
            break
        lacks = np.where(wanted > 0, wanted - found.volumes, 0.0)
        offsets = search.next(offsets, lacks)
    assert best is not None
    return best


class Search:
    """Offsets at which several volumes lack nothing: secants within brackets, one for each."""

    def __init__(self, area: Float[np.ndarray, "shells"]) -> None:
        """Begin with volumes that grow with the offset as fast as their ``area``."""
        self.area, self.slope = area, area
        self.low, self.high = np.full(len(area), -FARTHEST), np.full(len(area), FARTHEST)
        self.last: tuple[np.ndarray, np.ndarray] | None = None
        self.halved = np.zeros(len(area), dtype=bool)

    def next(
        self, offsets: Float[np.ndarray, "shells"], lacks: Float[np.ndarray, "shells"]
    ) -> Float[np.ndarray, "shells"]:
        """Return offsets to try after these, which left volumes that lack so much."""
        if self.last is not None:
            step, grown = offsets - self.last[0], self.last[1] - lacks
            told = np.abs(step) >= SHORT
            steep = grown / np.where(told, step, 1.0)
            steep = np.clip(steep, self.area / STEEPEST, self.area * STEEPEST)
            self.slope = np.where(told, steep, self.slope)
            # Half the way to a bound and lacking still, or bounds that meet beside what is sought:
            # a neighbour's offset has moved the bound.
            stale = (self.halved & (lacks * self.last[1] > 0)) | (self.high - self.low < SHORT)
            self.low = np.where(stale & (lacks < 0), -FARTHEST, self.low)
            self.high = np.where(stale & (lacks > 0), FARTHEST, self.high)
        self.last = offsets, lacks
        # The volume of something thin jumps: a bracket keeps the search from jumping back.
        self.low = np.where(lacks > 0, np.maximum(self.low, offsets), self.low)
        self.high = np.where(lacks < 0, np.minimum(self.high, offsets), self.high)
        tried = offsets + lacks / self.slope
        self.halved = ((tried <= self.low) | (tried >= self.high)) & (lacks != 0)
        return np.where(self.halved, (self.low + self.high) / 2, tried)


def _volumes(field: SolidField, mesh: CutMesh) -> Float[np.ndarray, "shells"]:
    rank = field.rank[mesh.region]
    total = np.bincount(rank, weights=mesh.volumes, minlength=len(field.shells))
    return total.astype(np.float64)  # of no tets it is integers
