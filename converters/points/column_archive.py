"""An archive of point columns, .npz: one array a column, or ``points`` (n, 3) for x, y, z."""

from __future__ import annotations

import os

import numpy as np

from .. import npz
from ..files import reading
from ..registry import Format, Keeps
from .table import XYZ, PointTable


def read_column_archive(path: str | os.PathLike) -> PointTable:
    """Read every array as a column, and ``comments`` as the remarks."""
    with reading(path, "an .npz of point columns x, y, z (or points) and more"):
        arrays = npz.load_npz(path)
        comments = tuple(str(arrays.pop("comments")).splitlines()) if "comments" in arrays else ()
        if "points" in arrays:  # a table (n, 3) instead of three columns
            points = arrays.pop("points")
            arrays = {**dict(zip(XYZ, points.T, strict=True)), **arrays}
        return PointTable(arrays, comments)


def write_column_archive(path: str | os.PathLike, table: PointTable) -> None:
    """Write every column, and the remarks as one text."""
    npz.save_npz(path, **table.columns, comments=np.array("\n".join(table.comments)))


COLUMN_ARCHIVE = Format(
    "columns archive",
    (".npz",),
    read_column_archive,
    write_column_archive,
    keeps=frozenset({Keeps.COLUMNS, Keeps.REMARKS, Keeps.HARMONICS}),
)
