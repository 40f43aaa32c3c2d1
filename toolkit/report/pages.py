"""Pages: what the report shows of a run, and of a single simulation; the folder of a run."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from ... import __version__
from ...converters import npz
from ...converters.files import writing_folder
from ...converters.mesh.meshdata import write_mesh
from ...fem.errors import ConvergenceError, InputError, UsageError
from ...fem.mesh import TetMesh
from ...fem.reduced.basis import accuracy_warnings, reduce_body
from ...fem.reduced.elasticity import ReducedElasticity, reduced_frequencies
from ...fem.reduced.model import ReducedModel, Subspace
from ...fem.scene.scene import Scene
from ...fem.scene.up import up_vector
from ...fem.table import Span
from ...predictors.appearance.surface import skin_of
from ...predictors.asset import Asset, UpAxis
from ..asset.document import SCHEMA, Sidecar, is_guess, now, plain, versions, write_json
from ..meshing.messages import listed
from ..meshing.quality import Quality, dihedral_angles, quality
from ..verdict.assignment import Assignment
from ..verdict.check import Check, si
from ..verdict.checks import gives_way, times
from ..verdict.description import describe, marks, place_rows
from ..verdict.run import RunResult, Stopwatch
from ..verdict.simulation import ModalSimulation, Simulation, StaticSimulation
from .html import Case, Fact, Look, PartRow, ReportContent, TouchBody, report_page, write_report
from .picture import (
    CAPTION,
    PARTICLES,
    REGION_CAPTION,
    feature_png,
    particle_film,
    region_png,
    render_png,
    story,
)

log = logging.getLogger(__name__)

MESHERS = {
    "ftetwild": "fTetWild", "stuffing": "a lattice cut to the surface", "particles": "whole cubes",
}  # fmt: skip
UNJUDGED = "not judged in a motion: a load at rest is, --scenario sag with --load"
# How an asset looks: coloured points of its surface, one a pixel of a picture of 200 x 200, and
# colours, what one map of the page tells apart.
COLOURED, MOST = 40_000, 64
MOST_CELLS, MOST_DOFS = 250, 40  # of a body to pull: what a page can step sixty times a second
# The force [N] of a finger moves its softest place by this fraction of the diagonal, as it is shown
FINGER, SHOWN = 10.0, 0.1
SLOWEST = 0.5  # s that its slowest vibration takes at least
PICTURE, SAMPLES = 320, 4  # pixels of a panel and rays a pixel: one or two seconds of a core


def run_page(
    result: RunResult, *, pictures: Mapping[str, bytes] | None = None, touch: bool = False
) -> ReportContent:
    """Gather what the report shows of a run, one case a sentence; pictures by their captions.

    With ``touch`` there are bodies to pull, where they can be.
    """
    conversion, document = result.conversion, result.document()
    asset, report = conversion.asset, conversion.report
    cases = []
    for one, verdicts in zip(result.cases, result.verdicts(), strict=True):
        body = one.assignment
        case = _case(body.text, one.simulation, body.document(), verdicts, touch=touch)
        alpha = body.field.alpha if result.turned else None
        cases.append(replace(case, look=look_of(asset, case.mesh), alpha=alpha))
    kept = f"{sum(one.ok for one in report.guarantees)} of {len(report.guarantees)}"
    kind = f"a surface through {asset.samples}" if asset.sampled else "a surface"
    faces, parts = sum(len(part.mesh.faces) for part in asset.parts), len(asset.parts)
    unit, gaps = asset.metres_per_unit, report.distances
    scale = "in metres" if unit == 1 else f"1 unit taken as {si(unit, 'm')}"
    loaded = (
        f"{_file_name(asset.source or asset.name)}: {kind}, {parts} part{'s' * (parts > 1)}, "
        f"{faces:,} triangles, {' × '.join(si(side, 'm') for side in asset.size)}, {scale}, "
        f"{asset.up} up"
    )
    meshed = (
        f"{len(conversion.mesh.tets):,} tets of about {si(report.edge_length, 'm')} by "
        f"{MESHERS.get(report.mesher, report.mesher)}, at most "
        f"{si(max(gaps.to_input, gaps.from_input), 'm')} off the file; {kept} guarantees kept"
    )
    return ReportContent(
        title=asset.name,
        cases=tuple(cases),
        up=asset.up,
        quality=_quality(
            conversion.mesh,
            report.quality,
            {
                "guarantees kept": kept,
                "distance to the input [m]": gaps.to_input,
                "distance from the input [m]": gaps.from_input,
            },
        ),
        warnings=tuple(document["warnings"]),
        provenance={
            "asset": asset.source or asset.name,
            "SHA-256": asset.source_hash or "",
            "metres per unit": unit,
            "versions": versions(),
            "seconds": {name: round(value, 2) for name, value in result.seconds.items()},
        },
        pictures={
            **(pictures or {}),
            **_films(result.cases[0].simulation, asset.up),
            **_numbered(result.cases[0].assignment, asset.up),
        },
        made=_made(result.date, sum(result.seconds.values())),
        command=result.command,
        loaded=(("Loaded", loaded), ("Mesh", meshed)),
    )


def simulation_page(
    name: str, simulation: Simulation, sidecar: Sidecar, *, touch: bool = False, command: str = ""
) -> ReportContent:
    """Gather what the report shows of one simulation, headed by its asset or the mesh's ``name``.

    ``command`` makes it again. With ``touch`` there is a body to pull, where it can be.
    """
    mesh, chosen = simulation.mesh, sidecar.record.get("assign", {})
    tets = _quality(mesh, quality(mesh))
    before = (w for stage in sidecar.record.values() for w in stage.get("warnings", ()))
    return ReportContent(
        title=sidecar.source.get("name") or name,
        cases=(_case(chosen.get("text", ""), simulation, chosen, touch=touch),),
        up=sidecar.up,
        quality=tets,
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


def _quality(
    mesh: TetMesh, known: Quality, fit: Mapping[str, object] | None = None
) -> dict[str, object]:
    """What the report shows of the tets, and how they ``fit`` the file that they were made of."""
    return {
        "tets": known.tets,
        "points": known.points,
        "volume [m³]": known.volume,
        **(fit or {}),
        "smallest altitude [m]": known.altitude_min,
        "connected components": known.components,
        "smallest dihedral angle of each tet [°]": dihedral_angles(mesh.points, mesh.tets).min(1),
    }


def _made(date: str, seconds: float) -> str:
    return " · ".join([date, f"autophyx-tet {__version__}", si(seconds, "s")])


def _films(simulation: Simulation, up: UpAxis) -> dict[str, bytes]:
    """Moving particles by caption, where particles moved the body."""
    if simulation.particles is None:
        return {}
    return {PARTICLES: particle_film(simulation.particles, up=up)}


def _numbered(body: Assignment, up: UpAxis) -> dict[str, bytes]:
    """Regions of like look by caption, where the parts were cut into some."""
    if body.regions is None:
        return {}
    return {REGION_CAPTION: region_png(body.regions.number, body.field.grid, up=up)}


def _case(
    text: str,
    simulation: Simulation,
    chosen: Mapping[str, Any],
    verdicts: Sequence[Check] = (),
    *,
    touch: bool,
) -> Case:
    """One text and its answer; where no body can be pulled, the terminal hears why."""
    modes, doubts = simulation.vibrations, chosen.get("doubts")
    rings = isinstance(simulation, ModalSimulation)
    rests = simulation if isinstance(simulation, StaticSimulation) else None
    parts = chosen.get("parts", [])
    rows = []
    for row in parts:
        ranges = plain(row["ranges"])
        spans = (Span(ranges[name]["min"], ranges[name]["max"]) for name in ("E", "nu", "rho"))
        same = ("name", "material", "why", "E", "nu", "rho", "volume", "mass", "source")
        rows.append(PartRow(*(row[name] for name in same), *spans))
    body = None
    if touch:
        try:
            body = touch_of(simulation.scene)
        except UsageError as error:
            log.warning("--touch: the page has no body to pull: %s", error)
        else:
            for warning in accuracy_warnings(body.model):
                log.warning("--touch: of the body to pull, %s", warning)
    judged = simulation.verdicts()
    return Case(
        text=text,
        mesh=simulation.mesh,
        parts=tuple(rows),
        displacement=None if rings else simulation.displacement,
        von_mises=None if rests is None else rests.solved.von_mises,
        max_von_mises=None if rests is None else rests.max_von_mises,
        motion=None if rings else simulation.animation.displacement,
        times=None if rings else simulation.animation.times,
        vibrations=None if modes is None else modes.shapes[:, : len(simulation.mesh.points)],
        state="Under load" if rests else "At the end",
        clock="load" if rests else "time",
        frequencies=simulation.frequencies,
        verdicts=(*judged, *verdicts),
        title=simulation.title,
        acting=describe(simulation.scene),
        marks=marks(simulation.scene),
        solved=simulation.solution,
        places=tuple(place_rows(simulation.numbers)) if rests else (),
        answers=(*found(simulation, parts), *([] if doubts is None else [unheard(doubts)])),
        touch=body,
    )


def look_of(asset: Asset, mesh: TetMesh) -> Look | None:
    """The colour of the asset's surface where it is nearest to each tet; None where it has one.

    A tet on the surface has the colour of its face, which lies nearer than its centroid.
    """
    from PIL import Image
    from scipy.spatial import KDTree

    where, colour = _coloured_points(asset)
    if len(np.unique(colour, axis=0)) < 2:
        return None
    at = mesh.centroids.copy()
    at[mesh.boundary.tet] = mesh.points[mesh.boundary.faces].mean(axis=1)
    seen = colour[KDTree(where).query(at)[1]]
    image = Image.fromarray(seen[None]).quantize(MOST, method=Image.Quantize.MEDIANCUT)
    table = np.array(image.getpalette()).reshape(-1, 3)
    used, index = np.unique(np.asarray(image)[0], return_inverse=True)
    return Look(tuple("#{:02x}{:02x}{:02x}".format(*table[k]) for k in used), index)


def _coloured_points(asset: Asset) -> tuple[Float[np.ndarray, "n 3"], UInt8[np.ndarray, "n 3"]]:
    """Points of even density on all parts, and their colours, sRGB bytes."""
    rng = np.random.default_rng(0)
    areas = np.array([part.mesh.area for part in asset.parts])
    where, colours = [], []
    for part, fraction in zip(asset.parts, areas / (areas.sum() or 1), strict=True):
        corners, area = part.mesh.triangles, part.mesh.area_faces
        if not area.sum() > 0:
            continue
        face = rng.choice(len(area), size=int(np.ceil(COLOURED * fraction)), p=area / area.sum())
        u, v = np.sort(rng.random((2, len(face))), axis=0)
        weight = np.stack([u, v - u, 1 - v], axis=1).astype(np.float32)
        where.append(np.einsum("nk,nki->ni", weight, corners[face]))
        colours.append(skin_of(part.mesh)(face, weight)[:, :3])
    if not where:
        return np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
    bytes_ = (255 * np.concatenate(colours).clip(0, 1) + 0.5).astype(np.uint8)
    return np.concatenate(where), bytes_


def touch_of(scene: Scene) -> TouchBody:
    """Body of ``scene`` as it is held, without its loads, to be pulled.

    Raises UsageError: Where it cannot be, and why.
    """
    if not scene.held.fixed.any():
        raise UsageError("nothing holds it: there is nothing to pull at")
    mesh, down = scene.mesh, -9.81 * up_vector(scene.up)
    try:
        model = reduce_body(
            mesh, scene.held, gravity_vector=down, kind=Subspace.VECTOR, most_cells=MOST_CELLS
        )
    except (InputError, ConvergenceError) as error:
        raise UsageError(f"it has no reduced model: {error}") from error
    if model.dofs > MOST_DOFS or len(model.cells) > MOST_CELLS:
        raise UsageError("pages.too_many", dofs=model.dofs, cells=len(model.cells))
    return shown(model)


def shown(model: ReducedModel) -> TouchBody:
    """Magnification and pace at which a reader sees ``model`` give way and swing."""
    elasticity = ReducedElasticity(model)
    surface = model.basis[np.unique(model.faces)]
    K = elasticity.tangent(np.zeros(model.dofs))
    soft = np.einsum("nia,ab,njb->nij", surface, np.linalg.inv(K), surface, optimize=True)
    moved = FINGER * float(np.linalg.eigvalsh(soft)[:, -1].max())
    diagonal = float(np.linalg.norm(np.ptp(model.points[model.mass > 0], axis=0)))
    slow = SLOWEST * float(reduced_frequencies(elasticity)[0])
    return TouchBody(model, _plain(SHOWN * diagonal / moved), _plain(slow), moved)


def _plain(value: float) -> float:
    """Nearest 1, 2 or 5 times a power of ten, at least 1."""
    steps = np.array([1, 2, 5, 10]) * 10.0 ** np.floor(np.log10(max(value, 1.0)))
    return float(steps[np.argmin(np.abs(np.log(steps / max(value, 1.0))))])


def loaded_mesh(name: str, mesh: TetMesh, sidecar: Sidecar) -> Iterator[Fact]:
    """Which mesh a simulation has loaded, and what it was made of."""
    parts, source = len(mesh.region_names), sidecar.source.get("path")
    size = " × ".join(si(side, "m") for side in np.ptp(mesh.bounds, axis=0))
    yield (
        "Loaded",
        f"{name}: a mesh of {len(mesh.tets):,} tets, {parts} part{'s' * (parts > 1)}, {size}, "
        f"{sidecar.up} up{f', of {_file_name(source)}' if source else ''}",
    )


def _file_name(source: str) -> str:
    return source.replace("\\", "/").rpartition("/")[2]


def unheard(doubts: Sequence[str]) -> Fact:
    """What of the words was not understood, or is a guess."""
    return "Not understood, or guessed", "; ".join(doubts) or "nothing of the words: each was used"


def found(simulation: Simulation, parts: Sequence[dict[str, Any]]) -> Iterator[Fact]:
    """What moves most, whether it gives way, and how well the materials are known."""
    if isinstance(simulation, ModalSimulation):
        first = simulation.frequencies[:1]
        yield "Rings", f"first at {si(first[0], 'Hz')}" if first else "no frequency was found"
    else:
        rests = isinstance(simulation, StaticSimulation)
        frames = simulation.displacement[None] if rests else simulation.animation.displacement
        far = np.linalg.norm(frames, axis=-1).max(axis=0)
        point, mesh = int(far.argmax()), simulation.mesh
        tet = int(np.flatnonzero((mesh.tets == point).any(axis=1))[0])
        part = mesh.region_names[mesh.region[tet]]
        place = ", ".join(f"{x:.3g}" for x in mesh.points[point])
        when = "" if rests else " at most"
        yield "Moves most", f"{part} by {si(float(far[point]), 'm')}{when}, at ({place}) m"
    yield (
        "Gives way",
        _gives_way(simulation) if isinstance(simulation, StaticSimulation) else UNJUDGED,
    )
    if not parts:
        return
    guesses = [part["name"] for part in parts if is_guess(part)]
    ranges = [plain(part["ranges"]["E"]) for part in parts]
    widest = max(E["max"] / E["min"] for E in ranges)
    factor = (
        f"known to a factor of {widest:.2g} or better"
        if widest != 1
        else "one value, of the table or as stated"
    )
    guessed = f", a guess for {listed(guesses)}" if guesses else ""
    count = f"{len(parts) - len(guesses)} of {len(parts)} from words or names"
    yield "Materials", f"{count}{guessed}; E is {factor}"


def _gives_way(simulation: StaticSimulation) -> str:
    """Strength, then buckling; what the table has no strength of is named."""
    if not simulation.solved.trusted:
        return "it moves too far for this law: no stress of it is to be relied on"
    words = []
    if safety := simulation.safety:
        worst = min(safety, key=lambda one: one.factor)
        words.append(
            f"{'yes' if worst.factor < 1 else 'no'}: the least safety factor is "
            f"{times(worst.factor)}, of {worst.part} ({worst.material}) against its "
            f"{gives_way(worst)[1]}"
        )
    known = {one.part for one in safety}
    unknown = [name for name in simulation.mesh.region_names if name not in known]
    if not simulation.materials:
        words.append("of its strength nothing is known: its materials came without their names")
    elif unknown:
        words.append(f"not known of {listed(unknown)}, whose material has no strength in the table")
    if factor := simulation.solved.load_factor:
        does = "it buckles at" if factor.value < 1 else "it would buckle at"
        words.append(f"{does} {times(factor.value, passed=factor.passed)} times its load")
    else:
        words.append(f"whether it buckles was not checked: {simulation.solved.load_factor_unmade}")
    return "; ".join(words)


def write_folder(folder: Path, result: RunResult, *, touch: bool = False) -> RunResult:
    """Write everything that `run` leaves or nothing; the result with its files.

    Mesh, field, motion, report, and run.json last; further texts go to ``text2/`` ... With
    ``touch`` the report has bodies to pull.
    """
    asset, first = result.conversion.asset, result.cases[0].simulation

    def write_picture(home: Path) -> Path:
        """Asset, stiffness and sag of the first sentence, side by side."""
        panels = story(asset, first.mesh, first.displacement, title=first.title)
        path = home / "picture.png"
        return render_png(path, panels, up=asset.up, pixels=PICTURE, samples=SAMPLES)

    def write_data(home: Path) -> list[Path]:
        files: list[Path] = []
        for number, case in enumerate(result.cases, 1):
            place = home if number == 1 else home / f"text{number}"
            place.mkdir(exist_ok=True)
            mesh, solved = case.assignment.mesh, case.simulation
            if number == 1:
                write_mesh(place / "mesh.msh", mesh)
                files += [place / "mesh.msh", case.assignment.described().write(place / "mesh.msh")]
            if len(solved.mesh.tets) == len(mesh.tets):  # with its grain
                mesh = solved.mesh
            fields = {"point_data": solved.point_data, "cell_data": solved.cell_data}
            write_mesh(place / "mesh.vtu", mesh, **fields)
            npz.save(place / "field.npz", case.assignment.field)
            files += [place / "mesh.vtu", place / "field.npz"]
            files += solved.write(place / "motion.pvd")
        return files

    with writing_folder(folder) as home:
        clock = Stopwatch()
        with ThreadPoolExecutor(1) as beside:  # on another core than the report is made on
            picture, data = beside.submit(write_picture, home), beside.submit(write_data, home)
            looks, pictures = [], {}
            if result.features is not None:
                looks.append(feature_png(home / "features.png", result.features, asset))
                pictures[CAPTION] = looks[0].read_bytes()
            page = run_page(result, pictures=pictures, touch=touch)
            report = write_report(home / "report.html", page)
        made = [*data.result(), *looks, picture.result(), report, home / "run.json"]
        clock.lap("write")
        spent = {"seconds": {**result.seconds, **clock.seconds}}
        spent["cpu_seconds"] = {**result.cpu_seconds, **clock.cpu_seconds}
        files = (*result.files, *(folder / file.relative_to(home) for file in made))
        result = replace(result, files=files, **spent)
        write_json(made[-1], {"schema": SCHEMA, **result.document()})
    return result


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
        page = run_page(result)
    else:
        page = simulation_page("mesh", result, Sidecar(up=result.scene.up))
    return Framed(report_page(page), height)
