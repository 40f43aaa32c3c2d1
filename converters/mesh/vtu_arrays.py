"""The data arrays of .vtu files: text, base64 or raw bytes, plain or packed in blocks."""

from __future__ import annotations

import base64
import lzma
import re
import zlib
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from ...fem.errors import InputError

_KINDS = {"Float": "f", "Int": "i", "UInt": "u"}


class VtuArrays:
    """Reads the data arrays of a file, and adds up what its compressed ones unpack to."""

    def __init__(self, root: ElementTree.Element, appended: tuple[bytes, bool], allowed: int):
        self._order: Literal["<", ">"] = ">" if root.get("byte_order") == "BigEndian" else "<"
        self._allowed = self._left = allowed
        self._header = _dtype(root.get("header_type", "UInt32")).newbyteorder(self._order)
        self._compressor = root.get("compressor")
        self._appended, self._raw = memoryview(appended[0]), appended[1]

    def under(self, parent: ElementTree.Element | None, rows: int | None = None):
        """Arrays by name of a parent element, each of ``rows`` rows where that is known."""
        found = {}
        for element in () if parent is None else parent.findall("DataArray"):
            name, width = element.get("Name", ""), int(element.get("NumberOfComponents") or 1)
            values = self._read(element)
            found[name] = values.reshape(-1, width) if width > 1 else values
            if rows is not None and len(found[name]) != rows:
                raise InputError(f"array {name!r} has {len(found[name])} rows, wanted {rows}")
        return found

    def _read(self, element: ElementTree.Element) -> np.ndarray:
        dtype, text = _dtype(element.attrib["type"]), (element.text or "")
        form = element.get("format", "ascii")
        if form == "ascii":
            return np.array(text.split(), dtype=dtype)
        if form == "appended":
            source: _Raw | _Base64 = (_Raw if self._raw else _Base64)(
                self._appended[int(element.attrib["offset"]) :]
            )
        elif form == "binary":
            source = _Base64("".join(text.split()).encode())
        else:
            raise InputError(f"arrays in the format {form!r} are not known")
        data = self._plain(source) if self._compressor is None else self._unpacked(source)
        return np.frombuffer(data, dtype.newbyteorder(self._order)).astype(dtype, copy=False)

    def _plain(self, source: _Raw | _Base64) -> bytes:
        width = self._header.itemsize
        (size,) = np.frombuffer(source.head(width), self._header)
        data = source.after(width, int(size))
        if len(data) != size:
            raise InputError(f"an array announces {size} bytes and holds {len(data)}")
        return data

    def _unpacked(self, source: _Raw | _Base64) -> bytearray:
        """Blocks behind a header of their count, their size, the last one's, and packed sizes."""
        count = int(np.frombuffer(source.head(self._header.itemsize), self._header)[0])
        length = (3 + count) * self._header.itemsize
        sizes = np.frombuffer(source.head(length), self._header)[3:].astype(np.int64)
        ends = np.cumsum(sizes)
        packed = source.after(length, int(ends[-1])) if count else b""
        if len(sizes) != count or (count and ends[-1] > len(packed)):
            raise InputError(f"a compressed array announces {count} blocks and holds fewer")
        data = bytearray()
        for end, size in zip(ends, sizes, strict=True):
            data += self._block(packed[end - size : end])
        return data

    def _block(self, packed: bytes) -> bytes:
        """The bytes of a block, at most those that are left of all that are allowed."""
        if self._compressor not in ("vtkZLibDataCompressor", "vtkLZMADataCompressor"):
            raise InputError(f"arrays packed by {self._compressor} are not read; zlib and LZMA are")
        lzma_packed = self._compressor == "vtkLZMADataCompressor"
        tool = lzma.LZMADecompressor() if lzma_packed else zlib.decompressobj()
        data = tool.decompress(packed, self._left + 1)
        if len(data) > self._left:
            raise InputError(
                f"its compressed arrays unpack to more than {self._allowed:,} bytes; "
                "write the mesh uncompressed if it is that large"
            )
        if not tool.eof:
            raise InputError("a compressed block is cut short")
        self._left -= len(data)
        return data


class _Raw:
    """Bytes of an array that stand as they are."""

    def __init__(self, data: memoryview) -> None:
        self._data = data

    def head(self, count: int) -> bytes:
        """The first ``count`` bytes."""
        return bytes(self._data[:count])

    def after(self, head: int, count: int) -> bytes:
        """``count`` bytes behind a header of ``head``."""
        return bytes(self._data[head : head + count])


class _Base64:
    """Bytes of an array as base64, the header encoded with the rest or before it."""

    def __init__(self, text: bytes | memoryview) -> None:
        self._text = text

    def head(self, count: int) -> bytes:
        """The first ``count`` bytes."""
        return base64.b64decode(self._text[: _characters(count)])[:count]

    def after(self, head: int, count: int) -> bytes:
        """``count`` bytes behind a header of ``head``."""
        at = _characters(head)
        if head % 3 and self._text[at - 1 : at] != b"=":
            return base64.b64decode(self._text[: _characters(head + count)])[head : head + count]
        return base64.b64decode(self._text[at : at + _characters(count)])[:count]


def _characters(count: int) -> int:
    """Length of the base64 text of ``count`` bytes."""
    return -(-count // 3) * 4


def _dtype(name: str) -> np.dtype:
    """Type of an array: Float64, Int32, UInt8 ..."""
    found = re.fullmatch(r"(Float|Int|UInt)(8|16|32|64)", name)
    if found is None:
        raise InputError(f"arrays of type {name!r} are not known")
    return np.dtype(f"{_KINDS[found[1]]}{int(found[2]) // 8}")
