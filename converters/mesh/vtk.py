"""VTK: .vtu and legacy .vtk, with the names of the regions kept in the file."""

from __future__ import annotations

import os
import re
from collections.abc import Container
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ...fem.errors import InputError
from ...fem.scene.mesh import TetMesh
from ..announced_sizes import check_counts
from ..files import reading, writing
from ..registry import Format
from .meshdata import (
    WHOLE,
    Arrays,
    MeshData,
    assemble,
    cell_arrays,
    checked,
    escape,
    from_meshio,
)
from .vtu import load_vtu

WANTED = "a VTK unstructured grid (.vtu or legacy .vtk) with tets"
# Region names travel as field data: UTF-8 bytes, one name a line, a type that every reader takes.
_NAMES = "region_names"
_LEGACY_HEAD = 1 << 20  # bytes searched for the names in a legacy file: they follow the title


def write_vtk(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> None:
    """Write .vtu (binary, zlib) or legacy .vtk (4.2, binary) by suffix.

    Cell arrays E [Pa], nu, rho [kg/m^3], of a grain its axes and constants, region, mat_id
    (region + 1) and ``cell_data``; point arrays from ``point_data``.
    """
    import meshio

    suffix = Path(path).suffix.lower()
    cells = cell_arrays(mesh, cell_data)
    points = checked(point_data, len(mesh.points), "point")
    if blank := [name for name in (*cells, *points) if re.search(r"\s", name)]:
        raise InputError(f"VTK array names must have no blanks, got {blank}")
    grid = meshio.Mesh(mesh.points, [("tetra", mesh.tets)])
    grid.point_data.update(points)
    grid.cell_data.update({name: [values] for name, values in cells.items()})
    with writing(path) as target:
        if suffix == ".vtu":
            meshio.vtu.write(str(target), grid, compression="zlib")
        else:
            meshio.vtk.write(str(target), grid, fmt_version="4.2", binary=True)
        _insert_names(target, mesh.region_names)


def read_vtk(path: str | os.PathLike) -> MeshData:
    """Read tets, regions and all arrays of a .vtu or legacy .vtk file."""
    with reading(path, WANTED) as source:
        return _read_xml(source) if source.suffix.lower() == ".vtu" else _read_legacy(source)


VTU = Format("VTK XML", (".vtu",), read_vtk, write_vtk, keeps=WHOLE)
VTK = Format("legacy VTK", (".vtk",), read_vtk, write_vtk, keeps=WHOLE)


def _read_xml(source: Path) -> MeshData:
    grid = load_vtu(source)
    raw = grid.field_data.get(_NAMES)
    listed = None if raw is None else np.asarray(raw, dtype=np.uint8).tobytes()
    return assemble(
        grid.points,
        grid.tets,
        point_data=grid.point_data,
        cell_data=grid.cell_data,
        names=_names(listed, grid.cell_data),
        ignored=grid.ignored,
    )


def _read_legacy(source: Path) -> MeshData:
    import meshio

    check_counts(source)
    grid = meshio.vtk.read(str(source))
    return from_meshio(grid, _names(_legacy_names(source), grid.cell_data))


def _names(listed: bytes | None, cell_data: Container[str]) -> dict[int, str]:
    """Names of the regions by tag, of a list of a line each."""
    lines = [] if listed is None else listed.decode("utf-8").split("\n")[:-1]
    if lines and "region" not in cell_data:
        raise InputError(f"it names {len(lines)} regions but has no cell array 'region'")
    return {tag: unquote(line) for tag, line in enumerate(lines)}


def _insert_names(file: Path, names: tuple[str, ...]) -> None:
    """Put the region names where VTK keeps field data: before the points."""
    raw = "".join(f"{escape(name)}\n" for name in names).encode("utf-8")
    content = file.read_bytes()
    if file.suffix == ".vtu":
        anchor = b"<UnstructuredGrid>"
        codes = " ".join(map(str, raw))
        block = (
            f'<FieldData><DataArray type="UInt8" Name="{_NAMES}" NumberOfTuples="{len(raw)}" '
            f'format="ascii">{codes}</DataArray></FieldData>'
        ).encode()
    else:
        anchor = b"DATASET UNSTRUCTURED_GRID\n"
        block = f"FIELD FieldData 1\n{_NAMES} 1 {len(raw)} unsigned_char\n".encode() + raw + b"\n"
    head, _, tail = content.partition(anchor)
    with file.open("wb") as out:
        out.writelines((head, anchor, block, tail))


def _legacy_names(file: Path) -> bytes | None:
    """Region names of a legacy file, binary or ASCII."""
    with file.open("rb") as source:
        head = source.read(_LEGACY_HEAD)
    match = re.search(rb"%s 1 (\d+) unsigned_char\n" % _NAMES.encode(), head)
    if match is None:
        return None
    count, rest = int(match[1]), head[match.end() :]
    if re.match(rb"[^\n]*\n[^\n]*\nBINARY", head):
        return rest[:count]
    return bytes(int(code) for code in rest.split(None, count)[:count])
