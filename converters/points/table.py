"""Points with named columns: point clouds and Gaussian splats, in every file format they come in.

The table of formats at the end maps a suffix to a reader and a writer. Every column and its order
is kept; formats without room for further columns are read-only here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...fem.errors import InputError
from .. import npz
from ..files import reading
from .ply import Ply, columns_table, read_ply, write_ply

_XYZ = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class PointTable:
    """Points [m] with named columns, each (n,) or (n, k), in the order of their file.

    A point may be invalid (not finite), as in clouds of depth cameras.
    ``comments`` are remarks of the file and ``keep`` whatever else its writer needs to give the
    whole file back.
    """

    columns: Mapping[str, np.ndarray]
    comments: tuple[str, ...] = ()
    keep: Any = field(default=None, repr=False)

    def __post_init__(self) -> None:
        missing = [name for name in _XYZ if name not in self.columns]
        if missing:
            raise InputError(f"points need columns x, y, z, got {list(self.columns)}")
        lengths = {name: len(values) for name, values in self.columns.items()}
        if len(set(lengths.values())) != 1 or not len(self):
            raise InputError(f"columns must be of one length > 0, got {lengths}")

    def __len__(self) -> int:
        return len(self.columns["x"])

    @property
    def positions(self) -> np.ndarray:
        """Positions [m], shape (n, 3), float64."""
        return np.stack([np.asarray(self.columns[name], dtype=np.float64) for name in _XYZ], axis=1)

    @property
    def is_splat(self) -> bool:
        """Whether the columns are those of 3D Gaussians."""
        return {"opacity", "scale_0", "rot_0"} <= self.columns.keys()

    def with_columns(self, extra: Mapping[str, np.ndarray], *, comment: str = "") -> PointTable:
        """Return the table with columns replaced in place or appended last."""
        comments = (*self.comments, comment) if comment else self.comments
        return replace(self, columns={**self.columns, **extra}, comments=comments)


class PointFormat(NamedTuple):
    """Reader of a point format and its writer, None where the format has no room for columns."""

    title: str
    read: Callable[[str | os.PathLike], PointTable]
    write: Callable[[str | os.PathLike, PointTable], None] | None


def read_points(path: str | os.PathLike) -> PointTable:
    """Read a point cloud or Gaussian splats by suffix."""
    return point_format(path).read(path)


def write_points(path: str | os.PathLike, table: PointTable) -> None:
    """Write a table in a format with room for its columns, all or nothing."""
    chosen = point_format(path)
    if chosen.write is None:
        room = ", ".join(suffix for suffix, f in FORMATS.items() if f.write)
        raise InputError(f"{path}: {chosen.title} has no room for further columns; {room} have")
    chosen.write(path, table)


def point_format(path: str | os.PathLike) -> PointFormat:
    """Look a path up in the table of point formats."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        known = ", ".join(f"{s} ({f.title})" for s, f in FORMATS.items())
        raise InputError(f"{path}: unknown point suffix {suffix!r}; known are {known}")
    return FORMATS[suffix]


def _read_ply(path: str | os.PathLike) -> PointTable:
    from .splats import is_packed, unpack

    with reading(path, "a PLY point cloud or 3D Gaussian splat"):
        ply = read_ply(path)
        if is_packed(ply):
            return PointTable(unpack(ply), ply.comments)
        names = ply.vertex.dtype.names or ()
        return PointTable({name: ply.vertex[name] for name in names}, ply.comments, keep=ply)


def _write_ply(path: str | os.PathLike, table: PointTable) -> None:
    vertex = {"vertex": columns_table(dict(table.columns))}
    if isinstance(table.keep, Ply):
        elements = {**table.keep.elements, **vertex}
        write_ply(path, replace(table.keep, elements=elements, comments=table.comments))
    else:
        write_ply(path, Ply(vertex, table.comments))


def _read_npz(path: str | os.PathLike) -> PointTable:
    with reading(path, "an .npz of point columns x, y, z (or points) and more"):
        arrays = npz.load_npz(path)
        comments = tuple(str(arrays.pop("comments")).splitlines()) if "comments" in arrays else ()
        if "points" in arrays:  # a table (n, 3) instead of three columns
            points = arrays.pop("points")
            arrays = {**dict(zip(_XYZ, points.T, strict=True)), **arrays}
        return PointTable(arrays, comments)


def _write_npz(path: str | os.PathLike, table: PointTable) -> None:
    npz.save_npz(path, **table.columns, comments=np.array("\n".join(table.comments)))


def _read_xyz(path: str | os.PathLike) -> PointTable:
    with reading(path, "a text file of rows x y z, further columns allowed") as source:
        rows = np.loadtxt(source, ndmin=2)
        if rows.shape[1] < 3:
            raise InputError(f"rows have {rows.shape[1]} numbers, wanted at least x y z")
        names = [*_XYZ, *(f"column_{i}" for i in range(3, rows.shape[1]))]
        return PointTable(dict(zip(names, rows.T, strict=True)))


def _lazy(module: str, name: str) -> Callable:
    """Function ``name`` of a sibling module, imported on its first call."""

    def call(*args):
        from importlib import import_module

        return getattr(import_module(f".{module}", __package__), name)(*args)

    return call


FORMATS: dict[str, PointFormat] = {
    ".ply": PointFormat("PLY cloud or splats", _read_ply, _write_ply),
    ".npz": PointFormat("columns archive", _read_npz, _write_npz),
    ".pcd": PointFormat("PCL cloud", _lazy("pcd", "read_pcd"), _lazy("pcd", "write_pcd")),
    ".las": PointFormat("LAS cloud", _lazy("las", "read_las"), _lazy("las", "write_las")),
    ".laz": PointFormat("LAZ cloud", _lazy("las", "read_las"), _lazy("las", "write_las")),
    ".xyz": PointFormat("text cloud", _read_xyz, None),
    ".splat": PointFormat("32-byte splats", _lazy("splats", "read_splat"), None),
    ".spz": PointFormat("Niantic splats", _lazy("spz", "read_spz"), None),
    ".ksplat": PointFormat("bucketed splats", _lazy("ksplat", "read_ksplat"), None),
}
