"""A small voxel radiance field fitted to posed photographs: the density that lifting asks for.

Density and colour live on the cells of a grid and are interpolated along rays; both are fitted to
the pixels by gradient descent (after Sun et al. 2022, DVGO, without its second network: a colour
does not depend on where it is seen from). Photographs need an alpha channel, or one plain colour
behind the object.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...fem.errors import InputError
from ..grid import Grid
from .views import Camera, Views

if TYPE_CHECKING:
    import torch

SAMPLES_PER_CELL = 2  # along a ray
COVERED = 0.1  # a pixel less opaque than this shows the background alone
FIRST_DEPTH = 0.05  # optical depth of a cell before the first step: light reaches all of them
# A cell is part of the object if it takes away this share of the light that crosses it.
SOLID = 0.3
BATCH = 8192  # rays rendered at once, where nothing is fitted
HULL_CELLS = 32  # of the coarse grid that looks for the object's bounds
HULL_PAD = 1.5  # cells added to those bounds on every side


@dataclass(frozen=True)
class FitOptions:
    """How long and how a field is fitted."""

    steps: int = 100
    rays: int = 2048  # of one step
    rate: float = 0.3
    smoothness: float = 1e-2  # weight of the mean jump of optical depth between neighbours
    pixels: int = 96  # longest side to which photographs are reduced
    seed: int = 0


class Radiance(NamedTuple):
    """A fitted field.

    ``density`` (nx, ny, nz) [1/m] is 0 where a cell hardly dims the light; ``colour``
    (nx, ny, nz, 3) in [0, 1]; ``error`` is the RMS error of the pixels' colours.
    """

    grid: Grid
    density: np.ndarray
    colour: np.ndarray
    error: float


class _Pixels(NamedTuple):
    """Rays of all pixels: origins, directions (n, 3), colours (n, 3), opacity (n,), view (n,)."""

    origins: torch.Tensor
    directions: torch.Tensor
    colour: torch.Tensor
    opacity: torch.Tensor
    view: torch.Tensor


def fit_radiance(
    views: Views, grid: Grid | None = None, *, cells: int = 48, options: FitOptions | None = None
) -> Radiance:
    """Fit density and colour of every cell to posed photographs.

    views: Photographs with their cameras; their opacity, where it is less than 1, is fitted too.
    grid: The grid; by default ``cells`` along the longest side of what the silhouettes allow.
    cells: Cells along the longest side of the default grid.
    options: How long and how it is fitted.
    """
    import torch
    import torch.nn.functional as F

    options = options or FitOptions()
    grid = grid or Grid.around(silhouette_bounds(views), cells=cells)
    # Every pixel of the reduced photographs as a ray; colours are premultiplied.
    shrink = min(options.pixels / max(views.opacity.shape[1:]), 1.0)
    height, width = (max(round(n * shrink), 1) for n in views.opacity.shape[1:])
    layers = np.concatenate(
        [views.colour * views.opacity[..., None], views.opacity[..., None]], axis=-1
    ).transpose(0, 3, 1, 2)
    layers = F.interpolate(torch.from_numpy(layers).float(), size=(height, width), mode="area")
    layers = layers.permute(0, 2, 3, 1).reshape(-1, 4)
    small = [camera.resized(height, width) for camera in views.cameras]
    directions = np.concatenate([camera.directions().reshape(-1, 3) for camera in small])
    origins = np.repeat([camera.position for camera in small], height * width, axis=0)
    pixels = _Pixels(
        torch.from_numpy(origins).float(), torch.from_numpy(directions).float(), layers[:, :3],
        layers[:, 3], torch.from_numpy(np.repeat(np.arange(len(small)), height * width)),
    )  # fmt: skip
    masked = bool((views.opacity < COVERED).any())
    allowed = torch.from_numpy(silhouette_hull(views, grid).T.copy())[None, None]
    # Logarithms of the optical depth (1, 1, nz, ny, nx), logits of colour and of backgrounds
    shape = grid.shape[::-1]
    log_depth = torch.full((1, 1, *shape), float(np.log(FIRST_DEPTH)), requires_grad=True)
    tint = torch.zeros(1, 3, *shape, requires_grad=True)
    background = torch.zeros(len(views.cameras), 3, requires_grad=True)
    descent = torch.optim.Adam([log_depth, tint, background], lr=options.rate)
    generator = torch.Generator().manual_seed(options.seed)

    def rendered(depth, colour, rays: _Pixels, dice: torch.Generator | None = None):
        """Colour and opacity of rays, before the backgrounds where these are not known."""
        seen, cover = _render(depth, colour, rays, grid, dice)
        if not masked:
            seen = seen + (1 - cover)[:, None] * background.sigmoid()[rays.view]
        return seen, cover

    for _ in range(options.steps):
        picked = torch.randint(len(pixels.view), (options.rays,), generator=generator)
        batch = _Pixels(*(column[picked] for column in pixels))
        depth = log_depth.exp() * allowed
        seen, cover = rendered(depth, tint.sigmoid(), batch, generator)
        loss = ((seen - batch.colour) ** 2).mean()
        if masked:
            loss = loss + ((cover - batch.opacity) ** 2).mean()
        taken = 1 - torch.exp(-depth)  # share of the light that a cell takes; its mean jump
        jumps = [taken.diff(dim=axis).abs().mean() for axis in (2, 3, 4)]
        loss = loss + options.smoothness * (jumps[0] + jumps[1] + jumps[2])
        descent.zero_grad()
        loss.backward()
        descent.step()
    with torch.no_grad():
        # The field in numbers, and how well it explains all pixels
        depth, colour = log_depth.exp() * allowed, tint.sigmoid()
        total = 0.0
        for start in range(0, len(pixels.view), BATCH):
            batch = _Pixels(*(column[start : start + BATCH] for column in pixels))
            total += float(((rendered(depth, colour, batch)[0] - batch.colour) ** 2).sum())
        optical = depth[0, 0].numpy().T.astype(np.float64)
        solid = 1 - np.exp(-optical) >= SOLID
        return Radiance(
            grid,
            np.where(solid, optical / grid.h, 0.0),
            np.ascontiguousarray(colour[0].numpy().transpose(3, 2, 1, 0)),
            float(np.sqrt(total / pixels.colour.numel())),
        )


def silhouette_hull(views: Views, grid: Grid) -> Bool[np.ndarray, "nx ny nz"]:
    """Cells that no picture shows to be empty: the visual hull (Laurentini 1994), a cell wider."""
    from scipy.ndimage import maximum_filter

    points = grid.centers().reshape(-1, 3)
    inside = np.ones(len(points), dtype=bool)
    for camera, opacity in zip(views.cameras, views.opacity, strict=True):
        x, y, depth = camera.project(points).T
        height, width = opacity.shape
        shown = (depth > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        # A centre may lie a cell's half diagonal outside of what its cell covers.
        reach = grid.h * camera.focal[0] / max(float(depth[shown].min(initial=np.inf)), grid.h)
        covered = maximum_filter(opacity >= COVERED, size=2 * int(np.ceil(reach)) + 1)
        inside[shown] &= covered[y[shown].astype(int), x[shown].astype(int)]
    return inside.reshape(grid.shape)


def silhouette_bounds(views: Views) -> Float[np.ndarray, "2 3"]:
    """Box [m] around what the silhouettes allow, near the point that the cameras look at."""
    center = focus(views.cameras)
    # Radius about that point which every picture still shows
    reach = np.inf
    for camera in views.cameras:
        half = np.array(camera.size[::-1]) / 2
        widest = float((half / np.hypot(camera.focal, half)).max())
        reach = min(reach, float(np.linalg.norm(center - camera.position)) * widest)
    grid = Grid.around(np.stack([center - reach, center + reach]), cells=HULL_CELLS, pad=0)
    cells = np.argwhere(silhouette_hull(views, grid))
    if not len(cells):
        raise InputError("radiance.silhouettes_nothing")
    low, high = grid.to_world(cells.min(axis=0)), grid.to_world(cells.max(axis=0))
    return np.stack([low - HULL_PAD * grid.h, high + HULL_PAD * grid.h])


def focus(cameras: Sequence[Camera]) -> Float[np.ndarray, "3"]:
    """Point [m] with the least squared distance to all optical axes."""
    across = [np.eye(3) - np.outer(c.pose[:3, 2], c.pose[:3, 2]) for c in cameras]
    right = sum(a @ c.position for a, c in zip(across, cameras, strict=True))
    # Parallel axes leave the point free along them: the smallest solution is as good as any.
    return np.linalg.lstsq(np.sum(across, axis=0), np.asarray(right), rcond=None)[0]


def _render(
    depth: torch.Tensor,
    colour: torch.Tensor,
    rays: _Pixels,
    grid: Grid,
    generator: torch.Generator | None = None,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Premultiplied colour (n, 3) and opacity (n,) of rays; samples jitter with a generator.

    ``depth`` is the optical depth of a cell, per length of its edge.
    """
    import torch
    import torch.nn.functional as F

    low, high = torch.tensor(grid.lo).float(), torch.tensor(grid.hi).float()
    step = grid.h / SAMPLES_PER_CELL
    safe = torch.where(rays.directions.abs() < 1e-9, 1e-9, rays.directions)  # never parallel
    times = (torch.stack([low, high])[:, None] - rays.origins) / safe
    enter = times.amin(dim=0).amax(dim=1).clamp(min=0)
    count = int(np.ceil(np.linalg.norm(grid.hi - grid.lo) / step))
    offset = torch.full((len(enter), 1), 0.5)
    if generator is not None:
        offset = torch.rand(len(enter), 1, generator=generator)
    along = enter[:, None] + (torch.arange(count) + offset) * step
    points = rays.origins[:, None] + along[..., None] * rays.directions[:, None]
    # Coordinates of grid_sample: -1 and 1 are the grid's faces, cell centres lie between.
    where = (2 * (points - low) / (high - low) - 1)[None, None]
    inside = (where.abs() <= 1).all(dim=-1)[0, 0]
    layers = torch.cat([depth, colour], dim=1)
    found = F.grid_sample(layers, where, align_corners=False, padding_mode="border")[0, :, 0]
    behind = torch.cumsum(found[0] * inside / SAMPLES_PER_CELL, dim=1)
    light = torch.exp(-F.pad(behind, (1, 0)))
    share = light[:, :-1] - light[:, 1:]
    return torch.einsum("ns,kns->nk", share, found[1:]), 1 - light[:, -1]
