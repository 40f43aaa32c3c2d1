"""A tet mesh file by its suffix: read and written with all that its format keeps."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from ...fem.errors import InputError
from ...fem.scene.mesh import TetMesh
from ..registry import MESH_FORMATS, Keeps, format_of, told_lost, written
from .meshdata import Arrays, MeshData, items_of, lost_words

log = logging.getLogger(__name__)


def read_mesh(path: str | os.PathLike) -> TetMesh:
    """Read a tet mesh [m] with its regions and, where E, nu and rho are there, its material."""
    return read_data(path).mesh


def read_data(path: str | os.PathLike) -> MeshData:
    """Read a tet mesh together with every other array on its points and tets."""
    if not Path(path).exists():
        raise InputError(f"no such file: {path}; wanted a tet mesh, as `convert` makes one")
    reader = format_of(path, MESH_FORMATS).read
    if reader is None:
        known = ", ".join(suffix for suffix in MESH_FORMATS if MESH_FORMATS[suffix].read)
        raise InputError(f"{path}: {Path(path).suffix} cannot be read; {known} can")
    return reader(path)


def write_mesh(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> tuple[Keeps, ...]:
    """Write a mesh with its regions, material and further arrays, all or nothing.

    Returns what of them the format does not keep, after a warning in the log.
    """
    form = format_of(path, MESH_FORMATS)
    if form.write is None:
        can = ", ".join(written(MESH_FORMATS))
        raise InputError(f"{path}: {Path(path).suffix} cannot be written; {can} can")
    form.write(path, mesh, point_data=point_data, cell_data=cell_data)
    lost = form.loses(items_of(mesh, point_data, cell_data))
    if lost:
        log.warning(told_lost(path, form, lost_words(lost, mesh)))
    return lost
