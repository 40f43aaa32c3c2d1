"""The verbs transfer and export: the material carried over to other carriers and programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from ..converters import npz
from ..converters.mesh.meshdata import grain_words, lost_words, read_mesh
from ..converters.registry import (
    GRID_FORMATS,
    MESH_FORMATS,
    POINT_FORMATS,
    PROGRAMS,
    Keeps,
    written,
)
from ..fem.errors import InputError, UsageError
from ..fem.grain import grained_parts, parts_of_grain, with_grains
from ..fem.mesh import TetMesh, material_of
from ..fem.note import Note
from ..predictors.field import MaterialField
from ..predictors.grid import Grid
from .asset import path_of
from .asset.document import BodyRecord, Sidecar, check_file, mesh_document
from .driving import checked_scale
from .options import ExportOptions, TransferOptions, with_given
from .simulation.scenario import grains_of_options
from .simulation.simulate import rows_of_field

if TYPE_CHECKING:
    from ..converters.programs.export import Exported
    from ..converters.transfer import Transferred

AWAY = 0.05  # of the field's diagonal: a carrier this far out is not that of the same body
NU_MOST = 0.49  # Poisson's ratio above which linear tets of most programs lock


@dataclass(frozen=True, eq=False)
class TransferResult:
    """What a transfer did, in metres, and the metres per unit of the target."""

    done: Transferred
    scale: float
    files: tuple[Path, ...]
    warnings: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``transfer --json`` prints; a splat's volume is weighted by opacity."""
        done, scale = self.done, self.scale
        return {
            "files": self.files,
            "values": done.points,
            "outside": done.n_fallback,
            "farthest": done.max_fallback_distance * scale,
            "invalid": done.n_invalid,
            "metres_per_unit": scale,
            "volume": None if done.volume is None else done.volume * scale**3,
            "mass": None if done.mass is None else done.mass * scale**3,
            "warnings": self.warnings,
        }


