"""What a conversion promises and how it proves it: the report of a tet mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Int

from ...fem.mesh import TetMesh, area_vectors, boundary_faces, face_areas
from ...predictors.asset import Part
from ..asset.repair import WELD_REL, RepairReport, enclosed_fractions, oriented, stacked, weld
from ..asset.solids import Solids
from ..asset.surface import (
    Surface,
    bounds_itself,
    component_volumes,
    face_edges,
    incoherence,
    open_components,
)
from ..asset.triangles import (
    Places,
    Points,
    Tets,
    Triangles,
    WindingNumber,
    closest,
    edge_components,
    inside,
    interface_faces,
    sample,
    stratified,
    winding_numbers,
)
from .quality import Quality, corner_nodes, vertex_count

Engine = Literal["tetwild", "alpha wrap + tetwild", "stuffing", "particles"]
BROKEN = "broken"  # begins the outcome of an attempt whose mesh breaks a guarantee
# Of epsilon: the envelope that the engine gets. It keeps sampled points of its surface within that
# distance of the input; between them the surface bulges, and where three faces meet in a right
# angle the corner is sqrt(3) envelopes away.
ENVELOPE_SHARE = 0.5
SHARE_TOLD = 0.005  # of the input's area: less is the noise of the samples near edges
VOLUME_SAMPLES = 64_000  # in the box of all solids: a third of it to 1 %
KIND_SAMPLES = 4000  # of the input: its hidden and sheet-like shares to one per cent
PROBE = 0.125  # epsilons off the surface at which each side is asked for: inside or outside
# Of its radius: room that a ball of diameter epsilon needs on both sides of a point of the input.
# Where it has less, a plate or gap is thinner than two envelopes, which may meet and close it.
ROOM = 0.9


LEFT_OUT = "share of the file's volume that is left out"
MOST_LOST = 0.05  # of the volume: a body that lacks more is another body
# Winding number from which a point is inside for certain: it sees the surface's inner side in at
# least three quarters of all directions. In a dish or over a sheet it is little more than a half.
CERTAIN, OUTSIDE = 0.75, 0.25
BODY = 0.5  # of the volume as seen: a file that encloses less as read is wound at random
INCOHERENT = 0.01  # of the edges: more neighbours that disagree are no slip but a habit
# Samples inside, for a share of 5 % to 0.7 %; so many times more are drawn in thin bodies.
FEWEST, MORE = 1_000, 4
LOSS_TOLD = 0.02  # of a part's volume, or of its longest side: less is the noise of the samples
FEW = 200  # samples inside a part: with fewer a share of its volume is not known to 2 %
BESIDE = 0.01  # of a face's own size: how far beside it it is asked what is around it
AREA_SAMPLES = 4_000  # of the file's area: shares to one per cent


@dataclass(frozen=True, eq=False)
class FileSurface:
    """The triangles of a file as ``read``, and ``seen``: wound so that what sees out is outside.

    The winding as read is ``coherent`` where neighbours agree; else it says nothing. Where nothing
    was ``turned`` or dropped the two are one. ``done`` is what it took to wind them so.
    """

    read: Surface
    seen: Surface
    coherent: bool
    turned: bool = True
    done: RepairReport = RepairReport()  # noqa: RUF009 - a frozen one

    @classmethod
    def of(cls, parts: Sequence[Part]) -> FileSurface:
        """Take the triangles of all parts."""
        read, (seen, done) = stacked(parts), oriented(parts, joint=True)
        turned = bool(done.flipped_faces or done.duplicate_faces or done.loose_faces)
        tolerance = WELD_REL * float(np.linalg.norm(np.ptp(read.points, axis=0)))
        welded, _ = weld(read, tolerance, within_parts=True)
        return cls(read, seen, incoherence(welded) <= INCOHERENT, turned, done)

    @property
    def oriented(self) -> tuple[Surface, RepairReport] | None:
        """What ``repair`` starts from, if nothing is open that it winds in another way."""
        return None if open_components(self.seen).any() else (self.seen, self.done)

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
            free = 1 - enclosed_fractions(surface.points, surface.faces, where[which])
            inside[which] = free < (1 - CERTAIN) ** layers
        return inside

    def excludes(self, where: Places) -> Bool[np.ndarray, "n"]:
        """Whether points [m] are outside for certain, as read and as seen."""
        read, seen = (winding < OUTSIDE for winding in self._windings(where))
        return (read | (not self.coherent)) & seen

    def _windings(self, where: Places) -> list[np.ndarray]:
        """Sizes of the winding numbers as read, and as seen where that differs, else twice."""
        found = [np.abs(winding(where)) for winding in self._winding]
        return [found[0], found[-1]]

    @cached_property
    def _winding(self) -> list[WindingNumber]:
        surfaces = [self.read, self.seen] if self.turned else [self.read]
        return [WindingNumber(s.points, s.faces) for s in surfaces]


@dataclass(frozen=True)
class PartLoss:
    """What is lost of one part: shares of its volume and area, around ``place`` [m].

    Its box is ``shorter`` [m] along the axis where it is most.
    """

    name: str
    volume: float
    area: float = 0.0
    place: tuple[float, float, float] | None = None
    shorter: float = 0.0


@dataclass(frozen=True)
class FileLosses:
    """What the solids lack of the file, and what they have beside it.

    ``volume`` [m^3] is what the file's triangles enclose for certain by their winding number,
    ``lost`` the share of it, and ``lost_area`` that of the file's area, which is in no solid;
    ``thin`` is the share in closed pieces thinner than a mesh can hold, a part of ``lost``;
    ``capped`` is the share of the solids' volume that the file does not enclose for certain, where
    holes were closed: the volume is anything from what is left without it; ``gained``, a part of
    it, is certain to be outside of the file. ``parts`` are those that lose. Those ``swallowed``
    have a closed surface inside another one of theirs that is wound alike: no cavity.
    """

    volume: float = 0.0
    lost: float = 0.0
    thin: float = 0.0
    lost_area: float = 0.0
    gained: float = 0.0
    capped: float = 0.0
    parts: tuple[PartLoss, ...] = ()
    swallowed: tuple[str, ...] = ()

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
        points, faces, part = file.read.points, file.read.faces, file.read.part
        corners = points[faces].reshape(-1, 3)
        bounds = np.stack([corners.min(axis=0), corners.max(axis=0)])
        for count in (FEWEST * MORE, FEWEST * MORE**2):
            boxes, where = stratified(bounds, rng=rng, count=count)
            where = where[file.encloses(where)]
            if len(where) >= FEWEST:
                break
        on = sample(points, faces, rng=rng, count=AREA_SAMPLES).where[:AREA_SAMPLES]
        inside_part, on_part = (part[closest(at, points, faces).face] for at in (where, on))
        seed = int(rng.integers(2**31))
        return cls(file, where, inside_part, boxes.volume, on, on_part, seed)


def losses(
    file: FileSamples, solids: Solids, names: Sequence[str], *, distance: float
) -> FileLosses:
    """Measure the solids against the file; area farther than ``distance`` [m] from them is lost."""
    outside, far = np.ones(len(file.inside), dtype=bool), np.ones(len(file.on), dtype=bool)
    gained = capped = 0.0
    if solids.shells:
        outside = solids.label(file.inside) < 0
        far = closest(file.on, solids.surface.points, solids.surface.faces).distance > distance
        rng = np.random.default_rng(file.seed)
        _, where = stratified(solids.bounds, rng=rng, count=4 * FEWEST)
        where = where[solids.label(where) >= 0]
        excluded, enclosed = file.surface.excludes(where), file.surface.encloses(where)
        gained, capped = _mean(excluded), _mean(excluded | ~enclosed)

    def by_part(owner: np.ndarray, lost: np.ndarray) -> np.ndarray:
        total = np.maximum(np.bincount(owner, minlength=len(names)), 1)
        return np.bincount(owner, weights=lost, minlength=len(names)) / total

    shares = by_part(file.inside_part, outside), by_part(file.on_part, far)
    return FileLosses(
        volume=file.cell * len(file.inside),
        lost=_mean(outside),
        thin=_mean(outside & solids.plates.contain(file.inside)),
        lost_area=float(far.mean()),
        gained=gained,
        capped=capped,
        parts=tuple(
            PartLoss(name, float(volume), float(area))
            for name, volume, area in zip(names, *shares, strict=True)
            if max(volume, area) > MOST_LOST
        ),
        swallowed=tuple(names[part] for part in swallowed(file.surface.read)),
    )


def swallowed(surface: Surface) -> list[int]:
    """Parts with a closed surface inside another one of theirs, wound alike, so that it is lost."""
    tolerance = WELD_REL * float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    surface, _ = weld(surface, tolerance, within_parts=True)
    surface = surface._replace(component=edge_components(surface.faces))
    volumes, closed = component_volumes(surface), ~open_components(surface)
    out = []
    for part in np.unique(surface.part).tolist():
        own = surface.part == part
        faces, component = surface.faces[own], surface.component[own]
        if len(some := np.unique(component[closed[component]])) < 2:
            continue
        normal = area_vectors(surface.points, faces)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        out_of = normal / np.maximum(size, np.finfo(float).tiny) * np.sign(volumes)[component, None]
        where = surface.points[faces].mean(axis=1) + BESIDE * np.sqrt(size) * out_of
        around = winding_numbers(surface.points, faces, where) * np.sign(volumes)[component]
        out += [part] * any(around[component == one].min() > CERTAIN for one in some)
    return out


def mesh_losses(
    file: FileSamples, mesh: TetMesh, names: Sequence[str], boxes: Sequence[np.ndarray]
) -> tuple[PartLoss, ...]:
    """What of each part's volume and box [m] the mesh lacks, where it is more than ``LOSS_TOLD``.

    boxes: Lower and upper corner [m] of each part, (2, 3).
    """
    missing = np.abs(winding_numbers(mesh.points, mesh.boundary.faces, file.inside)) < CERTAIN / 2
    out = []
    for part, (name, box) in enumerate(zip(names, boxes, strict=True)):
        mine = file.inside_part == part
        if mine.sum() < FEW or name not in mesh.region_names:
            continue
        held = mesh.points[mesh.tets[mesh.region == mesh.region_names.index(name)]].reshape(-1, 3)
        shorter = float(np.max(np.ptp(box, axis=0) - np.ptp(held, axis=0)))
        share, lost = float(missing[mine].mean()), file.inside[mine & missing]
        if share > LOSS_TOLD or shorter > LOSS_TOLD * np.ptp(box, axis=0).max():
            x, y, z = lost.mean(axis=0).tolist() if len(lost) else (np.nan,) * 3
            out.append(PartLoss(name, share, place=(x, y, z), shorter=max(shorter, 0.0)))
    return tuple(out)


def _mean(mask: Bool[np.ndarray, "n"]) -> float:
    return float(mask.mean()) if len(mask) else 0.0


@dataclass(frozen=True)
class Guarantee:
    """One promise: the measured ``value`` must not exceed ``threshold`` (both in ``unit``).

    ``at`` names the part of the input where a distance is largest.
    """

    name: str
    value: float
    threshold: float
    unit: str = "1"
    at: str = ""

    @property
    def ok(self) -> bool:
        """Whether it is kept."""
        return bool(self.value <= self.threshold)

    @property
    def sentence(self) -> str:
        """What was measured, and what was wanted."""
        where = f" at {self.at!r}" if self.at else ""
        value = f"{self.value:.3g} {self.unit}{where}"
        return f"{self.name} is {value}, wanted at most {self.threshold:.3g}"


@dataclass(frozen=True)
class Attempt:
    """One run of an engine: what it was asked [m], how long it took [s], how it ended.

    A lattice is asked for its edge alone: ``epsilon`` is that edge.
    """

    engine: Engine
    edge_length: float
    epsilon: float
    seconds: float
    outcome: str


@dataclass(frozen=True)
class Region:
    """One part in the mesh: tets and volume [m^3], and the volume its surface encloses [m^3]."""

    name: str
    tets: int
    volume: float
    input_volume: float


@dataclass(frozen=True)
class ThinPieces:
    """Closed pieces left out because they are thinner than ``thinnest`` [m]: how many, of which.

    Most of their volume is ``thickness`` [m] thick, or more.
    """

    count: int = 0
    parts: tuple[str, ...] = ()
    thinnest: float = 0.0
    thickness: float = 0.0


@dataclass(frozen=True)
class Distances:
    """One-sided sampled Hausdorff distances [m].

    ``to_input`` is the largest distance from the mesh's boundary to the repaired input,
    ``bridged_share`` the share of the boundary that is farther than epsilon from all that was read.
    ``from_input`` is that from the outer visible input, as read, to the boundary or an interface,
    without ``hidden_share`` of the input's area inside the solid, ``sheet_share`` with no volume on
    either side, and where solid or gap are thinner than epsilon; ``missed_share`` is of that kind
    and off the mesh. ``part_to`` and ``part_from`` are the parts where the two are largest.
    """

    to_input: float
    from_input: float
    hidden_share: float = 0.0
    sheet_share: float = 0.0
    missed_share: float = 0.0
    part_to: int = -1
    part_from: int = -1
    bridged_share: float = 0.0

    def good(self, epsilon: float) -> bool:
        """Whether both distances are within ``epsilon`` [m] and next to nothing is missed."""
        return self.largest <= epsilon and self.missed_share <= SHARE_TOLD

    @property
    def largest(self) -> float:
        """Hausdorff distance [m], both ways."""
        return max(self.to_input, self.from_input)


@dataclass(frozen=True)
class ConversionReport:
    """Everything measured about one conversion; lengths [m], volumes [m^3].

    ``layers`` of tets were asked of the engine through thin places. The mesher "stuffing" bounds
    no distance: ``epsilon`` is then the edge of its lattice, ``off_volume`` are the parts whose
    volume it misses, with the relative error, and ``thin_parts`` those thinner than the edge, with
    the share of their surface; of those ``fallen_apart`` a share of volume has come off, and
    from those with ``closed_gaps`` tets reach to other walls over air, from a share of all surface,
    and ``beads`` [m^3] join bodies that touch in the file.
    ``losses`` are those of the solids against the file as read. ``sheets`` are parts that enclose
    nothing and are not meshed, ``thin`` closed pieces that are not meshed either, ``lost`` are
    parts that enclose a volume but got no tet, ``hollow`` parts taken as solid whose names suggest
    a shell, ``walls`` parts that have got a wall of tets. As a ``whole``, open pieces enclose what
    their winding number calls inside. ``part_losses`` are those of the mesh, ``floaters`` loose
    pieces that were left out, with the share ``floating`` of the volume; of vertices where two
    hollows touched some are ``mended_vertices``, others still ``pinched`` [m]; the edge may be
    ``finer`` than the one that was given. ``differences``: ``warnings`` that it is another body.
    """

    repair: RepairReport
    attempts: tuple[Attempt, ...]
    guarantees: tuple[Guarantee, ...]
    quality: Quality
    regions: tuple[Region, ...]
    diagonal: float
    edge_length: float
    epsilon: float
    input_volume: float
    distances: Distances
    split_edges: int
    doubled_points: int
    mended_vertices: int = 0
    pinched: tuple[tuple[float, ...], ...] = ()
    layers: int = 1
    mesher: str = "ftetwild"
    off_volume: tuple[tuple[str, float], ...] = ()
    thin_parts: tuple[tuple[str, float], ...] = ()
    losses: FileLosses = field(default_factory=FileLosses)
    fallen_apart: tuple[tuple[str, float], ...] = ()
    closed_gaps: tuple[tuple[str, float], ...] = ()
    beads: float = 0.0
    sheets: tuple[str, ...] = ()
    thin: ThinPieces = field(default_factory=ThinPieces)
    hollow: tuple[str, ...] = ()
    walls: tuple[str, ...] = ()
    whole: bool = False
    lost: tuple[str, ...] = ()
    part_losses: tuple[PartLoss, ...] = ()
    floaters: int = 0
    floating: float = 0.0
    finer: bool = False
    warnings: tuple[str, ...] = ()
    differences: tuple[str, ...] = ()
    seed: int = 0

    @property
    def ok(self) -> bool:
        """Whether every guarantee is kept."""
        return all(guarantee.ok for guarantee in self.guarantees)

    @property
    def failed(self) -> tuple[str, ...]:
        """Sentences about the guarantees that are not kept."""
        return tuple(g.sentence for g in self.guarantees if not g.ok)

    @property
    def asked_epsilon(self) -> float:
        """Distance [m] that was asked for; ``epsilon`` is the one that the guarantees state."""
        return self.attempts[0].epsilon if self.attempts else self.epsilon

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, with the verdict of every guarantee."""
        return {
            **asdict(self),
            "ok": self.ok,
            "asked_epsilon": self.asked_epsilon,
            "guarantees": [{**asdict(g), "ok": g.ok} for g in self.guarantees],
        }


