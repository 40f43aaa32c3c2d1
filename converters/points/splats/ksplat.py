""".ksplat splats (version 0.1): sections of rows, positions counted from bucket centres."""

from __future__ import annotations

import os
import struct
from typing import NamedTuple

import numpy as np

from ....fem.errors import InputError
from ...files import reading
from ...registry import Format, Keeps
from ..table import PointTable
from .gaussians import SH_C0, standard_columns

WANTED = "a .ksplat file of version 0.1"
_FILE_HEADER, _SECTION_HEADER = 4096, 1024
_HARMONICS = (0, 9, 24, 45)
_SH_RANGE = 1.5  # of 8-bit harmonics where the header says nothing
_QUANTA = (1, 32767, 32767)  # of a bucket's half size, by level, where the section says nothing
_LEVELS = (("<f4", "<f4", "<f4"), ("<u2", "<f2", "<f2"), ("<u2", "<f2", "u1"))


class _Section(NamedTuple):
    """Layout of a section: splats, rows of space, buckets and where its bytes start."""

    splats: int
    rows: int
    capacity: int
    buckets: int
    size: float
    bucket_bytes: int
    quanta: int
    full: int
    partial: int
    degree: int
    start: int

    def dtype(self, level: int) -> np.dtype:
        """Type of a row at a level of compression."""
        position, other, harmonic = _LEVELS[level]
        return np.dtype(
            [("p", position, 3), ("s", other, 3), ("q", other, 4), ("rgba", "u1", 4),
             ("sh", harmonic, _HARMONICS[self.degree])]
        )  # fmt: skip

    @property
    def bucket_space(self) -> int:
        """Bytes of bucket sizes and centres before the rows."""
        return 4 * self.partial + self.bucket_bytes * self.buckets


def read_ksplat(path: str | os.PathLike) -> PointTable:
    """Read .ksplat at any of its three levels as the columns of the common PLY."""
    with reading(path, WANTED) as source:
        content = source.read_bytes()
        if len(content) < _FILE_HEADER or content[0] != 0 or content[1] < 1:
            raise InputError(f"{path} is no .ksplat of version 0.1; wanted {WANTED}")
        (sections,) = struct.unpack_from("<I", content, 4)
        (level,) = struct.unpack_from("<H", content, 20)
        low, high = struct.unpack_from("<ff", content, 36)
        span = (low or -_SH_RANGE, high or _SH_RANGE)
        if level >= len(_LEVELS) or sections > len(content) // _SECTION_HEADER:
            raise InputError(f"{path}: level {level}, {sections} sections; wanted {WANTED}")
        parts, start = [], _FILE_HEADER + sections * _SECTION_HEADER
        for i in range(sections):
            section = _section(content, _FILE_HEADER + i * _SECTION_HEADER, start, level)
            if section.splats:
                parts.append(_splats(content, section, level, span))
            start += section.bucket_space + section.rows * section.dtype(level).itemsize
        if not parts:
            raise InputError(f"{path} holds no splats; wanted {WANTED}")
        return PointTable(
            {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        )


KSPLAT = Format("bucketed splats", (".ksplat",), read_ksplat, keeps=frozenset({Keeps.HARMONICS}))


def _section(content: bytes, at: int, start: int, level: int) -> _Section:
    splats, rows, capacity, buckets = struct.unpack_from("<IIII", content, at)
    (size,) = struct.unpack_from("<f", content, at + 16)
    (bucket_bytes,) = struct.unpack_from("<H", content, at + 20)
    (quanta,) = struct.unpack_from("<I", content, at + 24)
    full, partial = struct.unpack_from("<II", content, at + 32)
    (degree,) = struct.unpack_from("<H", content, at + 40)
    if degree >= len(_HARMONICS):
        raise InputError(f"section of harmonic degree {degree}; wanted at most 3")
    return _Section(
        splats, rows, capacity, buckets, size, bucket_bytes, quanta or _QUANTA[level], full,
        partial, degree, start,
    )  # fmt: skip


def _splats(content: bytes, section: _Section, level: int, span) -> dict[str, np.ndarray]:
    dtype = section.dtype(level)
    rows_at = section.start + section.bucket_space
    if rows_at + section.splats * dtype.itemsize > len(content):
        raise InputError(f"section of {section.splats} splats ends after the file does")
    rows = np.frombuffer(content, dtype, section.splats, rows_at)
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
            raise InputError(f"{section.splats} splats do not fit {section.buckets} buckets")
        means = (means - section.quanta) * section.size / 2 / section.quanta + centres[bucket]
    with np.errstate(divide="ignore"):  # a flat splat has scale 0: its log is -inf
        log_scales = np.log(rows["s"].astype(np.float64))
    rest = rows["sh"].astype(np.float64)
    if level == 2:
        rest = span[0] + rest / 255 * (span[1] - span[0])
    colour = (rows["rgba"][:, :3] / 255 - 0.5) / SH_C0
    alpha = rows["rgba"][:, 3] / 255
    return standard_columns(
        means, log_scales, rows["q"].astype(np.float64), alpha, colour,
        _by_channel(rest) if section.degree else None,
    )  # fmt: skip


def _by_channel(rest: np.ndarray) -> np.ndarray:
    """Harmonics stored band by band, each (3, band), as (n, 3, all bands)."""
    bands, at = [], 0
    for width in (3, 5, 7):
        if at < rest.shape[1]:
            bands.append(rest[:, at : at + 3 * width].reshape(len(rest), 3, width))
            at += 3 * width
    return np.concatenate(bands, axis=2)
