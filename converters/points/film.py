"""Films of moving splats: they fill the frame, which follows them, over a ground with their shadow.

The file is written frame by frame and valid after each: what was drawn stays when it is stopped.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...fem.errors import InputError
from ...fem.scene.up import UpAxis, up_vector
from ...predictors.appearance.views import Camera, ring
from ..files import writing
from .gaussians import Gaussians, gaussians, matrices_of
from .table import PointTable
from .views import Look, blended, splat_view

if TYPE_CHECKING:
    from PIL.Image import Image

FPS, PIXELS, RIM = 30, 512, 0.07
# Splats that a camera is chosen by, cameras that are tried, and the side [px] of what they see.
FEW, TRIED, SMALL = 8_000, 8, 96
# A needle is so many times as long as at rest, beside as many neighbours.
LONG, NEIGHBOURS = 3.0, 8
# Splats beyond these quantiles are strays, and may leave the picture; so do crumbs that fly farther
# from the middle than the body is long.
EDGES = (0.005, 0.995)
# A frame follows a body that would fill less than this share of a frame that stands; it does so
# as smoothly as a mean over this share of the film.
SMALLER, SMOOTH = 0.8, 0.08
# The ground: its grey and that of its lines, half a body's size apart, and how far it is seen
# [sizes]; the sky above it, and a sun to the right of the usual first look.
FLOOR, LINE, SEEN = 0.93, 0.06, 2.2
SKY = np.array([[0.80, 0.86, 0.93], [0.97, 0.975, 0.98]])
SUN = np.array([0.45, 0.25, 1.0])  # along the side, the depth and the up axis
# Cells of the map of shadows, how dark they are, and how they blur: at the ground and per height.
CELLS, DARK, BLUR, SPREAD = 160, 0.5, 1.2, 12.0
SHADED = 30_000  # splats that throw them


class Moved(NamedTuple):
    """Splats in a frame: ``means`` (n, 3) [m], ``roots`` A (n, 3, 3) of Sigma = A A^T, ``opacity``.

    ``turned`` (n, 3, 3) are rotations R: a colour is that which was seen along R^T d.
    """

    means: np.ndarray
    roots: np.ndarray
    opacity: np.ndarray
    turned: np.ndarray | None = None


class Shown:
    """Splats of a table as a film needs them: all that stays of them over the frames."""

    def __init__(self, table: PointTable) -> None:
        found = gaussians(table)
        self.roots = matrices_of(found.rotations) * found.sigmas[:, None, :]
        self.found: Gaussians = found
        self.look = Look.of(table)

    def rest(self) -> Moved:
        """The splats where they are in the table."""
        return Moved(self.found.means, self.roots, self.found.opacity)

    @cached_property
    def around(self) -> Int[np.ndarray, "n k"]:
        """Rows of every splat's neighbours at rest, itself the first."""
        from scipy.spatial import KDTree

        means = self.found.means
        near = KDTree(means).query(means, k=min(NEIGHBOURS + 1, len(means)))[1]
        return near.reshape(len(means), -1)


def needles(shown: Shown, moved: Moved) -> Bool[np.ndarray, "n"]:
    """Splats that are seen longer than ``LONG`` times their rest, beside their neighbours."""

    def longest(roots: np.ndarray) -> np.ndarray:
        return np.sqrt(np.linalg.eigvalsh(roots @ roots.transpose(0, 2, 1))[:, 2])

    ratio = longest(moved.roots) / np.maximum(longest(shown.roots), np.finfo(float).tiny)
    return (ratio > LONG * np.median(ratio[shown.around], axis=1)) & (moved.opacity > 0)


