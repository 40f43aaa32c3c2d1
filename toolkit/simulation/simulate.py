"""The verb simulate: load a mesh, solve, and write what was asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...fem.errors import InputError, UsageError
from ...fem.mesh import TetMesh
from ...fem.solve.method import SCENARIOS
from ...predictors.asset import UpAxis
from ..asset.document import BodyRecord, check_file, check_folder, read_known
from ..driving import checked_scale
from ..driving import drive as move_carrier
from ..options import SimulateOptions, command_line
from ..verdict.simulation import Simulation
from .matter import cells_wanted, logged, voxel_body
from .scenario import changed_options, run_scenario


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
    record: BodyRecord | None = None,
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
    ``record`` is what is known of the body, by default what is on record beside the mesh;
    ``materials`` are other rows of the table by part: they have strengths and a grain. For
    particles, ``mesh`` may be a field (.npz), or splats or points as `transfer` writes them, which
    follow into a folder ``output``.

    Raises InputError where the mesh has no material, UsageError where a place of it is stated that
    is not there, and ConvergenceError where the solver does not reach its tolerance.
    """
    options = changed_options(options or SimulateOptions(), given)
    source = Path("MESH") if isinstance(mesh, TetMesh) else Path(mesh)
    # What is no mesh of tets is a body of voxels, for particles
    body = None
    if not isinstance(mesh, TetMesh):
        scale = 1.0 if drive_scale is None else drive_scale
        body = voxel_body(source, cells=cells_wanted(options), scale=scale)
    if body is not None:
        if options.solver != "mpm" and SCENARIOS[options.scenario].method != "mpm":
            raise UsageError(
                f"{source} is no mesh: --solver mpm makes particles of it, or `convert` it"
            )
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
    known = {"up": sidecar.up, "materials": record.materials, "classes": record.classes}
    with logged(output):
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
    )
    again = command_line("simulate", source, options=(options,), up=up, drive=drive, **wanted)
    files: list[Path] = []
    if drive is not None and output is not None:
        output.parent.mkdir(parents=True, exist_ok=True)
        place = {"folder": output.parent, "scale": scale, "up": sidecar.up}
        moved = result.animation.displacement
        driven = move_carrier(result.mesh, moved, drive, run=result.particles, **place)
        result = replace(result, driven=driven)
        files += driven.files
    if output is not None:
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
