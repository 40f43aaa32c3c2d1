"""VTK: .vtu and legacy .vtk, with the names of the regions kept in the file."""

from __future__ import annotations

import base64
import lzma
import os
import re
import zlib
from collections.abc import Container, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Literal, NamedTuple
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ..files import reading, writing, writing_folder
from ..registry import Format
from .meshdata import WHOLE, Arrays, MeshData, assemble, cell_arrays, checked, escape

WANTED = Note("vtk.vtk_unstructured")
# Region names travel as field data: UTF-8 bytes, one name a line, a type that every reader takes.
_NAMES = "region_names"


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
        raise InputError("vtk.vtk_array", blank=blank)
    grid = meshio.Mesh(mesh.points, [("tetra", mesh.tets)])
    grid.point_data.update(points)
    grid.cell_data.update({name: [values] for name, values in cells.items()})
    with writing(path) as target:
        if suffix == ".vtu":
            meshio.vtu.write(str(target), grid, compression="zlib")
        else:
            meshio.vtk.write(str(target), grid, fmt_version="4.2", binary=True)
        # Put the region names where VTK keeps field data: before the points
        raw = "".join(f"{escape(name)}\n" for name in mesh.region_names).encode("utf-8")
        content = target.read_bytes()
        if target.suffix == ".vtu":
            anchor = b"<UnstructuredGrid>"
            codes = " ".join(map(str, raw))
            block = (
                f'<FieldData><DataArray type="UInt8" Name="{_NAMES}" NumberOfTuples="{len(raw)}" '
                f'format="ascii">{codes}</DataArray></FieldData>'
            ).encode()
        else:
            anchor = b"DATASET UNSTRUCTURED_GRID\n"
            block = (
                f"FIELD FieldData 1\n{_NAMES} 1 {len(raw)} unsigned_char\n".encode() + raw + b"\n"
            )
        head, _, tail = content.partition(anchor)
        with target.open("wb") as out:
            out.writelines((head, anchor, block, tail))


def read_vtk(path: str | os.PathLike) -> MeshData:
    """Read tets, regions and all arrays of a .vtu or legacy .vtk file."""
    with reading(path, WANTED) as source:
        is_xml = source.suffix.lower() == ".vtu"
        grid = load_vtu(source) if is_xml else load_legacy(source.read_bytes())
        raw = grid.field_data.get(_NAMES)
        return assemble(
            grid.points,
            grid.tets,
            point_data=grid.point_data,
            cell_data=grid.cell_data,
            names=_names(None if raw is None else bytes(raw.astype(np.uint8)), grid.cell_data),
            ignored=grid.ignored,
        )


VTU = Format("VTK XML", (".vtu",), read_vtk, write_vtk, keeps=WHOLE)
VTK = Format("legacy VTK", (".vtk",), read_vtk, write_vtk, keeps=WHOLE)


def _names(listed: bytes | None, cell_data: Container[str]) -> dict[int, str]:
    """Names of the regions by tag, of a list of a line each."""
    lines = [] if listed is None else listed.decode("utf-8").split("\n")[:-1]
    if lines and "region" not in cell_data:
        raise InputError("vtk.names_regions", count=len(lines))
    return {tag: unquote(line) for tag, line in enumerate(lines)}


# A reader of .vtu files of our own: inline, appended or raw arrays, their unpacking bounded.
#
# meshio's reader unpacks whatever a compressed block holds (1 kB of zeros packed twice is a
# gigabyte), loses all cells but the last piece's, and its parts have no public name to build on.

