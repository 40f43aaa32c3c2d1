"""Gmsh .msh: our own ASCII 2.2 writer and reader; binary files and 4.1 are read through meshio.

The writer is our own because meshio's ASCII element data is unreadable under numpy 2, and because
Gmsh, meshio and MuJoCo all read this plain form.
"""

from __future__ import annotations

import io
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any
from urllib.parse import unquote

import numpy as np

from ...fem.errors import InputError
from ...fem.material import material_arrays
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ..files import check_counts, reading, writing
from ..registry import Format
from .meshdata import (
    WHOLE,
    Arrays,
    MeshData,
    assemble,
    checked,
    escape,
    first_of_equal,
    from_meshio,
)

_START = re.compile(r"^\$(\w+)[ \t\r]*\n", re.MULTILINE)
WANTED = Note("msh.gmsh_msh")
# Said by our writer, so that a file cut between two sections is not taken for a bare mesh.
_ANNOUNCED = Note("msh.sections_data")
_CELLS = {
    "1": "lines", "2": "triangles", "3": "quads", "5": "hexahedra", "6": "prisms", "7": "pyramids",
    "8": "lines", "9": "triangles", "10": "quads", "12": "hexahedra", "13": "prisms",
    "14": "pyramids", "15": "points", "17": "hexahedra", "18": "prisms", "19": "pyramids",
    "92": "hexahedra", "93": "hexahedra",
}  # fmt: skip


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
        if (form := re.match(rb"\s*\$MeshFormat\s+4\.1\s+([01])\s+8\s", head)) is not None:
            return _read_41(source.read_bytes(), text=form[1] == b"0")
        version = re.search(rb"\$MeshFormat\s+(\d[\d.]*)", head)
        if version and version[1][:1] != b"2" and version[1] != b"4.1":
            raise InputError("msh.version", version=version[1].decode(), wanted=WANTED)
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
    names, warnings = _volume_names(bodies.get("PhysicalNames", "")), []
    # A tet of several groups has a line for each: the smallest group keeps it
    _, group, sizes = np.unique(elements[:, 1], return_inverse=True, return_counts=True)
    order = np.argsort(sizes[group], kind="stable")
    once = np.sort(order[first_of_equal(elements[order, 2:])]) if len(order) else order
    dropped = np.setdiff1d(elements[np.setdiff1d(order, once), 1], elements[once, 1])
    if dropped.size:
        groups = ", ".join(names.get(tag, str(tag)) for tag in dropped.tolist())
        warnings.append(Note("msh.groups", groups=groups))
        elements = elements[once]
        names = {tag: name for tag, name in names.items() if tag not in dropped}
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
    return assemble(
        points, tets, point_data=point_data, cell_data=cell_data, names=names, ignored=ignored,
        warnings=warnings,
    )  # fmt: skip


# Points of an element by its type in Gmsh's files, and the types of tets.
_POINTS = {
    1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14,
    15: 1, 16: 8, 17: 20, 18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4,
    27: 5, 28: 6, 29: 20, 30: 35, 31: 56, 92: 64, 93: 125,
}  # fmt: skip
_TETS = (4, 11, 29, 30, 31)  # of orders 1 to 5: their corners come first


class _Cursor:
    """Numbers of a section one after the other, of text or of bytes."""

    def __init__(self, body: bytes, text: bool) -> None:
        self._body, self._at = body, 0
        self._values = np.array(body.split(), dtype=np.float64) if text else None

    def take(self, kind: str, count: int | np.integer) -> np.ndarray:
        """``count`` numbers of a kind: i4, u8 or f8."""
        count = int(count)
        if self._values is not None:
            found = self._values[self._at : self._at + max(count, 0)]
            self._at += len(found)
            if len(found) != count:
                raise InputError("msh.numbers_end", count=count)
            return found if kind == "f8" else found.astype(np.int64)
        size = count * int(kind[1])
        if not 0 <= size <= len(self._body) - self._at:
            raise InputError("msh.numbers_end", count=count)
        found = np.frombuffer(self._body, f"<{kind}", count, self._at)
        self._at += size
        return found if kind == "f8" else found.astype(np.int64)


