"""Closed surfaces of splats and density grids, ready to be repaired and meshed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ..fem.errors import NoVolumeError
from ..predictors.grid import Grid
from .grids.density import DensityGrid
from .points.splats import Gaussians, gaussians, opacity_grid
from .points.table import PointTable

if TYPE_CHECKING:
    import trimesh

_FAINT = 0.1  # opacity below which a splat is no part of a surface
_CUT = 0.2  # of the density at the splats' own centres: low, since a shell has thin places
_HALF = 0.5  # of a radiance field's median density, where it states no threshold
_GAP = 3  # cells: holes of a shell up to twice this wide are bridged, if that encloses something
_ENCLOSED = 0.9  # of the largest volume that any bridging encloses is as good as all of it
_DEPTH = 2.5  # cells below the first cut in which the ridge of the shell is looked for
_PAD = 4  # empty cells around, for the closing and the reach of the Gaussians


def splat_surface(table: PointTable, *, cells: int = 96) -> trimesh.Trimesh:
    """Closed surface [m] through the centres of the opaque splats, its inside solid.

    The opacity grid of a shell of splats is a ridge. It is cut on its outer side, its inside
    filled, and the cut moved in by the median distance to the crest.
    """
    splats = gaussians(table)
    keep = (splats.opacity > _FAINT) & np.isfinite(splats.means).all(axis=1)
    if not keep.any():
        raise NoVolumeError(f"none of {len(table)} splats has an opacity above {_FAINT}")
    splats = Gaussians(*(values[keep] for values in splats))
    bounds = np.stack([splats.means.min(axis=0), splats.means.max(axis=0)])
    grid = Grid.around(bounds, cells=cells, pad=_PAD)
    density = opacity_grid(splats, grid)
    here = density[tuple(grid.cell_of(splats.means).T)]
    surface = isosurface(density, grid, level=_CUT * float(np.median(here)))
    normals = np.asarray(surface.vertex_normals)
    surface.vertices = surface.vertices - _crest(density, grid, surface.vertices, normals) * normals
    return surface


def density_surface(source: DensityGrid, *, cells: int = 96) -> trimesh.Trimesh:
    """Closed surface [m] of a density grid at its threshold, its inside solid."""
    grid = Grid.around(source.occupied_box(), cells=cells, pad=_PAD)
    level = max(source.threshold, _HALF * float(np.median(source.density[source.density > 0])))
    return isosurface(source.on_grid(grid), grid, level=level)


def isosurface(
    density: Float[np.ndarray, "nx ny nz"], grid: Grid, *, level: float
) -> trimesh.Trimesh:
    """Outer surface [m] where the density falls below ``level``; holes inside are solid."""
    import igl
    import trimesh

    solid = _solid(density >= level)
    values = np.where(solid, np.maximum(density, 1.5 * level), np.minimum(density, level))
    values = np.where(density >= level, density, values)  # the cut itself stays between cells
    values = np.pad(values, 1)  # closed where the body touches the border
    outer = Grid(grid.lo - grid.h, grid.h, (values.shape[0], values.shape[1], values.shape[2]))
    order = (2, 1, 0)  # the library counts x fastest
    points = outer.centers().transpose(*order, 3).reshape(-1, 3)
    flat = np.ascontiguousarray(values.transpose(order).ravel())
    nx, ny, nz = values.shape
    vertices, faces = igl.marching_cubes(flat, points, nx, ny, nz, level)[:2]
    if np.size(faces) == 0:
        raise NoVolumeError(f"no surface: the largest density is {density.max():g}, cut {level:g}")
    surface = trimesh.Trimesh(vertices, faces, process=True)
    if surface.volume < 0:
        surface.invert()
    return surface


def _solid(dense: np.ndarray) -> np.ndarray:
    """Dense cells and all they enclose, holes bridged no wider than it takes.

    Bridging is to grow, fill and shrink again: closing alone leaves every hole of a thin sheet.
    """
    from scipy.ndimage import binary_dilation, binary_erosion, binary_fill_holes

    dense = np.pad(dense, _GAP + 1)
    tries = [np.asarray(binary_fill_holes(dense))]
    for k in range(1, _GAP + 1):
        grown = binary_fill_holes(binary_dilation(dense, iterations=k))
        tries.append(np.asarray(binary_erosion(grown, iterations=k)) | dense)
    counts = np.array([solid.sum() for solid in tries])
    inner = slice(_GAP + 1, -_GAP - 1)
    return tries[int(np.argmax(counts >= _ENCLOSED * counts.max()))][inner, inner, inner]


def _crest(density: np.ndarray, grid: Grid, vertices, normals) -> float:
    """Median depth [m] below the surface at which the density is largest."""
    from scipy.ndimage import map_coordinates

    depths = np.linspace(0, _DEPTH, 26) * grid.h
    along = vertices[:, None] - depths[:, None] * normals[:, None]
    values = map_coordinates(density, np.moveaxis(grid.to_index(along), -1, 0), order=1)
    return float(np.median(depths[values.argmax(axis=1)]))
