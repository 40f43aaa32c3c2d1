"""Our own archive of a tet mesh, .npz: the mesh and its material, and nothing beside."""

from __future__ import annotations

import os

from ...fem.errors import InputError
from ...fem.scene.mesh import TetMesh
from .. import npz
from ..registry import MATERIAL, Format, Keeps
from .meshdata import Arrays, MeshData


def read_mesh_archive(path: str | os.PathLike) -> MeshData:
    """Read what ``npz.save`` wrote of a mesh."""
    value = npz.load(path)
    if not isinstance(value, TetMesh):
        raise InputError(f"{path} holds a material field, wanted a tet mesh")
    return MeshData(value)


def write_mesh_archive(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> None:
    """Write the mesh; further arrays are refused, since there is no room for them."""
    if point_data or cell_data:
        raise InputError(f"{path}: .npz holds the mesh and its material only; use .vtu or .msh")
    npz.save(path, mesh)


MESH_ARCHIVE = Format(
    "own archive",
    (".npz",),
    read_mesh_archive,
    write_mesh_archive,
    keeps=MATERIAL | {Keeps.GRAIN, Keeps.REGIONS},
)
