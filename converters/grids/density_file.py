"""A density grid's file by its suffix: read and written with all that its format keeps."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from ...fem.errors import InputError
from ..registry import GRID_FORMATS, Keeps, format_of, told_lost, written
from .density import DensityGrid

log = logging.getLogger(__name__)


def read_density(path: str | os.PathLike) -> DensityGrid:
    """Read a density grid [1/m] by suffix."""
    reader = format_of(path, GRID_FORMATS).read
    if reader is None:
        raise InputError(f"{path}: {Path(path).suffix} is written only")
    return reader(path)


def write_density(path: str | os.PathLike, grid: DensityGrid) -> list[Path]:
    """Write a grid with its further arrays and return the files; what is lost is logged."""
    path = Path(path)
    suffix = path.suffix.lower()
    writer = GRID_FORMATS[suffix].write if suffix in GRID_FORMATS else None
    if writer is None:
        raise InputError(
            f"{path}: density grids are written as {' or '.join(written(GRID_FORMATS))}"
        )
    files = writer(path, grid)
    if lost := density_losses(path, grid):
        log.warning(told_lost(path, GRID_FORMATS[suffix], lost))
    return files


def density_losses(path: str | os.PathLike, grid: DensityGrid) -> tuple[Keeps, ...]:
    """What of the grid a file of that suffix does not keep."""
    given = [Keeps.ARRAYS] * bool(grid.fields) + [Keeps.THRESHOLD] * bool(grid.threshold)
    return format_of(path, GRID_FORMATS).loses(given)
