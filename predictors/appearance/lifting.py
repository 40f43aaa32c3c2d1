"""Features of pictures onto voxels, through the volume rendering equation (AutoPhyX 3.1).

With the density fixed, F(r) = sum_i T_i alpha_i Phi(x_i) is linear in the features Phi: a sparse
matrix of rays x cells, solved for all channels at once. A cell that no ray sees has no weight, so
that nothing of what hides it reaches it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ..grid import Grid
from .views import Camera

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Method = Literal["solve", "weighted", "average"]
SPENT = 1e-3  # share of light below which a ray is not followed further
FAINT = 1e-5  # a cell's share of a ray below which it is not stored
MET = 0.1  # a ray that lost less than this share of its light met nothing: not used
SEEN = 0.2  # rays (sum of their shares) that a cell needs to count as seen
# Cells seen less are solved for, since they explain part of what rays met, but their features are
# mostly noise and are not returned; those below this are left out altogether.
GLIMPSED = 1e-3
# Pull towards the weighted average, relative to a cell's own weight: it decides between cells that
# the rays cannot tell apart, and costs less than a per cent of the residual.
PULL = 1e-2
TOLERANCE = 1e-3  # of the normal equations, relative to their right-hand side
MAX_ITERATIONS = 60


class Lifted(NamedTuple):
    """Features on cells.

    ``cells`` (n, 3) are the cells with density, ``values`` (n, D) their features, 0 where not
    seen; ``weight`` (n,) is how many rays' worth of light each sent; ``residual`` is the RMS error
    of the rendered features relative to the RMS feature, over ``rays`` rays, before the features of
    cells that hardly anyone sees were dropped.
    """

    cells: np.ndarray
    values: np.ndarray
    weight: np.ndarray
    residual: float
    rays: int

    @property
    def seen(self) -> np.ndarray:
        """Whether each cell (n,) was seen."""
        return self.weight >= SEEN


class Rays(NamedTuple):
    """What pictures say: origins (n, 3) [m], unit directions (n, 3), features (n, D)."""

    origins: np.ndarray
    directions: np.ndarray
    features: np.ndarray


def lift(
    features: Float[np.ndarray, "views height width D"],
    cameras: Sequence[Camera],
    density: Float[np.ndarray, "nx ny nz"],
    grid: Grid,
    *,
    opacity: Float[np.ndarray, "views rows columns"] | None = None,
    method: Method = "solve",
) -> Lifted:
    """Lift dense features of pictures onto the cells of a grid that have density.

    features: Features of every picture, shape (views, height, width, D), at any resolution.
    cameras: Camera of every picture.
    density: Density [1/m] of every cell.
    grid: The grid.
    opacity: Share of the object in every pixel, shape (views, rows, columns); only rays through
        pixels with at least half are used. None uses all.
    method: ``solve``: least squares; ``weighted``: the average weighted by visibility, its first
        step; ``average``: over all pictures, hidden or not (VoMP; the ablation).
    """
    from scipy.sparse import diags_array

    if density.shape != grid.shape or len(features) != len(cameras):
        given = {"shape": density.shape, "shape_2": grid.shape, "count": len(features)}
        raise InputError("lifting.density_grid", count_2=len(cameras), **given)
    rays = pixel_rays(features, cameras, opacity)
    cells = np.argwhere(density > 0)
    matrix = ray_weights(rays, density, grid)
    met = np.asarray(matrix.sum(axis=1)).ravel() >= MET
    if not met.any():
        raise InputError("lifting.none_rays", count=len(met))
    wanted = rays.features[met].astype(np.float32)
    # Rows of sum 1: the feature of a picture is that of what the ray met.
    matrix = matrix[met]
    scaled: Any = diags_array(1 / np.asarray(matrix.sum(axis=1)).ravel()) @ matrix
    matrix = scaled.tocsr().astype(np.float32)
    weight = np.asarray(matrix.sum(axis=0)).ravel()
    if method == "average":
        # Mean over the pictures of the feature at each point's pixel, hidden or not
        points = grid.to_world(cells)
        height, width = features.shape[1:3]
        total = np.zeros((len(points), features.shape[-1]), dtype=np.float32)
        count = np.zeros((len(points), 1), dtype=np.float32)
        for view, camera in enumerate(cameras):
            x, y, depth = camera.resized(height, width).project(points).T
            inside = (depth > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
            total[inside] += features[view, y[inside].astype(int), x[inside].astype(int)]
            count[inside] += 1
        values = total / np.maximum(count, 1)
    else:
        iterations = MAX_ITERATIONS if method == "solve" else 0
        values = _least_squares(matrix, wanted, iterations=iterations)
    error = matrix @ values - wanted
    residual = float(np.sqrt((error**2).mean() / (wanted**2).mean()))
    if method != "average":
        values[weight < SEEN] = 0
    return Lifted(cells, values, weight, residual, len(wanted))


def pixel_rays(
    features: Float[np.ndarray, "views height width D"],
    cameras: Sequence[Camera],
    opacity: Float[np.ndarray, "views rows columns"] | None,
) -> Rays:
    """One ray through the middle of every feature cell that shows the object."""
    height, width = features.shape[1:3]
    origins, directions, values = [], [], []
    for view, camera in enumerate(cameras):
        shown = np.ones((height, width), dtype=bool)
        if opacity is not None:
            rows = ((np.arange(height) + 0.5) * opacity.shape[1] / height).astype(int)
            columns = ((np.arange(width) + 0.5) * opacity.shape[2] / width).astype(int)
            shown = opacity[view][np.ix_(rows, columns)] >= 0.5
        directions.append(camera.resized(height, width).directions()[shown])
        origins.append(np.broadcast_to(camera.position, directions[-1].shape))
        values.append(features[view][shown])
    return Rays(*map(np.concatenate, (origins, directions, values)))


def ray_weights(rays: Rays, density: Float[np.ndarray, "nx ny nz"], grid: Grid) -> csr_array:
    """Share T_i alpha_i of every cell with density in what each ray sees, rays x cells.

    Cells are walked one by one with their exact path lengths (Amanatides and Woo 1987), all rays
    at once, until a ray leaves the grid or its light is spent.
    """
    from scipy.sparse import csr_array

    column = np.full(grid.shape, -1, dtype=np.int32)
    column[density > 0] = np.arange((density > 0).sum(), dtype=np.int32)
    shape = np.array(grid.shape)
    # Every ray that meets the grid, at the point where it enters: its cell, and the lengths [m] so
    # far, to the next border along each axis, and between two borders
    directions = np.where(np.abs(rays.directions) < 1e-12, 1e-12, rays.directions)  # never parallel
    times = (np.stack([grid.lo, grid.hi])[:, None] - rays.origins) / directions
    here = np.maximum(times.min(axis=0).max(axis=1), 0)
    ray = np.flatnonzero(times.max(axis=0).min(axis=1) > here + np.finfo(float).tiny)
    origin, direction, here = rays.origins[ray], directions[ray], here[ray]
    cell = np.clip(grid.cell_of(origin + here[:, None] * direction), 0, shape - 1)
    step = np.sign(direction).astype(np.int64)
    border = (grid.lo + (cell + (step > 0)) * grid.h - origin) / direction
    border, pitch = np.maximum(border, here[:, None]), grid.h / np.abs(direction)
    light = np.ones(len(ray))
    none = np.zeros(0, dtype=np.int64)
    found: list[tuple[np.ndarray, ...]] = [(none, none.astype(np.int32), none.astype(np.float64))]
    while ray.size:
        axis = border.argmin(axis=1)
        row = np.arange(len(axis))
        leave = border[row, axis]
        at = tuple(cell.T)
        alpha = 1 - np.exp(-density[at] * (leave - here))
        share = light * alpha
        keep = share > FAINT
        found.append((ray[keep], column[at][keep], share[keep]))
        light, here = light * (1 - alpha), leave
        border[row, axis] += pitch[row, axis]
        cell[row, axis] += step[row, axis]
        coordinate = cell[row, axis]
        alive = (light > SPENT) & (coordinate >= 0) & (coordinate < shape[axis])
        if not alive.all():
            walk = (ray, cell, here, border, pitch, step, light)
            ray, cell, here, border, pitch, step, light = (a[alive] for a in walk)
    ray, cell, share = (np.concatenate(group) for group in zip(*found, strict=True))
    size = (len(rays.origins), int(column.max()) + 1)
    return csr_array((share.astype(np.float32), (ray, cell)), shape=size)


def _least_squares(
    matrix: csr_array, wanted: Float[np.ndarray, "rays D"], *, iterations: int
) -> Float[np.ndarray, "cells D"]:
    """Least squares features of the glimpsed cells by conjugate gradients, all channels at once.

    The start is the average weighted by visibility, W^T F / W^T 1, and the system, scaled by
    W^T 1, is (W^T W + pull W^T 1) Phi = W^T F + pull W^T 1 Phi_0.
    """
    weight = np.asarray(matrix.sum(axis=0)).ravel()
    met = weight >= GLIMPSED
    narrow = matrix[:, met].tocsr()
    across = narrow.T.tocsr()
    root = np.sqrt(weight[met]).astype(np.float32)[:, None]

    def normal(x: np.ndarray) -> np.ndarray:
        """Left side of the scaled system: (D^-1/2 W^T W D^-1/2 + pull) x with D = W^T 1."""
        return (across @ (narrow @ (x / root))) / root + np.float32(PULL) * x

    x = (across @ wanted) / root  # of the scaled unknowns root * Phi
    right = x * (1 + PULL)
    residual = right - normal(x)
    direction, square = residual.copy(), (residual**2).sum(axis=0)
    limit = TOLERANCE**2 * (right**2).sum(axis=0)
    for _ in range(iterations):
        if (square <= limit).all():
            break
        image = normal(direction)
        length = square / np.maximum((direction * image).sum(axis=0), np.finfo(np.float32).tiny)
        x += length * direction
        residual -= length * image
        before, square = square, (residual**2).sum(axis=0)
        direction *= square / np.maximum(before, np.finfo(np.float32).tiny)
        direction += residual
    values = np.zeros((len(weight), wanted.shape[1]), dtype=np.float32)
    values[met] = x / root
    return values