class InputVolume(NamedTuple):
    """Sampled volume [m^3] that each part claims, and the share by which their sum may be off."""

    by_part: np.ndarray
    uncertainty: float

    @property
    def total(self) -> float:
        """Volume [m^3] of all parts."""
        return float(self.by_part.sum())


def input_volume(
    solids: Solids, part_count: int, *, rng: np.random.Generator, crossing: bool = True
) -> InputVolume:
    """Volume that each part's surface encloses, overlaps counted once; sampled where there are any.

    crossing: Whether triangles may cross.
    """
    if not crossing and bodies_apart(solids):
        owner = np.zeros(solids.surface.component.max() + 1, np.int64)
        owner[solids.surface.component] = solids.surface.part
        exact = np.bincount(owner, np.abs(component_volumes(solids.surface)), part_count)
        return InputVolume(exact.astype(np.float64), 0.0)
    skin = Triangles(solids.surface.points, solids.surface.faces)
    found = inside(skin, solids.label, solids.bounds, rng=rng, count=VOLUME_SAMPLES)
    by_part = np.bincount(found.label, weights=found.cell, minlength=part_count)
    return InputVolume(by_part.astype(np.float64), found.uncertainty)


MOST_BODIES = 100  # of which each box is held against every other one


def bodies_apart(solids: Solids) -> bool:
    """Whether every component is a closed manifold of one part, and no two boxes overlap."""
    surface = solids.surface
    if any(shell.cavity is not None for shell in solids.shells):
        return False
    if (face_edges(surface.faces).count != 2).any() or not bounds_itself(surface.faces):
        return False
    order = np.argsort(surface.component, kind="stable")
    _, start = np.unique(surface.component[order], return_index=True)
    part, corners = surface.part[order], surface.points[surface.faces[order]]
    if (
        len(start) > MOST_BODIES
        or (np.minimum.reduceat(part, start) != np.maximum.reduceat(part, start)).any()
    ):
        return False
    low = np.minimum.reduceat(corners.min(axis=1), start)
    high = np.maximum.reduceat(corners.max(axis=1), start)
    meet = ((low[:, None] < high) & (high[:, None] > low)).all(axis=2)
    return int(meet.sum()) == len(start)


