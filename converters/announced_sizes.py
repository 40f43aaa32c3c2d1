"""Counts that a file announces, held against its size before a parser allocates for them."""

from __future__ import annotations

import re
import struct
from pathlib import Path

from ..fem.errors import InputError

# A keyword and the counts after it, in legacy VTK, Medit and Gmsh files; of VTK's fields the
# counts stand before their type. Whatever is counted takes a byte at least.
_ANNOUNCED = re.compile(
    rb"(?:^|[\r\n])[ \t]*(?:(?:POINTS|CELLS|CELL_TYPES|POINT_DATA|CELL_DATA|Vertices|Edges"
    rb"|Triangles|Quadrilaterals|Tetrahedra|Hexahedra|Prisms|Pyramids|\$Nodes|\$Elements)"
    rb"\s+(\d+)(?:[ \t]+(\d+))?|\S+[ \t]+(\d+)[ \t]+(\d+)[ \t]+(?:float|double|vtktypeint64|int"
    rb"|long|short|char|unsigned_char|unsigned_int|unsigned_long)\b)"
)
VLR_BYTES, EVLR_BYTES = 54, 60  # least of a variable length record of LAS, and of an extended one
LAZ_MOST = 4096  # times that LAZ may shrink points: equal points pack about a thousandfold


def check_counts(path: Path) -> None:
    """Refuse a mesh file that announces more of something than it has bytes."""
    data = path.read_bytes()
    for found in _ANNOUNCED.finditer(data):
        for count in found.groups():
            if count is not None and int(count) > len(data):
                raise InputError(
                    f"{path}: announces {count.decode()[:20]} of something, has {len(data)} bytes: "
                    "it is cut short or damaged"
                )


def check_las(path: Path) -> None:
    """Refuse a LAS or LAZ file whose header announces more records or points than can be there."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(375)
    if len(head) < 227 or head[:4] != b"LASF":
        raise InputError(f"{path}: does not start like a LAS file (LASF and 227 bytes)")
    start, records, kind, width, points = struct.unpack_from("<IIBHI", head, 96)
    extended = 0
    if head[25] >= 4 and len(head) == 375:  # LAS 1.4 counts in 64 bits
        extended, points = struct.unpack_from("<IQ", head, 243)
    packed = LAZ_MOST if kind >= 128 else 1
    for what, need in (
        ("variable length records", records * VLR_BYTES),
        ("extended records", extended * EVLR_BYTES),
        ("bytes before the points", start),
        ("bytes of points", points * width // packed),
    ):
        if need > size:
            raise InputError(f"{path}: announces {need} bytes of {what}, has {size}")
