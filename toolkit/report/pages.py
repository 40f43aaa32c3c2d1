"""Pages: what the report shows of a run, and of a single simulation."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ... import __version__
from ...converters import files as npz
from ...converters.files import writing_folder
from ...converters.mesh.meshdata import write_mesh
from ...fem.errors import UsageError
from ...fem.mesh import TetMesh
from ...fem.reduced.basis import accuracy_warnings
from ...fem.table import Span
from ...fem.verdicts import GIVES_WAY
from ...predictors.asset import UpAxis
from ...predictors.prediction import GUESS
from ..asset.document import SCHEMA, Sidecar, now, plain, versions, write_json
from ..meshing.messages import listed
from ..meshing.quality import dihedral_angles, quality
from ..verdict.description import describe, marks
from ..verdict.run import Conversion, RunCase, RunResult, Stopwatch
from ..verdict.simulation import Ringing, Settled, Simulation
from ..verdict.verdict import Verdict, si
from .content import Case, Fact, PartRow, ReportContent, look_of, touch_of
from .html import report_page, write_report
from .picture import PARTICLES, particle_film, render_png, story

log = logging.getLogger(__name__)


def run_page(
    result: RunResult, *, pictures: Mapping[str, bytes] | None = None, touch: bool = False
) -> ReportContent:
    """Gather what the report shows of a run, one case a sentence; pictures by their captions.

    With ``touch`` there are bodies to pull, where they can be.
    """
    conversion, document = result.conversion, result.document()
    asset = conversion.asset
    cases = [
        _case(c.assignment.text, c.simulation, c.assignment.document(), verdicts)
        for c, verdicts in zip(result.cases, result.verdicts(), strict=True)
    ]
    looks = [look_of(asset, case.mesh) for case in cases]
    cases = [replace(case, look=look) for case, look in zip(cases, looks, strict=True)]
    if result.turned:
        places = [c.assignment.field.alpha for c in result.cases]
        cases = [replace(case, alpha=alpha) for case, alpha in zip(cases, places, strict=True)]
    if touch:
        cases = [_touched(case, c.simulation) for case, c in zip(cases, result.cases, strict=True)]
    mesh, quality = conversion.mesh, conversion.report.quality
    kept = sum(guarantee.ok for guarantee in conversion.report.guarantees)
    return ReportContent(
        title=asset.name,
        cases=tuple(cases),
        up=asset.up,
        quality={
            "tets": quality.tets,
            "points": quality.points,
            "volume [m³]": quality.volume,
            "guarantees kept": f"{kept} of {len(conversion.report.guarantees)}",
            "distance to the input [m]": conversion.report.distances.to_input,
            "distance from the input [m]": conversion.report.distances.from_input,
            "smallest altitude [m]": quality.altitude_min,
            "connected components": quality.components,
            "smallest dihedral angle of each tet [°]": dihedral_angles(mesh.points, mesh.tets).min(
                1
            ),
        },
        warnings=tuple(document["warnings"]),
        provenance={
            "asset": asset.source or asset.name,
            "SHA-256": asset.source_hash or "",
            "metres per unit": asset.metres_per_unit,
            "versions": versions(),
            "seconds": {name: round(value, 2) for name, value in result.seconds.items()},
        },
        pictures={**(pictures or {}), **_films(result.cases[0].simulation, asset.up)},
        made=_made(result.date, sum(result.seconds.values())),
        command=result.command,
        loaded=tuple(loaded(conversion)),
    )


def simulation_page(
    name: str, simulation: Simulation, sidecar: Sidecar, *, touch: bool = False, command: str = ""
) -> ReportContent:
    """Gather what the report shows of one simulation, headed by its asset or the mesh's ``name``.

    ``command`` makes it again. With ``touch`` there is a body to pull, where it can be.
    """
    mesh, chosen = simulation.mesh, sidecar.record.get("assign", {})
    found = quality(mesh)
    case = _case(chosen.get("text", ""), simulation, chosen)
    before = (w for stage in sidecar.record.values() for w in stage.get("warnings", ()))
    return ReportContent(
        title=sidecar.source.get("name") or name,
        cases=(_touched(case, simulation) if touch else case,),
        up=sidecar.up,
        quality={
            "tets": found.tets,
            "points": found.points,
            "volume [m³]": found.volume,
            "smallest altitude [m]": found.altitude_min,
            "connected components": found.components,
            "smallest dihedral angle of each tet [°]": dihedral_angles(mesh.points, mesh.tets).min(
                1
            ),
        },
        warnings=tuple(dict.fromkeys((*before, *simulation.warnings))),
        provenance={
            **{key: value for key, value in sidecar.source.items() if value},
            "scenario": simulation.scenario,
            "versions": versions(),
            "seconds": {"simulate": round(simulation.seconds, 2)},
        },
        pictures=_films(simulation, sidecar.up),
        made=_made(now(), simulation.seconds),
        command=command,
        loaded=tuple(loaded_mesh(name, mesh, sidecar)),
    )


class Framed(NamedTuple):
    """A report as a notebook shows it: the page in a frame of its own."""

    page: str
    height: int

    def __repr__(self) -> str:
        return f"<Framed: a report of {len(self.page) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        allowed = 'sandbox="allow-scripts allow-downloads" style="border:0"'
        sized = f'width="100%" height="{self.height}"'
        return f'<iframe {allowed} {sized} srcdoc="{escape(self.page)}"></iframe>'


def show_report(result: RunResult | Simulation, *, height: int = 820) -> Framed:
    """Return the report of a run or of a simulation, for a notebook.

    Parameters
    ----------
    result
        What ``run`` or ``simulate`` returned.
    height
        Height of the frame [px].

    Returns
    -------
    Framed
        What a notebook shows as the page.
    """
    if isinstance(result, RunResult):
        return Framed(report_page(run_page(result)), height)
    page = simulation_page("mesh", result, Sidecar(up=result.scene.up))
    return Framed(report_page(page), height)


def _made(date: str, seconds: float) -> str:
    """When, by what and in how long."""
    return " · ".join([date, f"autophyx-tet {__version__}", si(seconds, "s")])


def _films(simulation: Simulation, up: UpAxis) -> dict[str, bytes]:
    """Moving particles by caption, where particles moved the body."""
    if simulation.particles is None:
        return {}
    return {PARTICLES: particle_film(simulation.particles, up=up)}


def _case(
    text: str,
    simulation: Simulation,
    chosen: Mapping[str, Any],
    verdicts: list[Verdict] | None = None,
) -> Case:
    animation, modes = simulation.animation, simulation.vibrations
    parts, doubts = chosen.get("parts", []), chosen.get("doubts")
    rings = isinstance(simulation, Ringing)
    rests = simulation if isinstance(simulation, Settled) else None
    judged = simulation.verdicts()
    return Case(
        text=text,
        mesh=simulation.mesh,
        parts=tuple(map(_part_row, parts)),
        displacement=None if rings else simulation.displacement,
        von_mises=rests and rests.solved.von_mises,
        max_von_mises=rests and rests.max_von_mises,
        motion=None if rings else animation.displacement,
        times=None if rings else animation.times,
        vibrations=None if modes is None else modes.shapes[:, : len(simulation.mesh.points)],
        state="Under load" if rests else "At the end",
        clock="load" if rests else "time",
        frequencies=simulation.frequencies,
        verdicts=(*judged, *(verdicts or ())),
        title=simulation.title,
        acting=describe(simulation.scene),
        marks=marks(simulation.scene),
        solved=simulation.solution,
        answers=(*found(simulation, parts), *([] if doubts is None else [unheard(doubts)])),
    )


def _touched(case: Case, simulation: Simulation) -> Case:
    """The case with its body to pull; on the terminal why there is none, or what it is not."""
    try:
        touch = touch_of(simulation.scene)
    except UsageError as error:
        log.warning("--touch: the page has no body to pull: %s", error)
        return case
    for warning in accuracy_warnings(touch.model):
        log.warning("--touch: of the body to pull, %s", warning)
    return replace(case, touch=touch)


def _part_row(row: dict[str, Any]) -> PartRow:
    ranges = plain(row["ranges"])
    E, nu, rho = (Span(ranges[name]["min"], ranges[name]["max"]) for name in ("E", "nu", "rho"))
    return PartRow(
        name=row["name"],
        material=row["material"],
        words=row["why"],
        E=row["E"],
        nu=row["nu"],
        rho=row["rho"],
        volume=row["volume"],
        mass=row["mass"],
        source=row["source"],
        E_span=E,
        nu_span=nu,
        rho_span=rho,
    )


# Answers: what a reader asks of a page before all else, a line each, in words.

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
        # How far, which part and where: of all frames of a motion
        if isinstance(simulation, Settled):
            frames, when = simulation.displacement[None], ""
        else:
            frames, when = simulation.animation.displacement, " at most"
        far = np.linalg.norm(frames, axis=-1).max(axis=0)
        point = int(far.argmax())
        mesh = simulation.mesh
        place = ", ".join(f"{x:.3g}" for x in mesh.points[point])
        yield (
            "Moves most",
            (f"{_part_at(mesh, point)} by {si(float(far[point]), 'm')}{when}, at ({place}) m"),
        )
    judged = isinstance(simulation, Settled)
    yield "Gives way", _gives_way(simulation) if judged else UNJUDGED
    if parts:
        yield "Materials", _materials(parts)


def unheard(doubts: Sequence[str]) -> Fact:
    """What of the words was not understood, or is a guess."""
    return "Not understood, or guessed", "; ".join(doubts) or "nothing of the words: each was used"


def _file_name(source: str) -> str:
    return source.replace("\\", "/").rpartition("/")[2]


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


# The folder that `run` leaves: mesh, field, motion, report, and run.json written last.

PICTURE, SAMPLES = 320, 4  # pixels of a panel and rays a pixel: one or two seconds of a core


def write_folder(folder: Path, result: RunResult, *, touch: bool = False) -> RunResult:
    """Write everything or nothing; the result with its files. Further texts go to ``text2/`` ...

    With ``touch`` the report has bodies to pull.
    """
    with writing_folder(folder) as home:
        clock = Stopwatch()
        made = [*_write_files(home, result, touch), home / "run.json"]
        clock.lap("write")
        spent = {"seconds": {**result.seconds, **clock.seconds}}
        spent["cpu_seconds"] = {**result.cpu_seconds, **clock.cpu_seconds}
        files = (*result.files, *(folder / file.relative_to(home) for file in made))
        result = replace(result, files=files, **spent)
        write_json(made[-1], {"schema": SCHEMA, **result.document()})
    return result


def _write_files(folder: Path, result: RunResult, touch: bool) -> list[Path]:
    """Write all but run.json; data and picture on another core than the report is made on."""
    with ThreadPoolExecutor(1) as beside:
        picture = beside.submit(_write_picture, folder / "picture.png", result)
        data = beside.submit(_write_data, folder, result)
        files, pictures = [], {}
        if result.features is not None:
            from .picture import CAPTION, feature_png

            asset = result.conversion.asset
            files.append(feature_png(folder / "features.png", result.features, asset))
            pictures[CAPTION] = files[-1].read_bytes()
        page = run_page(result, pictures=pictures, touch=touch)
        report = write_report(folder / "report.html", page)
    return [*data.result(), *files, picture.result(), report]


def _write_data(folder: Path, result: RunResult) -> list[Path]:
    files: list[Path] = []
    for number, case in enumerate(result.cases, 1):
        home = folder if number == 1 else folder / f"text{number}"
        home.mkdir(exist_ok=True)
        files += _write_case(home, case, bare_mesh=number == 1)
    return files


def _write_case(home: Path, case: RunCase, *, bare_mesh: bool) -> list[Path]:
    mesh, solved = case.assignment.mesh, case.simulation
    files = []
    if bare_mesh:
        write_mesh(home / "mesh.msh", mesh)
        files += [home / "mesh.msh", case.assignment.described().write(home / "mesh.msh")]
    if len(solved.mesh.tets) == len(mesh.tets):  # with its grain
        mesh = solved.mesh
    write_mesh(home / "mesh.vtu", mesh, point_data=solved.point_data, cell_data=solved.cell_data)
    npz.save(home / "field.npz", case.assignment.field)
    return [*files, home / "mesh.vtu", home / "field.npz", *solved.write(home / "motion.pvd")]


def _write_picture(path: Path, result: RunResult) -> Path:
    """Asset, stiffness and sag of the first sentence, side by side."""
    case, asset = result.cases[0], result.conversion.asset
    simulation = case.simulation
    panels = story(asset, simulation.mesh, simulation.displacement, title=simulation.title)
    render_png(path, panels, up=asset.up, pixels=PICTURE, samples=SAMPLES)
    return path
