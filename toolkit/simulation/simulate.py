"""The verb simulate: load a mesh, solve, and write what was asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...fem.errors import InputError, UsageError
from ...fem.scenarios.scenario import SCENARIOS
from ...fem.scene.mesh import TetMesh
from ...fem.uncertainty.ranges import Draws, Exact
from ...predictors.asset import UpAxis
from ..config import command_line
from ..driving import checked_scale
from ..driving import drive as move_carrier
from ..io.outputs import check_file, check_folder
from ..io.sidecar import (
    Sidecar,
    classes_on_record,
    differences_on_record,
    draws_on_record,
    exact_on_record,
    read_known,
    rows_on_record,
)
from ..options import SimulateOptions
from ..results.simulation import Simulation
from .conditions import changed_options
from .matter import cells_wanted, logged
from .voxel_body import VoxelBody, check_particles, voxel_body


def simulate(
    mesh: str | Path | TetMesh,
    *,
    up: UpAxis | None = None,
    output: Path | None = None,
    report: Path | None = None,
    picture: Path | None = None,
    drive: Path | None = None,
    drive_scale: float | None = None,
    materials: Mapping[str, str] | None = None,
    classes: Mapping[str, str] | None = None,
    differences: Sequence[str] | None = None,
    size_stated: bool | None = None,
    draws: Draws | None = None,
    exact: Exact | None = None,
    options: SimulateOptions | None = None,
    progress: Callable[[str, float], None] | None = None,
    **given: Any,
) -> Simulation:
    """Load a mesh with materials and solve its scenario: it settles, moves or rings.

    Options may be ``given`` by name too: ``simulate(mesh, fix=["part:handle"],
    load={"part:head": (0, 0, -10)})``. ``output`` takes the last state as .vtu or .vtk, or the
    motion as .pvd or .glb; ``report`` the page, .html; ``picture`` the last state as .png, or the
    motion as .gif or .webp. With ``drive``, splats or points of ``drive_scale`` metres per unit,
    ``output`` is a folder: motion.pvd, and a file a frame of what moves with the mesh.
    ``materials`` are the rows of the table by part, by default those on record beside the mesh:
    they have strengths and a grain; ``classes`` of matter for particles go with them, the
    ``differences`` of the mesh from its file, and whether its size was ``size_stated``, for the
    verdicts; for intervals what a predictor ``draws``, and which numbers are ``exact``. For
    particles, ``mesh`` may be a field (.npz), or splats or points as `transfer` writes them, which
    follow into a folder ``output``.

    Raises InputError where the mesh has no material, UsageError where a place of it is stated that
    is not there, and ConvergenceError where the solver does not reach its tolerance.
    """
    from .scenario import run_scenario

    options = changed_options(options or SimulateOptions(), given)
    body = _voxels(mesh, options, 1.0 if drive_scale is None else drive_scale)
    drive = drive or _own_carrier(body, output)
    wanted = {"output": output, "report": report, "picture": picture}
    output = _checked_output(drive, output)
    _check_pages(report, picture, touch=options.touch)
    source = Path("MESH") if isinstance(mesh, TetMesh) else Path(mesh)
    scale = 1.0 if drive is None else checked_scale(drive_scale, mesh, drive)
    mesh, sidecar = _with_material(mesh if body is None else body.mesh, up)
    if materials is None:
        materials, classes, draws, exact = _recorded(sidecar, body, classes, draws, exact)
    known = {"up": sidecar.up, "materials": materials, "classes": classes, "progress": progress}
    with logged(output):
        result = _noted(run_scenario(mesh, options, **known), body)
    result = replace(result, draws=draws or {}, exact=exact or {})
    result = _told(result, sidecar, differences, size_stated)
    if drive is not None and output is not None:
        result = _driven(result, drive, folder=output.parent, scale=scale, up=sidecar.up)
    again = command_line("simulate", source, options=(options,), up=up, drive=drive, **wanted)
    files = {**wanted, "output": output, "touch": options.touch, "command": again}
    return _shown(result, source.stem, sidecar, **files)


def _with_material(mesh: TetMesh | str | Path, up: UpAxis | None) -> tuple[TetMesh, Sidecar]:
    """The mesh, which must have a material, and its sidecar."""
    mesh, sidecar, *_ = read_known(mesh, None)
    _check_material(mesh)
    return mesh, replace(sidecar, up=up or sidecar.up)


def _recorded(
    sidecar: Sidecar,
    body: VoxelBody | None,
    classes: Mapping[str, str] | None,
    draws: Draws | None,
    exact: Exact | None,
) -> tuple[Mapping[str, str], Mapping[str, str], Draws, Exact]:
    """Rows, classes, draws and exact numbers of the parts: on record where they are not given."""
    rows = rows_on_record(sidecar) or (body.materials if body is not None else {})
    classes, draws = classes or classes_on_record(sidecar), draws or draws_on_record(sidecar)
    return rows, classes, draws, exact or exact_on_record(sidecar)


def _told(
    result: Simulation,
    sidecar: Sidecar,
    differences: Sequence[str] | None,
    size_stated: bool | None,
) -> Simulation:
    """The result with what is known of the making of its mesh, by default what is on record."""
    if differences is None:
        differences = differences_on_record(sidecar)
    if size_stated is None:
        size_stated = sidecar.source.get("size_stated", False)
    return replace(result, differences=tuple(differences), size_stated=size_stated)


def _check_material(mesh: TetMesh) -> None:
    if mesh.material is None:
        raise InputError("the mesh has no E, nu and rho: run `autophyx-tet assign` on it first")


def _driven(
    result: Simulation, carrier: Path, *, folder: Path, scale: float, up: UpAxis
) -> Simulation:
    """The result with the frames of a carrier that moved with it."""
    folder.mkdir(parents=True, exist_ok=True)
    place = {"folder": folder, "scale": scale, "up": up}
    moved = result.animation.displacement
    driven = move_carrier(result.mesh, moved, carrier, run=result.particles, **place)
    return replace(result, driven=driven, files=driven.files)


def _voxels(
    source: str | Path | TetMesh, options: SimulateOptions, scale: float
) -> VoxelBody | None:
    """What is no mesh of tets as a body of voxels, for particles."""
    if isinstance(source, TetMesh):
        return None
    body = voxel_body(Path(source), cells=cells_wanted(options), scale=scale)
    if body is not None:
        by_particles = options.solver == "mpm" or SCENARIOS[options.scenario].method == "mpm"
        check_particles(Path(source), particles=by_particles)
    return body


def _own_carrier(body: VoxelBody | None, output: Path | None) -> Path | None:
    """Splats that are the body themselves follow it where the output is a folder."""
    return None if body is None or output is None or output.suffix else body.carrier


def _noted(result: Simulation, body: VoxelBody | None) -> Simulation:
    """The result with what was assumed of a body of voxels."""
    if body is None:
        return result
    warnings = (*result.scene.warnings, *body.notes)
    return replace(result, scene=replace(result.scene, warnings=warnings))


def _check_pages(report: Path | None, picture: Path | None, *, touch: bool) -> None:
    if touch and report is None:
        raise UsageError("--touch: a body to pull is a part of the page: give --report FILE.html")
    if report is not None:
        check_file(report, (".html",))
    if picture is not None:
        from ..report.picture.snapshot import SUFFIXES

        check_file(picture, SUFFIXES)


def _shown(
    result: Simulation,
    name: str,
    sidecar: Sidecar,
    *,
    touch: bool,
    command: str,
    output: Path | None,
    report: Path | None,
    picture: Path | None,
) -> Simulation:
    """Write a result, its page and its picture; the files are on record."""
    if output is not None:
        result = replace(result, files=(*result.write(output), *result.files))
    if report is not None:
        from ..report.pages import simulation_page
        from ..report.report import write_report

        page = simulation_page(name, result, sidecar, touch=touch, command=command)
        written = write_report(report, page)
        result = replace(result, files=(*result.files, written))
    if picture is not None:
        from ..report.picture.snapshot import write_picture

        drawn = write_picture(picture, result, up=sidecar.up)
        result = replace(result, files=(*result.files, drawn))
    return result


def _checked_output(drive: Path | None, output: Path | None) -> Path | None:
    """The output if it can be written: with a driven carrier the .pvd in its folder."""
    if drive is None:
        if output is not None:
            check_file(output, (".vtu", ".vtk", ".pvd", ".glb"))
        return output
    if output is None:
        raise UsageError("--drive writes files: give a folder by -o")
    if output.suffix:
        raise UsageError(f"--drive: output {output} is a file, wanted a folder")
    if not drive.is_file():
        raise InputError(f"no such file: {drive}")
    check_folder(output)
    return output / "motion.pvd"
