""".ksplat splats (version 0.1): sections of rows, positions counted from bucket centres."""

from __future__ import annotations

import os
import struct
import zlib
from typing import NamedTuple

import numpy as np

from ...fem.errors import InputError
from ...fem.note import Note
from ..files import reading
from ..registry import Format, Keeps
from .gaussians import BANDS, SH_C0, standard_columns
from .table import PointTable

WANTED = Note("splat_files.ksplat_file")
_FILE_HEADER, _SECTION_HEADER = 4096, 1024
_HARMONICS = (0, 9, 24, 45)
_SH_RANGE = 1.5  # of 8-bit harmonics where the header says nothing
_QUANTA = (1, 32767, 32767)  # of a bucket's half size, by level, where the section says nothing
_LEVELS = (("<f4", "<f4", "<f4"), ("<u2", "<f2", "<f2"), ("<u2", "<f2", "u1"))


class _Section(NamedTuple):
    """Layout of a section: splats, rows of space, buckets, and the ``dtype`` of a row.

    From ``start`` on are the bucket sizes and centres, from ``rows_at`` on the rows.
    """

    splats: int
    rows: int
    capacity: int
    buckets: int
    size: float
    quanta: int
    full: int
    partial: int
    degree: int
    dtype: np.dtype
    start: int
    rows_at: int

    @classmethod
    def read(cls, content: bytes, at: int, start: int, level: int) -> _Section:
        """Read the header at ``at`` of a section that starts at ``start``."""
        splats, rows, capacity, buckets = struct.unpack_from("<IIII", content, at)
        (size,) = struct.unpack_from("<f", content, at + 16)
        (bucket_bytes,) = struct.unpack_from("<H", content, at + 20)
        (quanta,) = struct.unpack_from("<I", content, at + 24)
        full, partial = struct.unpack_from("<II", content, at + 32)
        (degree,) = struct.unpack_from("<H", content, at + 40)
        if degree >= len(_HARMONICS):
            raise InputError("splat_files.section_harmonic", degree=degree)
        position, other, harmonic = _LEVELS[level]
        dtype = np.dtype(
            [("p", position, 3), ("s", other, 3), ("q", other, 4), ("rgba", "u1", 4),
             ("sh", harmonic, _HARMONICS[degree])]
        )  # fmt: skip
        return cls(
            splats, rows, capacity, buckets, size, quanta or _QUANTA[level], full, partial, degree,
            dtype, start, start + 4 * partial + bucket_bytes * buckets,
        )  # fmt: skip


