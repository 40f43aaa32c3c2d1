"""A small ray tracer: a coloured surface on a white ground in soft daylight, no GPU, no display."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.up import UpAxis, up_vector
from ...predictors.appearance.surface import to_linear, to_srgb
from ...predictors.appearance.views import Camera

SMOOTH_COSINE = np.cos(np.deg2rad(40))  # sharper edges than this are drawn sharp
SMOOTHING = 2  # rays per pixel along each side
# Light on a white surface: from all around, and from the sun when it faces it.
SKY, SUN = 0.62, 0.62
SUN_SPREAD = 0.12  # half width of the sun as seen from the ground, in radians: soft shadows
LIFT = 1e-4  # rays leave the surface this far above it, as a share of its size: it hides not itself
# Steps of a sequence that fills the unit square evenly (powers of the plastic number).
PLASTIC = (0.7548776662466927, 0.5698402909980532)
GROUND_REACH = 1.6  # radius of the shadows on the ground, in sizes of the object


@dataclass(frozen=True, eq=False)
class ColouredSurface:
    """Triangles with a colour (sRGB, [0, 1]) at every corner.

    ``points`` [m] (points, 3), ``faces`` (faces, 3) point ids, ``colors`` (faces, 3 corners, 3).
    """

    points: Float[np.ndarray, "points 3"]
    faces: Int[np.ndarray, "faces 3"]
    colors: Float[np.ndarray, "faces 3 3"]

    @cached_property
    def triangles(self) -> Float[np.ndarray, "faces 3 3"]:
        """Corners [m] of every face."""
        return self.points[self.faces]

    @cached_property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m]."""
        corners = self.triangles.reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @cached_property
    def areas(self) -> Float[np.ndarray, "faces 3"]:
        """Normal of every face, as long as twice its area [m^2]."""
        a, b, c = self.triangles.transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @cached_property
    def corner_normals(self) -> Float[np.ndarray, "faces 3 3"]:
        """Unit normal at every corner: the mean over the faces around that turn gently."""
        from scipy.sparse import csr_matrix

        area = self.areas
        normal = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)
        count = len(self.faces)
        corner = csr_matrix(
            (np.ones(3 * count), (np.repeat(np.arange(count), 3), self.faces.ravel())),
            shape=(count, len(self.points)),
        )
        result = np.repeat(area[:, None], 3, axis=1)
        for k in range(3):
            around = (corner[:, self.faces[:, k]].T).tocoo()  # rows: faces, columns: their fellows
            gentle = np.einsum("ij,ij->i", normal[around.row], normal[around.col]) > SMOOTH_COSINE
            row, col = around.row[gentle], around.col[gentle]
            result[:, k] = csr_matrix((np.ones(len(row)), (row, col)), (count, count)) @ area
        return result / np.maximum(np.linalg.norm(result, axis=2, keepdims=True), 1e-300)


def trace(
    surface: ColouredSurface,
    camera: Camera,
    *,
    up: UpAxis = "z",
    ground: float | None = None,
    samples: int = 6,
) -> Float[np.ndarray, "height width 3"]:
    """Picture (sRGB, [0, 1]) of a surface on white ground.

    surface: What is seen.
    camera: Where it is seen from; its size is the picture's.
    up: Axis that points up.
    ground: Height [m] of the ground, by default where the surface is lowest.
    samples: Rays towards the sky from each point that a ray meets.
    """
    fine = camera.resized(*(SMOOTHING * side for side in camera.size))
    light = _Daylight(surface, up_vector(up), ground, np.random.default_rng(0))
    pixels = light.picture(fine, samples)
    height, width = camera.size
    blocks = pixels.reshape(height, SMOOTHING, width, SMOOTHING, 3)
    return to_srgb(np.clip(blocks.mean(axis=(1, 3)), 0, 1))


