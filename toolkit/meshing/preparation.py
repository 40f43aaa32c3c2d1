"""An asset's surfaces made ready: repaired, sorted into solids, held against the file as read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...predictors.asset import Asset, Part
from ..surfaces.offset import hollowed, thickened
from ..surfaces.repair import WELD_REL, Closing, RepairReport, repair
from ..surfaces.solids import Solids, sheet_faces
from ..surfaces.surface import Surface
from .conversion_report import Guarantee
from .losses import MOST_LOST, FileLosses, FileSamples, FileSurface, losses

# Ways to close what is open, until no volume is lost: piece by piece, all pieces together, either
# with caps larger than the piece itself, for those that are little more than a rim; without caps.
CLOSINGS = (
    Closing(),
    Closing(joint=True),
    Closing(largest=2.0),
    Closing(joint=True, largest=2.0),
    Closing(joint=True, whole=True),
)
MOST_GAINED = 0.25  # of the volume: with more that only caps enclose, a closing has filled a room


@dataclass(frozen=True)
class Preparation:
    """How surfaces become solids; lengths in metres.

    ``parts`` lie near the origin: far from it winding numbers and distances lose digits. Pieces
    thinner than ``thinnest`` are left out, sheets get the thickness ``thicken`` if any, solids the
    ``walls`` by number of their part.
    """

    parts: tuple[Part, ...]
    thinnest: float
    thicken: float | None
    walls: Mapping[int, float]

    @classmethod
    def of(
        cls, asset: Asset, *, thinnest: float, thicken: float | None, walls: Mapping[int, float]
    ) -> Preparation:
        """Take the bare parts of an asset, moved to the origin."""
        from trimesh import Trimesh

        centre = asset.bounds.mean(axis=0)
        parts = (
            replace(part, mesh=Trimesh(part.mesh.vertices - centre, part.mesh.faces, process=False))
            for part in asset.parts
        )
        return cls(tuple(parts), thinnest, thicken, walls)

    def prepared(self, *, epsilon: float, rng: np.random.Generator) -> Prepared:
        """Close the surfaces in the first way that loses no volume, or in the least lossy one."""
        file, tried = FileSamples.of(FileSurface.of(self.parts), rng=rng), []
        names = [part.name for part in self.parts]
        for closing in CLOSINGS:
            repaired, solids = self._solids(WELD_REL, closing)
            lost = losses(file, solids, names, distance=epsilon)
            if tried and lost.gained > max(tried[0].losses.gained, MOST_GAINED):
                continue
            tried.append(Prepared(solids, repaired, lost, self, closing, file.surface.read))
            if lost.bearable:
                break
        best = min(tried, key=lambda one: one.losses.lost)
        if self.thicken is not None:  # a sheet's volume closes no hole
            best = replace(best, losses=replace(best.losses, gained=0.0, capped=0.0))
        return replace(best, solids=hollowed(best.solids, self.walls))

    def again(self, weld_rel: float, closing: Closing) -> Solids:
        """Return the solids with another welding distance, a share of the diagonal."""
        return hollowed(self._solids(weld_rel, closing)[1], self.walls)

    def _solids(self, weld_rel: float, closing: Closing) -> tuple[RepairReport, Solids]:
        surface, repaired = repair(self.parts, weld_rel=weld_rel, closing=closing)
        if self.thicken is not None:
            sheet = sheet_faces(surface, thinnest=self.thinnest)
            surface = thickened(surface, sheet, self.thicken)
        solids = Solids.of(surface, len(self.parts), thinnest=self.thinnest, whole=closing.whole)
        return repaired, solids


@dataclass(frozen=True, eq=False)
class Prepared:
    """Solids, what repair changed, what they lack of the file; how they are prepared again."""

    solids: Solids
    repair: RepairReport
    losses: FileLosses
    preparation: Preparation
    closing: Closing
    read: Surface

    def again(self, weld_rel: float) -> Solids:
        """Return the solids with another welding distance, a share of the diagonal."""
        return self.preparation.again(weld_rel, self.closing)

    @property
    def kept_volume(self) -> Guarantee:
        """The promise that the solids hold next to all that the file encloses."""
        told = "share of the file's volume that is left out"
        return Guarantee(told, self.losses.lost, MOST_LOST)

    @property
    def reference(self) -> Surface | None:
        """Surface as read that distances are measured from; None where sheets were thickened."""
        return self.read if self.preparation.thicken is None else None