def _read_41(data: bytes, *, text: bool) -> MeshData:
    """MSH 4.1, text or binary: groups belong to entities, of which some may have none."""
    bodies: list[tuple[str, bytes]] = []
    for start in re.finditer(rb"^\$(?!End)([A-Z]\w*)[ \t\r]*\n", data, re.MULTILINE):
        end = data.find(b"$End" + start[1], start.end())
        if end < 0:
            raise InputError("msh.section_end", start=start[1].decode(), wanted=WANTED)
        bodies.append((start[1].decode(), data[start.end() : end]))
    sections = dict(bodies)
    for wanted in ("Nodes", "Elements"):
        if wanted not in sections:
            raise InputError("msh.section_missing", wanted=wanted, wanted_2=WANTED)
    groups = _entity_groups(sections.get("Entities", b""), text)
    # Nodes: blocks of their numbers, then of their places and, on curved ones, parameters
    cursor = _Cursor(sections["Nodes"], text)
    ids, points = [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    for _ in range(int(cursor.take("u8", 4)[0])):
        dimension, _, parametric = cursor.take("i4", 3)
        (count,) = cursor.take("u8", 1)
        ids.append(cursor.take("u8", count))
        width = 3 + (int(dimension) if parametric else 0)
        points.append(cursor.take("f8", count * width).reshape(-1, width)[:, :3])
    node_ids, points = np.concatenate(ids), np.concatenate(points)
    cursor = _Cursor(sections["Elements"], text)
    rows, tags, ignored = [np.zeros((0, 5), np.int64)], [np.zeros((0, 2), np.int64)], Counter()
    for _ in range(int(cursor.take("u8", 4)[0])):
        _, entity, kind = cursor.take("i4", 3).tolist()
        (count,) = cursor.take("u8", 1).tolist()
        if kind not in _POINTS:
            raise InputError("msh.cells_type", k=kind)
        table = cursor.take("u8", count * (1 + _POINTS[kind])).reshape(count, -1)
        if kind in _TETS:
            rows.append(table[:, :5])
            tags.append(np.tile([entity, kind], (count, 1)))
        else:
            ignored[_CELLS.get(str(kind), Note("msh.cells_type", k=kind))] += count
    elements, of = np.concatenate(rows), np.concatenate(tags)
    tets = _locate(elements[:, 1:].ravel(), node_ids, "Elements").reshape(-1, 4)
    names = _volume_names(sections.get("PhysicalNames", b"").decode("utf-8", "replace"))
    # The smallest of the groups of an entity; an entity without one is a region of its own
    size = Counter[int]()
    for entity, count in zip(*np.unique(of[:, 0], return_counts=True), strict=True):
        size.update(dict.fromkeys(groups.get(int(entity), ()), int(count)))
    largest = max([0, *names, *size])
    chosen, warnings = {}, []
    for entity in np.unique(of[:, 0]).tolist():
        own = groups.get(entity, ())
        chosen[entity] = min(own, key=lambda group: size[group], default=largest + entity)
        if not own:
            names[largest + entity] = f"volume {entity}"
        elif len(own) > 1:
            called = [names.get(group, str(group)) for group in own]
            warnings.append(Note("msh.groups", groups=", ".join(called)))
    names = {tag: name for tag, name in names.items() if tag in chosen.values() or not size[tag]}
    if not size and len(chosen) > 1:
        warnings.append(Note("msh.entities", count=len(chosen)))
    point_data, cell_data = {}, {}
    for kind, body in bodies:
        if kind in ("NodeData", "ElementData"):
            name, data_ids, values = _data_41(body, text)
            on_nodes = kind == "NodeData"
            target = point_data if on_nodes else cell_data
            target[name] = _spread(data_ids, values, node_ids if on_nodes else elements[:, 0])
    if size or len(chosen) > 1:
        cell_data["gmsh:physical"] = np.array([chosen[entity] for entity in of[:, 0].tolist()])
    else:
        names = {}
    return assemble(
        points, tets, point_data=point_data, cell_data=cell_data, names=names, ignored=ignored,
        warnings=warnings,
    )  # fmt: skip


def _entity_groups(body: bytes, text: bool) -> dict[int, tuple[int, ...]]:
    """Physical groups of every volume."""
    groups: dict[int, tuple[int, ...]] = {}
    if not body:
        return groups
    cursor = _Cursor(body, text)
    for dimension, count in enumerate(cursor.take("u8", 4).tolist()):
        for _ in range(count):
            (entity,) = cursor.take("i4", 1).tolist()
            cursor.take("f8", 6 if dimension else 3)  # its box, or place
            own = tuple(cursor.take("i4", cursor.take("u8", 1)[0]).tolist())
            if dimension:
                cursor.take("i4", cursor.take("u8", 1)[0])  # what bounds it
            if dimension == 3:
                groups[entity] = own
    return groups


def _data_41(body: bytes, text: bool) -> tuple[str, np.ndarray, np.ndarray]:
    """Name, ids (rows,) and values (rows,) or (rows, components) of a data section."""
    if text:
        return _array(body.decode("utf-8", "replace"))
    stream = io.BytesIO(body)

    def tags() -> list[str]:
        lines = range(int(stream.readline()))
        return [stream.readline().decode("utf-8", "replace").strip() for _ in lines]

    (name, *_), _, (_, width, rows, *_) = tags(), tags(), map(int, tags())
    row = np.dtype([("id", "<i4"), ("values", "<f8", (width,))])
    table: Any = np.frombuffer(body, row, rows, stream.tell())
    values = table["values"] if width > 1 else table["values"][:, 0]
    return unquote(name.strip('"')), table["id"].astype(np.int64), values


def _volume_names(section: str) -> dict[int, str]:
    """Names of the groups of volumes by tag."""
    found: Iterable[re.Match] = re.finditer(r'^\s*3\s+(\d+)\s+"(.*)"\s*$', section, re.MULTILINE)
    return {int(match[1]): unquote(match[2]) for match in found}


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
    known = {str(kind) for kind in _TETS}
    tets = []
    for row in rows:
        if row[1] in known:
            first = 3 + int(row[2])
            tets.append((row[0], row[3] if first > 3 else "0", *row[first : first + 4]))
    ignored = {
        _CELLS.get(k, Note("msh.cells_type", k=k)): n for k, n in kinds.items() if k not in known
    }
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
