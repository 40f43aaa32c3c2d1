"""What holds, grips, twists or stops particles on the nodes of the grid, and what pushes them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..errors import InputError
from ..mesh import TetMesh, face_areas, face_normals
from ..scene.obstacles import Distance, Obstacle, Plane
from ..scene.scene import Scene
from ..scene.supports import Supports
from ..scene.up import up_index

# How far held faces hold nodes inside the body [spacings]: on average over all places of a face
# between two nodes the last held one lies 0.16 spacings inside, where bars get their length.
DEPTH = 0.66
# Room around the body [over its longest side] in which particles may move: a held one, or on a grid
# of more cells than so many; and one that flies, bounces and tips over.
ROOM, FREE_ROOM, MOST_FREE = 0.5, 1.0, 64
# And around a held point. A node beside a held face is held with the body next to it: with what of
# that lies by the face, but for half a spacing.
AROUND, BESIDE = 0.6, 0.5
# The last step of a flight, over the whole time: what is left of it is followed.
LEAST_FLIGHT = 1e-3
# A body falls as one until it is so near to an obstacle [spacings]: weights reach two.
CLEAR = 3.0


class Touch(IntEnum):
    """What a wall does: it lets slide, holds altogether, or lets go and brakes by friction."""

    SLIP = 0
    STICKY = 1
    SEPARATE = 2


@dataclass(frozen=True, kw_only=True)
class Wall:
    """A rigid thing in the grid: nodes inside its ``shape`` follow it.

    shape: Plane, box, ball, capsule or another ``Obstacle``; it moves at its own velocity.
    touch: What it does to matter: a grip is sticky, a slide slips, the ground separates.
    friction: Coefficient of Coulomb friction [1] where it separates.
    axis: The only axis along which it holds or slides; None: by the normals of the shape.
    """

    shape: Obstacle
    touch: Touch = Touch.SEPARATE
    friction: float = 0.0
    axis: int | None = None

    def __post_init__(self) -> None:
        numbers = [self.friction, *self.shape.velocity]
        if not (np.isfinite(numbers).all() and self.friction >= 0):
            raise InputError("boundaries.wall_wanted", value=self)

    @property
    def moves(self) -> bool:
        """Whether other nodes lie in it later."""
        return bool(np.any(self.shape.velocity))

    def at(
        self, grid: BackgroundGrid, nodes: Int[np.ndarray, "nodes"], time: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes of ``nodes`` in it at ``time`` [s], its normals there and velocities [m/s]."""
        # A node on the surface is in the wall, whatever the last digit of its place.
        distance = self.distance(grid.positions(nodes), time)
        inside = distance.gap <= 1e-9 * grid.spacing
        normals = distance.normal[inside]
        velocity = np.asarray(self.shape.velocity, dtype=float)
        return nodes[inside], normals, np.tile(velocity, (len(normals), 1))

    def distance(self, x: Float[np.ndarray, "n 3"], time: float) -> Distance:
        """Distance [m] of places [m] from it at ``time`` [s], by the normals that it acts along."""
        gap, normal = self.shape.distance(x - np.multiply(self.shape.velocity, time))
        if self.axis is not None:
            normal = np.tile(np.eye(3)[self.axis], (len(x), 1))
        return Distance(gap, normal)


@dataclass(frozen=True, eq=False)
class FixedPlaces:
    """Where a body is held: outside of its held faces, and around its held points.

    ``samples`` [m] on held faces and their outward ``normals``; ``points`` [m] of no held face;
    ``body`` [m] are places in the body, ``spacing`` [m] is that of the grid, ``velocity`` [m/s]
    that of what holds.
    """

    samples: Float[np.ndarray, "m 3"]
    normals: Float[np.ndarray, "m 3"]
    points: Float[np.ndarray, "k 3"]
    body: Float[np.ndarray, "n 3"]
    spacing: float
    velocity: Sequence[float] = (0.0, 0.0, 0.0)

    def distance(self, x: Float[np.ndarray, "n 3"]) -> Distance:
        """Distance from the held room: nodes in it down to ``DEPTH`` spacings inside the body."""
        from scipy.spatial import KDTree

        gap, normal = np.full(len(x), np.inf), np.zeros_like(x)
        if len(self.samples):
            row = KDTree(self.samples).query(x)[1]
            normal = -self.normals[row]
            along = -((x - self.samples[row]) * normal).sum(axis=1)
            way = self.body[KDTree(self.body).query(x)[1]] - self.samples[row]
            side = np.linalg.norm(way - (way * normal).sum(axis=1)[:, None] * normal, axis=1)
            gap = np.maximum(-(along + DEPTH * self.spacing), side - BESIDE * self.spacing)
        if len(self.points):
            gap = np.minimum(gap, KDTree(self.points).query(x)[0] - AROUND * self.spacing)
        return Distance(gap, normal)


