""".splat: rows of 32 bytes, a Gaussian each, without harmonics."""

from __future__ import annotations

import os

import numpy as np

from ....fem.errors import InputError
from ...files import reading
from ...registry import Format
from ..table import PointTable
from .gaussians import SH_C0, normalised, standard_columns


def read_splat(path: str | os.PathLike) -> PointTable:
    """Read .splat: rows of 32 bytes, position, scale, RGBA and rotation as bytes."""
    with reading(path, "a .splat file of 32-byte rows") as source:
        if source.stat().st_size % 32:
            raise InputError(f"{path} has {source.stat().st_size} bytes, wanted a multiple of 32")
        dtype = [("p", "<f4", 3), ("s", "<f4", 3), ("rgba", "u1", 4), ("q", "u1", 4)]
        rows = np.fromfile(source, dtype=dtype)
        rotations = normalised((rows["q"] - 128.0) / 128)
        with np.errstate(divide="ignore"):  # a flat splat has scale 0: its log is -inf
            log_scales = np.log(rows["s"])
        colour = (rows["rgba"][:, :3] / 255 - 0.5) / SH_C0
        alpha = rows["rgba"][:, 3] / 255
        return PointTable(standard_columns(rows["p"], log_scales, rotations, alpha, colour))


SPLAT_ROWS = Format("32-byte splats", (".splat",), read_splat)
