"""The verb simulate: load a mesh, solve, and write what was asked for."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...converters import npz
from ...converters.points.table import PointTable, read_points
from ...converters.registry import POINT_FORMATS
from ...fem.errors import ConvergenceError, InputError, UsageError
from ...fem.mesh import TetMesh
from ...fem.mpm.time_step import MpmError
from ...fem.note import Note
from ...fem.solve.method import SCENARIOS
from ...predictors.asset import UpAxis
from ...predictors.field import MaterialField
from ..asset import path_of
from ..asset.document import BodyRecord, check_file, check_folder, read_known
from ..driving import Actor, DriveRecord, checked_scale, driven_record, record
from ..driving import drive as move_carrier
from ..options import EXPECTED, SimulateOptions, command_line
from ..verdict.simulation import Simulation
from .budget import MOST_TETS, coarsened, picture_seconds, shown_states
from .scenario import changed_options, film_plan, frames_told, run_scenario


def simulate(
    mesh: str | Path | TetMesh,
    *,
    up: UpAxis | None = None,
    output: str | Path | None = None,
    report: str | Path | None = None,
    picture: str | Path | None = None,
    drive: str | Path | None = None,
    drive_scale: float | None = None,
    materials: Mapping[str, str] | None = None,
    record: BodyRecord | None = None,
    options: SimulateOptions | None = None,
    progress: Callable[[str, float], None] | None = None,
    **given: Any,
) -> Simulation:
    """Load a mesh with materials and solve its scenario: it settles, moves or rings.

    Parameters
    ----------
    mesh
        Mesh [m] with E [Pa], nu [1] and rho [kg/m^3], or a file of one. For particles also a field
        (.npz), or splats or points as ``transfer`` writes them, which follow into a folder
        ``output``.
    up
        Axis that points up; by default what the mesh's sidecar says, else z.
    output
        The last state as .vtu or .vtk, or the motion as .pvd or .glb; with ``drive`` a folder:
        motion.pvd, and a file a frame of what moves with the mesh.
    report
        Page to write, .html.
    picture
        The last state as .png, or the motion as .gif or .webp.
    drive, drive_scale
        Splats or points that move with the mesh, and the metres per unit of theirs.
    materials
        Other rows of the table by part: they have strengths and a grain.
    record
        What is known of the body; by default what is on record beside the mesh.
    options
        Scenario, solver and loads; each may be ``given`` by name: ``simulate(mesh,
        fix=["part:handle"], load={"part:head": (0, 0, -10)})``.
    progress
        Called with the stage and the seconds [s] so far.

    Returns
    -------
    Simulation
        ``displacement`` (points, 3) [m], the solution of the method, and ``verdicts()`` in words.

    Raises
    ------
    InputError
        Where the mesh has no material.
    UsageError
        Where a place of it is stated that is not there.
    ConvergenceError
        Where the solver does not reach its tolerance.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> rest = apx.simulate(block, gravity=10.0, order=2)
    >>> round(rest.solved.max_displacement, 9)  # m: rho g L^2 / (2 E)
    0.005
    """
    options = changed_options(options or SimulateOptions(), given)
    output, report, picture, drive = map(path_of, (output, report, picture, drive))
    source = Path("MESH") if isinstance(mesh, TetMesh) else Path(mesh)
    # What is no mesh of tets is a body of voxels, for particles
    body = None
    if not isinstance(mesh, TetMesh):
        cells = options.grid
        if options.preset:
            from ...fem.mpm.method import PRESETS

            cells = PRESETS[options.preset].grid
        body = _voxel_body(source, cells=cells, scale=drive_scale or 1.0)
    if body is not None:
        if not takes_particles(options):
            raise UsageError("simulate.no_mesh", source=source)
        if output is not None and not output.suffix:
            drive = drive or body.carrier
    # What is to be written can be written, before the work
    wanted = {"output": output, "report": report, "picture": picture}
    if drive is None:
        if output is not None:
            check_file(output, (".vtu", ".vtk", ".pvd", ".glb"))
    elif output is None:
        raise UsageError("--drive writes files: give a folder by -o")
    elif output.suffix:
        raise UsageError(f"--drive: output {output} is a file, wanted a folder")
    elif not drive.is_file():
        raise InputError(f"no such file: {drive}")
    else:
        check_folder(output)
        output = output / "motion.pvd"
    if options.touch and report is None:
        raise UsageError("--touch: a body to pull is a part of the page: give --report FILE.html")
    if report is not None:
        check_file(report, (".html",))
    if picture is not None:
        from ..report.picture import SUFFIXES

        check_file(picture, SUFFIXES)
    scale = 1.0 if drive is None else checked_scale(drive_scale, mesh, drive)
    mesh, sidecar, *_ = read_known(mesh if body is None else body.mesh, None)
    if mesh.material is None:
        raise InputError("the mesh has no E, nu and rho: run `autophyx-tet assign` on it first")
    sidecar = replace(sidecar, up=up or sidecar.up)
    record = record or BodyRecord.of(sidecar)
    if materials is not None:
        record = record.of_other_materials(materials)
    elif body is not None and not record.materials:
        record = replace(record, materials=body.materials)
    if record.particles and not takes_particles(options):
        raise UsageError("simulate.particles", source=source, why=record.differences[0])
    known = {"up": sidecar.up, "materials": record.materials, "classes": record.classes}
    if options.budget is not None:
        if drive is None and output is not None:
            raise UsageError("budget.no_carrier")
    if options.budget is not None and drive is not None:
        mesh, options = _within_budget(mesh, options, drive, known, progress)
    with _logged(output):
        result = run_scenario(mesh, options, **known, progress=progress)
    if body is not None:
        warnings = (*result.scene.warnings, *body.notes)
        result = replace(result, scene=replace(result.scene, warnings=warnings))
    result = replace(
        result,
        draws=record.draws,
        exact=record.exact,
        differences=record.differences,
        size_stated=record.size_stated,
        guesses=record.guesses,
    )
    again = command_line("simulate", source, options=(options,), up=up, drive=drive, **wanted)
    files: list[Path] = []
    if drive is not None and output is not None:
        output.parent.mkdir(parents=True, exist_ok=True)
        place = {"folder": output.parent, "scale": scale, "up": sidecar.up}
        place["ground"] = result.scene.floor
        moved = result.animation.displacement
        if options.budget is None:
            driven = move_carrier(result.mesh, moved, drive, run=result.particles, **place)
        else:
            driven = _film(result, options, drive, mesh=mesh, **place, progress=progress)
        result = replace(result, driven=driven)
        files += driven.files
    if output is not None and options.budget is None:
        files[:0] = result.write(output)
    if report is not None:
        from ..report.html import write_report
        from ..report.pages import simulation_page

        page = simulation_page(source.stem, result, sidecar, touch=options.touch, command=again)
        files.append(write_report(report, page))
    if picture is not None:
        from ..report.picture import write_picture

        files.append(write_picture(picture, result, up=sidecar.up))
    return replace(result, files=tuple(files))


def takes_particles(options: SimulateOptions) -> bool:
    """Whether what solves the scenario are particles, which need no mesh."""
    return "mpm" in (options.solver, SCENARIOS[options.scenario].method)


def _within_budget(
    mesh: TetMesh,
    options: SimulateOptions,
    drive: Path,
    known: dict[str, Any],
    progress: Callable[[str, float], None] | None,
) -> tuple[TetMesh, SimulateOptions]:
    """A coarse body and the options of what drives it, told with what it will take."""
    body = coarsened(mesh)
    plan = film_plan(body, options, picture=picture_seconds(read_points(drive)), **known)
    if progress is not None:
        if body is mesh and len(mesh.tets) > 2 * MOST_TETS:
            progress(Note("budget.as_fine"), 0.0)
        progress(EXPECTED + plan.words, 0.0)
    return body, plan.options


def actor_of(
    table: PointTable, result: Simulation, options: SimulateOptions, *, mesh: TetMesh, scale: float
) -> Actor:
    """Splats that a motion within a budget carries, over the frames of its film.

    ``mesh`` is the body with what is held, of which the motion has the points alone.
    """
    from ...converters.embedding import Driven

    run, states = result.particles, result.animation.displacement
    if run is None:
        return Actor(Driven.of(table, mesh, scale=scale), shown_states(states, options))
    frames = shown_states(range(len(run.positions)), options)
    return Actor(Driven.by_particles(table, run, scale=scale), frames)


def _film(
    result: Simulation,
    options: SimulateOptions,
    carrier: Path,
    *,
    mesh: TetMesh,
    folder: Path,
    scale: float,
    up: UpAxis,
    ground: float | None,
    progress: Callable[[str, float], None] | None = None,
) -> DriveRecord:
    """The film ``folder``/film.webp of a motion within a budget, written frame by frame."""
    actor = actor_of(read_points(carrier), result, options, mesh=mesh, scale=scale)
    key = f"{options} {result.mesh} {carrier.name} {carrier.stat().st_size}"
    told = frames_told("film", progress, time.perf_counter())
    film = record(folder / "film.webp", [actor], up=up, ground=ground, key=key, progress=told)
    known = driven_record(actor.driven)
    return replace(known, frames=film.frames, picture=film.files[0], film=film)


class VoxelBody(NamedTuple):
    """Tets of voxels, how they came about, and the splats or points that can follow, if any.

    ``materials`` are the rows of the table by part, where a field has them.
    """

    mesh: TetMesh
    notes: tuple[str, ...]
    carrier: Path | None
    materials: dict[str, str]


def _voxel_body(path: Path, *, cells: int, scale: float = 1.0) -> VoxelBody | None:
    """Body of a field (.npz), or of splats or points with E, nu, rho; None for other files.

    Splats and points are filled on a grid of ``cells`` along their longest side; their unit is
    ``scale`` metres.
    """
    from ...converters.transfer import field_from_points, tets_of_field

    suffix = path.suffix.lower()
    if suffix == ".npz" and path.is_file() and "meta" in npz.load_npz(path):
        found = npz.load(path)
        is_field = isinstance(found, MaterialField)
        return VoxelBody(tets_of_field(found), (), None, rows_of_field(found)) if is_field else None
    if suffix not in POINT_FORMATS or not path.is_file():
        return None
    table = read_points(path)
    if not all(name in table.columns for name in ("E", "nu", "rho")):
        return None
    places = {name: scale * np.asarray(table.columns[name], dtype=np.float64) for name in "xyz"}
    names: tuple[str, ...] = ()
    for comment in reversed(table.comments):  # the first in which `transfer` names the parts
        with suppress(ValueError):
            remark = json.loads(comment)
            if isinstance(remark, dict) and "part" in remark:
                names = tuple(map(str, remark["part"]))
    field = field_from_points(table.with_columns(places), cells=cells, part_names=names)
    from scipy.ndimage import binary_erosion

    solid = np.asarray(field.occupied)
    outer = 1 - binary_erosion(solid).sum() / solid.sum()
    filled = Note("simulate.filled", voxels=solid.sum(), size=field.grid.h, outer=outer)
    return VoxelBody(tets_of_field(field), (filled,), path, {})


def rows_of_field(field: MaterialField) -> dict[str, str]:
    """The material that most cells of a part are of, by name of part."""
    if field.part is None or field.material is None:
        return {}
    rows = {}
    for part in np.unique(field.part[field.occupied]):
        own = field.material[field.occupied & (field.part == part)]
        rows[field.part_names[part]] = field.material_names[np.bincount(own).argmax()]
    return rows


@contextmanager
def _logged(output: Path | None) -> Iterator[None]:
    """Where a run of particles fails, write what is known of it beside ``output``, as JSON."""
    try:
        yield
    except MpmError as error:
        if output is None:
            raise
        log = output.with_suffix(".log")
        log.parent.mkdir(parents=True, exist_ok=True)
        known = {"plan": error.plan, "notes": error.notes, "failure": asdict(error.failure)}
        log.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
        raise ConvergenceError(f"{error}; log: {log}") from error
