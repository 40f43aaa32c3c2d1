"""Text clouds, .xyz: rows of x y z and unnamed columns; read only, since names have no place."""

from __future__ import annotations

import os

import numpy as np

from ...fem.errors import InputError
from ..files import reading
from ..registry import Format
from .table import XYZ as AXES
from .table import PointTable


def read_xyz(path: str | os.PathLike) -> PointTable:
    """Read rows of numbers; the fourth and later ones become column_3, column_4 ..."""
    with reading(path, "a text file of rows x y z, further columns allowed") as source:
        rows = np.loadtxt(source, ndmin=2)
        if rows.shape[1] < 3:
            raise InputError(f"rows have {rows.shape[1]} numbers, wanted at least x y z")
        names = [*AXES, *(f"column_{i}" for i in range(3, rows.shape[1]))]
        return PointTable(dict(zip(names, rows.T, strict=True)))


XYZ = Format("text cloud", (".xyz",), read_xyz)