def measure_distances(
    mesh: TetMesh,
    solids: Solids,
    *,
    epsilon: float,
    rng: np.random.Generator,
    reference: Surface | None = None,
) -> Distances:
    """Sampled distances of a mesh's boundary and the file, read as ``reference``, with caps."""
    boundary = mesh.boundary.faces.astype(np.int64)
    points, faces = solids.surface.points, solids.surface.faces
    reference = solids.surface if reference is None else reference
    there = sample(mesh.points, boundary, rng=rng).where
    back = sample(reference.points, reference.faces, rng=rng)
    target = np.concatenate([boundary, interface_faces(mesh.tets, mesh.region)])
    home = closest(back.where, mesh.points, target).distance

    def kinds(where: np.ndarray, normal: np.ndarray):
        """Which samples are hidden, of sheets, and visible with and without room for a ball.

        That is asked on both sides of each, the ball's diameter is epsilon.
        """
        both = np.array([-1, 1])[:, None, None] * normal * epsilon
        sides = (where + PROBE * both).reshape(-1, 3)
        below, above = (solids.label(sides) < 0).reshape(2, -1)
        centres = (where + both / 2).reshape(-1, 3)
        room = closest(centres, points, faces).distance >= ROOM * epsilon / 2
        room, visible = room.reshape(2, -1).all(axis=0), below != above
        return ~below & ~above, below & above, visible & room, visible & ~room

    hidden, sheet, _, _ = kinds(*(values[:KIND_SAMPLES] for values in back))
    # Only what is far away needs to be looked at closely; the others are samples of the whole.
    far = home > epsilon
    _, _, thick, thin = kinds(*(values[far] for values in back))
    counts = ~far
    counts[far] = thick
    away, farthest = closest(there, points, faces), np.where(counts, home, 0).argmax()
    own = closest(back.where[[farthest]], reference.points, reference.faces).face[0]
    bridge = closest(there[:KIND_SAMPLES], reference.points, reference.faces).distance > epsilon
    return Distances(
        to_input=float(away.distance.max()),
        from_input=float(home[farthest] if counts[farthest] else 0),
        hidden_share=float(hidden.mean()),
        sheet_share=float(sheet.mean()),
        missed_share=float(thin.sum() / len(home)),
        part_to=int(solids.surface.part[away.face[away.distance.argmax()]]),
        part_from=int(reference.part[own]),
        bridged_share=float(bridge.mean()),
    )


