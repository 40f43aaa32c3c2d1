"""Reading .vtu through meshio, with a bound on what its compressed arrays unpack to."""

from __future__ import annotations

import base64
import lzma
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...fem.errors import InputError

if TYPE_CHECKING:
    import meshio

MAX_UNPACKED = 4 << 30  # bytes in all arrays: a sixth of the memory of a 24 GiB machine


def load_vtu(path: Path, *, max_bytes: int = MAX_UNPACKED) -> meshio.Mesh:
    """Read a .vtu file whose compressed arrays hold at most ``max_bytes`` in all.

    meshio alone unpacks whatever a block holds: 1 kB of zeros packed twice is a gigabyte.
    """
    import meshio
    from meshio.vtu._vtu import VtuReader, vtu_to_numpy_type

    class BoundedReader(VtuReader):
        left = max_bytes

        def read_compressed_binary(self, data: str, dtype: np.dtype) -> np.ndarray:
            header = np.dtype(vtu_to_numpy_type[self.header_type])
            order = "<" if self.byte_order == "LittleEndian" else ">"
            packed = _blocks(data, header.newbyteorder(order))
            unpacked = bytearray()
            for block in packed:
                left = self.left - len(unpacked)
                unpacked += _unpack(block, str(self.compression), left, max_bytes)
            self.left -= len(unpacked)
            return np.frombuffer(unpacked, dtype=np.dtype(dtype).newbyteorder(order))

    reader: Any = BoundedReader(str(path))
    return meshio.Mesh(
        reader.points,
        reader.cells,
        point_data=reader.point_data,
        cell_data=reader.cell_data,
        field_data=reader.field_data,
    )


def _blocks(data: str, header: np.dtype) -> list[bytes]:
    """Packed blocks of an array: base64 of (count, size, last size, packed sizes), then of them."""
    count = int(np.frombuffer(_decode(data, header.itemsize), header)[0])
    length = (3 + count) * header.itemsize
    sizes = np.frombuffer(_decode(data, length), header)[3:].astype(np.int64)
    packed = base64.b64decode(data[_characters(length) :])
    ends = np.cumsum(sizes)
    if len(sizes) != count or (count and ends[-1] > len(packed)):
        raise InputError(f"a compressed array announces {count} blocks and holds fewer")
    return [packed[end - size : end] for size, end in zip(sizes, ends, strict=True)]


def _decode(data: str, count: int) -> bytes:
    """The first ``count`` bytes of a base64 text."""
    return base64.b64decode(data[: _characters(count)])[:count]


def _characters(count: int) -> int:
    """Length of the base64 text of ``count`` bytes."""
    return -(-count // 3) * 4


def _unpack(block: bytes, compressor: str, left: int, allowed: int) -> bytes:
    """The bytes of a block, at most the ``left`` ones of all that are ``allowed``."""
    tool = lzma.LZMADecompressor() if "LZMA" in compressor else zlib.decompressobj()
    result = tool.decompress(block, left + 1)
    if len(result) > left:
        raise InputError(
            f"its compressed arrays unpack to more than {allowed:,} bytes; "
            "write the mesh uncompressed if it is that large"
        )
    if not tool.eof:
        raise InputError("a compressed block is cut short")
    return result