def scene_room(scene: Scene, cells: int) -> BackgroundGrid:
    """Grid of ``cells`` along the longest side: around the body, and down to planes it falls on.

    Its nodes lie on the body's sides, and ``CLAMP_OFFSET`` inside its largest fixed face along
    every axis; between two fixed faces the spacing is a little less, so that both get them there.
    """
    low, high = scene.mesh.bounds
    free = not scene.held.fixed.any() and cells <= MOST_FREE
    spacing, side = scene.longest / cells, (FREE_ROOM if free else ROOM) * scene.longest
    held, faces = scene.held.fixed, scene.mesh.boundary.faces
    areas, normals = face_areas(scene.mesh.points, faces), face_normals(scene.mesh.points, faces)
    fixed: dict[int, list[tuple[float, float, float]]] = {}  # by axis: area, place, way out
    for axis, way in itertools.product(range(3), (-1.0, 1.0)):
        along = (way * normals[:, axis] > 1 - 1e-6) & held[faces, axis].all(axis=1)
        if along.any():
            places = scene.mesh.points[faces[along, 0], axis]
            place = way * float((way * places).max())
            fixed.setdefault(axis, []).append((float(areas[along].sum()), place, way))
    for (_, below, _), (_, above, _) in (f for f in fixed.values() if len(f) == 2):
        if (apart := above - below) > spacing:
            spacing = apart / (np.ceil(apart / spacing - 2 * CLAMP_OFFSET) + 2 * CLAMP_OFFSET)
            break
    planes = {axis: float(low[axis]) for axis in range(3)}
    for axis, places in fixed.items():
        _, place, way = max(places)
        planes[axis] = place - way * CLAMP_OFFSET * spacing
    reach = [low - side, high + side]
    for wall in (*scene.obstacles, *([scene.ground] if scene.ground else [])):
        if isinstance(wall, Plane):
            normal = np.asarray(wall.normal, dtype=float) / np.linalg.norm(wall.normal)
            corner = np.where(normal < 0, high, low)
            foot = corner + normal * min(0.0, float((np.asarray(wall.point) - corner) @ normal))
            reach.append(foot)
    first, k = next(iter(scene.obstacles), None), up_index(scene.up)
    if isinstance(first, Plane) and abs(first.normal[k]) > 1 - 1e-9:
        planes[k] = float(first.point[k])
    return grid_around(np.min(reach, axis=0), np.max(reach, axis=0), spacing, planes=planes)


def flight_time(
    x: Float[np.ndarray, "n 3"],
    obstacles: Sequence[Obstacle],
    velocity: Float[np.ndarray, "3"],
    gravity: Float[np.ndarray, "3"],
    duration: float,
    *,
    room: float,
) -> float:
    """How long [s] places ``x`` [m] fly as one until they are within ``room`` [m] of an obstacle.

    By steps that are too short to come nearer than that; at most ``duration`` [s].
    """
    time = 0.0
    while obstacles and time < duration:
        now, moved = velocity + time * gravity, time * velocity + time**2 / 2 * gravity
        left, fastest = np.inf, 0.0
        for one in obstacles:
            wall = np.asarray(one.velocity, dtype=float)
            left = min(left, float(one.distance(x + moved - time * wall).gap.min()) - room)
            fastest = max(fastest, float(np.linalg.norm(now - wall)))
        pull = float(np.linalg.norm(gravity))
        # (v + a t / 2) t is the farthest way of a time t
        step = 2 * left / (fastest + np.sqrt(fastest**2 + 2 * pull * max(left, 0.0)) + 1e-300)
        if step < LEAST_FLIGHT * duration:
            return time
        time += step
    return duration


def support_boundaries(
    mesh: TetMesh,
    supports: Supports,
    rest: Float[np.ndarray, "particles 3"],
    spacing: float,
    duration: float,
) -> tuple[Wall, ...]:
    """Walls of the supports of a mesh; prescribed displacements are reached after ``duration`` [s].

    ``rest`` are the places [m] of its particles, on a grid of ``spacing`` [m].
    ``InputError`` where there are springs.
    """
    if supports.springs.any():
        raise InputError("boundaries.springs_material")
    rows = np.concatenate([supports.fixed, supports.values * supports.fixed], axis=1)
    kinds, which = np.unique(rows, axis=0, return_inverse=True)
    walls = []
    for k, row in enumerate(kinds):
        axes, velocity = np.flatnonzero(row[:3]), tuple((row[3:] / duration).tolist())
        if not len(axes):
            continue
        fixed = which.reshape(-1) == k
        faces = mesh.boundary.faces
        faces = faces[fixed[faces].all(axis=1)]
        samples, of = _face_samples(mesh.points, faces, spacing / 2)
        normals = face_normals(mesh.points, faces)[of]
        fixed[faces] = False
        place = FixedPlaces(samples, normals, mesh.points[fixed], rest, spacing, velocity)
        if len(axes) == 3:
            walls.append(Wall(shape=place, touch=Touch.STICKY))
        for axis in axes if len(axes) < 3 else ():
            walls.append(Wall(shape=place, touch=Touch.SLIP, axis=int(axis)))
    return tuple(walls)