def sound(mesh: TetMesh, measured: Quality) -> tuple[Guarantee, ...]:
    """What every mesh promises, whoever made it."""
    return (
        Guarantee("tets without volume", float((mesh.volumes <= 0).sum()), 0),
        Guarantee("boundary edges not on two faces", float(measured.boundary.bad_edges), 0),
    )


def guarantees(
    mesh: TetMesh,
    measured: Quality,
    volume: InputVolume,
    gaps: Distances,
    epsilon: float,
    names: Sequence[str] = (),
) -> tuple[Guarantee, ...]:
    """Every promise of a conversion with the number that shows it; ``names`` are the parts'."""
    enclosed = volume.total
    to_at, from_at = (names[i] if names else "" for i in (gaps.part_to, gaps.part_from))
    area = float(face_areas(mesh.points, mesh.boundary.faces).sum())
    # A surface that moves by its envelope everywhere changes the volume by area times that.
    slack = area * ENVELOPE_SHARE * epsilon / enclosed + volume.uncertainty
    return (
        *sound(mesh, measured),
        Guarantee("distance from boundary to input", gaps.to_input, epsilon, "m", to_at),
        Guarantee("distance from input to boundary", gaps.from_input, epsilon, "m", from_at),
        Guarantee("relative error of volume", abs(mesh.volume - enclosed) / enclosed, slack),
    )


