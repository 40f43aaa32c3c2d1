"""A reader of .vtu files of our own: inline, appended or raw arrays, their unpacking bounded.

meshio's reader unpacks whatever a compressed block holds (1 kB of zeros packed twice is a
gigabyte), loses all cells but the last piece's, and its parts have no public name to build on.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError
from .vtu_arrays import VtuArrays

MAX_UNPACKED = 4 << 30  # bytes in all arrays: a sixth of the memory of a 24 GiB machine
_TET = 10
_CELLS = {
    1: "vertex", 3: "line", 5: "triangle", 7: "polygon", 9: "quad", 12: "hexahedron", 13: "wedge",
    14: "pyramid", 22: "triangle6", 24: "tetra10", 25: "hexahedron20", 42: "polyhedron",
}  # fmt: skip
_APPENDED = re.compile(rb"<AppendedData([^>]*)>")


class VtuGrid(NamedTuple):
    """Points (points, 3) and tets (tets, 4) of all pieces of a file, with their arrays.

    ``ignored`` counts the other cells by kind.
    """

    points: Float[np.ndarray, "points 3"]
    tets: Int[np.ndarray, "tets 4"]
    point_data: dict[str, np.ndarray]
    cell_data: dict[str, np.ndarray]
    field_data: dict[str, np.ndarray]
    ignored: dict[str, int]


def load_vtu(path: Path, *, max_bytes: int = MAX_UNPACKED) -> VtuGrid:
    """Read a .vtu file whose compressed arrays hold at most ``max_bytes`` in all."""
    root, appended = _document(path.read_bytes())
    arrays = VtuArrays(root, appended, max_bytes)
    grid = root.find("UnstructuredGrid")
    pieces = [] if grid is None else grid.findall("Piece")
    if grid is None or not pieces:
        raise InputError("no piece of an unstructured grid is in it")
    ignored: dict[str, int] = {}
    read = [_piece(piece, arrays, ignored) for piece in pieces]
    starts = np.cumsum([0, *(len(points) for points, *_ in read[:-1])])
    return VtuGrid(
        np.concatenate([points for points, *_ in read]),
        np.concatenate([tets + start for (_, tets, *_), start in zip(read, starts, strict=True)]),
        _joined([on_points for *_, on_points, _ in read]),
        _joined([on_tets for *_, on_tets in read]),
        arrays.under(grid.find("FieldData")),
        ignored,
    )


def _document(content: bytes) -> tuple[ElementTree.Element, tuple[bytes, bool]]:
    """The XML without its appended data, and that data with whether it is raw."""
    start = _APPENDED.search(content)
    if start is None:
        return _checked(ElementTree.fromstring(content)), (b"", False)
    stop = content.rfind(b"</AppendedData>")
    raw = re.search(rb"encoding\s*=\s*[\"']raw", start[1]) is not None
    data = content[start.end() : stop].partition(b"_")[2]
    tail = content[stop + len(b"</AppendedData>") :]
    return _checked(ElementTree.fromstring(content[: start.start()] + tail)), (data, raw)


def _checked(root: ElementTree.Element) -> ElementTree.Element:
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise InputError(f"it is a {root.tag} of {root.get('type')}, no VTKFile UnstructuredGrid")
    return root


def _piece(piece: ElementTree.Element, arrays: VtuArrays, ignored: dict[str, int]):
    """Points, tets, arrays on the points and arrays on the tets of a piece."""
    count, cells = int(piece.attrib["NumberOfPoints"]), int(piece.attrib["NumberOfCells"])
    (points,) = arrays.under(piece.find("Points"), count).values()
    found = arrays.under(piece.find("Cells"))
    corners, ends, kinds = (np.ravel(found[n]) for n in ("connectivity", "offsets", "types"))
    if not len(ends) == len(kinds) == cells:
        raise InputError(f"{cells} cells announced, {len(ends)} offsets and {len(kinds)} types")
    is_tet = kinds == _TET
    for kind, number in zip(*np.unique(kinds[~is_tet], return_counts=True), strict=True):
        name = _CELLS.get(int(kind), f"cells of type {kind}")
        ignored[name] = ignored.get(name, 0) + int(number)
    first = ends[is_tet].astype(np.int64) - 4
    if (np.diff(ends.astype(np.int64), prepend=0)[is_tet] != 4).any() or (first < 0).any():
        raise InputError("a tet has other than four corners")
    tets = corners[first[:, None] + np.arange(4)].astype(np.int64)
    if tets.size and not 0 <= tets.min() <= tets.max() < count:
        raise InputError(f"tets name points {tets.min()}..{tets.max()} of {count}")
    on_points = arrays.under(piece.find("PointData"), count)
    on_cells = arrays.under(piece.find("CellData"), cells)
    return points, tets, on_points, {name: values[is_tet] for name, values in on_cells.items()}


def _joined(pieces: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Arrays that every piece has, one piece after the other."""
    shared = [name for name in pieces[0] if all(name in piece for piece in pieces)]
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in shared}