MAX_UNPACKED = 4 << 30  # bytes in all arrays: a sixth of the memory of a 24 GiB machine
_TETS = (10, 24, 71)  # linear, quadratic, of any order: their corners come first
_CELLS = {
    1: "vertex", 3: "line", 5: "triangle", 7: "polygon", 9: "quad", 12: "hexahedron", 13: "wedge",
    14: "pyramid", 22: "triangle6", 25: "hexahedron20", 42: "polyhedron",
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
    content, appended, raw = path.read_bytes(), b"", False
    if (start := _APPENDED.search(content)) is not None:
        stop = content.rfind(b"</AppendedData>")
        raw = re.search(rb"encoding\s*=\s*[\"']raw", start[1]) is not None
        appended = content[start.end() : stop].partition(b"_")[2]
        content = content[: start.start()] + content[stop + len(b"</AppendedData>") :]
    root = ElementTree.fromstring(content)
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise InputError("vtk.vtkfile_unstructuredgrid", tag=root.tag, get=root.get("type"))
    arrays = VtuArrays(root, appended, max_bytes, raw=raw)
    grid = root.find("UnstructuredGrid")
    pieces = [] if grid is None else grid.findall("Piece")
    if grid is None or not pieces:
        raise InputError("vtk.piece_unstructured")
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


def _piece(piece: ElementTree.Element, arrays: VtuArrays, ignored: dict[str, int]):
    """Points, tets, arrays on the points and arrays on the tets of a piece."""
    count, cells = int(piece.attrib["NumberOfPoints"]), int(piece.attrib["NumberOfCells"])
    (points,) = arrays.under(piece.find("Points"), count).values()
    found = arrays.under(piece.find("Cells"))
    corners, ends, kinds = (np.ravel(found[n]) for n in ("connectivity", "offsets", "types"))
    if not len(ends) == len(kinds) == cells:
        raise InputError("vtk.cells_announced", cells=cells, count=len(ends), count_2=len(kinds))
    tets, is_tet = _tets(corners, ends, kinds, count, ignored)
    on_points = arrays.under(piece.find("PointData"), count)
    on_cells = arrays.under(piece.find("CellData"), cells)
    return points, tets, on_points, {name: values[is_tet] for name, values in on_cells.items()}


def _tets(
    corners: np.ndarray, ends: np.ndarray, kinds: np.ndarray, count: int, ignored: dict[str, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the tets over ``count`` points, and which cells they are; others are counted."""
    is_tet = np.isin(kinds, _TETS)
    for kind, number in zip(*np.unique(kinds[~is_tet], return_counts=True), strict=True):
        name = _CELLS.get(int(kind), Note("vtk.cells_type", kind=kind))
        ignored[name] = ignored.get(name, 0) + int(number)
    width = np.diff(ends.astype(np.int64), prepend=0)[is_tet]
    first = ends[is_tet].astype(np.int64) - width
    if (width < 4).any() or (width[kinds[is_tet] == _TETS[0]] != 4).any() or (first < 0).any():
        raise InputError("vtk.tet_other")
    tets = corners[first[:, None] + np.arange(4)].astype(np.int64)
    if tets.size and not 0 <= tets.min() <= tets.max() < count:
        raise InputError("vtk.tets_name", min=tets.min(), max=tets.max(), count=count)
    return tets, is_tet


def _joined(pieces: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Arrays that every piece has, one piece after the other."""
    shared = [name for name in pieces[0] if all(name in piece for piece in pieces)]
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in shared}


# The data arrays of .vtu files: text, base64 or raw bytes, plain or packed in blocks.

_KINDS = {"Float": "f", "Int": "i", "UInt": "u"}


class VtuArrays:
    """Reads the data arrays of a file, and adds up what its compressed ones unpack to."""

    def __init__(self, root: ElementTree.Element, appended: bytes, allowed: int, *, raw: bool):
        self._order: Literal["<", ">"] = ">" if root.get("byte_order") == "BigEndian" else "<"
        self._allowed = self._left = allowed
        self._header = _dtype(root.get("header_type", "UInt32")).newbyteorder(self._order)
        self._compressor = root.get("compressor")
        self._appended, self._raw = memoryview(appended), raw

    def under(self, parent: ElementTree.Element | None, rows: int | None = None):
        """Arrays by name of a parent element, each of ``rows`` rows where that is known."""
        found = {}
        for element in () if parent is None else parent.findall("DataArray"):
            name, width = element.get("Name", ""), int(element.get("NumberOfComponents") or 1)
            values = self._read(element)
            found[name] = values.reshape(-1, width) if width > 1 else values
            if rows is not None and len(found[name]) != rows:
                raise InputError("vtk.array_rows", name=name, count=len(found[name]), rows=rows)
        return found

    def _read(self, element: ElementTree.Element) -> np.ndarray:
        dtype, text = _dtype(element.attrib["type"]), (element.text or "")
        form = element.get("format", "ascii")
        if form == "ascii":
            return np.array(text.split(), dtype=dtype)
        if form == "appended":
            source = _Bytes(self._appended[int(element.attrib["offset"]) :], self._raw)
        elif form == "binary":
            source = _Bytes(memoryview("".join(text.split()).encode()), raw=False)
        else:
            raise InputError("vtk.arrays_format", form=form)
        if self._compressor is None:
            width = self._header.itemsize
            (size,) = np.frombuffer(source.head(width), self._header)
            data = source.after(width, int(size))
            if len(data) != size:
                raise InputError("vtk.array_announces", size=size, count=len(data))
        else:
            data = self._unpacked(source)
        return np.frombuffer(data, dtype.newbyteorder(self._order)).astype(dtype, copy=False)

    def _unpacked(self, source: _Bytes) -> bytearray:
        """Blocks behind a header of their count, their size, the last one's, and packed sizes."""
        count = int(np.frombuffer(source.head(self._header.itemsize), self._header)[0])
        length = (3 + count) * self._header.itemsize
        sizes = np.frombuffer(source.head(length), self._header)[3:].astype(np.int64)
        ends = np.cumsum(sizes)
        packed = source.after(length, int(ends[-1])) if count else b""
        if len(sizes) != count or (count and ends[-1] > len(packed)):
            raise InputError("vtk.compressed_array", count=count)
        if self._compressor not in ("vtkZLibDataCompressor", "vtkLZMADataCompressor"):
            raise InputError("vtk.arrays_packed", compressor=self._compressor)
        data = bytearray()
        for end, size in zip(ends, sizes, strict=True):
            is_lzma = self._compressor == "vtkLZMADataCompressor"
            tool = lzma.LZMADecompressor() if is_lzma else zlib.decompressobj()
            block = tool.decompress(packed[end - size : end], self._left + 1)
            if len(block) > self._left:
                raise InputError("vtk.compressed_arrays", allowed=self._allowed)
            if not tool.eof:
                raise InputError("vtk.compressed_block")
            self._left -= len(block)
            data += block
        return data


class _Bytes:
    """Bytes of an array: ``raw``, or as base64, the header encoded with the rest or before it."""

    def __init__(self, data: memoryview, raw: bool) -> None:
        self._data, self._raw = data, raw

    def head(self, count: int) -> bytes:
        """The first ``count`` bytes."""
        if self._raw:
            return bytes(self._data[:count])
        return base64.b64decode(self._data[: _characters(count)])[:count]

    def after(self, head: int, count: int) -> bytes:
        """``count`` bytes behind a header of ``head``."""
        if self._raw:
            return bytes(self._data[head : head + count])
        at = _characters(head)
        if head % 3 and self._data[at - 1 : at] != b"=":
            return base64.b64decode(self._data[: _characters(head + count)])[head : head + count]
        return base64.b64decode(self._data[at : at + _characters(count)])[:count]


def _characters(count: int) -> int:
    """Length of the base64 text of ``count`` bytes."""
    return -(-count // 3) * 4


def _dtype(name: str) -> np.dtype:
    """Type of an array: Float64, Int32, UInt8 ..."""
    found = re.fullmatch(r"(Float|Int|UInt)(8|16|32|64)", name)
    if found is None:
        raise InputError("vtk.arrays_type", name=name)
    return np.dtype(f"{_KINDS[found[1]]}{int(found[2]) // 8}")


# Legacy .vtk files, text or big-endian bytes, up to version 5.1.

_TYPES = {
    "unsigned_char": "u1", "char": "i1", "unsigned_short": "u2", "short": "i2",
    "unsigned_int": "u4", "int": "i4", "unsigned_long": "u8", "long": "i8", "float": "f4",
    "double": "f8", "vtkidtype": "i4", "vtktypeint64": "i8", "vtktypeuint64": "u8",
}  # fmt: skip
# Values a row of the arrays that have a fixed number of them.
_WIDTHS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1,
           "PEDIGREE_IDS": 1}  # fmt: skip
_LEGACY = re.compile(rb"# vtk DataFile Version (\d)[^\n]*\n[^\n]*\n[ \t]*(ASCII|BINARY)\s")


class _Words:
    """Words and numbers of a file one after the other."""

    def __init__(self, content: bytes, at: int, text: bool) -> None:
        self._content, self._at = content, at
        self._words = content[at:].split() if text else None
        self._next = 0

    def word(self) -> str:
        """The next word; none at the end."""
        if self._words is not None:
            found = self._words[self._next : self._next + 1]
            self._next += 1
            return found[0].decode("utf-8", "replace") if found else ""
        found = re.compile(rb"\s*(\S*)").match(self._content, self._at)
        assert found is not None
        self._at = found.end()
        return found[1].decode("utf-8", "replace")

    def count(self) -> int:
        """The next word as a number of things, which take a byte each at least."""
        count = int(self.word())
        if not 0 <= count <= len(self._content):
            raise InputError("vtk.counts", count=count)
        return count

    def numbers(self, kind: str, count: int) -> np.ndarray:
        """``count`` numbers of a type, which begin on the next line."""
        if kind.lower() not in _TYPES:
            raise InputError("vtk.arrays_type", name=kind)
        dtype = np.dtype(_TYPES[kind.lower()])
        if self._words is not None:
            found = self._words[self._next : self._next + count]
            self._next += count
            if len(found) != count:
                raise InputError("vtk.counts", count=count)
            return np.array(found, dtype="S").astype(np.float64 if dtype.kind == "f" else dtype)
        start = self._content.index(b"\n", self._at) + 1
        self._at = start + count * dtype.itemsize
        if self._at > len(self._content):
            raise InputError("vtk.counts", count=count)
        return np.frombuffer(self._content, dtype.newbyteorder(">"), count, start).astype(dtype)

    def skip(self) -> None:
        """Go over the block of an array's own remarks, which an empty line ends."""
        if self._words is None:
            end = re.compile(rb"\n[ \t\r]*\n|$").search(self._content, self._at)
            self._at = len(self._content) if end is None else end.end()
            return
        known = {*_WIDTHS, *"CELLS CELL_TYPES POINT_DATA CELL_DATA FIELD SCALARS METADATA".split()}
        while self._next < len(self._words) and self._words[self._next].decode("latin-1") not in (
            *known, "COLOR_SCALARS", "LOOKUP_TABLE", "TEXTURE_COORDINATES", "POINTS",
        ):  # fmt: skip
            # Arrays of a field follow its remarks without a word of their own
            self._next += 1


def load_legacy(content: bytes) -> VtuGrid:
    """Take the bytes of a legacy file apart."""
    head = _LEGACY.match(content)
    if head is None:
        raise InputError("vtk.legacy")
    words = _Words(content, head.end(), head[2] == b"ASCII")
    points, corners, ends, kinds = np.zeros((0, 3)), *np.zeros((3, 0), np.int64)
    field: dict[str, np.ndarray] = {}
    on_points: dict[str, np.ndarray] = {}
    on_cells: dict[str, np.ndarray] = {}
    target, rows = field, 0
    if (words.word(), words.word().upper()) != ("DATASET", "UNSTRUCTURED_GRID"):
        raise InputError("vtk.legacy")
    while key := words.word().upper():
        if key == "POINTS":
            count = words.count()
            points = words.numbers(words.word(), 3 * count).reshape(-1, 3)
        elif key == "CELLS" and int(head[1]) >= 5:
            count, size = words.count(), words.count()
            words.word()
            ends = words.numbers(words.word(), count)[1:]
            words.word()
            corners = words.numbers(words.word(), size)
        elif key == "CELLS":  # each with the number of its corners before them
            count, size = words.count(), words.count()
            flat, starts, at = words.numbers("int", size), [], 0
            for _ in range(count):
                starts.append(at)
                at += 1 + max(int(flat[at]), 0)
            corners = np.delete(flat, starts)
            ends = np.cumsum(flat[starts]) if starts else ends
        elif key == "CELL_TYPES":
            kinds = words.numbers("int", words.count())
        elif key in ("POINT_DATA", "CELL_DATA"):
            target, rows = (on_points if key == "POINT_DATA" else on_cells), words.count()
        elif key == "FIELD":
            words.word()
            for _ in range(words.count()):
                name = words.word()
                if name == "METADATA":
                    words.skip()
                    name = words.word()
                width, length = words.count(), words.count()
                values = words.numbers(words.word(), width * length)
                target[unquote(name)] = values.reshape(-1, width) if width > 1 else values
        elif key == "SCALARS":
            name, kind, width, following = words.word(), words.word(), 1, words.word()
            if following.isdigit():
                width, following = int(following), words.word()
            if following.upper() != "LOOKUP_TABLE":
                raise InputError("vtk.keyword", key=following[:20])
            words.word()
            values = words.numbers(kind, width * rows)
            target[unquote(name)] = values.reshape(-1, width) if width > 1 else values
        elif key in _WIDTHS:
            name, kind = words.word(), words.word()
            values = words.numbers(kind, _WIDTHS[key] * rows)
            target[unquote(name)] = values.reshape(rows, -1) if _WIDTHS[key] > 1 else values
        elif key == "TEXTURE_COORDINATES":
            name, width = words.word(), words.count()
            target[unquote(name)] = words.numbers(words.word(), width * rows).reshape(rows, -1)
        elif key in ("COLOR_SCALARS", "LOOKUP_TABLE"):
            words.word()
            count = words.count() * (rows if key == "COLOR_SCALARS" else 4)
            words.numbers("unsigned_char" if head[2] == b"BINARY" else "float", count)
        elif key == "METADATA":
            words.skip()
        else:
            raise InputError("vtk.keyword", key=key[:20])
    if not len(ends) == len(kinds):
        raise InputError(
            "vtk.cells_announced", cells=len(kinds), count=len(ends), count_2=len(kinds)
        )
    ignored: dict[str, int] = {}
    tets, is_tet = _tets(corners, ends, kinds, len(points), ignored)
    for values in (*on_points.values(), *on_cells.values()):
        if len(values) not in (len(points), len(kinds)):
            raise InputError("vtk.array_rows", name="", count=len(values), rows=len(kinds))
    tet_data = {name: values[is_tet] for name, values in on_cells.items()}
    return VtuGrid(points, tets, on_points, tet_data, field, ignored)


# ParaView time series: a .pvd index beside one .vtu a frame.

PVD_WANTED = Note("vtk.paraview_pvd")
TimedFields = tuple[float, Mapping[str, np.ndarray]]


def write_pvd(path: str | os.PathLike, mesh: TetMesh, frames: Iterable[TimedFields]) -> list[Path]:
    """Write frames (time [s], point arrays such as ``displacement``) of one mesh as they come.

    Frame i goes to ``STEM_0000i.vtu`` beside the index; all appear when all are written. Returns
    every file, the index first.
    """
    path = Path(path)
    with writing_folder(path.parent) as folder:
        entries, names = [], [path.name]
        for i, (time, point_data) in enumerate(frames):
            names.append(f"{path.stem}_{i:05d}.vtu")
            write_vtk(folder / names[-1], mesh, point_data=point_data)
            entries.append(f'<DataSet timestep="{float(time)!r}" file={quoteattr(names[-1])}/>')
        if not entries:
            raise InputError("vtk.series_needs", name=path.name)
        lines = [
            '<?xml version="1.0" encoding="utf-8"?>',
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian"><Collection>',
            *entries,
            "</Collection></VTKFile>\n",
        ]
        with writing(folder / path.name) as target:
            target.write_text("\n".join(lines), encoding="utf-8")
    return [path.with_name(name) for name in names]


def read_pvd(path: str | os.PathLike) -> Iterator[tuple[float, MeshData]]:
    """Read a series frame by frame: (time [s], mesh and arrays)."""
    with reading(path, PVD_WANTED) as source:
        folder = source.parent.resolve()
        frames = []
        for entry in ElementTree.parse(source).iter("DataSet"):
            file = (folder / entry.attrib["file"]).resolve()
            if not file.is_relative_to(folder):
                raise InputError("vtk.refers_outside", path=path, file=file)
            frames.append((float(entry.attrib["timestep"]), file))
    return ((time, read_vtk(file)) for time, file in frames)