# Degrees: dihedral angles of a lattice whose nodes were moved onto sharp edges.
SHARPEST, BLUNTEST = 9.0, 166.0
LATTICE_VOLUME = 0.05  # relative error of volume that a lattice may have: more is too coarse


def lattice_guarantees(
    mesh: TetMesh,
    measured: Quality,
    volume: InputVolume,
    parted: float,
    most_parted: float = LATTICE_VOLUME,
) -> tuple[Guarantee, ...]:
    """What a lattice promises: good tets, a closed boundary and the volume, but no distance.

    ``parted`` [m^3] is in pieces that have come off larger ones, a share ``most_parted`` at most.
    """
    beyond = max(SHARPEST - measured.dihedral_min, measured.dihedral_max - BLUNTEST, 0.0)
    missed = max(abs(mesh.volume / volume.total - 1) - volume.uncertainty, 0.0)
    return (
        *sound(mesh, measured),
        Guarantee("dihedral angle beyond 9 to 166 degrees", beyond, 0, "degrees"),
        Guarantee("relative error of volume", missed, LATTICE_VOLUME),
        Guarantee("share of volume in pieces that fell off", parted / mesh.volume, most_parted),
    )


# Each round splits edges that share no tet; a mesh that needs more rounds is not one of ours.
MAX_ROUNDS = 50


