"""A scene in words and as marks to draw: what holds a body, acts on it and meets it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.mesh import face_areas
from ...fem.scene.loads import resultant
from ...fem.scene.obstacles import Box, Capsule, Obstacle, Plane, Sphere
from ...fem.scene.scene import Hold, Scene
from ...fem.scene.up import up_vector
from .check import area_words, si

Kind = Literal["support", "motion", "load", "gravity", "obstacle"]
AXES = "xyz"
# A report draws at most so many marks of supports, and arrows of one load.
MOST_HELD, MOST_ARROWS = 150, 24
ALONG = 1e-6  # a vector is called after an axis when it leaves it by less than this fraction
# A load whose faces push against each other (a pressure, a torque) is told by its torque or
# pressure where its net force is below this fraction of the sum of their sizes.
BALANCED = 1e-6
SIDES = 32  # lines of a circle, around an obstacle
REACH = 0.75  # sizes of the body that the square of a plane reaches from under its middle


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
    mesh, held, acting = scene.mesh, scene.held, []
    for hold in scene.holds or _holds_of_scenario(scene):
        count = f"{len(hold.points):,} points"
        if any(hold.by):
            way = vector_words(np.array(hold.by), "m")
            acting.append(Acting("motion", f"{hold.name} is moved by {way} ({count})"))
        else:
            axes = " and ".join(AXES[axis] for axis in hold.axes)
            directions = "in all directions" if len(hold.axes) == 3 else f"in {axes} only"
            acting.append(Acting("support", f"{hold.name} is held {directions} ({count})"))
    if held.springs.any():
        count, total = int(held.springs.any(axis=1).sum()), float(held.springs.sum())
        acting.append(Acting("support", f"springs of {si(total, 'N/m')} at {count:,}"))
    elif not held.fixed.any():
        acting.append(Acting("support", "nothing holds it"))
    for load in scene.tractions:
        total = resultant(mesh, load)
        area = f"over {area_words(total.area)}"
        name = f"on {load.name}" if load.name else "on the surface"
        sizes = np.linalg.norm(np.broadcast_to(load.value, (len(load.faces), 3)), axis=1)
        sum_of_sizes = float(sizes @ face_areas(mesh.points, load.faces))
        sizes = sizes if load.shares is None else sizes / load.shares
        if np.linalg.norm(total.force) > BALANCED * sum_of_sizes:
            words = f"{vector_words(total.force, 'N')} {name}, {area}"
        elif np.ptp(sizes) <= ALONG * sizes.max():
            pressure = si(float(sizes.max()), "Pa")
            words = f"a pressure of {pressure} {name}, without a net force, {area}"
        else:
            words = f"a torque of {vector_words(total.torque, 'N m')} {name}, {area}"
        acting.append(Acting("load", words))
    if scene.forces is not None:
        force = vector_words(scene.forces.sum(axis=0), "N")
        acting.append(Acting("load", f"forces at points, {force}"))
    gravity = float(np.linalg.norm(scene.gravity_vector))
    words = "no gravity"
    if gravity > 0:
        way = vector_words(np.asarray(scene.gravity_vector), "m/s²")
        words = f"gravity of {way}: its weight is {si(mesh.mass * gravity, 'N')}"
    acting.append(Acting("gravity", words))
    for obstacle in scene.obstacles:
        if isinstance(obstacle, Plane):
            normal = np.asarray(obstacle.normal, dtype=float) / np.linalg.norm(obstacle.normal)
            level = si(float(normal @ np.asarray(obstacle.point)), "m")
            words = f"a plane that faces {_way(normal).removeprefix('along ')}, at {level}"
        elif isinstance(obstacle, Sphere):
            words = f"a ball of radius {si(obstacle.radius, 'm')}"
        elif isinstance(obstacle, Capsule):
            words = f"a capsule of radius {si(obstacle.radius, 'm')}"
        elif isinstance(obstacle, Box):
            words = f"a box of {' × '.join(si(2 * float(h), 'm') for h in obstacle.half)}"
        else:
            words = f"an obstacle ({type(obstacle).__name__})"
        if np.any(obstacle.velocity):
            words += f", moving {vector_words(np.asarray(obstacle.velocity), 'm/s')}"
        if scene.friction:
            words += f", friction {scene.friction:g}"
        acting.append(Acting("obstacle", words))
    return tuple(acting)


# Columns of a table of places: what carries a rest, and what acts on it.
PLACES = {
    "does": "", "place": "place", "force": "force", "torque": "torque about its middle",
    "area": "area", "fixed": "on fixed points",
}  # fmt: skip


def place_rows(rest: Mapping[str, Any]) -> list[dict[str, str]]:
    """What every support carries and every load does, in words, of the numbers of a rest."""
    rows = [("held", one) for one in rest["reactions"]] + [("load", one) for one in rest["loads"]]
    largest = {
        name: max((np.linalg.norm(one[name]) for _, one in rows), default=0.0)
        for name in ("force", "torque")
    }

    def words(one: Mapping[str, Any], name: str, unit: str) -> str:
        vector = np.asarray(one[name], dtype=float)
        if np.linalg.norm(vector) <= BALANCED * largest[name]:  # round-off of what balances
            return "0"
        return vector_words(vector, unit)

    return [
        {
            "does": does,
            "place": one["place"] or ("its support" if does == "held" else "its surface"),
            "force": words(one, "force", "N"),
            "torque": words(one, "torque", "N m"),
            "area": area_words(one["area"]) if "area" in one else "",
            "fixed": f"{one['on_fixed']:.0%}" if "on_fixed" in one else "",
        }
        for does, one in rows
    ]


def _holds_of_scenario(scene: Scene) -> Iterator[Hold]:
    """Points alike in what is held of them, called by where they are."""
    fixed, upwards = scene.held.fixed, up_vector(scene.up)
    low, high = sorted(scene.mesh.bounds @ upwards)
    for pattern in np.unique(fixed[fixed.any(axis=1)], axis=0):
        ids = np.flatnonzero((fixed == pattern).all(axis=1))
        z = (scene.mesh.points[ids] @ upwards).mean()
        end = "its base" if z - low <= high - z else "its top"
        yield Hold(end, ids, tuple(np.flatnonzero(pattern).tolist()))


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


def marks(scene: Scene) -> Marks:
    """Places and directions at which a picture shows supports and loads."""

    def thinned(ids: np.ndarray, most: int) -> np.ndarray:
        chosen = np.linspace(0, len(ids) - 1, min(most, len(ids))).round().astype(int)
        return ids[chosen]

    points, held, bounds = scene.mesh.points, scene.held, scene.mesh.bounds
    still = held.fixed & (held.values == 0)
    ids = thinned(np.flatnonzero(still.any(axis=1)), MOST_HELD)
    moving = thinned(np.flatnonzero((held.fixed & ~still).any(axis=1)), MOST_ARROWS)
    vectors = held.values[moving]
    vectors = vectors / (np.linalg.norm(vectors, axis=1).max(initial=0.0) or 1.0)
    arrows = [np.zeros((0, 6))]
    for load in scene.tractions:
        chosen = thinned(np.arange(len(load.faces)), MOST_ARROWS)
        middles = points[load.faces[chosen]].mean(axis=1)
        values = np.broadcast_to(load.value, (len(load.faces), 3))[chosen]
        arrows.append(np.hstack([middles, values]))
    joined = np.concatenate(arrows)
    joined[:, 3:] /= np.linalg.norm(joined[:, 3:], axis=1).max(initial=0.0) or 1.0
    way = np.asarray(scene.gravity_vector)
    lines = [outline(obstacle, bounds) for obstacle in scene.obstacles]
    floors = [line[None, :, :3] for line, one in zip(lines, scene.obstacles, strict=True)
              if isinstance(one, Plane)]  # fmt: skip
    return Marks(
        points[ids],
        np.hstack([points[moving], vectors]),
        joined,
        way / (float(np.linalg.norm(way)) or 1.0),
        np.concatenate([np.zeros((0, 6)), *lines]),
        np.concatenate([np.zeros((0, 4, 3)), *floors]),
    )


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
