"""A picture of lifted features: their first three principal components as red, green and blue."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....predictors.asset import Asset, UpAxis
from ....predictors.grid import Grid
from ....predictors.images.features import VoxelFeatures
from .panels import Panel, asset_panel, render_png
from .tracer import ColouredSurface

CAPTION = (
    "What the image encoder sees, lifted onto voxels: the first three principal components of its "
    "features as red, green and blue. Parts of one colour look alike to it."
)


class VoxelShell(NamedTuple):
    """Faces between full and empty cells: points (points, 3) [m], triangles, the cell of each."""

    points: np.ndarray
    faces: np.ndarray
    cell: np.ndarray


def feature_panel(voxels: VoxelFeatures, *, title: str = "") -> Panel:
    """Panel of the cells of an asset, coloured by what their features have in common."""
    shell = voxel_shell(voxels.occupied, voxels.grid)
    row = np.full(voxels.grid.shape, -1)
    row[tuple(voxels.cells.T)] = np.arange(len(voxels.cells))
    colours = voxels.picture()[row[tuple(shell.cell.T)]]
    corners = np.repeat(colours[:, None], 3, axis=1).astype(np.float64)
    return Panel((ColouredSurface(shell.points, shell.faces, corners),), title)


def feature_png(
    path: str | os.PathLike[str],
    voxels: VoxelFeatures,
    asset: Asset | None = None,
    *,
    up: UpAxis = "z",
) -> Path:
    """Write the picture of the features, beside the asset as it looks where there is one."""
    panel = feature_panel(voxels, title=f"features of {voxels.encoder}")
    panels = [panel] if asset is None else [asset_panel(asset, title=asset.name), panel]
    return render_png(path, panels, up=up if asset is None else asset.up)


def voxel_shell(occupied: Bool[np.ndarray, "nx ny nz"], grid: Grid) -> VoxelShell:
    """Two triangles for every face that a full cell turns to an empty one, facing outwards."""
    corners, cells = [], []
    padded = np.pad(occupied, 1)
    for axis in range(3):
        for side in (0, 1):
            beside = np.roll(padded, 1 - 2 * side, axis=axis)[1:-1, 1:-1, 1:-1]
            bare = np.argwhere(occupied & ~beside)
            cells.append(bare)
            corners.append(bare[:, None] + _square(axis, side))
    quads: Int[np.ndarray, "quads 4 3"] = np.concatenate(corners)
    points, index = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(-1, 4)
    faces = np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]])
    world: Float[np.ndarray, "points 3"] = grid.to_world(points - 0.5)
    return VoxelShell(world, faces, np.tile(np.concatenate(cells), (2, 1)))


def _square(axis: int, side: int) -> Int[np.ndarray, "4 3"]:
    """Corners of a unit cell's face, counter-clockwise seen from outside."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    corners = np.insert(square, 0, side, axis=1)  # the face across the first axis, outward +
    return np.roll(corners if side else corners[::-1], axis, axis=1)
