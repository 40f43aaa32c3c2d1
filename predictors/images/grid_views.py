"""Pictures of matter on a grid: splats, point clouds and NeRF grids seen without photographs.

Rays are marched through the cells with the transmittance that lifting uses, not rasterised: what a
picture shows is then exactly what lifting explains, and any carrier that gives a density and a
colour per cell can be seen. The price is the resolution of the grid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..asset import UpAxis
from ..grid import Grid
from .cameras import Camera, hemisphere
from .lifting import Rays, ray_weights
from .views import Views

BARE = 1e-3  # opacity below which a pixel has no colour of its own


def render_grid(
    density: Float[np.ndarray, "nx ny nz"],
    colour: Float[np.ndarray, "nx ny nz 3"],
    grid: Grid,
    cameras: Sequence[Camera] | None = None,
    *,
    up: UpAxis = "z",
) -> Views:
    """Render cells of a density [1/m] and a colour (sRGB in [0, 1]).

    The default cameras are 15 on the upper hemisphere of the cells that have density.
    """
    cameras = tuple(cameras or hemisphere(matter_bounds(density, grid), up=up))
    shown = colour[density > 0].astype(np.float64)
    colours, covers = [], []
    for camera in cameras:
        directions = camera.directions().reshape(-1, 3)
        origins = np.broadcast_to(camera.position, directions.shape)
        share = ray_weights(Rays(origins, directions, directions), density, grid)
        cover = np.asarray(share.sum(axis=1)).ravel()
        mean = (share @ shown) / np.maximum(cover, BARE)[:, None]
        colours.append((mean * (cover >= BARE)[:, None]).reshape(*camera.size, 3))
        covers.append(cover.reshape(camera.size))
    return Views(
        cameras,
        colour=np.stack(colours).clip(0, 1).astype(np.float32),
        opacity=np.stack(covers).clip(0, 1).astype(np.float32),
        up=up,
    )


def matter_bounds(density: Float[np.ndarray, "nx ny nz"], grid: Grid) -> Float[np.ndarray, "2 3"]:
    """Box [m] around the cells that have density."""
    cells = np.argwhere(density > 0)
    low, high = grid.to_world(cells.min(axis=0)), grid.to_world(cells.max(axis=0))
    return np.stack([low - grid.h / 2, high + grid.h / 2])
