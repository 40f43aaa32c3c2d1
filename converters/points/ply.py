"""PLY: the vertex table with every property and its order kept; other elements pass through.

Splats packed in chunks are unpacked.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from ...fem.errors import InputError
from ...fem.note import Note
from ..files import reading, writing
from ..registry import Format, Keeps
from .gaussians import SH_C0, standard_columns
from .table import Others, PointTable

WANTED = Note("ply.ply_file")
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_NAMES = {code: name for name, code in reversed(_TYPES.items())}
_ORDERS: dict[str, Literal["=", "<", ">"]] = {
    "ascii": "=",
    "binary_little_endian": "<",
    "binary_big_endian": ">",
}
_HEADER_BYTES = 1 << 20  # a header longer than this is not one


@dataclass(frozen=True, eq=False)
class Ply:
    """Elements of a PLY file: structured arrays by name, in order.

    ``rest`` are the header lines and the bytes of the elements from the first with a list property
    on (faces), kept as they are; ``encoding`` is ``ascii`` or one of the two binary ones.
    """

    elements: dict[str, np.ndarray]
    comments: tuple[str, ...] = ()
    encoding: str = "binary_little_endian"
    rest: tuple[tuple[str, ...], bytes] = field(default=((), b""))

    @property
    def vertex(self) -> np.ndarray:
        """The table of vertices."""
        return self.elements["vertex"]

    @property
    def others(self) -> tuple[str, ...]:
        """What stands beside the vertices, in words."""
        lists = [line.split()[1] for line in self.rest[0] if line.startswith("element ")]
        return tuple(f"element {name}" for name in (*self.elements, *lists) if name != "vertex")


def read_ply(path: str | os.PathLike) -> Ply:
    """Read a PLY file; its ``vertex`` element must have scalar properties only."""
    with reading(path, WANTED) as source:
        return parse_ply(source.read_bytes())


def parse_ply(data: bytes, *, surface: bool = False) -> Ply:
    """Take the bytes of a PLY file apart.

    Of a ``surface``, which is not written again, vertices may have lists or stand behind faces.
    """
    if not data.startswith(b"ply"):
        raise InputError("ply.first_line", lines=data[:20].decode("utf-8", "replace"))
    head, end, _ = data[:_HEADER_BYTES].partition(b"end_header")
    lone = re.match(rb"ply[ \t]*\r(?!\n)", data)  # lines end as on old Macintoshes
    start = data.find(b"\r" if lone else b"\n", len(head)) + 1
    if not end or not start:
        raise InputError("ply.header_end")
    header = [line.strip() for line in head.decode("utf-8", "replace").splitlines()[1:]]
    (encoding,) = [line.split()[1] for line in header if line.startswith("format ")] or [""]
    if encoding not in _ORDERS:
        raise InputError("ply.header_names")
    comments = tuple(line[8:] for line in header if line.startswith("comment"))
    elements, declared = {}, _declared(header)
    while declared and not any(counter for *_, counter in declared[0].fields):
        name, count, fields, _ = declared.pop(0)
        dtype = np.dtype([(field, kind) for field, kind, _ in fields])
        if encoding == "ascii":
            words = data[start:].split(None, count * len(fields)) if count < len(data) else []
            if len(words) < count * len(fields):
                raise InputError("ply.rows_announced", count=count)
            table: Any = np.empty(count, dtype=dtype)
            for i, (field, kind, _) in enumerate(fields):
                column = np.array(words[i : count * len(fields) : len(fields)], dtype="S")
                table[field] = column.astype(kind)
            rest = words[count * len(fields) :]
            start = len(data) - len(rest[0]) if rest else len(data)
        else:
            size, left = count * dtype.itemsize, len(data) - start
            if not 0 <= size <= left:
                raise InputError("ply.rows_bytes", count=count, itemsize=dtype.itemsize, left=left)
            rows = np.frombuffer(data, dtype.newbyteorder(_ORDERS[encoding]), count, start)
            table, start = rows.astype(dtype), start + size
        elements[name] = table
    rest = tuple(header[declared[0].line :]) if declared else ()
    ply = Ply(elements, comments, encoding, (rest, data[start:]))
    if "vertex" not in elements:
        late = [element for element in declared if element.name == "vertex"] if surface else []
        if not late:
            raise InputError("ply.vertex_element", wanted=WANTED)
        plain = [(name, kind) for name, kind, counter in late[0].fields if counter is None]
        empty: Any = np.zeros(late[0].count, np.dtype(plain))
        elements["vertex"] = empty
        for rows in listed(ply)["vertex"]:
            for name, _ in plain:
                elements["vertex"][name][rows.number] = rows.values[name][:, 0]
    return ply


class _Element(NamedTuple):
    """An element of a header: its rows, and of each property name, type and type of the count."""

    name: str
    count: int
    fields: list[tuple[str, str, str | None]]
    line: int


def _declared(header: Sequence[str]) -> list[_Element]:
    found: list[_Element] = []
    for number, line in enumerate(header):
        words = line.split()
        try:
            if words[:1] == ["element"]:
                found.append(_Element(words[1], int(words[2]), [], number))
            elif words[:2] == ["property", "list"]:
                found[-1].fields.append((words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[:1] == ["property"]:
                found[-1].fields.append((words[2], _TYPES[words[1]], None))
            elif words and words[0] not in ("format", "comment", "obj_info"):
                raise KeyError(words[0])
        except (KeyError, IndexError, ValueError) as error:
            raise InputError("ply.header_line", line=line[:60]) from error
    return found


class Rows(NamedTuple):
    """Rows of an element whose lists have equal lengths.

    ``number`` (n,) of each; ``values`` by name, (n, 1) or of a list (n, k).
    """

    number: np.ndarray
    values: dict[str, np.ndarray]


def listed(ply: Ply) -> dict[str, list[Rows]]:
    """Elements with lists by name."""
    header, body = ply.rest
    order = _ORDERS[ply.encoding]
    text, found, at = order == "=", {}, 0
    data = np.array(body.split(), dtype=np.float64) if text else np.frombuffer(body, np.uint8)
    for element in _declared(header):
        # Of each property the type and size of a value, and of the count that stands before them
        fields = []
        for _, kind, counter in element.fields:
            both = np.dtype(order + kind), np.dtype(order + (counter or "u1"))
            sizes = (1, 1) if text else tuple(one.itemsize for one in both)
            fields.append((*both, sizes[0], sizes[1] if counter else 0))
        groups: dict[tuple[int, ...], list[tuple[int, int]]] = {}
        for number in range(element.count):
            lengths, start = [], at
            for _, counter, size, counter_size in fields:
                many = 1
                if counter_size and at + counter_size <= len(data):
                    many = int(data[at] if text else np.frombuffer(body, counter, 1, at)[0])
                at += counter_size + many * size
                if many < 0 or at > len(data):
                    raise InputError("ply.lists_end", name=element.name)
                lengths.append(many)
            groups.setdefault(tuple(lengths), []).append((number, start))
        found[element.name] = []
        for lengths, rows in groups.items():
            numbers, starts = np.array(rows).T
            values = {}
            for (name, *_), (kind, _, size, counter_size), many in zip(
                element.fields, fields, lengths, strict=True
            ):
                starts = starts + counter_size
                cells = data[starts[:, None] + np.arange(many * size)]
                values[name] = cells if text else cells.view(kind)
                starts = starts + many * size
            found[element.name].append(Rows(numbers, values))
    return found


def write_ply(path: str | os.PathLike, ply: Ply) -> None:
    """Write a PLY file in its own encoding."""
    lines = ["ply", f"format {ply.encoding} 1.0", *(f"comment {c}" for c in ply.comments)]
    for name, table in ply.elements.items():
        lines.append(f"element {name} {len(table)}")
        for column in table.dtype.names or ():
            lines.append(f"property {_NAMES[table.dtype[column].str[1:]]} {column}")
    rest_header, rest = ply.rest
    header = "\n".join([*lines, *rest_header, "end_header\n"])
    with writing(path) as target, target.open("wb") as file:
        file.write(header.encode("utf-8"))
        for table in ply.elements.values():
            if ply.encoding == "ascii":
                file.writelines(f"{' '.join(map(repr, row))}\n".encode() for row in table.tolist())
            else:
                order = table.dtype.newbyteorder(_ORDERS[ply.encoding])
                file.write(np.ascontiguousarray(table.astype(order, copy=False)).data)
        file.write(rest)


def columns_table(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Structured array of columns, in order; values keep their type."""
    dtype = [(name, np.asarray(values).dtype) for name, values in columns.items()]
    table = np.empty(len(next(iter(columns.values()))), dtype=dtype)
    for name, values in columns.items():
        table[name] = values
    return table