@dataclass(frozen=True, eq=False)
class ExportResult:
    """What an export wrote, and what binning changed."""

    mesh: TetMesh
    target: str
    done: Exported
    files: tuple[Path, ...]
    warnings: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``export --json`` prints; ``bins`` is null where every tet has its own."""
        return {
            "files": self.files,
            "for": self.target,
            **mesh_document(self.mesh),
            "bins": self.done.bins,
            "quantisation": self.quantisation(),
            "warnings": self.warnings,
        }

    def quantisation(self) -> dict[str, dict[str, float]] | None:
        """Return the largest and mean relative change of E and rho, and change of nu, by binning.

        The mean is weighted by volume; None where the program takes exact values.
        """
        if self.done.error is None:
            return None
        return {
            kind: {"E": 10**E - 1, "nu": nu, "rho": 10**rho - 1}
            for kind, (E, nu, rho) in self.done.error._asdict().items()
        }


def transfer(
    source: str | Path | MaterialField | TetMesh,
    target: str | Path,
    *,
    output: str | Path,
    options: TransferOptions | None = None,
    **given: Any,
) -> TransferResult:
    """Write splats, points or a density grid again with E [Pa], nu [1], rho [kg/m^3] appended.

    Parameters
    ----------
    source
        Field (.npz), mesh with materials, or labelled points of another predictor.
    target
        Carrier to write again, every property kept.
    output
        File to write; a format without room for more columns gets STEM.npz beside it.
    options
        Scale [m] of a unit of the target, cells of the field; each may be ``given`` by name.

    Returns
    -------
    TransferResult
        How many values were carried, how far outside the field any was, the files, warnings.

    Raises
    ------
    InputError
        Where a file cannot be read or written, or the source has no material.
    UsageError
        Where the output is the carrier itself.

    Examples
    --------
    >>> import numpy as np, autophyx_tet as apx
    >>> from autophyx_tet.converters import PointTable, read_points, write_points
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh
    >>> jelly = ElementMaterial.uniform(6, E=1e5, nu=0.3, rho=1e3)
    >>> write_points("point.ply", PointTable({name: np.full(1, 0.5) for name in "xyz"}))
    >>> mesh = box_mesh((1, 1, 1), (1, 1, 1)).with_material(jelly)
    >>> done = apx.transfer(mesh, "point.ply", output="jelly.ply", cells=4)
    >>> read_points("jelly.ply").columns["E"].round(1).tolist()  # Pa
    [100000.0]
    """
    from ..converters.transfer import append_material, field_from_tets, is_density

    options = with_given(options or TransferOptions(), given, verb="transfer")
    target, output = Path(target), path_of(output)
    # suffixes with room for the values, and its own
    if is_density(target):
        suffixes = written(GRID_FORMATS)
    else:
        suffixes = tuple(dict.fromkeys([target.suffix.lower(), *written(POINT_FORMATS)]))
    check_file(output, suffixes)
    if output.resolve() == target.resolve():
        raise UsageError(f"output {output} is the file to be written again: give it another name")
    scale = checked_scale(options.scale, source, target)
    field = source if isinstance(source, MaterialField | TetMesh) else _read_source(Path(source))
    # Words for the grain of the parts that have one: no carrier keeps it
    if isinstance(field, MaterialField):
        parts = parts_of_grain(rows_of_field(field))
    else:
        known = Sidecar.read(Path(source)) if isinstance(source, str | Path) else None
        parts = grained_parts(field) or parts_of_grain(BodyRecord.of(known).materials)
    lost = (grain_words(parts),) if parts else ()
    if isinstance(field, TetMesh):
        field = field_from_tets(field, cells=options.cells)
    grid = Grid(field.grid.lo / scale, field.grid.h / scale, field.grid.shape)
    with TemporaryDirectory(dir=output.parent, prefix=".tmp-") as scratch:
        done = append_material(replace(field, grid=grid), target, Path(scratch) / output.name)
        files = _publish(done.files, output.parent, source)
    warnings = []
    away = done.max_fallback_distance / float(np.linalg.norm(grid.hi - grid.lo))
    if away > AWAY:
        count = {"outside": done.n_fallback, "count": done.points}
        warnings.append(Note("transfer.outside_field", away=away, **count))
    if done.n_invalid:
        count = {"invalid": done.n_invalid, "count": done.points}
        warnings.append(Note("transfer.invalid", **count))
    if lost := (*done.lost, *lost):
        warnings.append(f"not kept in {output.name}: {', '.join(lost)}")
    return TransferResult(done, scale, files, tuple(warnings))


def export(
    mesh: str | Path | TetMesh,
    target: str,
    *,
    output: str | Path,
    options: ExportOptions | None = None,
    **given: Any,
) -> ExportResult:
    """Write a mesh with materials as the files of another program.

    Parameters
    ----------
    mesh
        Mesh [m] with E [Pa], nu [1], rho [kg/m^3] on its tets, or a file of one.
    target
        Name of the program: gmsh, calculix, newton, mujoco, usd, sofa, fenics.
    output
        Main file; without a suffix it is a stem.
    options
        Bins, names of arrays, gravity; each may be ``given`` by name.

    Returns
    -------
    ExportResult
        ``files``, and what binning changed.

    Raises
    ------
    UsageError
        For an unknown target, or an option that it cannot follow.
    InputError
        Where the mesh has no material or the output cannot be written.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> from autophyx_tet.converters import read_mesh
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh
    >>> jelly = ElementMaterial.uniform(6, E=1e5, nu=0.3, rho=1e3)
    >>> mesh = box_mesh((1, 1, 1), (1, 1, 1)).with_material(jelly)
    >>> done = apx.export(mesh, "gmsh", output="jelly.msh")
    >>> round(read_mesh("jelly.msh").mass, 6)  # kg: rho V
    1000.0
    """
    from ..converters.programs.export import export_mesh

    options = with_given(options or ExportOptions(), given, verb="export")
    output = path_of(output)
    suffixes = PROGRAMS[target].suffixes
    if options.bins < 1:
        raise UsageError(f"--bins must be at least 1, got {options.bins}")
    if options.names != "symbols" and target != "gmsh":
        raise UsageError(f"--names {options.names} is for gmsh: {target} has names of its own")
    output = output if output.suffix else output.with_name(output.name + suffixes[0])
    check_file(output, suffixes)
    body = mesh if isinstance(mesh, TetMesh) else read_mesh(mesh)
    known = None if isinstance(mesh, TetMesh) else Sidecar.read(Path(mesh))
    record = BodyRecord.of(known)
    body, notes = with_grains(body, record.materials, grains_of_options(body, options.grain))
    with TemporaryDirectory(dir=output.parent, prefix=".tmp-") as scratch:
        done = export_mesh(
            body,
            target,
            Path(scratch) / output.name,
            bins=options.bins,
            names=options.names,
            up=options.up or (known.up if known else "z"),
            gravity=options.gravity,
            order=options.order,
        )
        files = _publish(done.files, output.parent, mesh)
    result = ExportResult(body, target, done, files)
    # How the program takes the body, and what it will not see as it is in the mesh
    warnings = [*(() if Keeps.GRAIN in done.lost else notes), *done.notes]
    if record.particles:
        warnings.append(record.differences[0])
    change = result.quantisation()
    if change and max(change["largest"].values()) > 1e-9:  # rounding of a mean of equals is less
        warnings.append(Note("transfer.grouped", bins=done.bins, **change["largest"]))
    if lost := lost_words(done.lost, body):
        warnings.append(f"not kept in the files for {target}: {', '.join(lost)}")
    material = material_of(body)
    for item, name in ((Keeps.E, "E"), (Keeps.NU, "nu"), (Keeps.RHO, "rho")):
        if item in done.lost:
            low, high = (f"{end(getattr(material, name)):.3g}" for end in (np.min, np.max))
            warnings.append(f"{name} runs from {low} to {high}: one value is written")
    if soft := int((material.nu > NU_MOST).sum()):
        warnings.append(f"{soft} tets have nu > {NU_MOST}: linear tets of most programs lock there")
    return replace(result, warnings=tuple(warnings))


def _read_source(path: Path) -> MaterialField | TetMesh:
    """Read a field or a mesh; other columns of points with E, nu, rho become a field."""
    from ..converters.transfer import read_field_points

    suffix = path.suffix.lower()
    if suffix == ".npz" and "meta" in npz.load_npz(path):
        return npz.load(path)
    if suffix in POINT_FORMATS:
        return read_field_points(path)
    if suffix in MESH_FORMATS:
        return read_mesh(path)
    known = ", ".join(sorted({*MESH_FORMATS, *POINT_FORMATS}))
    raise InputError(f"{path}: no field or mesh is read from {suffix!r}; known are {known}")


def _publish(written: Sequence[Path], folder: Path, source: object) -> tuple[Path, ...]:
    """Move finished files to their place, all of them, but never over the source."""
    files = tuple(folder / path.name for path in written)
    for file in files:
        if isinstance(source, str | Path) and file.exists() and file.samefile(source):
            raise InputError(f"{file} is the input and would be overwritten: give another -o")
    for path, file in zip(written, files, strict=True):
        path.replace(file)
    return files
