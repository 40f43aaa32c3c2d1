"""Pinhole cameras around an object: made on a hemisphere, or read from a transforms.json."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ...fem.scene.up import UpAxis, up_vector

FIELD_OF_VIEW = np.deg2rad(40.0)  # of the made cameras: a portrait lens, little distortion
MARGIN = 1.05  # share of the image that the bounding sphere leaves free around itself
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
Pixels = tuple[float, float]  # (x, y) [px]
RING_HEIGHT = 0.25  # a little above the horizon: 14 degrees
PIXELS = 256  # side of a made image: 15 of them are a million rays


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera; its own axes are x right, y up, looking along -z.

    Parameters
    ----------
    pose
        Camera to world, shape (4, 4): rotation and position [m].
    focal
        Focal lengths (x, y) [px].
    center
        Principal point (x, y) [px] from the upper left corner.
    size
        Image (height, width) [px].
    """

    pose: Float[np.ndarray, "4 4"]
    focal: tuple[float, float]
    center: tuple[float, float]
    size: tuple[int, int]

    @property
    def position(self) -> Float[np.ndarray, "3"]:
        """Centre of projection [m]."""
        return self.pose[:3, 3]

    def resized(self, height: int, width: int) -> Camera:
        """Return the same camera with another number of pixels over the same field of view."""
        fy, fx = height / self.size[0], width / self.size[1]
        focal = (self.focal[0] * fx, self.focal[1] * fy)
        center = (self.center[0] * fx, self.center[1] * fy)
        return Camera(self.pose, focal, center, (height, width))

    def framing(self, points: Float[np.ndarray, "n 3"], *, rim: float) -> Camera:
        """Return the same camera with all points [m] in its picture, less a ``rim`` as a share."""
        seen = self.project(points)[:, :2]
        low, high = seen.min(axis=0), seen.max(axis=0)
        height, width = self.size
        zoom = (1 - 2 * rim) * float(np.min([width, height] / np.maximum(high - low, 1e-9)))
        x, y = [width, height] - (low + high - 2 * np.array(self.center)) * zoom
        focal = (zoom * self.focal[0], zoom * self.focal[1])
        return Camera(self.pose, focal, (float(x) / 2, float(y) / 2), self.size)

    def directions(self) -> Float[np.ndarray, "height width 3"]:
        """Unit direction in the world of the ray through every pixel centre."""
        rows, columns = np.meshgrid(*(np.arange(n) + 0.5 for n in self.size), indexing="ij")
        x = (columns - self.center[0]) / self.focal[0]
        y = (self.center[1] - rows) / self.focal[1]
        rays = np.stack([x, y, -np.ones_like(x)], axis=-1) @ self.pose[:3, :3].T
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True)

    def project(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Pixel position (x, y) [px] of points [m] and their depth along the optical axis [m]."""
        local = (points - self.position) @ self.pose[:3, :3]
        depth = -local[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            x = self.center[0] + self.focal[0] * local[:, 0] / depth
            y = self.center[1] - self.focal[1] * local[:, 1] / depth
        return np.stack([x, y, depth], axis=1)


class Shot(NamedTuple):
    """A photograph's file and the camera that took it."""

    path: Path
    camera: Camera


def hemisphere(
    bounds: Float[np.ndarray, "2 3"],
    *,
    count: int = 15,
    lower: int = 0,
    up: UpAxis = "z",
    pixels: int = PIXELS,
) -> tuple[Camera, ...]:
    """Return cameras spread evenly over the upper hemisphere of a box, looking at its centre.

    A spiral of golden angles with even steps of height gives every camera the same solid angle.

    Parameters
    ----------
    bounds
        Lower and upper corner [m] of the object, shape (2, 3).
    count
        Cameras above the horizon (AutoPhyX 3.3: 15).
    lower
        Further cameras below the horizon.
    up
        Axis that points up.
    pixels
        Side of the square images.
    """
    cameras = []
    for i in range(count + lower):
        height = (i + 0.5) / count if i < count else -(i - count + 0.5) / lower
        cameras.append(_around(bounds, height, i * GOLDEN_ANGLE, up=up, pixels=pixels))
    return tuple(cameras)


def ring(
    bounds: Float[np.ndarray, "2 3"],
    *,
    count: int,
    height: float = RING_HEIGHT,
    up: UpAxis = "z",
    pixels: int = PIXELS,
) -> tuple[Camera, ...]:
    """Return cameras evenly around a box [m], all at sin(elevation) ``height``, looking at it."""
    return tuple(
        _around(bounds, height, 2 * np.pi * i / count, up=up, pixels=pixels) for i in range(count)
    )


def _around(bounds: np.ndarray, height: float, turn: float, *, up: UpAxis, pixels: int) -> Camera:
    """A camera whose picture holds the sphere about a box, ``turn`` [rad] about its upright."""
    center, radius = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0])) / 2
    distance = MARGIN * radius / np.sin(FIELD_OF_VIEW / 2)
    axis = up_vector(up)
    side = np.roll(axis, 1)
    level = np.cos(turn) * side + np.sin(turn) * np.cross(axis, side)
    outward = np.sqrt(1 - height**2) * level + height * axis
    return look_at(center + distance * outward, center, up=up, pixels=pixels)


