"""Export to external solvers: the table target -> writer, binned or exact materials."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from ...fem.errors import InputError, UsageError
from ...fem.scene.mesh import TetMesh
from ...fem.scene.supports import Supports
from ..mesh.msh import write_msh
from .material_bins import BinError, NameStyle, UpAxis, bin_materials, named_arrays


@dataclass(frozen=True)
class ExportOptions:
    """What the writers of the table may use: see ``export_mesh``."""

    names: NameStyle = "symbols"
    up: UpAxis = "z"
    gravity: float = 9.81
    supports: Supports | None = None


class Exported(NamedTuple):
    """Files written, the number of bins and what they changed (None: exact, per element)."""

    files: list[Path]
    bins: int | None
    error: BinError | None


class _Target(NamedTuple):
    """Suffixes of the main file, the first is the default; module with ``write``; binned or not."""

    suffixes: tuple[str, ...]
    module: str
    binned: bool


TARGETS: dict[str, _Target] = {
    "gmsh": _Target((".msh",), "export", False),
    "calculix": _Target((".inp",), "calculix", True),
    "newton": _Target((".vtk", ".npz"), "newton", False),
    "mujoco": _Target((".xml",), "mujoco", True),
    "usd": _Target((".usda",), "usd", True),
    "sofa": _Target((".scn",), "sofa", False),
    "fenics": _Target((".msh",), "fenics", True),
}


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
) -> Exported:
    """Write what ``target`` reads, one of ``TARGETS``; ``out`` without a suffix is a stem.

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

    Raises
    ------
    UsageError
        For an unknown target, or a suffix that the target does not read.
    """
    if target not in TARGETS:
        raise UsageError(f"unknown target {target!r}; known are {', '.join(TARGETS)}")
    chosen = TARGETS[target]
    out = Path(out)
    suffix = out.suffix.lower() or chosen.suffixes[0]
    if suffix not in chosen.suffixes:
        raise UsageError(f"{out}: {target} is written as {' or '.join(chosen.suffixes)}")
    path = out if out.suffix else out.with_name(out.name + suffix)
    options = ExportOptions(names, up, gravity, supports)
    writer: Callable[..., list[Path]] = import_module(f".{chosen.module}", __package__).write
    if not chosen.binned:
        return Exported(writer(path, mesh, options), None, None)
    binned = bin_materials(mesh, bins=bins)
    return Exported(writer(path, mesh, binned, options), len(binned), binned.error)


def write(path: Path, mesh: TetMesh, options: ExportOptions) -> list[Path]:
    """Write for Gmsh: groups by region, one view an array under the wanted names."""
    if mesh.material is None:
        raise InputError("the mesh has no material yet: run `assign` first")
    arrays = named_arrays(mesh, options.names)
    write_msh(path, mesh.with_material(None), cell_data=arrays)
    return [path]
