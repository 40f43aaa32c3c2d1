"""Splats as a body: their summed opacity on a grid, and the closed surface through them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ....fem.device import start_warp
from ....fem.errors import NoVolumeError
from ....predictors.grid import Grid
from ...grids.isosurface import PAD, shell_surface
from ..table import PointTable
from .gaussians import Gaussians, gaussians

if TYPE_CHECKING:
    import trimesh
    from scipy.spatial import KDTree

REACH = 3.0  # standard deviations at which a Gaussian ends: opacity 1 % of its peak
MAX_REACH = 8  # cells that a Gaussian covers at most on either side: bad fits are clamped
_FAINT = 0.1  # opacity below which a splat is no part of a surface
_CUT = 0.2  # of the density at the splats' own centres: low, since a shell has thin places
_FINE = 0.75  # of what a splat covers: cells so large see a rod as thick as that
_FEWEST, _MOST = 96, 192  # cells along the longest side
_NEIGHBOURS, _ASKED = 4, 2_000  # the fourth nearest splat, of so many, tells how far they lie apart


def splat_surface(table: PointTable, *, cells: int | None = None) -> trimesh.Trimesh:
    """Closed surface [m] through the centres of the opaque splats, its inside solid.

    The opacity grid of a shell of splats is a ridge. It is cut on its outer side, its inside
    filled, and the cut moved in to where the splats lie below it: their own places, since in a
    thin body the ridges of both sides are one. By default cells are as large as what a splat
    covers.
    """
    from scipy.spatial import KDTree

    splats = gaussians(table)
    keep = (splats.opacity > _FAINT) & np.isfinite(splats.means).all(axis=1)
    if not keep.any():
        raise NoVolumeError(f"none of {len(table)} splats has an opacity above {_FAINT}")
    splats = Gaussians(*(values[keep] for values in splats))
    tree = KDTree(splats.means)
    bounds = np.stack([splats.means.min(axis=0), splats.means.max(axis=0)])
    grid = Grid.around(bounds, cells=cells or _cells(splats, tree), pad=PAD)
    density = opacity_grid(splats, grid)
    here = density[tuple(grid.cell_of(splats.means).T)]

    def depth(outer: trimesh.Trimesh) -> float:
        """Median depth [m] below the outer surface at which the nearest splat lies."""
        vertices, normals = np.asarray(outer.vertices), np.asarray(outer.vertex_normals)
        below = vertices - splats.means[tree.query(vertices)[1]]
        return float(np.median(np.einsum("ni,ni->n", below, normals)))

    return shell_surface(density, grid, level=_CUT * float(np.median(here)), depth=depth)


def _cells(splats: Gaussians, tree: KDTree) -> int:
    """Cells along the longest side that are no smaller than splats, nor than the gaps between."""
    some = splats.means[:: max(1, len(splats.means) // _ASKED)]
    nearest = min(_NEIGHBOURS, len(splats.means) - 1)
    apart = float(np.median(tree.query(some, k=nearest + 1)[0][:, -1]))
    covered = max(apart, float(np.median(splats.sigmas.max(axis=1))))
    longest = float(np.ptp(splats.means, axis=0).max())
    return int(np.clip(longest / (_FINE * covered), _FEWEST, _MOST)) if covered else _FEWEST


def opacity_grid(splats: Gaussians, grid: Grid) -> Float[np.ndarray, "nx ny nz"]:
    """Summed opacity at the centre of every cell: sum of opacity exp(-d^T S^-1 d / 2).

    Each Gaussian is widened by half a cell, so that none falls between centres, and ends at three
    standard deviations or ``MAX_REACH`` cells.
    """
    from ...grids.kernels_volume import add_gaussians

    warp = start_warp()
    sigmas = np.clip(np.hypot(splats.sigmas / grid.h, 0.5), None, MAX_REACH / REACH)  # in cells
    axes = _rotation_matrices(splats.rotations)
    means = grid.to_index(splats.means)
    reach = REACH * np.sqrt(np.einsum("nij,nj->ni", axes**2, sigmas**2))  # of the box around each
    lower = np.clip(np.ceil(means - reach), 0, grid.shape)
    upper = np.clip(np.floor(means + reach), -1, np.array(grid.shape) - 1)
    whiten = axes.transpose(0, 2, 1) / sigmas[:, :, None]
    density = warp.zeros(grid.shape, dtype=warp.float64, device="cpu")
    warp.launch(
        add_gaussians,
        len(means),
        [
            warp.array(means, dtype=warp.vec3d, device="cpu"),
            warp.array(whiten, dtype=warp.mat33d, device="cpu"),
            warp.array(splats.opacity, dtype=warp.float64, device="cpu"),
            warp.array(lower.astype(np.int32), dtype=warp.vec3i, device="cpu"),
            warp.array(upper.astype(np.int32), dtype=warp.vec3i, device="cpu"),
            warp.float64(REACH),
        ],
        [density],
        device="cpu",
    )
    return density.numpy()


def _rotation_matrices(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of unit quaternions wxyz; columns are the axes."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
