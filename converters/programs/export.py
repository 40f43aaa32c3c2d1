"""Export to other programs: the files of each, and what of mesh and scene they do not hold."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal, NamedTuple

from ...fem.errors import UsageError
from ...fem.scene.mesh import TetMesh, material_of
from ...fem.scene.supports import Supports
from ...predictors.asset import UpAxis
from ..registry import PROGRAMS, Keeps
from .material_bins import BinError, NameStyle, bin_materials
from .scene_options import SceneOptions


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

    Parameters
    ----------
    mesh
        Tets with a material.
    target
        Name of the program.
    out
        Main file, or its stem.
    bins
        Most materials of a target that knows no material a tet.
    names
        What the arrays for Gmsh are called.
    up
        The axis against gravity.
    gravity
        Acceleration [m/s^2], downwards.
    supports
        What holds the body in the CalculiX and SOFA scenes; None: as in ``fem.scenarios.sag``.
    order
        Order of the elements of a CalculiX deck, 1 or 2; None: as in ``fem.solve_static``.

    Raises
    ------
    UsageError
        For an unknown program, a suffix that it does not read, or fewer bins than ways of a grain.
    InputError
        Where the mesh has no material.
    """
    program, out = PROGRAMS[target], Path(out)
    suffix = out.suffix.lower() or program.suffixes[0]
    if suffix not in program.suffixes:
        raise UsageError(f"{out}: {target} is written as {' or '.join(program.suffixes)}")
    path = out if out.suffix else out.with_name(out.name + suffix)
    form, options = program.format(suffix), SceneOptions(names, up, gravity, supports, order)
    if form.write is None:
        raise UsageError(f"{out}: {form.title} is not written")
    material_of(mesh)
    lost = form.loses(options.items(mesh))
    notes = tuple(program.notes(mesh, options)) if program.notes else ()
    if not form.binned:
        return Exported(form.write(path, mesh, options), None, None, lost, notes)
    binned = bin_materials(mesh, bins=bins, grain=Keeps.GRAIN in form.binned)
    error = binned.error
    if Keeps.RHO not in form.binned:  # the bins' rho is not what is written
        error = BinError((*error.largest[:2], 0.0), (*error.mean[:2], 0.0))
    return Exported(form.write(path, mesh, binned, options), len(binned), error, lost, notes)