def read_ply_points(path: str | os.PathLike) -> PointTable:
    """Read the vertices as points; splats packed in chunks become the columns of the common PLY."""
    with reading(path, Note("ply.ply_point")):
        return ply_points(read_ply(path))


def ply_points(ply: Ply) -> PointTable:
    """Vertices of a file as points."""
    names = ply.vertex.dtype.names or ()
    if "packed_position" in names and "chunk" in ply.elements:  # splats in chunks of 256
        return PointTable(unpack(ply.elements), ply.comments)
    columns = {name: ply.vertex[name] for name in names}
    return PointTable(columns, ply.comments, Others(_TITLE, ply.others, ply))


def write_ply_points(path: str | os.PathLike, table: PointTable) -> None:
    """Write the columns as vertices, in the encoding and with the elements they were read with."""
    vertex = {"vertex": columns_table(dict(table.columns))}
    if table.others is not None and isinstance(table.others.value, Ply):
        ply = table.others.value
        elements = {**ply.elements, **vertex}
        write_ply(path, replace(ply, elements=elements, comments=table.comments))
    else:
        write_ply(path, Ply(vertex, table.comments))


_TITLE = Note("ply.ply_cloud")
PLY = Format(
    _TITLE,
    (".ply",),
    read_ply_points,
    write_ply_points,
    keeps=frozenset({Keeps.COLUMNS, Keeps.REMARKS, Keeps.HARMONICS, Keeps.OTHERS}),
)