def read_ksplat(path: str | os.PathLike) -> PointTable:
    """Read .ksplat at any of its three levels as the columns of the common PLY."""
    with reading(path, WANTED) as source:
        content = source.read_bytes()
        if len(content) < _FILE_HEADER or content[0] != 0 or content[1] < 1:
            raise InputError("splat_files.ksplat_version", path=path, wanted=WANTED)
        (sections,) = struct.unpack_from("<I", content, 4)
        (level,) = struct.unpack_from("<H", content, 20)
        low, high = struct.unpack_from("<ff", content, 36)
        span = (low or -_SH_RANGE, high or _SH_RANGE)
        if level >= len(_LEVELS) or sections > len(content) // _SECTION_HEADER:
            raise InputError(
                "splat_files.level_sections",
                path=path,
                level=level,
                sections=sections,
                wanted=WANTED,
            )
        parts, start = [], _FILE_HEADER + sections * _SECTION_HEADER
        for i in range(sections):
            section = _Section.read(content, _FILE_HEADER + i * _SECTION_HEADER, start, level)
            if section.splats:
                parts.append(_splats(content, section, level, span))
            start = section.rows_at + section.rows * section.dtype.itemsize
        if not parts:
            raise InputError("splat_files.holds_splats", path=path, wanted=WANTED)
        return PointTable(
            {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        )


KSPLAT = Format("bucketed splats", (".ksplat",), read_ksplat, keeps=frozenset({Keeps.HARMONICS}))


def _splats(content: bytes, section: _Section, level: int, span) -> dict[str, np.ndarray]:
    if section.rows_at + section.splats * section.dtype.itemsize > len(content):
        raise InputError("splat_files.section_splats", splats=section.splats)
    rows = np.frombuffer(content, section.dtype, section.splats, section.rows_at)
    means = rows["p"].astype(np.float64)
    if level:
        sizes = np.frombuffer(content, "<u4", section.partial, section.start)
        centres = np.frombuffer(
            content, "<f4", 3 * section.buckets, section.start + 4 * section.partial
        ).reshape(-1, 3)
        filled = np.concatenate([np.full(section.full, section.capacity), sizes])
        ends = np.cumsum(filled.astype(np.int64))
        bucket = np.searchsorted(ends, np.arange(section.splats), side="right")
        if bucket.max() >= len(centres):
            raise InputError(
                "splat_files.splats_fit", splats=section.splats, buckets=section.buckets
            )
        means = (means - section.quanta) * section.size / 2 / section.quanta + centres[bucket]
    with np.errstate(divide="ignore"):  # a flat splat has scale 0: its log is -inf
        log_scales = np.log(rows["s"].astype(np.float64))
    rest = rows["sh"].astype(np.float64)
    if level == 2:
        rest = span[0] + rest / 255 * (span[1] - span[0])
    # Harmonics are stored band by band, each (3, band)
    ends = np.cumsum([3 * width for width in BANDS[: section.degree]])
    bands = [band.reshape(len(rest), 3, -1) for band in np.split(rest, ends[:-1], axis=1)]
    colour = (rows["rgba"][:, :3] / 255 - 0.5) / SH_C0
    alpha = rows["rgba"][:, 3] / 255
    return standard_columns(
        means, log_scales, rows["q"].astype(np.float64), alpha, colour,
        np.concatenate(bands, axis=2) if section.degree else None,
    )  # fmt: skip


# Niantic's .spz splats, versions 1 to 4: compressed planes of fixed-point values.
#
# The file's axes are kept: the format's own are right-up-back, but not every writer turns to them.

SPZ_WANTED = Note("splat_files.spz_splat")
_MAGIC, _HEADER = b"NGSP", 16
_COEFFICIENTS = (0, 3, 8, 15, 24)
_COLOUR = 0.15  # the format's own range of the constant harmonic, wider than SH_C0
_MAX_BYTES = 1 << 32  # unpacked; about 66 million splats


def read_spz(path: str | os.PathLike) -> PointTable:
    """Read .spz as the columns of the common PLY, in the file's own axes."""
    with reading(path, SPZ_WANTED) as source:
        content = source.read_bytes()
        if content[:2] == b"\x1f\x8b":  # undo gzip, within bounds
            stream = zlib.decompressobj(16 + zlib.MAX_WBITS)
            content = stream.decompress(content, _MAX_BYTES)
            if not stream.eof:
                raise InputError("splat_files.gzip_stream", max_bytes=_MAX_BYTES)
        if len(content) < _HEADER or content[:4] != _MAGIC:
            raise InputError("splat_files.holds_ngsp", path=path, spz_wanted=SPZ_WANTED)
        version, n, degree, bits = struct.unpack_from("<IIBB", content, 4)
        if version not in (1, 2, 3, 4) or degree >= len(_COEFFICIENTS):
            raise InputError(
                "splat_files.version_degree",
                path=path,
                version=version,
                degree=degree,
                spz_wanted=SPZ_WANTED,
            )
        k = _COEFFICIENTS[degree]
        widths = [6 if version == 1 else 9, 1, 3, 3, 4 if version > 2 else 3, 3 * k]
        streams = _compressed if version == 4 else _uncompressed
        planes = [
            np.frombuffer(raw, np.uint8).reshape(n, width)
            for raw, width in zip(streams(content, n, widths), widths, strict=False)
        ]
        position, alpha, colour, scale, rotation = planes[:5]
        if version == 1:  # half floats, else 24-bit fixed point
            means = position.copy().view("<f2").astype(np.float64)
        else:
            low, middle, high = position.reshape(n, 3, 3).astype(np.int64).transpose(2, 0, 1)
            value = low | middle << 8 | high << 16
            means = np.where(value >= 1 << 23, value - (1 << 24), value) / 2.0**bits
        return PointTable(
            standard_columns(
                means,
                scale / 16.0 - 10,
                _rotations(rotation),
                alpha[:, 0] / 255.0,
                (colour / 255.0 - 0.5) / _COLOUR,
                (planes[5].reshape(n, k, 3).transpose(0, 2, 1) - 128.0) / 128 if k else None,
            )
        )


SPZ = Format("Niantic splats", (".spz",), read_spz, keeps=frozenset({Keeps.HARMONICS}))


def _uncompressed(content: bytes, n: int, widths: list[int]) -> list[bytes]:
    """Planes one after the other behind the header (versions 1 to 3)."""
    ends = _HEADER + n * np.cumsum(widths)
    if len(content) < ends[-1]:
        raise InputError(
            "splat_files.splats_bytes", n=n, count=sum(widths), count_2=len(content) - _HEADER
        )
    starts = [_HEADER, *ends[:-1]]
    return [content[start:end] for start, end in zip(starts, ends, strict=True)]


def _compressed(content: bytes, n: int, widths: list[int]) -> list[bytes]:
    """Planes as Zstandard streams, listed with both sizes in a table of contents (version 4)."""
    try:
        import zstandard
    except ImportError as error:
        raise InputError("splat_files.spz_needs") from error
    count, (toc,) = content[15], struct.unpack_from("<I", content, 16)
    if count != sum(width > 0 for width in widths):
        raise InputError(
            "splat_files.streams_announced", count=count, count_2=sum(w > 0 for w in widths)
        )
    sizes = [struct.unpack_from("<QQ", content, toc + 16 * i) for i in range(count)]
    planes, at = [], toc + 16 * count
    for (packed, size), width in zip(sizes, widths, strict=False):
        if size != n * width or at + packed > len(content):
            raise InputError("splat_files.stream_bytes", size=size, n=n * width)
        raw = content[at : at + packed]
        planes.append(zstandard.ZstdDecompressor().decompress(raw, max_output_size=size))
        at += packed
    return planes


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