def _face_samples(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"], step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Places on faces that are at most ``step`` [m] apart, and the face of each."""
    corners = points[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    parts = np.maximum(np.ceil(edges / step), 1).astype(np.int64)
    places, owners = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int64)]
    for n in np.unique(parts):
        some = np.flatnonzero(parts == n)
        a, b = (g.ravel() for g in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
        weights = np.stack([a, b, n - a - b], axis=1)[a + b <= n] / n
        places.append(np.einsum("sk,fki->fsi", weights, corners[some]).reshape(-1, 3))
        owners.append(np.repeat(some, len(weights)))
    return np.concatenate(places), np.concatenate(owners)


# The background grid: where it lies, how fine it is, which of its nodes are near particles.

# Fixed nodes of a plane clamp lie this fraction of a spacing inside the body: at the clamp itself
# they make it longer by 0.15 spacings (hanging bars of 8 to 32 cells).
CLAMP_OFFSET = 0.16
# Nodes around the room of the particles: their own weights, and a spacing of drift.
MARGIN = 4
# And around particles that the grid was moved to: it is not moved soon again.
SLACK = 16
# Nodes of a grid: 32 bytes each, two grids with two threads.
MOST_NODES = 30_000_000


class BackgroundGrid(NamedTuple):
    """Nodes ``spacing`` [m] apart from ``origin`` (3,) [m] on, ``shape`` (3,) of them."""

    origin: np.ndarray
    spacing: float
    shape: tuple[int, int, int]

    @property
    def count(self) -> int:  # type: ignore  (that of a tuple, which nobody counts in)
        """Number of nodes."""
        return int(np.prod(self.shape))

    def first_nodes(self, x: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n 3"]:
        """Lowest of the 27 nodes around every position [m]."""
        return np.floor((x - self.origin) / self.spacing - 0.5).astype(np.int64)

    def positions(self, numbers: Int[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of nodes by number."""
        return self.origin + self.spacing * np.stack(np.unravel_index(numbers, self.shape), axis=1)

    def holds(self, x: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Which positions [m] have all of their 27 nodes in the grid."""
        first = self.first_nodes(x)
        return np.asarray(((first >= 0) & (first < np.array(self.shape) - 2)).all(axis=1))

    def around(
        self, bounds: Float[np.ndarray, "2 3"], kept: Int[np.ndarray, "nodes"]
    ) -> BackgroundGrid | None:
        """Grid of the same places of nodes, elsewhere, where a box [m] comes near to the border.

        The nodes ``kept`` stay in it. None where this one does, or the other would not fit.
        """
        low, high = self.first_nodes(bounds)
        high = high + 2
        if (low >= 1).all() and (high < np.array(self.shape) - 1).all():
            return None
        still = np.stack(np.unravel_index(kept, self.shape), axis=1)
        low = np.minimum(low - SLACK, still.min(axis=0, initial=np.iinfo(np.int64).max))
        high = np.maximum(high + SLACK, still.max(axis=0, initial=np.iinfo(np.int64).min))
        shape = high - low + 1
        if np.prod(shape.astype(float)) > MOST_NODES:
            return None
        return BackgroundGrid(self.origin + self.spacing * low, self.spacing, tuple(shape.tolist()))


def grid_around(
    low: Sequence[float] | np.ndarray,
    high: Sequence[float] | np.ndarray,
    spacing: float,
    *,
    planes: dict[int, float] | None = None,
) -> BackgroundGrid:
    """Grid around the room from ``low`` to ``high`` [m] in which particles may move.

    ``planes`` are positions [m] by axis that a layer of nodes shall lie at.

    Raises InputError: Where the room is not finite, or the grid would not fit into memory.
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if not (np.isfinite([*low, *high]).all() and (high >= low).all() and spacing > 0):
        raise InputError("boundaries.grid_every", low=low, high=high, spacing=spacing)
    origin = low - MARGIN * spacing
    for axis, at in (planes or {}).items():
        origin[axis] = at - np.ceil((at - origin[axis]) / spacing - 1e-9) * spacing
    shape = np.ceil((high - origin) / spacing - 1e-9).astype(np.int64) + MARGIN + 1
    if np.prod(shape.astype(float)) > MOST_NODES:
        raise InputError(
            "boundaries.grid_nodes", shape="x".join(map(str, shape)), most_nodes=MOST_NODES
        )
    return BackgroundGrid(origin, float(spacing), (int(shape[0]), int(shape[1]), int(shape[2])))