def tracked(
    places: Float[np.ndarray, "seen n 3"], table: PointTable, up: UpAxis, frames: int
) -> list[Camera]:
    """A camera for each of ``frames``, for splats of ``table`` that are known over some ``places``.

    All stand in one place, around the middle, where the splats are seen to move farthest and in
    contrast, at one zoom. Where a frame that stands would show them small, it follows them.
    """
    from scipy.ndimage import gaussian_filter1d

    places = places.copy()
    places[~np.isfinite(places)] = np.nan
    # Strays, and what has no place, are moved in
    low, high = np.nanquantile(places, EDGES, axis=1, keepdims=True)
    middle, far = np.nanmedian(places, axis=1, keepdims=True), np.linalg.norm((high - low)[0])
    low, high = np.maximum(low, middle - far), np.minimum(high, middle + far)
    places = np.clip(np.where(np.isnan(places), low, places), low, high)
    bounds = np.stack([places.min(axis=(0, 1)), places.max(axis=(0, 1))])
    flat = places.reshape(-1, 3)

    def seen(camera: Camera) -> float:
        pixels = camera.project(flat)[:, :2].reshape(*places.shape[:2], 2)
        moved = np.linalg.norm(pixels - pixels[0], axis=2).mean(axis=1).max()
        return float((moved + 1.0) * splat_view(table, camera.framing(flat, rim=RIM)).std())

    best = max(ring(bounds, count=TRIED, up=up, pixels=SMALL), key=seen).resized(PIXELS, PIXELS)
    pixels = best.project(flat)[:, :2].reshape(*places.shape[:2], 2)
    # Edges of the body in every frame, between those that are known
    at = np.linspace(0, len(pixels) - 1, frames)
    first = np.floor(at).astype(int)
    between = (at - first)[:, None]
    low, high = (
        (1 - between) * edge[first] + between * edge[np.minimum(first + 1, len(edge) - 1)]
        for edge in (pixels.min(axis=1), pixels.max(axis=1))
    )
    middle = np.tile((low.min(axis=0) + high.max(axis=0)) / 2, (len(low), 1))
    smooth = SMOOTH * len(low)
    follow = gaussian_filter1d((low + high) / 2, smooth, axis=0, mode="nearest")

    def zoom(centre: np.ndarray) -> float:
        return (0.5 - RIM) * PIXELS / float(np.maximum(high - centre, centre - low).max())

    if zoom(middle) < SMALLER * zoom(follow):
        middle = follow
    scale, half = zoom(middle), PIXELS / 2
    focal = (scale * best.focal[0], scale * best.focal[1])
    at = half + scale * (np.array(best.center) - middle)
    return [Camera(best.pose, focal, (float(x), float(y)), best.size) for x, y in at]


