"""Where else a material field comes from: tets, labelled points, output of VoMP or Pixie."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..fem.errors import InputError
from ..fem.scene.mesh import TetMesh
from ..predictors.field import MaterialField
from ..predictors.grid import Grid
from .points.point_file import read_points
from .points.table import PointTable
from .voxelisation import containing_tets, voxelize

# What other programs call the three values and the label, ours first.
ALIASES: Mapping[str, tuple[str, ...]] = {
    "E": ("E", "youngs_modulus", "young_modulus"),
    "nu": ("nu", "poisson_ratio", "poissons_ratio"),
    "rho": ("rho", "density"),
    "part": ("part", "part_label", "segment"),
}
_POSITIONS = ("points", "xyz", "coords", "voxel_coords_world", "positions")
NU_MAX = 0.495  # predictors may say 0.5; an elastic solid stays below it


def field_from_tets(mesh: TetMesh, *, cells: int = 64) -> MaterialField:
    """Field of per-tet E, nu, rho: each voxel takes the values of the tet around its centre.

    Regions become parts; one too thin to hold a centre gets a voxel with its mean values.
    """
    if mesh.material is None:
        raise InputError("the mesh has no material yet: run `assign` first")
    voxels = voxelize(mesh, cells=cells)
    owner = containing_tets(mesh, voxels.grid)
    stamped = voxels.occupied & (mesh.region[owner] != voxels.part)
    for region in np.unique(voxels.part[stamped]):
        inside = np.flatnonzero(mesh.region == region)
        owner[stamped & (voxels.part == region)] = inside[np.argmax(mesh.volumes[inside])]
    return MaterialField(
        voxels.grid,
        voxels.occupied,
        *(getattr(mesh.material, name)[owner] for name in ("E", "nu", "rho")),
        part=voxels.part,
        part_names=voxels.part_names,
    )


def field_from_points(
    table: PointTable,
    *,
    cells: int = 64,
    spacing: float | None = None,
    fill: bool = True,
    part_names: tuple[str, ...] = (),
) -> MaterialField:
    """Field of points with E [Pa], nu, rho [kg/m^3] and, where known, part.

    A voxel takes the mean of its points in (log10 E, nu, log10 rho), of the commonest part alone.
    ``spacing`` [m] is the voxel where the points lie on a grid of their own, else ``cells`` go
    along the longest side; ``fill`` closes the inside of a shell with the nearest voxel.
    """
    values = {name: _column(table, name) for name in ("E", "nu", "rho")}
    positions = table.positions
    good = np.isfinite(positions).all(axis=1)
    good &= np.all([np.isfinite(v) for v in values.values()], axis=0)
    if not good.any():
        raise InputError("no point has finite x, y, z, E, nu, rho")
    positions = positions[good]
    bounds = np.stack([positions.min(axis=0), positions.max(axis=0)])
    if spacing is None:
        grid = Grid.around(bounds, cells=cells)
    else:
        grid = _grid_of(bounds, spacing)
    cell = np.asarray(np.ravel_multi_index(tuple(grid.cell_of(positions).T), grid.shape))
    E, nu, rho = (v[good] for v in values.values())
    scaled = np.stack([np.log10(E), np.minimum(nu, NU_MAX), np.log10(rho)], axis=1)
    name = _name(table, "part")
    raw = np.zeros(len(cell)) if name is None else np.asarray(table.columns[name])[good]
    ids, label = np.unique(raw.astype(np.int64), return_inverse=True)
    found = _gather(grid.shape, cell, scaled, label)
    if fill:
        found = _filled(found)
    names = tuple(part_names[i] if 0 <= i < len(part_names) else f"part {i}" for i in ids)
    return MaterialField(
        grid,
        found.occupied,
        10**found.logE,
        found.nu,
        10**found.logrho,
        part=None if name is None else found.part,
        part_names=() if name is None else names,
    )


def read_field_points(
    path: str | os.PathLike, *, cells: int = 64, spacing: float | None = None
) -> MaterialField:
    """Field from a file of another predictor: VoMP's .npz, Pixie's .ply, or any labelled cloud."""
    return field_from_points(read_points(path), cells=cells, spacing=spacing)


class _Cells(NamedTuple):
    """Means of the points of each cell: occupied, log10 E, nu, log10 rho, and the label or -1."""

    occupied: np.ndarray
    logE: np.ndarray
    nu: np.ndarray
    logrho: np.ndarray
    part: np.ndarray


def _gather(
    shape: tuple[int, int, int], cell: np.ndarray, values: np.ndarray, label: np.ndarray
) -> _Cells:
    """Mean of ``values`` (n, 3) over the points of each cell, of its commonest label alone."""
    size, labels = int(np.prod(shape)), int(label.max()) + 1
    pairs, counts = np.unique(cell * labels + label, return_counts=True)
    order = np.argsort(counts, kind="stable")  # the commonest label of a cell is written last
    part = np.full(size, -1)
    part[pairs[order] // labels] = pairs[order] % labels
    own = label == part[cell]
    count = np.bincount(cell[own], minlength=size)
    means = [np.bincount(cell[own], v[own], size) / np.maximum(count, 1) for v in values.T]
    return _Cells(*(array.reshape(shape) for array in (count > 0, *means, part)))


def _filled(cells: _Cells) -> _Cells:
    """Holes closed, each inner cell a copy of the nearest one that is known."""
    from scipy.ndimage import binary_fill_holes, distance_transform_edt

    nearest = np.asarray(
        distance_transform_edt(~cells.occupied, return_distances=False, return_indices=True)
    )
    solid = np.asarray(binary_fill_holes(cells.occupied))
    near = [array[tuple(nearest)] for array in cells]
    return _Cells(solid, near[1], near[2], near[3], np.where(solid, near[4], -1))


def _grid_of(bounds: np.ndarray, spacing: float) -> Grid:
    """Grid whose cell centres are the points that span ``bounds``, one empty cell around."""
    shape = np.rint((bounds[1] - bounds[0]) / spacing).astype(int) + 3
    return Grid(bounds[0] - 1.5 * spacing, spacing, (int(shape[0]), int(shape[1]), int(shape[2])))


def _name(table: PointTable, quantity: str) -> str | None:
    return next((name for name in ALIASES[quantity] if name in table.columns), None)


def _column(table: PointTable, quantity: str) -> np.ndarray:
    name = _name(table, quantity)
    if name is None:
        raise InputError(
            f"points have no {quantity} (also {ALIASES[quantity][1:]}), got {list(table.columns)}"
        )
    return np.asarray(table.columns[name], dtype=np.float64).ravel()
