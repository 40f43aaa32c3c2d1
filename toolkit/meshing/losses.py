"""What of the file as it was read is not in the solids: by volume and by area, by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...predictors.asset import Part
from ..asset.repair import WELD_REL, enclosed_shares, oriented, stacked, weld
from ..asset.solids import Solids
from ..asset.surface import Surface, incoherence, open_components
from ..asset.triangles import Places, WindingNumber, closest, sample, stratified

MOST_LOST = 0.05  # of the volume: a body that lacks more is another body
# Winding number from which a point is inside for certain: it sees the surface's inner side in at
# least three quarters of all directions. In a dish or over a sheet it is little more than a half.
CERTAIN, OUTSIDE = 0.75, 0.25
BODY = 0.5  # of the volume as seen: a file that encloses less as read is wound at random
INCOHERENT = 0.01  # of the edges: more neighbours that disagree are no slip but a habit
# Samples inside, for a share of 5 % to 0.7 %; so many times more are drawn in thin bodies.
FEWEST, MORE = 1_000, 4
AREA_SAMPLES = 4_000  # of the file's area: shares to one per cent


@dataclass(frozen=True, eq=False)
class FileSurface:
    """The triangles of a file as ``read``, and ``seen``: wound so that what sees out is outside.

    The winding as read is ``coherent`` where neighbours agree; else it says nothing. Where nothing
    was ``turned`` or dropped the two are one.
    """

    read: Surface
    seen: Surface
    coherent: bool
    turned: bool = True

    @classmethod
    def of(cls, parts: Sequence[Part]) -> FileSurface:
        """Take the triangles of all parts."""
        read, (seen, done) = stacked(parts), oriented(parts, joint=True)
        turned = bool(done.flipped_faces or done.duplicate_faces or done.loose_faces)
        tolerance = WELD_REL * float(np.linalg.norm(np.ptp(read.points, axis=0)))
        welded, _ = weld(read, tolerance, within_parts=True)
        return cls(read, seen, incoherence(welded) <= INCOHERENT, turned)

    def encloses(self, where: Places) -> Bool[np.ndarray, "n"]:
        """Whether points [m] are inside for certain: as read, unless that makes no body.

        Where sheets overlap, as leaves do, the winding number is their sum, though no direction
        may be closed: each layer must close as many directions as one alone would have to.

        What is twice inside as read and outside as seen is a cavity, its wall wound as that of a
        body. Patches that are coherent in themselves, but turned against each other, enclose less
        as read than as seen; sheets that are turned to be seen may seem to enclose a little more.
        """
        windings = self._windings(where)
        read, seen = (winding > CERTAIN for winding in windings)
        read &= ~((windings[0] > 1 + CERTAIN) & (windings[1] < OUTSIDE))
        as_read = self.coherent and read.sum() >= BODY * seen.sum()
        surface, inside = (self.read, read) if as_read else (self.seen, seen)
        if open_components(self.seen).any():
            which = np.flatnonzero(inside)
            layers = np.maximum(windings[0 if as_read else 1][which], 1)
            free = 1 - enclosed_shares(surface.points, surface.faces, where[which])
            inside[which] = free < (1 - CERTAIN) ** layers
        return inside

    def excludes(self, where: Places) -> Bool[np.ndarray, "n"]:
        """Whether points [m] are outside for certain, as read and as seen."""
        read, seen = (winding < OUTSIDE for winding in self._windings(where))
        return (read | (not self.coherent)) & seen

    def _windings(self, where: Places) -> list[np.ndarray]:
        """Sizes of the winding numbers as read and as seen."""
        read, *seen = (np.abs(winding(where)) for winding in self._winding)
        return [read, *(seen or [read])]

    @cached_property
    def _winding(self) -> list[WindingNumber]:
        """Winding number as read, and as seen where that differs."""
        surfaces = [self.read, self.seen] if self.turned else [self.read]
        return [WindingNumber(s.points, s.faces) for s in surfaces]


@dataclass(frozen=True)
class PartLoss:
    """Shares of one part: of its volume, of its area."""

    name: str
    volume: float
    area: float


@dataclass(frozen=True)
class FileLosses:
    """What the solids lack of the file, and what they have beside it.

    ``volume`` [m^3] is what the file's triangles enclose for certain by their winding number,
    ``lost`` the share of it, and ``lost_area`` that of the file's area, which is in no solid;
    ``thin`` is the share in closed pieces thinner than a mesh can hold, a part of ``lost``;
    ``capped`` is the share of the solids' volume that the file does not enclose for certain, where
    holes were closed: the volume is anything from what is left without it; ``gained``, a part of
    it, is certain to be outside of the file. ``parts`` are those that lose.
    """

    volume: float = 0.0
    lost: float = 0.0
    thin: float = 0.0
    lost_area: float = 0.0
    gained: float = 0.0
    capped: float = 0.0
    parts: tuple[PartLoss, ...] = ()

    @property
    def bearable(self) -> bool:
        """Whether what is lost may be left out: thin plates are, by name, for they are whole."""
        return self.lost - self.thin <= MOST_LOST


class FileSamples(NamedTuple):
    """Random points of a file, and the part that each is of.

    ``inside`` (n, 3) [m], each for a volume ``cell`` [m^3]; ``on`` (m, 3) [m] its surface; a
    ``seed`` for more of them.
    """

    surface: FileSurface
    inside: np.ndarray
    inside_part: np.ndarray
    cell: float
    on: np.ndarray
    on_part: np.ndarray
    seed: int

    @classmethod
    def of(cls, file: FileSurface, *, rng: np.random.Generator) -> FileSamples:
        """Sample a file's surface and what it encloses for certain."""
        inside, cell = _inside(file, rng)
        on = sample(file.read.points, file.read.faces, rng=rng, count=AREA_SAMPLES).where
        on = on[:AREA_SAMPLES]
        part = [
            file.read.part[closest(where, file.read.points, file.read.faces).face]
            for where in (inside, on)
        ]
        return cls(file, inside, part[0], cell, on, part[1], int(rng.integers(2**31)))


