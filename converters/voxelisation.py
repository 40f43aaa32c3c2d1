"""Tets as labelled voxels, and the regions of tets by voxels that were divided further."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.scene.mesh import TetMesh
from ..predictors.grid import Grid
from ..predictors.voxels import PartVoxels

_PAIRS = 1 << 19  # pairs of a tet and a column at a time: about 100 MB of temporaries
# Regions are one shape where volume and radii differ by less than this share: a leg of 5 cm of a
# table of 1.2 m, meshed four times, differs by .6 %; a bar with the radii of a rod has 4.7 % more.
SAME_SHAPE = 0.02
_ON_FACE = 1e-9  # of a barycentric coordinate: a cell centre on a face counts as inside


def voxelize(mesh: TetMesh, *, cells: int = 64) -> PartVoxels:
    """Voxels whose centre lies in a tet, labelled by region, ``cells`` along the longest side.

    A region too thin to hold a centre gets the free voxel nearest to its largest tet.
    """
    grid = Grid.around(mesh.bounds, cells=cells)
    part = _stamp_missing(mesh, grid, _rasterised(mesh, grid))
    return PartVoxels(grid, part, mesh.region_names, shapes=congruent_regions(mesh))


def congruent_regions(mesh: TetMesh) -> tuple[int, ...]:
    """For each region the first one that it is, moved, turned or mirrored; itself if none.

    Compared are volume and principal radii of gyration, which no rigid motion changes.
    """
    found = np.array([_invariants(mesh, mesh.region == i) for i in range(len(mesh.region_names))])
    gap = np.abs(found[:, None] - found)
    same = np.all(gap <= SAME_SHAPE * np.minimum(found[:, None], found), axis=2)
    return tuple((same | np.eye(len(found), dtype=bool)).argmax(axis=1).tolist())


def _invariants(mesh: TetMesh, tets: Bool[np.ndarray, "tets"]) -> Float[np.ndarray, "4"]:
    """Principal radii of gyration [m], the longest last, and the volume [m^3]."""
    volumes, corners = mesh.volumes[tets], mesh.points[mesh.tets[tets]]
    volume = volumes.sum()
    if not volume:
        return np.full(4, np.nan)  # like no other
    corners = corners - np.average(corners.mean(axis=1), axis=0, weights=volumes)
    sums = corners.sum(axis=1)
    # The exact second moment of a tet: V / 20 (sum of x x' over corners + (sum of x) (sum of x)').
    moment = np.einsum("t,tai,taj->ij", volumes, corners, corners)
    moment = (moment + np.einsum("t,ti,tj->ij", volumes, sums, sums)) / (20 * volume)
    radii = np.sqrt(np.linalg.eigvalsh(moment).clip(min=0))
    return np.array([*radii, volume])


def divided_by_voxels(mesh: TetMesh, parts: PartVoxels, parents: Sequence[int]) -> TetMesh:
    """Return the mesh with its regions divided as their voxels were.

    ``parents`` (pieces,) is the region that each of ``parts`` is a piece of; a tet goes to the
    piece of its region whose voxel is nearest to its centroid.
    """
    from scipy.spatial import KDTree

    of_piece = np.asarray(parents)
    region = np.empty_like(mesh.region)
    for parent in np.unique(mesh.region):
        tets = mesh.region == parent
        cells = np.argwhere(parts.occupied & (of_piece[parts.part] == parent))
        _, nearest = KDTree(cells).query(parts.grid.to_index(mesh.centroids[tets]))
        region[tets] = parts.part[tuple(cells[nearest].T)]
    return TetMesh(mesh.points, mesh.tets, region, parts.part_names)


def containing_tets(mesh: TetMesh, grid: Grid) -> Int[np.ndarray, "nx ny nz"]:
    """Tet around each cell centre (the first, on a common face), -1 outside, shape of the grid."""
    corners = grid.to_index(mesh.points[mesh.tets])  # in cells, so that centres are integers
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    # The barycentric coordinates are gradient @ x + offset.
    gradient = np.concatenate([inverse, -inverse.sum(axis=1, keepdims=True)], axis=1)
    offset = -np.einsum("tij,tj->ti", gradient, corners[:, 0]) + [0.0, 0.0, 0.0, 1.0]
    owner = np.full(grid.shape, len(mesh.tets), dtype=np.int64)
    lower, upper = corners.min(axis=1) - _ON_FACE, corners.max(axis=1) + _ON_FACE
    for tet, x, y in _columns(lower[:, :2], upper[:, :2], grid.shape[:2]):
        height = gradient[tet, :, 2]
        rest = np.einsum("nij,nj->ni", gradient[tet, :, :2], np.stack([x, y], axis=1))
        rest += offset[tet] + _ON_FACE  # inside where height * z >= -rest, of every face
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -rest / height
        bottom = np.where(height > 0, crossing, lower[tet, 2:]).max(axis=1)
        top = np.where(height < 0, crossing, upper[tet, 2:]).min(axis=1)
        first = np.ceil(bottom).clip(0, grid.shape[2]).astype(np.int64)
        last = np.floor(top).clip(-1, grid.shape[2] - 1).astype(np.int64)
        count = np.maximum(last - first + 1, 0) * ((height != 0) | (rest >= 0)).all(axis=1)
        pair, above = _unrolled(count)
        cells = x[pair], y[pair], first[pair] + above
        np.minimum.at(owner, cells, tet[pair])
    return np.where(owner < len(mesh.tets), owner, -1)


def _rasterised(mesh: TetMesh, grid: Grid) -> np.ndarray:
    """Region of the tet around each cell centre, -1 outside, shape of the grid."""
    owner = containing_tets(mesh, grid)
    return np.where(owner >= 0, mesh.region[owner], -1)


def _columns(
    lower: np.ndarray, upper: np.ndarray, shape: tuple[int, int]
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Pairs of a box and a column (x, y) of cells through it, in bounded portions.

    ``lower`` and ``upper`` (n, 2) are fractional cell indices, centres are whole numbers; columns
    outside the grid of ``shape`` are left out.
    """
    lo = np.maximum(np.ceil(lower), 0).astype(np.int64)
    hi = np.minimum(np.floor(upper), np.array(shape) - 1).astype(np.int64)
    counts = np.maximum(hi - lo + 1, 0)
    sizes = counts.prod(axis=1)
    portion = np.cumsum(sizes) // _PAIRS  # a box stays whole
    for boxes in np.split(np.arange(len(sizes)), np.flatnonzero(np.diff(portion)) + 1):
        pair, at = _unrolled(sizes[boxes])
        box = boxes[pair]
        yield box, lo[box, 0] + at // counts[box, 1], lo[box, 1] + at % counts[box, 1]


def _unrolled(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For counts 2, 0, 3 the owners 0 0 2 2 2 and the places within them 0 1 0 1 2."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def _stamp_missing(mesh: TetMesh, grid: Grid, label: np.ndarray) -> np.ndarray:
    """Give each region without a voxel the nearest one that is no other region's last."""
    count = np.bincount(label[label >= 0], minlength=len(mesh.region_names))
    volumes = mesh.volumes
    for region in np.setdiff1d(mesh.region, np.flatnonzero(count)):
        largest = np.argmax(np.where(mesh.region == region, volumes, 0))
        distance = np.linalg.norm(grid.centers() - mesh.centroids[largest], axis=-1)
        free = (label < 0) | (count[label] > 1)
        cell = np.unravel_index(np.argmin(np.where(free, distance, np.inf)), grid.shape)
        if label[cell] >= 0:
            count[label[cell]] -= 1
        label[cell], count[region] = region, 1
    return label
