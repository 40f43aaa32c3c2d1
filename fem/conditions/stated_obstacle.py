"""Obstacles in words: 'sphere:0,0,1,0.1=0,0,-2' is a ball that comes down at 2 m/s."""

from __future__ import annotations

import numpy as np

from ..errors import UsageError
from ..scene.obstacles import Box, Capsule, Obstacle, Plane, Sphere
from .selection import half_space, numbers

OBSTACLES = (
    "plane:z<0 (or x>1), sphere:x,y,z,r, box:x0,y0,z0,x1,y1,z1 or capsule:x0,y0,z0,x1,y1,z1,r"
)


def stated_obstacle(words: str) -> Obstacle:
    """Find the obstacle that ``words`` mean [m], with its velocity [m/s] after '=', if it moves.

    A plane is solid where its words hold: 'plane:z<0' is the ground.

    Raises
    ------
    UsageError
        Where the words are not understood.
    """
    said = f"--obstacle {words}"
    shape, equals, way = words.partition("=") if "<=" not in words else (words, "", "")
    velocity = tuple(numbers(way, 3, said).tolist()) if equals else (0.0, 0.0, 0.0)
    kind, _, rest = shape.strip().partition(":")
    if kind == "plane":
        axis, sign, level = half_space(rest, said)
        normal = sign * np.eye(3)[axis]
        return Plane(tuple(sign * level * normal), tuple(normal), velocity)
    if kind == "sphere":
        *centre, radius = numbers(rest, 4, said).tolist()
        return Sphere(tuple(centre), _positive(radius, said), velocity)
    if kind == "capsule":
        *ends, radius = numbers(rest, 7, said).tolist()
        return Capsule(tuple(ends[:3]), tuple(ends[3:]), _positive(radius, said), velocity)
    if kind == "box":
        corners = numbers(rest, 6, said).reshape(2, 3)
        half = np.abs(corners[1] - corners[0]) / 2
        _positive(float(half.min()), said)
        return Box(tuple(corners.mean(axis=0).tolist()), tuple(half.tolist()), velocity)
    raise UsageError(f"{said}: no obstacle is called {kind!r}; wanted {OBSTACLES}")


def _positive(size: float, said: str) -> float:
    if not size > 0:
        raise UsageError(f"{said}: it has the size {size:g} m, wanted > 0")
    return size
