"""Closed surfaces where a density falls below a level, their insides solid."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ...fem.errors import NoVolumeError
from ...predictors.grid import Grid
from .density import DensityGrid

if TYPE_CHECKING:
    import trimesh

PAD = 4  # empty cells around, for the closing of holes
_HALF = 0.5  # of a radiance field's median density, where it states no threshold
_GAP = 3  # cells: holes of a shell up to twice this wide are bridged, if that encloses something
_BAND = 2.0  # cells about a level in which distances are those to the triangles
_ENCLOSED = 0.9  # of the largest volume that any bridging encloses is as good as all of it


def density_surface(source: DensityGrid, *, cells: int = 96) -> trimesh.Trimesh:
    """Closed surface [m] of a density grid at its threshold, its inside solid."""
    grid = Grid.around(source.occupied_box(), cells=cells, pad=PAD)
    level = max(source.threshold, _HALF * float(np.median(source.density[source.density > 0])))
    return isosurface(source.on_grid(grid), grid, level=level)


def isosurface(
    density: Float[np.ndarray, "nx ny nz"], grid: Grid, *, level: float
) -> trimesh.Trimesh:
    """Outer surface [m] where the density falls below ``level``; holes inside are solid."""
    return _cut(density, _solid(density >= level), grid, level)


def shell_surface(
    density: Float[np.ndarray, "nx ny nz"],
    grid: Grid,
    *,
    level: float,
    depth: Callable[[trimesh.Trimesh], float],
) -> trimesh.Trimesh:
    """Surface [m] that lies ``depth`` [m] of the outer one below it; what is enclosed is solid.

    A level of the distance and not moved vertices: these would fold where a body is thin.
    """
    import igl
    from scipy.ndimage import distance_transform_edt

    solid = _solid(density >= level)
    outer = _cut(density, solid, grid, level)
    below = depth(outer)
    away = np.asarray(distance_transform_edt(np.pad(solid, 1)))[1:-1, 1:-1, 1:-1] * grid.h
    near = solid & (np.abs(away - below) < _BAND * grid.h)
    triangles = np.ascontiguousarray(outer.vertices), np.ascontiguousarray(outer.faces)
    away[near] = np.sqrt(igl.point_mesh_squared_distance(grid.centers()[near], *triangles)[0])
    # A body that is thinner than that all over stays as its cut is.
    return _marched(away, grid, below) if 0 < below < away.max() else outer


def _cut(density: np.ndarray, solid: np.ndarray, grid: Grid, level: float) -> trimesh.Trimesh:
    """Surface of the solid cells, where it is that of the dense ones as the density falls."""
    values = np.where(solid, np.maximum(density, 1.5 * level), np.minimum(density, level))
    values = np.where(density >= level, density, values)  # the cut itself stays between cells
    return _marched(values, grid, level)


def _marched(values: Float[np.ndarray, "nx ny nz"], grid: Grid, level: float) -> trimesh.Trimesh:
    """Where the values pass ``level``, between the cells; closed at the border of the grid."""
    import igl
    import trimesh

    values = np.pad(values, 1)
    outer = Grid(grid.lo - grid.h, grid.h, (values.shape[0], values.shape[1], values.shape[2]))
    order = (2, 1, 0)  # the library counts x fastest
    points = outer.centers().transpose(*order, 3).reshape(-1, 3)
    flat = np.ascontiguousarray(values.transpose(order).ravel())
    nx, ny, nz = values.shape
    vertices, faces = igl.marching_cubes(flat, points, nx, ny, nz, level)[:2]
    if np.size(faces) == 0:
        raise NoVolumeError(f"no surface: the largest value is {values.max():g}, cut {level:g}")
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
