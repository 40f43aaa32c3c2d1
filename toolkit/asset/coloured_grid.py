"""Density and colour on a grid: of splats, of a point cloud, of a radiance field."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...converters.carriers import is_density
from ...converters.grids import DensityGrid, read_density
from ...converters.points.gaussians import SH_C0, Gaussians, gaussians
from ...converters.points.table import PointTable, read_points
from ...converters.points.views import opacity_grid
from ...converters.registry import GRID_FORMATS, POINT_FORMATS
from ...fem.errors import InputError
from ...predictors.appearance.surface import GREY, OPAQUE, density_of_points
from ...predictors.grid import Grid
from .triangles import Places

FAINT = 0.1  # opacity below which a splat is haze, no part of the object
SOLID = 0.3  # opacity from which a cell is matter, as in a fitted radiance field
GAP = 3.0  # cell over the distance of neighbouring points: 1 in 5,000 of them stays empty then
SPARSE = 95  # percentile of that distance: the rest are strays
_HEAD_BYTES = 1 << 16  # of a PLY header
_TRIANGLES = re.compile(rb"element\s+(face|tristrips)\s+[1-9]")


class ColouredGrid(NamedTuple):
    """Density [1/m] (nx, ny, nz) and colour (nx, ny, nz, 3), sRGB in [0, 1], of cells."""

    density: Float[np.ndarray, "nx ny nz"]
    colour: Float[np.ndarray, "nx ny nz 3"]
    grid: Grid


def is_carrier(path: Path) -> bool:
    """Whether a file holds splats, points without triangles, or a density grid."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        if not path.is_file():
            return True  # its reader says so
        with path.open("rb") as file:
            return not _TRIANGLES.search(file.read(_HEAD_BYTES).partition(b"end_header")[0])
    return suffix in POINT_FORMATS or suffix in GRID_FORMATS


def read_coloured_grid(path: Path, *, cells: int) -> ColouredGrid:
    """Read a carrier onto a grid of at most ``cells`` along its longest side.

    Lengths are taken as metres. Clouds that are sparser than that get larger cells.
    """
    if is_density(path):
        # Cells above the field's threshold that stop light; it has the colour of its own fields
        source = read_density(path)
        grid = Grid.around(source.occupied_box(), cells=cells)
        density = source.on_grid(grid)
        solid = (density > source.threshold) & (-np.expm1(-density * grid.h) >= SOLID)
        fields = [source.fields.get(name) for name in ("red", "green", "blue")]
        colour = np.broadcast_to(GREY[:3].astype(np.float64), (*grid.shape, 3))
        if all(values is not None for values in fields):
            shown = [
                DensityGrid(source.lo, source.hi, np.asarray(v, np.float64)).on_grid(grid)
                for v in fields
            ]
            colour = np.stack(shown, axis=-1).clip(0, 1)
        return _checked(ColouredGrid(np.where(solid, density, 0.0), colour, grid))
    table = read_points(path)
    return _of_splats(table, cells) if table.is_splat else _of_cloud(table, cells)


def _of_splats(table: PointTable, cells: int) -> ColouredGrid:
    """A cell's opacity is the summed one of the splats there, its colour their weighted mean."""
    splats = gaussians(table)
    keep = (splats.opacity > FAINT) & np.isfinite(splats.means).all(axis=1)
    if not keep.any():
        raise InputError(f"none of {len(table)} splats has an opacity above {FAINT:g}")
    splats = Gaussians(*(values[keep] for values in splats))
    base = np.stack([table.columns[f"f_dc_{i}"][keep].astype(np.float64) for i in range(3)], axis=1)
    colours = (0.5 + SH_C0 * base).clip(0, 1)
    grid = Grid.around(_bounds(splats.means), cells=cells)
    cover = opacity_grid(splats, grid)
    sums = [
        opacity_grid(splats._replace(opacity=splats.opacity * channel), grid)
        for channel in colours.T
    ]
    weight = np.maximum(cover, np.finfo(float).tiny)
    colour = np.stack(sums, axis=-1) / np.expand_dims(weight, -1)
    opacity = np.minimum(cover, 1 - np.exp(-OPAQUE))
    depth = np.where(opacity >= SOLID, -np.log1p(-opacity), 0.0)
    return _checked(ColouredGrid(depth / grid.h, colour.clip(0, 1), grid))


def _of_cloud(table: PointTable, cells: int) -> ColouredGrid:
    """Cells that hold a point are opaque and have the mean colour of their points."""
    from scipy.spatial import KDTree

    keep = np.asarray(np.isfinite(table.positions).all(axis=1))
    points = table.positions[keep]
    if len(points) < 2:
        raise InputError(f"a cloud of {len(points)} finite points has no features: 2 are the least")
    bounds = _bounds(points)
    apart = float(np.percentile(KDTree(points).query(points, k=2)[0][:, 1], SPARSE))
    finest = float(np.ptp(bounds, axis=0).max()) / max(GAP * apart, np.finfo(float).tiny)
    grid = Grid.around(bounds, cells=int(np.clip(finest, 1, cells)))
    density = density_of_points(points, grid)
    flat = np.ravel_multi_index(tuple(grid.cell_of(points).T), grid.shape)
    count = np.maximum(np.bincount(flat, minlength=density.size), 1)
    columns = [table.columns.get(name) for name in ("red", "green", "blue")]
    colours = np.tile(GREY[:3].astype(np.float64), (len(points), 1))
    if all(column is not None for column in columns):
        colours = np.stack([np.asarray(column)[keep] for column in columns], axis=1)
        whole = np.iinfo(colours.dtype).max if colours.dtype.kind in "ui" else 1
        colours = (colours / whole).astype(np.float64).clip(0, 1)
    sums = [np.bincount(flat, c, density.size) for c in colours.T]
    colour = (np.stack(sums, axis=-1) / count[:, None]).reshape(*grid.shape, 3)
    return ColouredGrid(density, colour, grid)


def _checked(coloured: ColouredGrid) -> ColouredGrid:
    if not coloured.density.any():
        raise InputError(f"no cell of {coloured.grid.h:g} m stops {SOLID:.0%} of the light")
    return coloured


def _bounds(points: Places) -> Float[np.ndarray, "2 3"]:
    return np.stack([points.min(axis=0), points.max(axis=0)])
