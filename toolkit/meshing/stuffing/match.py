"""Volumes: how much of each shell is wanted, and offsets of the surfaces that give it.

Cutting loses volume where a body is thin or convex, up to all of a rod of one long edge. A surface
moved outward by the volume that lacks, over its area, gives it back. Lengths are in long edges.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ....fem.scene.boundary import face_areas
from ...surfaces.samples import Inside, inside
from .cut import CutMesh
from .field import ShellField, SolidField

SAMPLES = 32_000  # in the boxes of all shells; one of one volume in three is known to .5 %
FEWEST = 2_000  # in the box of one shell of many
HIDDEN = 0.01  # of its volume: a shell that keeps less beside smaller ones keeps but noise
CLOSED = 0.05  # relative: a shell whose exact volume is that near to the sampled one is closed
# Relative errors of volume with which the first passes and the later ones are content.
PASSES, MOST_PASSES = 2, 9
GOOD, GOOD_ENOUGH = 0.002, 0.009
# The volume of a part much thinner than a long edge jumps: so many passes without a better mesh are
# the last ones.
PATIENCE = 3
FARTHEST = 0.35  # largest offset: labels are known within a long edge of the surfaces
STEEPEST = 3.0  # how many times more or less than its area a volume may grow with the offset


class Matched(NamedTuple):
    """A mesh, its volume by shell and the one wanted, 0 where it does not matter."""

    mesh: CutMesh
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


def wanted_volumes(field: SolidField) -> Float[np.ndarray, "shells"]:
    """Volume of each shell without what smaller shells take of it; 0 where they take all."""
    rng = np.random.default_rng(0)
    count = max(SAMPLES // len(field.shells), FEWEST)
    held = [_samples(shell, count, rng) for shell in field.shells]
    whole = np.array([_volume(*pair) for pair in zip(field.shells, held, strict=True)])
    wanted = whole.copy()
    for rank, (where, _, cell, _) in enumerate(held):
        own = cell * whole[rank] / max(cell.sum(), np.finfo(float).tiny)
        for higher in field.shells[rank + 1 :]:
            free = ~higher.shell.contains(where)
            where, own = where[free], own[free]
        for lower in range(rank):
            wanted[lower] -= own[field.shells[lower].shell.contains(where)].sum()
    return np.where(wanted > HIDDEN * whole, wanted + field.added, 0.0)


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
) -> Matched:
    """Build a mesh, and again with other offsets until the volumes are those ``wanted``.

    The best pass counts.
    """
    idle = 0
    area = np.array([face_areas(*shell.triangles).sum() for shell in field.shells])
    search, offsets, best = Search(area), np.zeros(len(area)), None
    for number in range(MOST_PASSES):
        mesh = build(offsets)
        found = Matched(mesh, _volumes(field, mesh), wanted)
        if best is None or found.error < best.error:
            best, idle = found, 0
        else:
            idle += 1
        if idle == PATIENCE or best.error < (GOOD if number < PASSES else GOOD_ENOUGH):
            break
        lacks = np.where(wanted > 0, wanted - found.volumes, 0.0)
        offsets = search.next(offsets, lacks)
    assert best is not None
    return best


class Search:
    """Offsets at which several volumes lack nothing: secants within brackets, one for each."""

    def __init__(self, area: Float[np.ndarray, "shells"]) -> None:
        """Begin with volumes that grow with the offset as fast as their ``area``."""
        self.area = area
        self.low, self.high = np.full(len(area), -FARTHEST), np.full(len(area), FARTHEST)
        self.last: tuple[np.ndarray, np.ndarray] | None = None
        self.halved = np.zeros(len(area), dtype=bool)

    def next(
        self, offsets: Float[np.ndarray, "shells"], lacks: Float[np.ndarray, "shells"]
    ) -> Float[np.ndarray, "shells"]:
        """Return offsets to try after these, which left volumes that lack so much."""
        slope = self.area
        if self.last is not None:
            step, grown = offsets - self.last[0], self.last[1] - lacks
            rate = grown / np.where(step == 0, 1.0, step)
            steep = np.clip(rate, self.area / STEEPEST, self.area * STEEPEST)
            slope = np.where(step == 0, slope, steep)
            # Half the way to a bound and lacking still: a neighbour's offset has moved the bound.
            stale = self.halved & (lacks * self.last[1] > 0)
            self.low = np.where(stale & (lacks < 0), -FARTHEST, self.low)
            self.high = np.where(stale & (lacks > 0), FARTHEST, self.high)
        self.last = offsets, lacks
        # The volume of something thin jumps: a bracket keeps the search from jumping back.
        self.low = np.where(lacks > 0, np.maximum(self.low, offsets), self.low)
        self.high = np.where(lacks < 0, np.minimum(self.high, offsets), self.high)
        tried = offsets + lacks / slope
        self.halved = ((tried <= self.low) | (tried >= self.high)) & (lacks != 0)
        return np.where(self.halved, (self.low + self.high) / 2, tried)


def _volumes(field: SolidField, mesh: CutMesh) -> Float[np.ndarray, "shells"]:
    rank = field.rank[mesh.region]
    total = np.bincount(rank, weights=mesh.volumes, minlength=len(field.shells))
    return total.astype(np.float64)  # of no tets it is integers
