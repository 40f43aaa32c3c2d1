"""Answers: what a reader asks of a page before all else, a line each, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...fem.scene.mesh import TetMesh
from ...fem.verdicts import GIVES_WAY
from ...predictors.prediction import GUESS
from ..io.document import plain
from ..io.sidecar import Sidecar
from ..meshing.messages import listed
from ..results.conversion import Conversion
from ..results.quantities import si
from ..results.ringing import Ringing
from ..results.settled import Settled
from ..results.simulation import Simulation
from .content import Fact

MESHERS = {"ftetwild": "fTetWild", "stuffing": "a lattice cut to the surface"}
UNJUDGED = "not judged in a motion: a load at rest is, --scenario sag with --load"
SAFE_TOLD = 1000.0  # safety factors above it are told as more than it


def loaded(conversion: Conversion) -> Iterator[Fact]:
    """What was loaded, and what mesh was made of it."""
    asset, report = conversion.asset, conversion.report
    kind = f"a surface through {asset.samples}" if asset.sampled else "a surface"
    faces, parts = sum(len(part.mesh.faces) for part in asset.parts), len(asset.parts)
    unit = asset.metres_per_unit
    scale = "in metres" if unit == 1 else f"1 unit taken as {si(unit, 'm')}"
    size = " × ".join(si(side, "m") for side in asset.size)
    yield (
        "Loaded",
        f"{_file_name(asset.source or asset.name)}: {kind}, {parts} part{'s' * (parts > 1)}, "
        f"{faces:,} triangles, {size}, {scale}, {asset.up} up",
    )
    kept = sum(guarantee.ok for guarantee in report.guarantees)
    gaps = report.distances
    off = max(gaps.to_input, gaps.from_input)
    yield (
        "Mesh",
        f"{len(conversion.mesh.tets):,} tets of about {si(report.edge_length, 'm')} by "
        f"{MESHERS.get(report.mesher, report.mesher)}, at most {si(off, 'm')} off the file; "
        f"{kept} of {len(report.guarantees)} guarantees kept",
    )


def loaded_mesh(name: str, mesh: TetMesh, sidecar: Sidecar) -> Iterator[Fact]:
    """Which mesh a simulation has loaded, and what it was made of."""
    parts, source = len(mesh.region_names), sidecar.source.get("path")
    size = " × ".join(si(side, "m") for side in np.ptp(mesh.bounds, axis=0))
    yield (
        "Loaded",
        f"{name}: a mesh of {len(mesh.tets):,} tets, {parts} part{'s' * (parts > 1)}, {size}, "
        f"{sidecar.up} up{f', of {_file_name(source)}' if source else ''}",
    )


def found(simulation: Simulation, parts: Sequence[dict[str, Any]]) -> Iterator[Fact]:
    """What moves most, whether it gives way, and how well the materials are known."""
    if isinstance(simulation, Ringing):
        first = simulation.frequencies[:1]
        yield "Rings", f"first at {si(first[0], 'Hz')}" if first else "no frequency was found"
    else:
        yield "Moves most", _moves(simulation)
    judged = isinstance(simulation, Settled)
    yield "Gives way", _gives_way(simulation) if judged else UNJUDGED
    if parts:
        yield "Materials", _materials(parts)


def unheard(doubts: Sequence[str]) -> Fact:
    """What of the words was not understood, or is a guess."""
    return "Not understood, or guessed", "; ".join(doubts) or "nothing of the words: each was used"


def _file_name(source: str) -> str:
    return source.replace("\\", "/").rpartition("/")[2]


def _moves(simulation: Simulation) -> str:
    """How far, which part and where: of all frames of a motion."""
    if isinstance(simulation, Settled):
        frames, when = simulation.displacement[None], ""
    else:
        frames, when = simulation.animation.displacement, " at most"
    far = np.linalg.norm(frames, axis=-1).max(axis=0)
    point = int(far.argmax())
    mesh = simulation.mesh
    place = ", ".join(f"{x:.3g}" for x in mesh.points[point])
    return f"{_part_at(mesh, point)} by {si(float(far[point]), 'm')}{when}, at ({place}) m"


def _part_at(mesh: TetMesh, point: int) -> str:
    """Name of a part that has this point."""
    tet = int(np.flatnonzero((mesh.tets == point).any(axis=1))[0])
    return mesh.region_names[mesh.region[tet]]


def _gives_way(simulation: Settled) -> str:
    """Strength, then buckling; what the table has no strength of is named."""
    said = []
    if not simulation.solved.trusted:
        return "it moves too far for this law: no stress of it is to be relied on"
    if safety := simulation.safety:
        worst = min(safety, key=lambda one: one.factor)
        verb = "yes" if worst.factor < 1 else "no"
        said.append(
            f"{verb}: the least safety factor is {_times(worst.factor)}, of {worst.part} "
            f"({worst.material}) against its {GIVES_WAY[worst.side][1]}"
        )
    known = {one.part for one in safety}
    unknown = [name for name in simulation.mesh.region_names if name not in known]
    if not simulation.materials:
        said.append("of its strength nothing is known: its materials came without their names")
    elif unknown:
        said.append(f"not known of {listed(unknown)}, whose material has no strength in the table")
    if factor := simulation.solved.load_factor:
        does = "it buckles at" if factor.value < 1 else "it would buckle at"
        said.append(f"{does} {_times(factor.value)} times its load")
    else:
        said.append(f"whether it buckles was not checked: {simulation.solved.load_factor_unmade}")
    return "; ".join(said)


def _times(factor: float) -> str:
    return f"{factor:.3g}" if factor <= SAFE_TOLD else f"more than {SAFE_TOLD:.0f}"


def _materials(parts: Sequence[dict[str, Any]]) -> str:
    """How many are as said, which are guesses, how far E is known."""
    guesses = [part["name"] for part in parts if _is_guess(part)]
    spans = [p["ranges"]["E"] for p in parts]
    ends = [(s["min"], s["max"]) if isinstance(s, dict) else (s.min, s.max) for s in spans]
    widest = max(high / low for low, high in ends)
    known = f"{len(parts) - len(guesses)} of {len(parts)} from words or names"
    guessed = f", a guess for {listed(guesses)}" if guesses else ""
    if widest == 1:
        return f"{known}{guessed}; E is as stated"
    return f"{known}{guessed}; E is known to a factor of {widest:.2g} or better"


def _is_guess(part: dict[str, Any]) -> bool:
    """Whether no word settles its material: nothing near is known, or no clause speaks of it."""
    binding = plain(part["binding"])
    unsaid = binding is not None and binding["clause"] is None
    return part["guessed"] or not part["understood"] or part["weight"] < GUESS or unsaid
