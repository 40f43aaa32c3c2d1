"""PCD of the Point Cloud Library: ascii, binary and binary_compressed in, binary out."""

from __future__ import annotations

import os
import struct
from typing import Any

import numpy as np

from ...fem.errors import InputError
from ...fem.note import Note
from ..files import reading, writing
from ..registry import Format, Keeps
from .table import Others, PointTable

WANTED = Note("pcd.pcd_point")
_KINDS = {"F": "f", "I": "i", "U": "u"}
_MAX_FIELDS = 10_000
_TITLE = "PCL cloud"
_VIEWPOINT = "0 0 0 1 0 0 0".split()  # at the origin, not turned


def read_pcd(path: str | os.PathLike) -> PointTable:
    """Read a PCD file; a field of several values becomes a column (n, k)."""
    with reading(path, WANTED) as source:
        content = source.read_bytes()
        header, start = _header(content)
        sizes = [int(size) for size in header["SIZE"]]
        counts = [int(count) for count in header.get("COUNT", ["1"] * len(sizes))]
        kinds = [_KINDS[kind] for kind in header["TYPE"]]
        fields = [
            (name, f"<{kind}{size}", () if count == 1 else (count,))
            for name, kind, size, count in zip(header["FIELDS"], kinds, sizes, counts, strict=True)
        ]
        dtype, n = np.dtype(fields), int(header["POINTS"][0])
        body, encoding = content[start:], header["DATA"][0]
        # What of the header says more than the points do
        more: list[Note | str] = (
            [] if header.get("HEIGHT", ["1"]) == ["1"] else [Note("pcd.rows_camera")]
        )
        more += [] if header.get("VIEWPOINT", _VIEWPOINT) == _VIEWPOINT else ["viewpoint"]
        remarks, others = tuple(header["#"]), Others(_TITLE, tuple(more), header)
        if encoding == "binary_compressed":
            # Compressed files store field after field, not point after point
            body = _unpack(body)
            columns, at = {}, 0
            for name, kind, shape in fields:
                count = n * int(np.prod(shape))
                columns[name] = np.frombuffer(body, kind, count, at).reshape(n, *shape).copy()
                at += count * np.dtype(kind).itemsize
            return PointTable(columns, remarks, others)
        if encoding == "ascii":
            rows = _ascii(body, dtype, n)
        elif 0 <= n * dtype.itemsize <= len(body):
            rows: Any = np.frombuffer(body, dtype=dtype, count=n).copy()
        else:
            raise InputError("pcd.points_bytes", n=n, itemsize=dtype.itemsize, count=len(body))
        return PointTable({name: rows[name] for name in dtype.names or ()}, remarks, others)


def write_pcd(path: str | os.PathLike, table: PointTable) -> None:
    """Write binary PCD 0.7 with every column; whole numbers and floats of 1 to 8 bytes."""
    dtype, columns = [], {}
    for name, values in table.columns.items():
        values = np.asarray(values)
        if values.dtype.kind not in "fiu" or values.ndim > 2 or len(name.split()) != 1:
            raise InputError("pcd.column_pcd", name=name, dtype=values.dtype, shape=values.shape)
        columns[name] = values
        dtype.append((name, values.dtype.newbyteorder("<"), values.shape[1:]))
    rows = np.empty(len(table), dtype=dtype)
    for name, values in columns.items():
        rows[name] = values
    read = table.others
    kept = read.value if read is not None and read.title == _TITLE else {}
    counts = [values.shape[1] if values.ndim == 2 else 1 for values in columns.values()]
    lines = [
        *(f"# {' '.join(comment.split())}" for comment in table.comments),
        "VERSION 0.7",
        f"FIELDS {' '.join(columns)}",
        f"SIZE {' '.join(str(values.dtype.itemsize) for values in columns.values())}",
        f"TYPE {' '.join(values.dtype.kind.upper() for values in columns.values())}",
        f"COUNT {' '.join(map(str, counts))}",
        f"WIDTH {' '.join(kept.get('WIDTH', [str(len(table))]))}",
        f"HEIGHT {' '.join(kept.get('HEIGHT', ['1']))}",
        f"VIEWPOINT {' '.join(kept.get('VIEWPOINT', _VIEWPOINT))}",
        f"POINTS {len(table)}",
        "DATA binary\n",
    ]
    with writing(path) as target, target.open("wb") as file:
        file.write("\n".join(lines).encode("utf-8"))
        file.write(rows.tobytes())


PCD = Format(
    _TITLE,
    (".pcd",),
    read_pcd,
    write_pcd,
    keeps=frozenset({Keeps.COLUMNS, Keeps.REMARKS, Keeps.HARMONICS, Keeps.OTHERS}),
)


def _header(content: bytes) -> tuple[dict[str, list[str]], int]:
    """Header words by keyword, remarks under ``#``, and where the data starts."""
    header, start = {"#": []}, 0
    while (end := content.find(b"\n", start)) >= 0:
        line = content[start:end].decode("utf-8").strip()
        start = end + 1
        if line.startswith("#"):
            header["#"].append(line[1:].strip())
        elif line:
            key, *words = line.split()
            header[key] = words
            if key == "DATA":
                break
    missing = {"FIELDS", "SIZE", "TYPE", "POINTS", "DATA"} - header.keys()
    if missing or len(header["FIELDS"]) > _MAX_FIELDS:
        raise InputError("pcd.pcd_header", missing=sorted(missing))
    return header, start


def _ascii(body: bytes, dtype: np.dtype, n: int) -> np.ndarray:
    rows = [line.split() for line in body.splitlines() if line.strip()]
    if len(rows) != n:
        raise InputError("pcd.points_announced", n=n, count=len(rows))
    table = np.empty(n, dtype=dtype)
    at = 0
    for name in dtype.names or ():
        width = int(np.prod(dtype[name].shape))
        cells = np.array([row[at : at + width] for row in rows], dtype="S")
        table[name] = cells.astype(dtype[name].base).reshape(table[name].shape)
        at += width
    return table


def _unpack(body: bytes) -> bytes:
    """Undo LZF: a control byte below 32 announces literals, another one a copy from behind."""
    packed, size = struct.unpack_from("<II", body)
    if packed > len(body) - 8 or size > 300 * max(packed, 1):  # a copy of 264 takes three bytes
        raise InputError("pcd.packed_plain", packed=packed, size=size, count=len(body))
    source, out, at = body[8 : 8 + packed], bytearray(), 0
    while at < packed:
        control = source[at]
        at += 1
        if control < 32:
            out += source[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += source[at]
            at += 1
        behind = ((control & 31) << 8) + source[at] + 1
        at += 1
        first = len(out) - behind
        if first < 0:
            raise InputError("pcd.packed_data_refers")
        for i in range(length + 2):
            out.append(out[first + i])
    if len(out) != size:
        raise InputError("pcd.packed_data", count=len(out), size=size)
    return bytes(out)
