"""The surface of an asset on a grid: which cells it touches, and which part is in each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int

from ..asset import Asset
from ..grid import Grid
from ..voxels import PartVoxels

if TYPE_CHECKING:
    import trimesh

SPACING = 0.35  # of the samples on a triangle, in cells: a cell cut by less than this may be missed
LARGEST_PIECE = 256  # subdivisions of a triangle's longest edge in one step: 33,000 samples
# Optical depth of a surface cell along its edge: e^-8, a three-thousandth, of the light passes.
OPAQUE = 8.0


def surface_voxels(asset: Asset, grid: Grid) -> PartVoxels:
    """Return the cells that the asset's surface touches, each with the part most seen in it."""
    best = np.zeros(np.prod(grid.shape), dtype=np.int32)
    label = np.full(len(best), -1, dtype=np.int32)
    for index, part in enumerate(asset.parts):
        count = np.zeros_like(best)
        for points in surface_samples(part.mesh, SPACING * grid.h):
            cells = np.clip(grid.cell_of(points), 0, np.array(grid.shape) - 1)
            count += np.bincount(
                np.ravel_multi_index(tuple(cells.T), grid.shape), minlength=len(best)
            ).astype(np.int32)
        more = count > best
        label[more], best[more] = index, count[more]
    labels = tuple(part.labels or (part.name,) for part in asset.parts)
    return PartVoxels(grid, label.reshape(grid.shape), asset.part_names, labels)


def surface_samples(mesh: trimesh.Trimesh, spacing: float) -> Iterator[Float[np.ndarray, "n 3"]]:
    """Points [m] on every triangle, no farther apart than ``spacing`` [m], corners included."""
    corners = np.asarray(mesh.triangles)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    # Powers of two: triangles of about one size share one pattern of barycentric weights.
    pieces = 2 ** np.ceil(np.log2(np.maximum(edges / spacing, 1))).astype(int)
    while (big := pieces > LARGEST_PIECE).any():
        corners = np.concatenate([corners[~big], _quartered(corners[big])])
        pieces = np.concatenate([pieces[~big], np.repeat(pieces[big] // 2, 4)])
    for count in np.unique(pieces):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        inside = i + j <= count
        weights = np.stack([i[inside], j[inside], (count - i - j)[inside]], axis=1) / count
        yield np.einsum("wc,tck->twk", weights, corners[pieces == count]).reshape(-1, 3)


def random_points(
    mesh: trimesh.Trimesh, count: int, rng: np.random.Generator
) -> tuple[Int[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
    """Faces and corner weights of points uniform on the surface."""
    share = mesh.area_faces / mesh.area_faces.sum()
    faces = rng.choice(len(share), size=count, p=share)
    u, v = rng.random((2, count))
    root = np.sqrt(u)
    return faces, np.stack([1 - root, root * (1 - v), root * v], axis=1)


def _quartered(corners: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Every triangle as four, by the middles of its edges."""
    a, b, c = corners.transpose(1, 0, 2)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(triangle, axis=1) for triangle in four])


def opaque_density(
    occupied: Bool[np.ndarray, "nx ny nz"], grid: Grid
) -> Float[np.ndarray, "nx ny nz"]:
    """Density [1/m] of cells that let (almost) no light through."""
    return occupied * (OPAQUE / grid.h)


def density_of_points(
    points: Float[np.ndarray, "n 3"], grid: Grid
) -> Float[np.ndarray, "nx ny nz"]:
    """Density [1/m] of a point cloud [m]: cells that hold a point are opaque."""
    cells = grid.cell_of(points)
    cells = cells[grid.contains(cells)]
    occupied = np.zeros(grid.shape, dtype=bool)
    occupied[tuple(cells.T)] = True
    return opaque_density(occupied, grid)
