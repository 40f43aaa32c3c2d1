"""Export to other programs: the files of each, and what of mesh and scene they do not hold."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from ...fem.errors import UsageError
from ...fem.material import GRAIN, material_arrays
from ...fem.mesh import TetMesh, material_of
from ...fem.note import Note
from ...fem.scene.supports import Supports
from ...predictors.asset import UpAxis
from ..mesh.meshdata import WHOLE, far_offset, items_of
from ..mesh.msh import write_msh
from ..registry import PROGRAMS, Format, Keeps, Program
from .material_bins import BinError, NameStyle, bin_materials, named_arrays


class Exported(NamedTuple):
    """Files written, the number of bins and what they changed (None: exact, per element).

    ``lost`` is what was given and is not in the files; of what is binned ``error`` tells. ``notes``
    say how the program will take the body.
    """

    files: list[Path]
    bins: int | None
    error: BinError | None
    lost: tuple[Keeps, ...] = ()
    notes: tuple[str, ...] = ()


def export_mesh(
    mesh: TetMesh,
    target: str,
    out: str | os.PathLike,
    *,
    bins: int = 64,
    names: NameStyle = "symbols",
    up: UpAxis = "z",
    gravity: float = 9.81,
    supports: Supports | None = None,
    order: Literal[1, 2] | None = None,
) -> Exported:
    """Write what ``target`` reads, one of ``PROGRAMS``; ``out`` without a suffix is a stem.

    mesh: Tets with a material.
    target: Name of the program.
    out: Main file, or its stem.
    bins: Most materials of a target that knows no material a tet.
    names: What the arrays for Gmsh are called.
    up: The axis against gravity.
    gravity: Acceleration [m/s^2], downwards.
    supports: What holds the body in the CalculiX and SOFA scenes; None: as in
        ``fem.scenarios.sag``.
    order: Order of the elements of a CalculiX deck, 1 or 2; None: as in ``fem.solve_static``.
    Raises UsageError: For an unknown program, a suffix that it does not read, or fewer bins than
        ways of a grain.
    Raises InputError: Where the mesh has no material.
    """
    program, out = PROGRAMS[target], Path(out)
    suffix = out.suffix.lower() or program.suffixes[0]
    if suffix not in program.suffixes:
        raise UsageError(
            "export.written", out=out, target=target, suffixes=" or ".join(program.suffixes)
        )
    path = out if out.suffix else out.with_name(out.name + suffix)
    form, options = program.format(suffix), SceneOptions(names, up, gravity, supports, order)
    if form.write is None:
        raise UsageError("export.written_2", out=out, title=form.title)
    material_of(mesh)
    lost = form.loses(options.items(mesh))
    notes = tuple(program.notes(mesh, options)) if program.notes else ()
    if form.single and (offset := far_offset(mesh)).any():
        mesh = replace(mesh, points=mesh.points - offset)
        x, y, z = offset.tolist()
        notes = (*notes, Note("export.recentred", x=x, y=y, z=z))
    if not form.binned:
        return Exported(form.write(path, mesh, options), None, None, lost, notes)
    binned = bin_materials(mesh, bins=bins, grain=Keeps.GRAIN in form.binned)
    error = binned.error
    if Keeps.RHO not in form.binned:  # the bins' rho is not what is written
        error = BinError((*error.largest[:2], 0.0), (*error.mean[:2], 0.0))
    return Exported(form.write(path, mesh, binned, options), len(binned), error, lost, notes)


@dataclass(frozen=True)
class SceneOptions:
    """What the user says beside the mesh.

    ``names`` of the arrays, the axis ``up`` against gravity, its size ``gravity`` [m/s^2], the
    ``supports`` that hold the body, and the ``order`` of the elements; None: the program's choice.
    """

    names: NameStyle = "symbols"
    up: UpAxis = "z"
    gravity: float = 9.81
    supports: Supports | None = None
    order: Literal[1, 2] | None = None

    def items(self, mesh: TetMesh) -> Iterator[Keeps]:
        """What the files for ``mesh`` have to keep; what does not vary is no value a tet."""
        for item in items_of(mesh):
            values = getattr(mesh.material, _VARYING[item]) if item in _VARYING else None
            if values is None or np.ptp(values) > _SAME * values.max():
                yield item
        if self.supports is not None:
            fixed = self.supports.fixed
            whole = fixed.all(axis=1)
            if whole.any():
                yield Keeps.HELD
            if (fixed.any(axis=1) & ~whole).any():
                yield Keeps.ROLLERS
            if self.supports.values[fixed].any():
                yield Keeps.PRESCRIBED
            if self.supports.springs.any():
                yield Keeps.SPRINGS
        if self.order == 2:
            yield Keeps.QUADRATIC


# Values of one part that went through a field differ in their last bits, and are one value.
_SAME = 1e-9
_VARYING = {Keeps.E: "E", Keeps.NU: "nu", Keeps.RHO: "rho"}


# Gmsh: a .msh with a group a region, one view an array under the wanted names.


def _write(path: Path, mesh: TetMesh, options: SceneOptions) -> list[Path]:
    grain = {
        name: values for name, values in material_arrays(mesh.material).items() if name in GRAIN
    }
    arrays = named_arrays(mesh, options.names) | grain
    write_msh(path, mesh.with_material(None), cell_data=arrays)
    return [path]


GMSH = Program(
    (
        Format(
            "Gmsh 2.2", (".msh",), write=_write, keeps=WHOLE - {Keeps.POINT_DATA, Keeps.CELL_DATA}
        ),
    )
)