# SuperSplat's packed PLY: chunks of 256 splats, values as bits between the bounds of a chunk.

_CHUNK = 256  # splats a chunk
Elements = Mapping[str, np.ndarray]


def unpack(elements: Elements) -> dict[str, np.ndarray]:
    """Columns of a chunk-packed PLY: 11-10-11 bit positions and scales between chunk bounds."""
    chunk, vertex = elements["chunk"], elements["vertex"]
    if len(chunk) * _CHUNK < len(vertex):
        raise InputError("ply.packed_splats", count=len(vertex), count_2=len(chunk))
    of = np.arange(len(vertex)) // _CHUNK

    def between(names: str, share: np.ndarray) -> np.ndarray:
        low, high = (
            np.stack([chunk[f"{end}_{name}"][of] for name in names.split()], axis=1)
            for end in ("min", "max")
        )
        return low * (1 - share) + high * share

    colour = _bits(vertex["packed_color"], (8, 8, 8, 8))
    rgb = colour[:, :3]
    if "min_r" in (chunk.dtype.names or ()):
        rgb = between("r g b", rgb)
    rest = None
    if "sh" in elements:
        harmonics = elements["sh"]
        level = np.stack([harmonics[name] for name in harmonics.dtype.names or ()], axis=1)
        inner = (level + 0.5) / 256
        rest = (np.where(level == 0, 0, np.where(level == 255, 1, inner)) - 0.5) * 8
    # Quaternions wxyz from the index of the largest component and the others, 10 bits each
    packed = vertex["packed_rotation"]
    three = (_bits(packed, (2, 10, 10, 10))[:, 1:] - 0.5) * 2**0.5
    largest = np.sqrt(np.maximum(0, 1 - (three**2).sum(axis=1)))
    place = (packed >> np.uint32(30)).astype(np.int64)
    result = np.empty((len(packed), 4))
    others = np.array([[j for j in range(4) if j != i] for i in range(4)])[place]
    np.put_along_axis(result, others, three, axis=1)
    np.put_along_axis(result, place[:, None], largest[:, None], axis=1)
    return standard_columns(
        between("x y z", _bits(vertex["packed_position"], (11, 10, 11))),
        between("scale_x scale_y scale_z", _bits(vertex["packed_scale"], (11, 10, 11))),
        result,
        colour[:, 3],
        (rgb - 0.5) / SH_C0,
        rest,
    )


def _bits(packed: np.ndarray, widths: tuple[int, ...]) -> np.ndarray:
    """Bit fields of uint32, highest first, each as a share of its largest value."""
    shifts = np.cumsum((0, *widths[:0:-1]))[::-1]
    fields = [
        packed >> np.uint32(s) & np.uint32(2**w - 1) for s, w in zip(shifts, widths, strict=True)
    ]
    return np.stack(fields, axis=1) / (2.0 ** np.array(widths) - 1)
