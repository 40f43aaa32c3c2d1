"""Triangle strips of a binary PLY, in lists of any lengths: trimesh reads only lists of one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ....fem.errors import InputError

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip


class Strips(NamedTuple):
    """``points`` (n, 3) in the file's unit, and strips of their numbers, which -1 may divide."""

    points: np.ndarray
    rows: list[np.ndarray]


class _Element(NamedTuple):
    """An element of the header: its rows, its plain columns, or the two types of its list."""

    name: str
    count: int
    columns: list[tuple[str, str]]
    listed: tuple[str, str] | None


def binary_strips(path: Path, data: bytes) -> Strips | None:
    """Read the vertices and strips of a binary PLY; None of other files.

    Raises
    ------
    InputError
        Where the file is cut short, or an element before the strips has lists.
    """
    header, _, body = data.partition(b"end_header")
    order = re.search(rb"format binary_(little|big)_endian", header)
    if order is None or b"element tristrips" not in header:
        return None
    body = body[body.index(b"\n") + 1 :]
    points, at = np.zeros((0, 3)), 0
    for element in _elements(header.decode("ascii", "replace"), "<>"[order[1] == b"big"]):
        if element.name == "tristrips" and element.listed:
            return Strips(points, _lists(path, element, body, at))
        if element.listed:
            break
        dtype = np.dtype(element.columns)
        if at + element.count * dtype.itemsize > len(body):
            raise InputError(f"{path}: ends before its {element.count} {element.name} elements do")
        table = np.frombuffer(body, dtype, element.count, at)
        if element.name == "vertex":
            points = np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)
        at += element.count * dtype.itemsize
    raise InputError(f"{path}: has lists before its triangle strips: export it with faces")


def _elements(header: str, order: str) -> list[_Element]:
    found: list[_Element] = []
    for words in map(str.split, header.splitlines()):
        if words[:1] == ["element"]:
            found.append(_Element(words[1], int(words[2]), [], None))
        elif words[:2] == ["property", "list"]:
            types = order + TYPES[words[2]], order + TYPES[words[3]]
            found[-1] = found[-1]._replace(listed=types)
        elif words[:1] == ["property"]:
            found[-1].columns.append((words[2], order + TYPES[words[1]]))
    return found


def _lists(path: Path, element: _Element, body: bytes, at: int) -> list[np.ndarray]:
    assert element.listed is not None
    length, value = map(np.dtype, element.listed)
    rows = []
    for _ in range(element.count):
        size = int(np.frombuffer(body[at : at + length.itemsize].ljust(length.itemsize), length)[0])
        at += length.itemsize
        if size < 0 or at + size * value.itemsize > len(body):
            raise InputError(f"{path}: ends before its triangle strips do")
        rows.append(np.frombuffer(body, value, size, at).astype(np.int64))
        at += size * value.itemsize
    return rows