def look_at(
    position: Float[np.ndarray, "3"],
    target: Float[np.ndarray, "3"],
    *,
    up: UpAxis = "z",
    pixels: int = PIXELS,
    field_of_view: float = FIELD_OF_VIEW,
) -> Camera:
    """Return a square camera at ``position`` [m] that looks at ``target`` [m]."""
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross(up_vector(up), back)
    if np.linalg.norm(right) < 1e-6:  # straight from above: any upright will do
        right = np.roll(up_vector(up), 1)
    right = right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(back, right), back, position], axis=1)
    focal = pixels / 2 / np.tan(field_of_view / 2)
    return Camera(pose, (focal, focal), (pixels / 2, pixels / 2), (pixels, pixels))


def read_transforms(path: str | Path) -> tuple[Shot, ...]:
    """Read the photographs and cameras of a ``transforms.json`` (NeRF's convention).

    Intrinsics may stand once for all frames or in each: ``fl_x``, ``fl_y``, ``cx``, ``cy`` [px], or
    ``camera_angle_x`` [rad]; what is missing is a centred, square-pixel camera.

    Raises
    ------
    InputError
        Where the file or a photograph is missing or invalid, or lies outside the file's folder.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no readable transforms.json: {error}") from error
    frames = document.get("frames") if isinstance(document, dict) else None
    if not isinstance(frames, list) or not frames:
        raise InputError(f"{path}: wanted a list 'frames' with at least one photograph")
    return tuple(_shot(path, number, {**document, **frame}) for number, frame in enumerate(frames))


def _shot(path: Path, number: int, frame: dict[str, Any]) -> Shot:
    from PIL import Image

    try:
        photo = _photograph(path.parent, str(frame["file_path"]))
        pose = np.array(frame["transform_matrix"], dtype=np.float64)
        with Image.open(photo) as image:
            width, height = image.size
        focal, center = _intrinsics(frame, width, height)
    except (KeyError, TypeError, ValueError, ZeroDivisionError, OSError) as error:
        raise InputError(f"{path}: frame {number} is not usable: {error!r}") from error
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise InputError(f"{path}: frame {number} needs a finite 4 x 4 transform_matrix")
    return Shot(photo, Camera(pose, focal, center, (height, width)))


def _intrinsics(frame: dict[str, Any], width: int, height: int) -> tuple[Pixels, Pixels]:
    """Focal lengths and centre, each (x, y) [px] of the photograph; the file's may be others."""
    w = float(frame.get("w", width))
    h = float(frame.get("h", height * w / width))
    if "fl_x" in frame:
        focal = float(frame["fl_x"]), float(frame.get("fl_y", frame["fl_x"]))
    else:
        focal = (w / 2 / np.tan(float(frame["camera_angle_x"]) / 2),) * 2
    center = float(frame.get("cx", w / 2)), float(frame.get("cy", h / 2))
    across, down = width / w, height / h
    return (focal[0] * across, focal[1] * down), (center[0] * across, center[1] * down)


def _photograph(folder: Path, name: str) -> Path:
    """The file of a frame, which NeRF's own data sets name without a suffix."""
    for candidate in (folder / name, folder / f"{name}.png", folder / f"{name}.jpg"):
        if candidate.is_file():
            if not candidate.resolve().is_relative_to(folder.resolve()):
                raise InputError(f"{name} lies outside {folder}: move the photographs beside it")
            return candidate
    raise InputError(f"photograph {name} is missing in {folder}")
