"""NanoVDB through warp: one file an array, values in float32."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ...fem.device import start_warp
from ...fem.errors import InputError
from ...predictors.grid import MAX_CELLS
from ..files import reading, writing
from ..registry import Format, Keeps
from .density import DensityGrid


def read_nanovdb(path: str | os.PathLike) -> DensityGrid:
    """Read a float grid over the box of its voxels; its threshold is 0."""
    with reading(path, "a NanoVDB file with a float grid") as source:
        from .kernels_volume import lookup

        warp = start_warp()
        with source.open("rb") as file:
            volume = warp.Volume.load_from_nvdb(file, device="cpu")
        info = volume.get_grid_info()
        if info.type_str != "float":
            raise InputError(f"{path} holds a grid of {info.type_str}, wanted float")
        cells = volume.get_voxels()
        values = warp.zeros(len(cells), dtype=warp.float32, device="cpu")
        warp.launch(lookup, len(cells), [volume.id, cells], [values], device="cpu")
        cells, values = cells.numpy(), values.numpy()
        low, shape = cells.min(axis=0), np.ptp(cells, axis=0) + 1
        if np.prod(shape, dtype=np.float64) > MAX_CELLS:
            raise InputError(f"{path} spans {shape} cells, at most {MAX_CELLS} in all are taken")
        density = np.zeros(shape, dtype=np.float32)
        density[tuple((cells - low).T)] = values
        spacing = np.array([*volume.get_voxel_size()], dtype=np.float64)
        lo = np.array([*info.translation]) + (low - 0.5) * spacing
        return DensityGrid(lo, lo + shape * spacing, density)


def write_nanovdb(path: Path, grid: DensityGrid) -> list[Path]:
    """Write STEM.nvdb of the density and STEM.NAME.nvdb of every further array."""
    arrays = {"": grid.density, **{f".{name}": a for name, a in grid.fields.items()}}
    files = [path.with_name(f"{path.stem}{name}.nvdb") for name in arrays]
    for file, array in zip(files, arrays.values(), strict=True):
        _write(file, grid, array)
    return files


NANOVDB = Format(
    "NanoVDB", (".nvdb",), read_nanovdb, write_nanovdb, keeps=frozenset({Keeps.ARRAYS})
)


def _write(path: Path, grid: DensityGrid, array: np.ndarray) -> None:
    warp = start_warp()
    with writing(path) as target:
        # NanoVDB counts voxel centres: cell (0, 0, 0) sits half a cell inside the box.
        warp.Volume.load_from_numpy(
            np.ascontiguousarray(array, dtype=np.float32),
            tuple((grid.lo + grid.spacing / 2).tolist()),
            tuple(grid.spacing.tolist()),
            0.0,
            device="cpu",
        ).save_to_nvdb(str(target))