class Stage:
    """What stands around splats: a ground at a height [m] along ``up``, and the sky.

    ``middle`` (3,) and ``size`` [m] are those of the body; without a ``ground`` there is sky alone.
    """

    def __init__(self, middle: np.ndarray, size: float, up: UpAxis, ground: float | None) -> None:
        self.up, self.size, self.ground = up_vector(up), size, ground
        side = np.roll(self.up, 1)
        self.axes = np.stack([side, np.cross(self.up, side)])
        self.sun = SUN @ np.stack([*self.axes, self.up])
        self.middle = self.axes @ middle
        self._empty: tuple[Any, ...] | None = None  # a view, and what is seen without splats

    def behind(self, camera: Camera, moved: Moved) -> Float[np.ndarray, "height width 3"]:
        """Picture of what is behind the splats: the ground with their shadow, and the sky."""
        from scipy.ndimage import map_coordinates

        view = (camera.center, camera.focal, camera.size, camera.pose.tobytes())
        if self._empty is None or view != self._empty[0]:
            self._empty = (view, *self._drawn(camera))
        _, sky, near, grey, fade, at = self._empty
        if self.ground is None:
            return sky
        shadow = map_coordinates(self._shadows(moved), at, order=1, mode="constant")
        floor = (grey * (1 - DARK * shadow))[:, None]
        picture = sky.copy()
        picture[near] += (floor - sky[near]) * fade[:, None]
        return picture

    def _drawn(self, camera: Camera) -> tuple[np.ndarray, ...]:
        """Sky, pixels of the ground; its grey there, how far it hides the sky, and map places."""
        height = np.linspace(0, 1, camera.size[0])[:, None, None]
        sky = np.broadcast_to(SKY[0] + height * (SKY[1] - SKY[0]), (*camera.size, 3))
        if self.ground is None:
            return sky, sky, sky, sky, sky
        # The ray of a pixel is (x, y, -1) to the camera: its part along a way is a sum over them
        x = (np.arange(camera.size[1]) + 0.5 - camera.center[0]) / camera.focal[0]
        y = (camera.center[1] - np.arange(camera.size[0]) - 0.5)[:, None] / camera.focal[1]

        def along(way: np.ndarray) -> np.ndarray:
            right, over, back = way @ camera.pose[:3, :3]
            return right * x + over * y - back

        above, down = float(camera.position @ self.up) - self.ground, along(self.up)
        near = (down < -1e-6) & (above > 0)
        far = -above / down[near]
        ground = [way @ camera.position + far * along(way)[near] for way in self.axes]
        away = (np.stack(ground, axis=1) - self.middle) / self.size
        far = far * np.sqrt(1 + x**2 + y**2)[near]
        fade = np.exp(-(away**2).sum(axis=1) / SEEN**2)
        some = fade > 1e-3  # beyond, the sky alone is seen
        near[near] = some
        far, away, fade = far[some], away[some], fade[some]
        # Lines as wide as a pixel where they are near, and fainter beyond
        cell = np.abs((2 * away + 0.5) % 1 - 0.5)
        pixel = far / (camera.focal[0] * self.size)
        lines = np.clip(1.2 - cell / (2 * pixel[:, None]), 0, 1).max(axis=1)
        index = (away / (2 * SEEN) + 0.5).T * CELLS - 0.5
        return sky, near, FLOOR - LINE * lines, fade, index

    def _shadows(self, moved: Moved) -> Float[np.ndarray, "cells cells"]:
        """Fraction of the sun's light that is taken from the ground, blurred by height."""
        from scipy.ndimage import gaussian_filter

        some = slice(None, None, max(1, len(moved.means) // SHADED))
        means, opacity = moved.means[some], moved.opacity[some]
        good = np.isfinite(means).all(axis=1) & (opacity > 0)
        means, opacity = means[good], opacity[good]
        height = np.maximum(means @ self.up - self.ground, 0.0)
        foot = (means - height[:, None] * self.sun / (self.sun @ self.up)) @ self.axes.T
        width = 2 * SEEN * self.size / CELLS
        index = np.floor((foot - self.middle) / width + CELLS / 2).astype(int)
        # Area that a splat covers, all of them together that of those it stands for
        area = 2 * np.pi * (moved.roots[some][good] ** 2).sum(axis=(1, 2)) / 3
        cover = opacity * area * (len(moved.means) / max(len(means), 1)) / width**2
        inside = ((index >= 0) & (index < CELLS)).all(axis=1)
        taken, layers = np.zeros((CELLS, CELLS)), np.array([0.0, 0.1, 0.3, 1.0, np.inf])
        for low, high in pairwise(layers):
            mine = inside & (height >= low * self.size) & (height < high * self.size)
            if mine.any():
                depth = np.zeros((CELLS, CELLS))
                np.add.at(depth, tuple(index[mine].T), cover[mine])
                blur = BLUR + SPREAD * float(height[mine].mean()) / self.size
                taken = np.maximum(taken, gaussian_filter(1 - np.exp(-depth), blur))
        return taken


def picture(
    shown: Sequence[Shown],
    moved: Sequence[Moved],
    camera: Camera,
    stage: Stage,
    titles: Sequence[str] = (),
) -> Image:
    """A frame: bodies side by side, each as ``camera`` sees it, under its title."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = camera.size
    sheet = Image.new("RGB", (width * len(shown), height))
    for i, (body, now) in enumerate(zip(shown, moved, strict=True)):
        away = now.means - camera.position
        if now.turned is not None:
            away = np.einsum("nji,nj->ni", now.turned, away)
        drawn = blended(now.means, now.roots, now.opacity, body.look.seen(away), camera,
                        stage.behind(camera, now))  # fmt: skip
        sheet.paste(Image.fromarray((255 * drawn).round().astype(np.uint8)), (i * width, 0))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(18)
    for i, title in enumerate(titles):
        draw.text((i * width + 14, 12), title, fill=(50, 55, 65), font=font)
    return sheet


class WebP:
    """An animated WebP that is valid after every frame, and goes on where it was left.

    After the container specification: RIFF, VP8X, ANIM, and an ANMF chunk a frame.
    """

    QUALITY = 88
    MOST = 1 << 24  # pixels of a side that the container can state

    def __init__(self, path: Path, size: tuple[int, int], fps: float = FPS) -> None:
        self.path, self.size, self.fps = path, size, fps
        self.frames = self._kept()

    def add(self, image: Image) -> None:
        """Append a frame; until its length is in the header, the file is as it was before."""
        if image.size != self.size:
            raise InputError("film.size", got=image.size, wanted=self.size)
        held = BytesIO()
        image.save(held, "WEBP", quality=self.QUALITY, method=3)
        # Times are whole milliseconds: the ends of frames are rounded, not their lengths
        start, end = (round(1000 * n / self.fps) for n in (self.frames, self.frames + 1))
        body = _u(0, 6) + _u(self.size[0] - 1, 3) + _u(self.size[1] - 1, 3)
        body += _u(end - start, 3) + b"\x02" + held.getvalue()[12:]
        chunk = b"ANMF" + _u(len(body), 4) + body + b"\0" * (len(body) % 2)
        if self.frames:
            with self.path.open("r+b") as file:
                file.seek(0, os.SEEK_END)
                file.write(chunk)
                length = file.tell()
                file.flush()
                file.seek(4)
                file.write(_u(length - 8, 4))
        else:  # a film without a frame is none
            width, height = self.size
            head = b"VP8X" + _u(10, 4) + _u(2, 4) + _u(width - 1, 3) + _u(height - 1, 3)
            head += b"ANIM" + _u(6, 4) + b"\xff" * 4 + _u(0, 2) + chunk  # endlessly repeated
            with writing(self.path) as new:
                new.write_bytes(b"RIFF" + _u(4 + len(head), 4) + b"WEBP" + head)
        self.frames += 1

    def _kept(self) -> int:
        """Whole frames of what was left, of the same size; what follows them is cut off."""
        if not self.path.is_file():
            return 0
        known = self.path.read_bytes()
        end = min(len(known), 8 + int.from_bytes(known[4:8], "little"))
        size = tuple(int.from_bytes(known[i : i + 3], "little") + 1 for i in (24, 27))
        if known[:4] != b"RIFF" or known[12:16] != b"VP8X" or size != self.size:
            return 0
        at, frames = 12, 0
        while at + 8 <= end:
            length = int.from_bytes(known[at + 4 : at + 8], "little")
            frames += known[at : at + 4] == b"ANMF"
            at += 8 + length + length % 2
        with self.path.open("r+b") as file:
            file.truncate(end)
        return frames


def _u(value: int, count: int) -> bytes:
    return value.to_bytes(count, "little")


def write_mp4(path: Path, source: Path) -> Path | None:
    """Write a film (.webp) as .mp4 beside it; None without ``imageio-ffmpeg`` (extra film)."""
    try:
        import imageio_ffmpeg
    except ImportError:
        return None
    from PIL import Image, ImageSequence

    with Image.open(source) as film:
        options: Any = {"fps": FPS, "codec": "libx264", "quality": 8, "macro_block_size": 2}
        writer = imageio_ffmpeg.write_frames(str(path), film.size, **options)
        writer.send(None)
        for frame in ImageSequence.Iterator(film):
            writer.send(np.ascontiguousarray(frame.convert("RGB")))
        writer.close()
    return path