NOWHERE = np.zeros((0, 3))


class Separated(NamedTuple):
    """A mesh whose pieces no longer hang together by bare edges or vertices.

    ``origin`` (tets,) is the tet of the given mesh that each tet lies in, or beside.
    ``split_edges``, ``doubled_points`` and ``mended`` vertices, where two hollows touched, count
    what was done; ``pinched`` (n, 3) are vertices where they still do.
    """

    points: Points
    tets: Tets
    origin: Int[np.ndarray, "tets"]
    split_edges: int
    doubled_points: int
    mended: int = 0
    pinched: Places = NOWHERE


def separate(points: Points, tets: Tets) -> Separated:
    """Double the nodes where tets meet without sharing a face, so that the boundary is manifold.

    A vertex where the tets form several face-connected groups gets a node for each. An edge with
    several groups around it, whose ends hang together elsewhere, first gets a point in its middle,
    which then is doubled in the same way. Points that no tet uses are dropped.
    """
    origin = np.arange(len(tets))
    split = doubled = 0
    for _ in range(MAX_ROUNDS):
        used = vertex_count(tets)
        tets, old = corner_nodes(tets)
        points = points[old]
        doubled += len(old) - used
        # Of the bare edges those of which no tet has two are halved
        taken = np.zeros(len(tets), dtype=bool)
        middles, halves, parents = [], [], []
        for u, v in bare_edges(tets).tolist():
            around = np.flatnonzero(np.isin(tets, (u, v)).sum(axis=1) == 2)
            if not taken[around].any():
                taken[around] = True
                middle = len(points) + len(middles)
                middles.append((points[u] + points[v]) / 2)
                halves += [np.where(tets[around] == end, middle, tets[around]) for end in (u, v)]
                parents += [around, around]
        if not middles:
            break
        split += len(middles)
        points = np.concatenate([points, middles])
        tets = np.concatenate([tets[~taken], *halves])
        origin = origin[np.concatenate([np.flatnonzero(~taken), *parents])]
    return Separated(points, tets.astype(np.int32), origin, split, doubled)


def bare_edges(tets: Tets) -> np.ndarray:
    """Edges (n, 2) with more than two faces of the boundary: several groups of tets around them."""
    faces = boundary_faces(tets).faces
    directed, edge, count = face_edges(faces)
    first = np.unique(edge, return_index=True)[1]
    return np.sort(directed[first], axis=1)[count != 2]
