"""Gmsh .msh: our own ASCII 2.2 writer and reader; binary files and 4.1 are read through meshio.

The writer is our own because meshio's ASCII element data is unreadable under numpy 2, and because
Gmsh, meshio and MuJoCo all read this plain form.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from urllib.parse import unquote

import numpy as np

from ...fem.errors import InputError
from ...fem.material import material_arrays
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ..files import check_counts, reading, writing
from ..registry import Format
from .meshdata import WHOLE, Arrays, MeshData, assemble, checked, escape, from_meshio

_START = re.compile(r"^\$(\w+)[ \t\r]*\n", re.MULTILINE)
WANTED = Note("msh.gmsh_msh")
_TET = "4"
# Said by our writer, so that a file cut between two sections is not taken for a bare mesh.
_ANNOUNCED = Note("msh.sections_data")
_CELLS = {"1": "lines", "2": "triangles", "3": "quads", "5": "hexahedra", "15": "points"}


def write_msh(
    path: str | os.PathLike,
    mesh: TetMesh,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> None:
    """Write ASCII MSH 2.2: a physical group a region; E, nu, rho [SI] as element data, exactly.

    So are the axes and constants of a grain.

    ``point_data`` and ``cell_data`` are further arrays of 1, 3 or 9 components a row.
    """
    cells = material_arrays(mesh.material) | checked(cell_data, len(mesh.tets), "tet")
    nodes = checked(point_data, len(mesh.points), "point")
    with writing(path) as target, target.open("w", encoding="utf-8", newline="\n") as file:
        file.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
        file.write(f"$Comments\n{_ANNOUNCED} {len(nodes) + len(cells)}\n$EndComments\n")
        names, tag = [escape(name) for name in mesh.region_names], mesh.region + 1
        file.write(f"$PhysicalNames\n{len(names)}\n")
        file.writelines(f'3 {number} "{name}"\n' for number, name in enumerate(names, 1))
        file.write(f"$EndPhysicalNames\n$Nodes\n{len(mesh.points)}\n")
        file.writelines(_rows("%d %r %r %r\n", *mesh.points.T))
        file.write(f"$EndNodes\n$Elements\n{len(mesh.tets)}\n")
        file.writelines(_rows("%d 4 2 %d %d %d %d %d %d\n", tag, tag, *(mesh.tets.T + 1)))
        file.write("$EndElements\n")
        for name, array in nodes.items():
            file.writelines(_data("NodeData", name, array))
        for name, array in cells.items():
            file.writelines(_data("ElementData", name, array))


def read_msh(path: str | os.PathLike) -> MeshData:
    """Read tets, physical groups (as regions) and every node and element array of a .msh file."""
    with reading(path, WANTED) as source:
        with source.open("rb") as file:
            head = file.read(64)
        if not head.lstrip().startswith((b"$MeshFormat", b"$Comments")):
            raise InputError("msh.start_meshformat", path=path, wanted=WANTED)
        if re.match(rb"\s*\$MeshFormat\s+2(\.\d+)?\s+0\s", head):
            return _read_ascii2(source.read_text(encoding="utf-8", errors="replace"))
        check_counts(source)
        import meshio

        return from_meshio(meshio.gmsh.read(str(source)))


MSH = Format("Gmsh", (".msh",), read_msh, write_msh, keeps=WHOLE)


def _data(kind: str, name: str, values: np.ndarray) -> Iterator[str]:
    columns = np.asarray(values, dtype=np.float64).reshape(len(values), -1).T
    if len(columns) not in (1, 3, 9):
        raise InputError("msh.array_components", name=name, count=len(columns))
    yield f'${kind}\n1\n"{escape(name)}"\n1\n0.0\n3\n0\n{len(columns)}\n{len(values)}\n'
    yield from _rows("%d" + " %r" * len(columns) + "\n", *columns)
    yield f"$End{kind}\n"


def _rows(line: str, *columns: np.ndarray) -> Iterator[str]:
    """Lines numbered from 1; ``%r`` writes the shortest text that reads back exactly."""
    values = zip(*(column.tolist() for column in columns), strict=True)
    return (line % (i, *row) for i, row in enumerate(values, 1))


def _read_ascii2(text: str) -> MeshData:
    sections = list(_sections(text))
    bodies = dict(sections)
    # Refuse a file of ours that holds fewer data sections than it announces
    announced = re.search(rf"^{_ANNOUNCED} (\d+)$", bodies.get("Comments", ""), re.MULTILINE)
    present = sum(kind in ("NodeData", "ElementData") for kind, _ in sections)
    if announced and present < int(announced[1]):
        raise InputError("msh.sections_data_where", present=present, announced=announced[1])
    for wanted in ("Nodes", "Elements"):
        if wanted not in bodies:
            raise InputError("msh.section_missing", wanted=wanted, wanted_2=WANTED)
    nodes = _table(bodies["Nodes"], 4)
    elements, ignored = _tets(bodies["Elements"])
    node_ids, points = nodes[:, 0].astype(np.int64), nodes[:, 1:]
    ids, tags, corners = elements[:, 0], elements[:, 1], elements[:, 2:]
    tets = _locate(corners.ravel(), node_ids, "Elements").reshape(-1, 4)
    point_data, cell_data = {}, {}
    for kind, body in sections:
        if kind == "NodeData":
            name, data_ids, values = _array(body)
            point_data[name] = _spread(data_ids, values, node_ids)
        elif kind == "ElementData":
            name, data_ids, values = _array(body)
            cell_data[name] = _spread(data_ids, values, ids)
    if tags.any():
        cell_data["gmsh:physical"] = tags
    found: Iterable[re.Match] = re.finditer(
        r'^\s*3\s+(\d+)\s+"(.*)"\s*$', bodies.get("PhysicalNames", ""), re.MULTILINE
    )
    names = {int(match[1]): unquote(match[2]) for match in found}
    return assemble(
        points, tets, point_data=point_data, cell_data=cell_data, names=names, ignored=ignored
    )


def _sections(text: str) -> Iterator[tuple[str, str]]:
    """Name and body of every section."""
    at = 0
    while start := _START.search(text, at):
        end = text.find(f"\n$End{start[1]}", start.end() - 1)
        if end < 0:
            raise InputError("msh.section_end", start=start[1], wanted=WANTED)
        yield start[1], text[start.end() : end + 1]
        at = end + 1 + len(f"$End{start[1]}")
    if rest := text[at:].strip():
        raise InputError("msh.text_after", rest=rest[:40], wanted=WANTED)


def _table(body: str, columns: int) -> np.ndarray:
    """Numbers of a body that starts with its row count, shape (rows, columns)."""
    count, _, rest = body.lstrip().partition("\n")
    values = np.array(rest.split(), dtype=np.float64)
    if values.size != int(count) * columns:
        raise InputError("msh.numbers_where", size=values.size, count=count, columns=columns)
    return values.reshape(-1, columns)


def _tets(body: str) -> tuple[np.ndarray, dict[str, int]]:
    """Rows (id, physical tag, four node ids) of the tets, and the count of every other cell."""
    count, _, rest = body.lstrip().partition("\n")
    rows = [line.split() for line in rest.splitlines() if line.strip()]
    if len(rows) != int(count):
        raise InputError("msh.elements_where", count=len(rows), count_2=count)
    kinds = Counter(row[1] for row in rows)
    tets = [(row[0], row[3] if row[2] != "0" else "0", *row[-4:]) for row in rows if row[1] == _TET]
    ignored = {_CELLS.get(k, Note("msh.cells_type", k=k)): n for k, n in kinds.items() if k != _TET}
    return np.array(tets, dtype=np.int64).reshape(-1, 6), ignored


def _array(body: str) -> tuple[str, np.ndarray, np.ndarray]:
    """Name, ids (rows,) and values (rows,) or (rows, components) of a data section."""
    lines = iter(body.splitlines())
    strings = [next(lines).strip().strip('"') for _ in range(int(next(lines)))]
    for _ in range(int(next(lines))):
        next(lines)  # real tags: the time
    _, components, rows, *_ = [int(next(lines)) for _ in range(int(next(lines)))]
    table = _table(f"{rows}\n" + "\n".join(lines), components + 1)
    values = table[:, 1:] if components > 1 else table[:, 1]
    return unquote(strings[0]), table[:, 0].astype(np.int64), values


def _locate(wanted: np.ndarray, ids: np.ndarray, what: str) -> np.ndarray:
    """Row of every wanted id."""
    order = np.argsort(ids)
    place = np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)
    rows = order[place]
    missing = np.flatnonzero(ids[rows] != wanted)
    if missing.size:
        raise InputError("msh.names_id", what=what, wanted=wanted[missing[0]], size=missing.size)
    return rows


def _spread(ids: np.ndarray, values: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """Values in the order of the ids ``onto``; NaN where the section says nothing."""
    result = np.full((len(onto), *values.shape[1:]), np.nan)
    there = np.isin(onto, ids)
    result[there] = values[_locate(onto[there], ids, "data")]
    return result
