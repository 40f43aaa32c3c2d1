"""Niantic's .spz splats, versions 1 to 4: compressed planes of fixed-point values.

The file's axes are kept: the format's own are right-up-back, but not every writer turns to them.
"""

from __future__ import annotations

import os
import struct
import zlib

import numpy as np

from ....fem.errors import InputError
from ...files import reading
from ...registry import Format, Keeps
from ..table import PointTable
from .gaussians import standard_columns

WANTED = "an .spz splat file of version 1 to 4"
_MAGIC, _HEADER = b"NGSP", 16
_COEFFICIENTS = (0, 3, 8, 15, 24)
_COLOUR = 0.15  # the format's own range of the constant harmonic, wider than SH_C0
_MAX_BYTES = 1 << 32  # unpacked; about 66 million splats


def read_spz(path: str | os.PathLike) -> PointTable:
    """Read .spz as the columns of the common PLY, in the file's own axes."""
    with reading(path, WANTED) as source:
        content = _plain(source.read_bytes())
        if len(content) < _HEADER or content[:4] != _MAGIC:
            raise InputError(f"{path} holds no NGSP header; wanted {WANTED}")
        version, n, degree, bits = struct.unpack_from("<IIBB", content, 4)
        if version not in (1, 2, 3, 4) or degree >= len(_COEFFICIENTS):
            raise InputError(f"{path} is version {version}, degree {degree}; wanted {WANTED}")
        k = _COEFFICIENTS[degree]
        widths = [6 if version == 1 else 9, 1, 3, 3, 4 if version > 2 else 3, 3 * k]
        streams = _compressed if version == 4 else _plain_planes
        planes = [
            np.frombuffer(raw, np.uint8).reshape(n, width)
            for raw, width in zip(streams(content, n, widths), widths, strict=False)
        ]
        position, alpha, colour, scale, rotation = planes[:5]
        return PointTable(
            standard_columns(
                _positions(position, version, bits),
                scale / 16.0 - 10,
                _rotations(rotation),
                alpha[:, 0] / 255.0,
                (colour / 255.0 - 0.5) / _COLOUR,
                (planes[5].reshape(n, k, 3).transpose(0, 2, 1) - 128.0) / 128 if k else None,
            )
        )


SPZ = Format("Niantic splats", (".spz",), read_spz, keeps=frozenset({Keeps.HARMONICS}))


def _plain_planes(content: bytes, n: int, widths: list[int]) -> list[bytes]:
    """Planes one after the other behind the header (versions 1 to 3)."""
    ends = _HEADER + n * np.cumsum(widths)
    if len(content) < ends[-1]:
        raise InputError(
            f"{n} splats of {sum(widths)} bytes announced, {len(content) - _HEADER} there"
        )
    starts = [_HEADER, *ends[:-1]]
    return [content[start:end] for start, end in zip(starts, ends, strict=True)]


def _compressed(content: bytes, n: int, widths: list[int]) -> list[bytes]:
    """Planes as Zstandard streams, listed with both sizes in a table of contents (version 4)."""
    try:
        import zstandard
    except ImportError as error:
        raise InputError(".spz 4 needs zstandard: pip install 'autophyx-tet[splats]'") from error
    count, (toc,) = content[15], struct.unpack_from("<I", content, 16)
    if count != sum(width > 0 for width in widths):
        raise InputError(f"{count} streams announced, {sum(w > 0 for w in widths)} wanted")
    sizes = [struct.unpack_from("<QQ", content, toc + 16 * i) for i in range(count)]
    planes, at = [], toc + 16 * count
    for (packed, size), width in zip(sizes, widths, strict=False):
        if size != n * width or at + packed > len(content):
            raise InputError(f"a stream of {size} bytes announced, {n * width} wanted")
        raw = content[at : at + packed]
        planes.append(zstandard.ZstdDecompressor().decompress(raw, max_output_size=size))
        at += packed
    return planes


def _plain(content: bytes) -> bytes:
    """Undo gzip, within bounds."""
    if content[:2] != b"\x1f\x8b":
        return content
    stream = zlib.decompressobj(16 + zlib.MAX_WBITS)
    plain = stream.decompress(content, _MAX_BYTES)
    if not stream.eof:
        raise InputError(f"the gzip stream is cut short or unpacks to more than {_MAX_BYTES} bytes")
    return plain


def _positions(raw: np.ndarray, version: int, bits: int) -> np.ndarray:
    """Positions (n, 3) from half floats (version 1) or 24-bit fixed point."""
    if version == 1:
        return raw.copy().view("<f2").astype(np.float64)
    low, middle, high = (raw.reshape(len(raw), 3, 3)[:, :, i].astype(np.int64) for i in range(3))
    value = low | middle << 8 | high << 16
    return np.where(value >= 1 << 23, value - (1 << 24), value) / 2.0**bits


def _rotations(raw: np.ndarray) -> np.ndarray:
    """Quaternions wxyz from the first three components, or from all but the largest."""
    if raw.shape[1] == 3:
        xyz = raw / 127.5 - 1
        w = np.sqrt(np.maximum(0, 1 - (xyz**2).sum(axis=1)))
        return np.column_stack([w, xyz])
    packed = raw.copy().view("<u4")[:, 0]
    largest = (packed >> 30).astype(np.int64)
    others = np.array([[j for j in range(4) if j != i] for i in range(4)])[largest]
    fields = np.stack([packed >> shift & 1023 for shift in (20, 10, 0)], axis=1).astype(np.int64)
    three = np.where(fields & 512, -1, 1) * (fields & 511) / 511 * 0.5**0.5
    xyzw = np.empty((len(raw), 4))
    np.put_along_axis(xyzw, others, three, axis=1)
    rest = np.sqrt(np.maximum(0, 1 - (three**2).sum(axis=1)))
    np.put_along_axis(xyzw, largest[:, None], rest[:, None], axis=1)
    return xyzw[:, [3, 0, 1, 2]]
