"""A scene in words and as marks to draw: what holds a body, acts on it and meets it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.mesh import face_areas
from ...fem.scene.loads import Traction, resultant
from ...fem.scene.obstacles import Box, Capsule, Obstacle, Plane, Sphere
from ...fem.scene.scene import Hold, Scene
from ...fem.scene.up import up_vector
from .verdict import area_words, si

Kind = Literal["support", "motion", "load", "gravity", "obstacle"]
AXES = "xyz"
# A report draws at most so many marks of supports, and arrows of one load.
MOST_HELD, MOST_ARROWS = 150, 24
# A vector is called after an axis when it leaves it by less than this share.
ALONG = 1e-6
# A load whose faces push against each other (a pressure, a torque) is told by its torque or
# pressure where its net force is below this share of the sum of their sizes.
BALANCED = 1e-6


class Acting(NamedTuple):
    """One thing that holds, moves, loads or meets the body, in words."""

    kind: Kind
    words: str


class Marks(NamedTuple):
    """Where to draw: ``held`` (n, 3) and ``moved`` points [m], ``arrows`` (n, 6): place and way.

    Ways of one load have the lengths of its tractions, the largest of all loads 1; ``gravity`` is
    the direction (3,) of it, or zeros; ``outlines`` (n, 6) are the ends of lines around obstacles
    where they start, ``floors`` the corners of what is drawn of planes.
    """

    held: Float[np.ndarray, "held 3"]
    moved: Float[np.ndarray, "moved 6"]
    arrows: Float[np.ndarray, "arrows 6"]
    gravity: Float[np.ndarray, "3"]
    outlines: Float[np.ndarray, "outlines 6"]
    floors: Float[np.ndarray, "planes 4 3"]


def describe(scene: Scene) -> tuple[Acting, ...]:
    """Everything that acts in a scene, one sentence each."""
    return (*_supports(scene), *_loads(scene), *_gravity(scene), *_obstacles(scene))


def marks(scene: Scene) -> Marks:
    """Places and directions at which a picture shows supports and loads."""
    points, held = scene.mesh.points, scene.held
    still = held.fixed & (held.values == 0)
    ids = _thinned(np.flatnonzero(still.any(axis=1)), MOST_HELD)
    moving = _thinned(np.flatnonzero((held.fixed & ~still).any(axis=1)), MOST_ARROWS)
    vectors = held.values[moving]
    moved = np.hstack(
        [points[moving], (vectors / (np.linalg.norm(vectors, axis=1).max(initial=0.0) or 1.0))]
    )
    arrows = [_arrows(scene, load) for load in scene.tractions]
    largest = max((np.linalg.norm(a[:, 3:], axis=1).max(initial=0.0) for a in arrows), default=0.0)
    joined = np.concatenate([np.zeros((0, 6)), *arrows])
    joined[:, 3:] /= largest or 1.0
    size = float(np.linalg.norm(scene.gravity_vector))
    lines = [np.zeros((0, 6)), *(outline(o, scene.mesh.bounds) for o in scene.obstacles)]
    way = np.asarray(scene.gravity_vector) / (size or 1.0)
    planes = [o for o in scene.obstacles if isinstance(o, Plane)]
    floors = [outline(o, scene.mesh.bounds)[None, :, :3] for o in planes]
    floors = np.concatenate([np.zeros((0, 4, 3)), *floors])
    return Marks(points[ids], moved, joined, way, np.concatenate(lines), floors)


def vector_words(vector: np.ndarray, unit: str) -> str:
    """Size and direction of a vector: '10 N along -z', or with its components."""
    size = float(np.linalg.norm(vector))
    if size == 0:
        return si(0.0, unit)
    return f"{si(size, unit)} {_way(np.asarray(vector) / size)}"


def _way(unit: np.ndarray) -> str:
    k = int(np.argmax(np.abs(unit)))
    if np.linalg.norm(np.delete(unit, k)) < ALONG:
        return f"along {'-' if unit[k] < 0 else ''}{AXES[k]}"
    return f"along ({', '.join(f'{x:.3g}' for x in np.round(unit, 3) + 0.0)})"


def _supports(scene: Scene) -> Iterator[Acting]:
    held = scene.held
    for hold in scene.holds or _found(scene):
        directions = "in all directions" if len(hold.axes) == 3 else f"in {_named(hold.axes)} only"
        count = f"{len(hold.points):,} points"
        if any(hold.by):
            way = vector_words(np.array(hold.by), "m")
            yield Acting("motion", f"{hold.name} is moved by {way} ({count})")
        else:
            yield Acting("support", f"{hold.name} is held {directions} ({count})")
    if held.springs.any():
        count = int(held.springs.any(axis=1).sum())
        yield Acting("support", f"springs of {si(float(held.springs.sum()), 'N/m')} at {count:,}")
    if not (held.fixed.any() or held.springs.any()):
        yield Acting("support", "nothing holds it")


def _found(scene: Scene) -> Iterator[Hold]:
    """What a scenario holds: points alike in what is held of them, called by where they are."""
    fixed = scene.held.fixed
    for pattern in np.unique(fixed[fixed.any(axis=1)], axis=0):
        ids = np.flatnonzero((fixed == pattern).all(axis=1))
        upwards = up_vector(scene.up)
        z = scene.mesh.points[ids] @ upwards
        low, high = sorted(scene.mesh.bounds @ upwards)
        end = "its base" if z.mean() - low <= high - z.mean() else "its top"
        yield Hold(end, ids, tuple(np.flatnonzero(pattern).tolist()))


def _named(axes: tuple[int, ...]) -> str:
    return " and ".join(AXES[axis] for axis in axes)


def _loads(scene: Scene) -> Iterator[Acting]:
    for load in scene.tractions:
        yield Acting("load", _load(scene, load))
    if scene.forces is not None:
        yield Acting("load", f"forces at points, {vector_words(scene.forces.sum(axis=0), 'N')}")


def _load(scene: Scene, load: Traction) -> str:
    total = resultant(scene.mesh, load)
    area = f"over {area_words(total.area)}"
    name = f"on {load.name}" if load.name else "on the surface"
    sizes = np.linalg.norm(np.broadcast_to(load.value, (len(load.faces), 3)), axis=1)
    sum_of_sizes = float(sizes @ face_areas(scene.mesh.points, load.faces))
    if np.linalg.norm(total.force) > BALANCED * sum_of_sizes:
        return f"{vector_words(total.force, 'N')} {name}, {area}"
    if np.ptp(sizes) <= ALONG * sizes.max():
        return f"a pressure of {si(float(sizes.max()), 'Pa')} {name}, without a net force, {area}"
    return f"a torque of {vector_words(total.torque, 'N m')} {name}, {area}"


def _gravity(scene: Scene) -> Iterator[Acting]:
    if np.any(scene.gravity_vector):
        way = vector_words(np.asarray(scene.gravity_vector), "m/s²")
        weight = scene.mesh.mass * float(np.linalg.norm(scene.gravity_vector))
        yield Acting("gravity", f"gravity of {way}: its weight is {si(weight, 'N')}")
    else:
        yield Acting("gravity", "no gravity")


def _obstacles(scene: Scene) -> Iterator[Acting]:
    for obstacle in scene.obstacles:
        words = _obstacle(obstacle)
        if np.any(obstacle.velocity):
            words += f", moving {vector_words(np.asarray(obstacle.velocity), 'm/s')}"
        if scene.friction:
            words += f", friction {scene.friction:g}"
        yield Acting("obstacle", words)


def _obstacle(obstacle: Obstacle) -> str:
    if isinstance(obstacle, Plane):
        normal = np.asarray(obstacle.normal, dtype=float) / np.linalg.norm(obstacle.normal)
        level = si(float(normal @ np.asarray(obstacle.point)), "m")
        return f"a plane that faces {_way(normal).removeprefix('along ')}, at {level}"
    if isinstance(obstacle, Sphere):
        return f"a ball of radius {si(obstacle.radius, 'm')}"
    if isinstance(obstacle, Capsule):
        return f"a capsule of radius {si(obstacle.radius, 'm')}"
    if isinstance(obstacle, Box):
        return f"a box of {' × '.join(si(2 * float(h), 'm') for h in obstacle.half)}"
    return f"an obstacle ({type(obstacle).__name__})"


def _arrows(scene: Scene, load: Traction) -> np.ndarray:
    """Where and how strongly a traction acts, on some of its faces, (n, 6)."""
    chosen = _thinned(np.arange(len(load.faces)), MOST_ARROWS)
    middles = scene.mesh.points[load.faces[chosen]].mean(axis=1)
    return np.hstack([middles, np.broadcast_to(load.value, (len(load.faces), 3))[chosen]])


def _thinned(ids: np.ndarray, most: int) -> np.ndarray:
    if len(ids) <= most:
        return ids
    return ids[np.linspace(0, len(ids) - 1, most).round().astype(int)]


# Outlines of obstacles: lines that a picture draws around them.

# Lines of a circle.
SIDES = 32
# A plane is drawn as a square that reaches this many sizes of the body from under its middle.
REACH = 0.75


def outline(obstacle: Obstacle, bounds: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "lines 6"]:
    """Ends [m] of lines around an ``obstacle`` beside a body with these ``bounds`` [m]."""
    if isinstance(obstacle, Plane):
        normal = np.asarray(obstacle.normal, dtype=float) / np.linalg.norm(obstacle.normal)
        middle = bounds.mean(axis=0)
        middle = middle - ((middle - np.asarray(obstacle.point)) @ normal) * normal
        across = np.linalg.svd(normal[None])[2][1:] * REACH * float(np.ptp(bounds, axis=0).max())
        corners = middle + np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) @ across
        return np.hstack([corners, np.roll(corners, -1, axis=0)])
    if isinstance(obstacle, Box):
        signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        i, j = np.triu_indices(8, 1)
        edge = np.abs(signs[i] - signs[j]).sum(axis=1) == 2
        corners = np.asarray(obstacle.centre) + signs * np.asarray(obstacle.half)
        return np.hstack([corners[i[edge]], corners[j[edge]]])
    if isinstance(obstacle, Sphere):
        return _ball(np.asarray(obstacle.centre, dtype=float), obstacle.radius)
    if isinstance(obstacle, Capsule):
        ends = np.array([obstacle.start, obstacle.end], dtype=float)
        balls = [_ball(end, obstacle.radius) for end in ends]
        return np.concatenate([*balls, ends.reshape(1, 6)])
    return np.zeros((0, 6))


def _ball(centre: np.ndarray, radius: float) -> np.ndarray:
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    circle = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros(SIDES)], axis=1)
    rings = [centre + np.roll(circle, k, axis=1) for k in range(3)]
    return np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])