def _inside(file: FileSurface, rng: np.random.Generator) -> tuple[Places, float]:
    """Random points that lie inside for certain, and the volume [m^3] that each stands for."""
    corners = file.read.points[file.read.faces].reshape(-1, 3)
    bounds = np.stack([corners.min(axis=0), corners.max(axis=0)])
    where, cell = np.zeros((0, 3)), 0.0
    for count in (FEWEST * MORE, FEWEST * MORE**2):
        boxes, where = stratified(bounds, rng=rng, count=count)
        where, cell = where[file.encloses(where)], boxes.volume
        if len(where) >= FEWEST:
            break
    return where, cell


def losses(
    file: FileSamples, solids: Solids, names: Sequence[str], *, distance: float
) -> FileLosses:
    """Measure the solids against the file; area farther than ``distance`` [m] from them is lost."""
    outside, far = np.ones(len(file.inside), dtype=bool), np.ones(len(file.on), dtype=bool)
    if solids.shells:
        outside = solids.label(file.inside) < 0
        far = closest(file.on, solids.surface.points, solids.surface.faces).distance > distance
    by_volume = _shares(file.inside_part, outside, len(names))
    by_area = _shares(file.on_part, far, len(names))
    gained, capped = _added(file, solids)
    return FileLosses(
        volume=file.cell * len(file.inside),
        lost=_mean(outside),
        thin=_mean(outside & solids.plates.contain(file.inside)),
        lost_area=float(far.mean()),
        gained=gained,
        capped=capped,
        parts=tuple(
            PartLoss(name, float(v), float(a))
            for name, v, a in zip(names, by_volume, by_area, strict=True)
            if max(v, a) > MOST_LOST
        ),
    )


def _mean(mask: Bool[np.ndarray, "n"]) -> float:
    return float(mask.mean()) if len(mask) else 0.0


def _added(file: FileSamples, solids: Solids) -> tuple[float, float]:
    """Shares of the solids' volume that the file excludes, and that it does not enclose."""
    if not solids.shells:
        return 0.0, 0.0
    rng = np.random.default_rng(file.seed)
    _, where = stratified(solids.bounds, rng=rng, count=4 * FEWEST)
    where = where[solids.label(where) >= 0]
    excluded, enclosed = file.surface.excludes(where), file.surface.encloses(where)
    return _mean(excluded), _mean(excluded | ~enclosed)


def _shares(
    owner: Int[np.ndarray, "n"], lost: np.ndarray, count: int
) -> Float[np.ndarray, "parts"]:
    """Share of each part's samples that is lost."""
    total = np.maximum(np.bincount(owner, minlength=count), 1)
    return np.bincount(owner, weights=lost, minlength=count) / total
