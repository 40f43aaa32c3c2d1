"""PLY: the vertex table with every property and its order kept; other elements pass through.

Splats packed in chunks are unpacked.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import BinaryIO, Literal

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
    "float32": "f4", "float64": "f8",
}  # fmt: skip
_NAMES = {code: name for name, code in reversed(_TYPES.items())}
_ORDERS: dict[str, Literal["=", "<", ">"]] = {
    "ascii": "=",
    "binary_little_endian": "<",
    "binary_big_endian": ">",
}
_HEADER_LINES = 10_000  # a header longer than this is not one


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
    with reading(path, WANTED) as source, source.open("rb") as file:
        header = _header(file)
        encoding, comments, declared, rest = _parse(header)
        elements = {}
        for name, count, dtype in declared:
            left = os.fstat(file.fileno()).st_size - file.tell()
            if encoding == "ascii":
                elements[name] = _ascii_rows(file, count, dtype)
                continue
            if not 0 <= count * dtype.itemsize <= left:
                raise InputError("ply.rows_bytes", count=count, itemsize=dtype.itemsize, left=left)
            rows = np.fromfile(file, dtype.newbyteorder(_ORDERS[encoding]), count)
            elements[name] = rows.astype(rows.dtype.newbyteorder("="), copy=False)
        if "vertex" not in elements:
            raise InputError("ply.vertex_element", path=path, wanted=WANTED)
        return Ply(elements, comments, encoding, (rest, file.read()))


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
        ply = read_ply(path)
        packed = "packed_position" in (ply.vertex.dtype.names or ())
        if packed and "chunk" in ply.elements:  # splats in chunks of 256
            return PointTable(unpack(ply.elements), ply.comments)
        names = ply.vertex.dtype.names or ()
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


def _header(file: BinaryIO) -> list[str]:
    lines = []
    for _ in range(_HEADER_LINES):
        line = file.readline(4096)
        lines.append(line.decode("utf-8", errors="replace").strip("\r\n"))
        if lines[0].strip() != "ply":
            raise InputError("ply.first_line", lines=lines[0][:20])
        if lines[-1].strip() == "end_header":
            return lines[1:-1]
        if not line:
            break
    raise InputError("ply.header_end")


def _parse(header: list[str]):
    """Encoding, comments, elements (name, count, dtype) and the lines from a list element on."""
    encoding, comments, declared = "", [], []
    starts = [i for i, line in enumerate(header) if line.startswith("element ")]
    lists = [i for i, line in enumerate(header) if line.startswith("property list ")]
    first_list = max((i for i in starts if lists and i < lists[0]), default=len(header))
    for line in header[:first_list]:
        words = line.split()
        if not words or words[0] == "obj_info":
            continue
        if words[0] == "comment":
            comments.append(line[8:])
        elif words[0] == "format" and len(words) > 1 and words[1] in _ORDERS:
            encoding = words[1]
        elif words[0] == "element" and len(words) == 3:
            declared.append((words[1], int(words[2]), []))
        elif words[0] == "property" and len(words) == 3 and words[1] in _TYPES and declared:
            declared[-1][2].append((words[2], _TYPES[words[1]]))
        else:
            raise InputError("ply.header_line", line=line[:60])
    if not encoding:
        raise InputError("ply.header_names")
    elements = [(name, count, np.dtype(fields)) for name, count, fields in declared]
    return encoding, tuple(comments), elements, tuple(header[first_list:])


def _ascii_rows(file: BinaryIO, count: int, dtype: np.dtype) -> np.ndarray:
    if count > os.fstat(file.fileno()).st_size:
        raise InputError("ply.rows_announced", count=count)
    rows = [tuple(file.readline().split()) for _ in range(count)]
    if rows and {len(row) for row in rows} != {len(dtype.names or ())}:
        raise InputError("ply.row_values", count=len(dtype.names or ()))
    table = np.empty(count, dtype=dtype)
    for name, values in zip(dtype.names or (), zip(*rows, strict=True), strict=False):
        table[name] = np.array(values, dtype="S").astype(dtype[name])
    return table


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
