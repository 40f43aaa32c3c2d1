"""Between fields and tets: a field sampled at every tet, and tets as labelled voxels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ..fem.scene.material import ElementMaterial
from ..fem.scene.mesh import TetMesh
from ..predictors.field import MaterialField
from ..predictors.grid import Grid
from ..predictors.sampling import ANY_PART, sample_field
from ..predictors.voxels import PartVoxels

Mode = Literal["centroid", "quadrature"]

# Four-point rule of degree 2 on a tet: barycentric coordinates (5 -+ sqrt 5) / 20.
_NEAR, _FAR = (5 + 3 * 5**0.5) / 20, (5 - 5**0.5) / 20
_QUADRATURE = np.full((4, 4), _FAR) + (_NEAR - _FAR) * np.eye(4)
_PAIRS = 1 << 21  # pairs of a box and a cell at a time: about 200 MB of temporaries
_ON_FACE = 1e-9  # of a barycentric coordinate: a cell centre on a face counts as inside


class Assigned(NamedTuple):
    """A mesh with its material, and how it was sampled.

    ``n_fallback`` samples found no voxel of their part around them, the nearest was at most
    ``max_fallback_distance`` [m] away; ``unmatched`` regions have no part of their name in the
    field and took the nearest part.
    """

    mesh: TetMesh
    n_fallback: int
    max_fallback_distance: float
    unmatched: tuple[str, ...]


def assign(mesh: TetMesh, field: MaterialField, *, mode: Mode = "centroid") -> Assigned:
    """Give every tet E, nu, rho of the field; a region samples only the part of its own name.

    ``centroid`` takes one sample a tet; ``quadrature`` the mean of four in (log10 E, nu,
    log10 rho), for tets larger than a voxel.
    """
    part, unmatched = _parts(mesh, field)
    at = np.full((1, 4), 0.25) if mode == "centroid" else _QUADRATURE
    points = np.einsum("qv,tvi->tqi", at, mesh.points[mesh.tets]).reshape(-1, 3)
    sample = sample_field(field, points, part=np.repeat(part, len(at)))
    logE, nu, logrho = (
        values.reshape(-1, len(at)).mean(axis=1)
        for values in (np.log10(sample.E), sample.nu, np.log10(sample.rho))
    )
    return Assigned(
        mesh.with_material(ElementMaterial(10**logE, nu, 10**logrho)),
        sample.n_fallback,
        sample.max_fallback_distance,
        unmatched,
    )


def voxelize(mesh: TetMesh, *, cells: int = 64) -> PartVoxels:
    """Voxels whose centre lies in a tet, labelled by region, ``cells`` along the longest side.

    A region too thin to hold a centre gets the free voxel nearest to its largest tet.
    """
    grid = Grid.around(mesh.bounds, cells=cells)
    return PartVoxels(grid, _stamp_missing(mesh, grid, rasterize(mesh, grid)), mesh.region_names)


def divide(mesh: TetMesh, parts: PartVoxels, parents: Sequence[int]) -> TetMesh:
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


def rasterize(mesh: TetMesh, grid: Grid) -> np.ndarray:
    """Region of the tet around each cell centre, -1 outside, shape of the grid."""
    owner = containing_tets(mesh, grid)
    return np.where(owner >= 0, mesh.region[owner], -1)


def containing_tets(mesh: TetMesh, grid: Grid) -> np.ndarray:
    """Tet around each cell centre (the first, on a common face), -1 outside, shape of the grid."""
    corners = grid.to_index(mesh.points[mesh.tets])  # in cells, so that centres are integers
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    owner = np.full(grid.shape, len(mesh.tets), dtype=np.int64)
    lower, upper = corners.min(axis=1) - _ON_FACE, corners.max(axis=1) + _ON_FACE
    for tet, cell in _cell_boxes(lower, upper, grid.shape):
        local = np.einsum("nij,nj->ni", inverse[tet], cell - corners[tet, 0])
        inside = (local >= -_ON_FACE).all(axis=1) & (local.sum(axis=1) <= 1 + _ON_FACE)
        np.minimum.at(owner, tuple(cell[inside].T), tet[inside])
    return np.where(owner < len(mesh.tets), owner, -1)


def _cell_boxes(
    lower: np.ndarray, upper: np.ndarray, shape: tuple[int, int, int]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs (box, cell) of every cell whose centre lies in a box, in bounded portions.

    ``lower`` and ``upper`` (n, 3) are fractional cell indices, centres are whole numbers; cells
    outside the grid of ``shape`` are left out.
    """
    lo = np.maximum(np.ceil(lower), 0).astype(np.int64)
    hi = np.minimum(np.floor(upper), np.array(shape) - 1).astype(np.int64)
    counts = np.maximum(hi - lo + 1, 0)
    sizes = counts.prod(axis=1)
    ends = np.cumsum(sizes)
    total = int(ends[-1]) if len(ends) else 0
    for start in range(0, total, _PAIRS):
        pair = np.arange(start, min(start + _PAIRS, total))
        box = np.searchsorted(ends, pair, side="right")
        rest = pair - (ends - sizes)[box]
        ny, nz = counts[box, 1], counts[box, 2]
        yield box, lo[box] + np.stack([rest // (ny * nz), rest // nz % ny, rest % nz], axis=1)


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


def _parts(mesh: TetMesh, field: MaterialField) -> tuple[np.ndarray, tuple[str, ...]]:
    """Part label of every tet by the name of its region, and the names without a part."""
    if field.part is None:
        return np.full(len(mesh.tets), ANY_PART), ()
    held = set(np.unique(field.part[field.occupied]))
    label = {name: i for i, name in enumerate(field.part_names) if i in held}
    of_region = np.array([label.get(name, ANY_PART) for name in mesh.region_names])
    used = [mesh.region_names[i] for i in np.unique(mesh.region)]
    return of_region[mesh.region], tuple(name for name in used if name not in label)
