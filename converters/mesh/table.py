"""The table of mesh formats: suffix -> reader and writer."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ...fem.errors import InputError
from ...fem.scene.mesh import TetMesh
from .. import npz
from ..announced_sizes import check_counts
from ..files import reading
from .meshdata import Arrays, MeshData, from_meshio
from .msh import read_msh, write_msh
from .vtk import read_vtk, write_vtk


class Format(NamedTuple):
    """Reader and writer of a format, either may be missing; ``title`` is for messages."""

    title: str
    read: Callable[..., MeshData] | None
    write: Callable[..., None] | None


def _read_npz(path: str | os.PathLike) -> MeshData:
    value = npz.load(path)
    if not isinstance(value, TetMesh):
        raise InputError(f"{path} holds a material field, wanted a tet mesh")
    return MeshData(value)


def _write_npz(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> None:
    if point_data or cell_data:
        raise InputError(f"{path}: .npz holds the mesh and its material only; use .vtu or .msh")
    npz.save(path, mesh)


def _read_medit(path: str | os.PathLike) -> MeshData:
    with reading(path, "a Medit .mesh file with tets") as source:
        check_counts(source)
        import meshio

        return from_meshio(meshio.medit.read(str(source)))


FORMATS: dict[str, Format] = {
    ".msh": Format("Gmsh", read_msh, write_msh),
    ".vtu": Format("VTK XML", read_vtk, write_vtk),
    ".vtk": Format("legacy VTK", read_vtk, write_vtk),
    ".npz": Format("own archive", _read_npz, _write_npz),
    ".mesh": Format("Medit, read only", _read_medit, None),
}


def read_mesh(path: str | os.PathLike) -> TetMesh:
    """Read a tet mesh with its regions and, where E, nu and rho are there, its material."""
    return read_data(path).mesh


def read_data(path: str | os.PathLike) -> MeshData:
    """Read a tet mesh together with every other array on its points and tets."""
    reader = _format(path).read
    if reader is None:
        raise InputError(f"{path}: {Path(path).suffix} cannot be read; {_known('read')} can")
    return reader(path)


def write_mesh(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> None:
    """Write a mesh with its regions, material and further arrays, all or nothing."""
    writer = _format(path).write
    if writer is None:
        raise InputError(f"{path}: {Path(path).suffix} cannot be written; {_known('write')} can")
    writer(path, mesh, point_data=point_data, cell_data=cell_data)


def _format(path: str | os.PathLike) -> Format:
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        known = ", ".join(f"{s} ({f.title})" for s, f in FORMATS.items())
        raise InputError(f"{path}: unknown mesh suffix {suffix!r}; known are {known}")
    return FORMATS[suffix]


def _known(what: str) -> str:
    return ", ".join(s for s, f in FORMATS.items() if getattr(f, what) is not None)
