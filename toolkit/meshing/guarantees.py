"""What a conversion promises and how it proves it: the report of a tet mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Int

from ...fem.mesh import TetMesh, boundary_faces
from ..asset.repair import RepairReport
from ..asset.solids import Solids
from ..asset.surface import Surface, face_edges
from ..asset.triangles import (
    Points,
    Samples,
    Tets,
    Triangles,
    closest,
    inside,
    interface_faces,
    sample,
)
from .losses import FileLosses
from .quality import Quality, corner_nodes, vertex_count

Engine = Literal["tetwild", "alpha wrap + tetwild", "stuffing"]
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
    their winding number calls inside. ``differences``: ``warnings`` that it is another body.
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


def input_volume(solids: Solids, part_count: int, *, rng: np.random.Generator) -> InputVolume:
    """Volume that each part's surface encloses, overlaps counted once."""
    skin = Triangles(solids.surface.points, solids.surface.faces)
    found = inside(skin, solids.label, solids.bounds, rng=rng, count=VOLUME_SAMPLES)
    by_part = np.bincount(found.label, weights=found.cell, minlength=part_count)
    return InputVolume(by_part.astype(np.float64), found.uncertainty)


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
    # Only what is far away needs to be looked at closely; the others are samples of the whole.
    far = home > epsilon
    usual = _kinds(solids, Samples(*(a[:KIND_SAMPLES] for a in back)), epsilon)
    unusual = _kinds(solids, Samples(*(a[far] for a in back)), epsilon)
    counts = ~far
    counts[far] = unusual.thick
    away, farthest = closest(there, points, faces), np.where(counts, home, 0).argmax()
    own = closest(back.where[[farthest]], reference.points, reference.faces).face[0]
    bridge = closest(there[:KIND_SAMPLES], reference.points, reference.faces).distance > epsilon
    return Distances(
        to_input=float(away.distance.max()),
        from_input=float(home[farthest] if counts[farthest] else 0),
        hidden_share=float(usual.hidden.mean()),
        sheet_share=float(usual.sheet.mean()),
        missed_share=float(unusual.thin.sum() / len(home)),
        part_to=int(solids.surface.part[away.face[away.distance.argmax()]]),
        part_from=int(reference.part[own]),
        bridged_share=float(bridge.mean()),
    )


class Kinds(NamedTuple):
    """What each sample of the input is part of: masks (n,)."""

    hidden: np.ndarray
    sheet: np.ndarray
    thick: np.ndarray
    thin: np.ndarray


def _kinds(solids: Solids, samples: Samples, epsilon: float) -> Kinds:
    """Ask on both sides of each sample for inside, and for room for a ball of ``epsilon`` [m]."""
    both = np.array([-1, 1])[:, None, None] * samples.normal * epsilon
    sides = (samples.where + PROBE * both).reshape(-1, 3)
    below, above = (solids.label(sides) < 0).reshape(2, -1)
    visible = below != above
    centres = (samples.where + both / 2).reshape(-1, 3)
    room = closest(centres, solids.surface.points, solids.surface.faces).distance
    roomy = (room >= ROOM * epsilon / 2).reshape(2, -1).all(axis=0)
    return Kinds(~below & ~above, below & above, visible & roomy, visible & ~roomy)


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
    a, b, c = (mesh.points[mesh.boundary.faces[:, i]] for i in range(3))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    # A surface that moves by its envelope everywhere changes the volume by area times that.
    slack = area * ENVELOPE_SHARE * epsilon / enclosed + volume.uncertainty
    return (
        Guarantee("tets without volume", float((mesh.volumes <= 0).sum()), 0),
        Guarantee("boundary edges not on two faces", float(measured.boundary.bad_edges), 0),
        Guarantee("distance from boundary to input", gaps.to_input, epsilon, "m", to_at),
        Guarantee("distance from input to boundary", gaps.from_input, epsilon, "m", from_at),
        Guarantee("relative error of volume", abs(mesh.volume - enclosed) / enclosed, slack),
    )


# What a mesh that a lattice was cut to promises, and how it proves it.

# Degrees: dihedral angles of a lattice whose nodes were moved onto sharp edges.
SHARPEST, BLUNTEST = 9.0, 166.0
LATTICE_VOLUME = 0.05  # relative error of volume that a lattice may have: more is too coarse


def lattice_guarantees(
    mesh: TetMesh, measured: Quality, volume: InputVolume, parted: float
) -> tuple[Guarantee, ...]:
    """What a lattice promises: good tets, a closed boundary and the volume, but no distance.

    ``parted`` [m^3] is in pieces that have come off larger ones.
    """
    beyond = max(SHARPEST - measured.dihedral_min, measured.dihedral_max - BLUNTEST, 0.0)
    missed = max(abs(mesh.volume / volume.total - 1) - volume.uncertainty, 0.0)
    return (
        Guarantee("tets without volume", float((mesh.volumes <= 0).sum()), 0),
        Guarantee("boundary edges not on two faces", float(measured.boundary.bad_edges), 0),
        Guarantee("dihedral angle beyond 9 to 166 degrees", beyond, 0, "degrees"),
        Guarantee("relative error of volume", missed, LATTICE_VOLUME),
        Guarantee("share of volume in pieces that fell off", parted / mesh.volume, LATTICE_VOLUME),
    )


# Separate non-manifold edges and vertices of a tet mesh's boundary by doubling nodes.

# Each round splits edges that share no tet; a mesh that needs more rounds is not one of ours.
MAX_ROUNDS = 50


class Separated(NamedTuple):
    """A mesh whose pieces no longer hang together by bare edges or vertices.

    ``origin`` (tets,) is the tet of the given mesh that each tet lies in; ``split_edges`` and
    ``doubled_points`` count what was done.
    """

    points: Points
    tets: Tets
    origin: Int[np.ndarray, "tets"]
    split_edges: int
    doubled_points: int


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
        bad = bare_edges(tets)
        if not len(bad):
            break
        chosen = _independent(bad, tets)
        split += len(chosen)
        points, tets, parent = _halve(points, tets, chosen)
        origin = origin[parent]
    return Separated(points, tets.astype(np.int32), origin, split, doubled)


def bare_edges(tets: np.ndarray) -> np.ndarray:
    """Edges (n, 2) with more than two faces of the boundary: several groups of tets around them."""
    faces = boundary_faces(tets).faces
    directed, edge, count = face_edges(faces)
    first = np.unique(edge, return_index=True)[1]
    return np.sort(directed[first], axis=1)[count != 2]


def _independent(edges: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """A subset of ``edges`` of which no tet has two."""
    taken = np.zeros(len(tets), dtype=bool)
    chosen = []
    for edge in edges:
        around = np.isin(tets, edge).sum(axis=1) == 2
        if not taken[around].any():
            taken |= around
            chosen.append(edge)
    return np.array(chosen)


def _halve(points, tets, edges) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Put a point in the middle of each edge; returns points, tets and each tet's parent."""
    middle = len(points) + np.arange(len(edges))
    points = np.concatenate([points, points[edges].mean(axis=1)])
    halves, parents = [], []
    for (u, v), m in zip(edges, middle, strict=True):
        around = np.flatnonzero(np.isin(tets, (u, v)).sum(axis=1) == 2)
        halves += [np.where(tets[around] == u, m, tets[around])]
        halves += [np.where(tets[around] == v, m, tets[around])]
        parents += [around, around]
    cut, halves = np.concatenate(parents), np.concatenate(halves)
    keep = np.setdiff1d(np.arange(len(tets)), cut)
    return points, np.concatenate([tets[keep], halves]), np.concatenate([keep, cut])
