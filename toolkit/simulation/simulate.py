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
from ..asset.document import BodyRecord, Sidecar, check_file, check_folder, path_of, read_known
from ..driving import checked_scale
from ..driving import drive as move_carrier
from ..options import SimulateOptions, command_line
from ..verdict.simulation import Simulation
from .matter import VoxelBody, cells_wanted, check_particles, logged, voxel_body
from .scenario import changed_options


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
    from .scenario import run_scenario

    options = changed_options(options or SimulateOptions(), given)
    output, report, picture, drive = map(path_of, (output, report, picture, drive))
    body = _voxels(mesh, options, 1.0 if drive_scale is None else drive_scale)
    drive = drive or (None if body is None or output is None or output.suffix else body.carrier)
    wanted = {"output": output, "report": report, "picture": picture}
    output = _checked_output(drive, output)
    _check_pages(report, picture, touch=options.touch)
    source = Path("MESH") if isinstance(mesh, TetMesh) else Path(mesh)
    scale = 1.0 if drive is None else checked_scale(drive_scale, mesh, drive)
    mesh, sidecar = _with_material(mesh if body is None else body.mesh, up)
    record = _known(record or BodyRecord.of(sidecar), body, materials)
    known = {"up": sidecar.up, "materials": record.materials, "classes": record.classes}
    with logged(output):
        result = _noted(run_scenario(mesh, options, **known, progress=progress), body)
    result = replace(
        result,
        draws=record.draws,
        exact=record.exact,
        differences=record.differences,
        size_stated=record.size_stated,
    )
    if drive is not None and output is not None:
        # The result with the frames of a carrier that moved with it
        output.parent.mkdir(parents=True, exist_ok=True)
        place = {"folder": output.parent, "scale": scale, "up": sidecar.up}
        moved = result.animation.displacement
        driven = move_carrier(result.mesh, moved, drive, run=result.particles, **place)
        result = replace(result, driven=driven, files=driven.files)
    again = command_line("simulate", source, options=(options,), up=up, drive=drive, **wanted)
    files = {**wanted, "output": output, "touch": options.touch, "command": again}
    return _shown(result, source.stem, sidecar, **files)


def _with_material(mesh: TetMesh | str | Path, up: UpAxis | None) -> tuple[TetMesh, Sidecar]:
    """The mesh, which must have a material, and its sidecar."""
    mesh, sidecar, *_ = read_known(mesh, None)
    if mesh.material is None:
        raise InputError("the mesh has no E, nu and rho: run `autophyx-tet assign` on it first")
    return mesh, replace(sidecar, up=up or sidecar.up)


def _known(
    record: BodyRecord, body: VoxelBody | None, materials: Mapping[str, str] | None
) -> BodyRecord:
    """The record with the rows that were given, or else, where it has none, those of voxels."""
    if materials is not None:
        return record.of_other_materials(materials)
    if body is None or record.materials:
        return record
    return replace(record, materials=body.materials)


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
        from ..report.picture import SUFFIXES

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
        from ..report.html import write_report
        from ..report.pages import simulation_page

        page = simulation_page(name, result, sidecar, touch=touch, command=command)
        written = write_report(report, page)
        result = replace(result, files=(*result.files, written))
    if picture is not None:
        from ..report.picture import write_picture

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