class _Daylight:
    """The surface in its light, with lengths in sizes of the surface (for float32)."""

    def __init__(self, surface: ColouredSurface, up, ground: float | None, rng) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.surface, self.up, self.rng = surface, up, rng
        lo, hi = surface.bounds
        self.center, self.size = (lo + hi) / 2, float(np.linalg.norm(hi - lo)) or 1.0
        floor = min(up @ lo, up @ hi) if ground is None else ground
        self.floor = (floor - up @ self.center) / self.size
        self.scene = EmbreeScene()
        triangles = ((surface.triangles - self.center) / self.size).astype(np.float32)
        self._alive = TriangleMesh(self.scene, triangles)  # embree reads its memory

    def picture(self, camera: Camera, samples: int) -> np.ndarray:
        """Linear colour (height * width, 3) of every pixel."""
        origin = (camera.position - self.center) / self.size
        rays = camera.directions().reshape(-1, 3)
        hit = self.scene.run(
            np.broadcast_to(origin, rays.shape).astype(np.float32),
            rays.astype(np.float32),
            query="INTERSECT",
            output=True,
        )
        pixels = np.ones((len(rays), 3))
        seen = np.flatnonzero(hit["primID"] >= 0)
        face = hit["primID"][seen].astype(np.int64)
        u, v = (hit[name][seen].astype(np.float64) for name in "uv")
        weights = np.stack([1 - u - v, u, v], axis=1)
        at = origin + hit["tfar"][seen, None].astype(np.float64) * rays[seen]
        normal = np.einsum("nc,nck->nk", weights, self.surface.corner_normals[face])
        turned = np.einsum("nk,nk->n", self.surface.areas[face], rays[seen])
        normal *= -np.sign(turned)[:, None]  # both sides of a face are lit
        color = to_linear(np.einsum("nc,nck->nk", weights, self.surface.colors[face]))
        pixels[seen] = color * self._light(at, normal, samples)[:, None]
        # Darken the white ground where the object takes light from it, fading with distance
        free = hit["primID"] < 0
        down = -(rays @ self.up)
        below = np.flatnonzero(free & (down > 1e-6) & (origin @ self.up > self.floor))
        travelled = (origin @ self.up - self.floor) / down[below]
        at = origin + travelled[:, None] * rays[below]
        away = np.linalg.norm(at - self.floor * self.up, axis=1) / GROUND_REACH
        near = away < 1
        at, below = at[near], below[near]
        normal = np.broadcast_to(self.up, at.shape)
        open_light = SKY * _sky(2 / 3) + SUN * (self._sun() @ self.up)  # 2/3: Lambert's mean height
        shadow = 1 - np.minimum(self._light(at, normal, samples) / open_light, 1)
        pixels[below] = (1 - shadow * (1 - away[near] ** 2))[:, None]
        return pixels

    def _light(self, at, normal, samples: int) -> np.ndarray:
        """Light on a white surface: the free share of a bright sky, and the sun if it is seen."""
        start = (at + LIFT * normal).astype(np.float32)
        sky, sun = np.zeros(len(at)), np.zeros(len(at))
        base = self.rng.random((len(at), 2))
        facing = normal @ self._sun()
        lit = np.flatnonzero(facing > 0)
        for i in range(samples):
            pair = (base + i * np.array(PLASTIC)) % 1
            height, turn = 2 * pair[:, 0] - 1, 2 * np.pi * pair[:, 1]
            ring = np.sqrt(1 - height**2)
            ball = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
            towards = normal + 0.999 * ball  # Lambert: the cosine is in the density
            towards /= np.linalg.norm(towards, axis=1, keepdims=True)
            sky += self._free(start, towards) * _sky(towards @ self.up)
            seen = self._free(start[lit], self._sun() + SUN_SPREAD * ball[lit])
            sun[lit] += seen * facing[lit]
        return (SKY * sky + SUN * sun) / samples

    def _sun(self) -> np.ndarray:
        """Direction of the sun: high, to the right of the usual first look."""
        side = np.roll(self.up, 1)
        sun = 1.0 * self.up + 0.75 * side - 0.15 * np.cross(self.up, side)
        return sun / np.linalg.norm(sun)

    def _free(self, start, towards) -> np.ndarray:
        hit = self.scene.run(start, towards.astype(np.float32), query="OCCLUDED")
        return (hit < 0).astype(np.float64)


def _sky(height):
    """Brightness of the sky at a height (sine of the elevation), 1 overhead, dimmer to the side."""
    return (1 + 0.35 * height) / 1.35
