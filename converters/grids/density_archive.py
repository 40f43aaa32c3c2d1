"""Our own archive of a density grid, .npz: density, box [m], threshold, further arrays."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ...fem.errors import InputError
from .. import npz
from ..files import reading
from ..registry import Format, Keeps
from .density import DensityGrid


def read_density_archive(path: str | os.PathLike) -> DensityGrid:
    """Read the arrays density, aabb_min, aabb_max and, where there, order and threshold."""
    arrays = npz.load_npz(path)
    with reading(path, "an .npz with density, aabb_min, aabb_max"):
        missing = {"density", "aabb_min", "aabb_max"} - arrays.keys()
        if missing:
            raise InputError(f"{path} lacks {sorted(missing)}, got {sorted(arrays)}")
        if str(arrays.pop("order", "xyz")) != "xyz":
            raise InputError(f"{path}: axes must be in the order 'xyz'")
        return DensityGrid(
            np.asarray(arrays.pop("aabb_min"), dtype=np.float64),
            np.asarray(arrays.pop("aabb_max"), dtype=np.float64),
            arrays.pop("density"),
            float(arrays.pop("threshold", 0.0)),
            arrays,
        )


def write_density_archive(path: Path, grid: DensityGrid) -> list[Path]:
    """Write one file with all arrays."""
    npz.save_npz(
        path, density=grid.density, aabb_min=grid.lo, aabb_max=grid.hi, order=np.array("xyz"),
        threshold=np.array(grid.threshold), **grid.fields,
    )  # fmt: skip
    return [path]


DENSITY_ARCHIVE = Format(
    "own archive",
    (".npz",),
    read_density_archive,
    write_density_archive,
    keeps=frozenset({Keeps.ARRAYS, Keeps.THRESHOLD}),
)
