"""ParaView time series: a .pvd index beside one .vtu a frame."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from ...fem.errors import InputError
from ...fem.scene.mesh import TetMesh
from ..files import reading, writing, writing_folder
from .meshdata import Arrays, MeshData
from .vtk import read_vtk, write_vtk

WANTED = "a ParaView .pvd series"
TimedFields = tuple[float, Mapping[str, np.ndarray]]


def write_pvd(
    path: str | os.PathLike,
    mesh: TetMesh,
    frames: Iterable[TimedFields],
    *,
    cell_data: Arrays | None = None,
) -> list[Path]:
    """Write frames (time [s], point arrays such as ``displacement``) of one mesh as they come.

    Frame i goes to ``STEM_0000i.vtu`` beside the index; all appear when all are written. Returns
    every file, the index first.
    """
    path = Path(path)
    with writing_folder(path.parent) as folder:
        names = _write_series(folder / path.name, mesh, frames, cell_data)
    return [path.with_name(name) for name in names]


def _write_series(
    path: Path, mesh: TetMesh, frames: Iterable[TimedFields], cell_data: Arrays | None
) -> list[str]:
    """Write frames and index; their names, the index first."""
    entries, names = [], []
    for i, (time, point_data) in enumerate(frames):
        file = path.with_name(f"{path.stem}_{i:05d}.vtu")
        write_vtk(file, mesh, point_data=point_data, cell_data=cell_data)
        entries.append(f'<DataSet timestep="{float(time)!r}" file={quoteattr(file.name)}/>')
        names.append(file.name)
    if not entries:
        raise InputError(f"{path.name}: a series needs at least one frame, got none")
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian"><Collection>',
        *entries,
        "</Collection></VTKFile>\n",
    ]
    with writing(path) as target:
        target.write_text("\n".join(lines), encoding="utf-8")
    return [path.name, *names]


def read_pvd(path: str | os.PathLike) -> Iterator[tuple[float, MeshData]]:
    """Read a series frame by frame: (time [s], mesh and arrays)."""
    with reading(path, WANTED) as source:
        folder = source.parent.resolve()
        frames = []
        for entry in ElementTree.parse(source).iter("DataSet"):
            file = (folder / entry.attrib["file"]).resolve()
            if not file.is_relative_to(folder):
                raise InputError(f"{path} refers to {file}, outside its folder")
            frames.append((float(entry.attrib["timestep"]), file))
    return ((time, read_vtk(file)) for time, file in frames)
