"""A film of moving splats: one camera that holds the whole motion, from where it is seen best."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ....predictors.asset import UpAxis
from ....predictors.images.cameras import Camera, ring
from ..table import PointTable
from .splat_views import splat_view

# Frames of a film, its side [px], and the share of that left free on each side.
SHOWN, PIXELS, RIM = 24, 384, 0.06
# Splats that a camera is chosen by, cameras that are tried, and the side [px] of what they see.
FEW, TRIED, SMALL = 8_000, 8, 96
# Splats beyond these quantiles are strays, and may leave the picture.
EDGES = (0.005, 0.995)


def thinned(table: PointTable) -> PointTable:
    """At most ``FEW`` splats of a table, evenly taken, to choose a camera by."""
    step = max(1, len(table) // FEW)
    return PointTable({name: np.asarray(v)[::step] for name, v in table.columns.items()})


def chosen_camera(frames: Sequence[PointTable], up: UpAxis) -> Camera:
    """The camera around moving splats that sees them move farthest, and in contrast."""
    places = np.stack([_inner(table.positions) for table in frames])
    all_places = places.reshape(-1, 3)
    bounds = np.stack([all_places.min(axis=0), all_places.max(axis=0)])
    around = ring(bounds, count=TRIED, up=up, pixels=SMALL)
    cameras = [camera.framing(all_places, rim=RIM) for camera in around]

    def seen(camera: Camera) -> float:
        pixels = camera.project(all_places)[:, :2].reshape(*places.shape[:2], 2)
        moved = np.linalg.norm(pixels - pixels[0], axis=2).mean(axis=1).max()
        return float(moved * splat_view(frames[0], camera).std())

    return max(cameras, key=seen).resized(PIXELS, PIXELS)


def _inner(places: np.ndarray) -> np.ndarray:
    """Places with strays, and what has none, moved in."""
    low, high = np.nanquantile(np.where(np.isfinite(places), places, np.nan), EDGES, axis=0)
    return np.clip(np.where(np.isfinite(places), places, low), low, high)


class SplatFilm:
    """A GIF of about ``SHOWN`` of ``frames`` frames, seen by one ``camera``."""

    def __init__(self, camera: Camera, frames: int) -> None:
        self.camera = camera
        self.stride = stride(frames)
        self.sheets: list[Any] = []

    def show(self, number: int, table: PointTable) -> None:
        """Draw a frame, if it is one of those that are shown."""
        from PIL import Image

        if number % self.stride == 0:
            drawn = splat_view(table, self.camera)
            self.sheets.append(Image.fromarray((255 * drawn).round().astype(np.uint8)))

    def save(self, path: Path) -> Path:
        """Write what was shown, two seconds of it, endlessly repeated."""
        each = round(2000 / len(self.sheets))
        self.sheets[0].save(
            path, "GIF", save_all=True, append_images=self.sheets[1:], duration=each, loop=0
        )
        return path


def stride(frames: int) -> int:
    """From a shown frame to the next."""
    return -(-frames // SHOWN)
