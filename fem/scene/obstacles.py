"""Rigid obstacles with a closed-form distance: plane, box, sphere, capsule, gripper plates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np


class Distance(NamedTuple):
    """Signed distance ``gap`` (n,) [m], positive outside, and its gradient ``normal`` (n, 3)."""

    gap: np.ndarray
    normal: np.ndarray


@runtime_checkable
class Obstacle(Protocol):
    """A rigid body that keeps the simulated one outside; it may move with constant velocity."""

    @property
    def velocity(self) -> Sequence[float]:
        """Velocity [m/s], shape (3,)."""

    def distance(self, x: np.ndarray) -> Distance:
        """Distance of positions ``x`` (n, 3) [m] from the obstacle at time 0."""


def _from(away: np.ndarray, radius: float = 0.0) -> Distance:
    """Distance of points that are ``away`` (n, 3) [m] from the middle of what has a ``radius``."""
    length = np.linalg.norm(away, axis=1)
    return Distance(length - radius, away / np.where(length > 0, length, 1.0)[:, None])


@dataclass(frozen=True)
class Plane:
    """Half-space below the plane through ``point`` [m] with the outward ``normal``.

    Parameters
    ----------
    point, normal
        A point of the plane [m] and the way out of the half-space, of any length, shape (3,).
    velocity
        Velocity [m/s], shape (3,).

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import Plane
    >>> Plane().distance(np.array([[5.0, 5.0, 2.0]])).gap  # m above z = 0
    array([2.])
    """

    point: Sequence[float] = (0.0, 0.0, 0.0)
    normal: Sequence[float] = (0.0, 0.0, 1.0)
    velocity: Sequence[float] = (0.0, 0.0, 0.0)

    def distance(self, x: np.ndarray) -> Distance:
        """Height above the plane."""
        normal = np.asarray(self.normal, dtype=float) / np.linalg.norm(self.normal)
        return Distance((x - self.point) @ normal, np.broadcast_to(normal, x.shape))


@dataclass(frozen=True)
class Sphere:
    """Ball of ``radius`` [m] around ``centre`` [m].

    Parameters
    ----------
    centre, radius
        Its middle [m], shape (3,), and its radius [m].
    velocity
        Velocity [m/s], shape (3,).

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import Sphere
    >>> Sphere((0, 0, 0), 1.0).distance(np.array([[3.0, 4.0, 0.0]])).gap  # m
    array([4.])
    """

    centre: Sequence[float]
    radius: float
    velocity: Sequence[float] = (0.0, 0.0, 0.0)

    def distance(self, x: np.ndarray) -> Distance:
        """Distance from the surface of the ball."""
        return _from(x - self.centre, self.radius)


@dataclass(frozen=True)
class Capsule:
    """All points within ``radius`` [m] of the segment from ``start`` to ``end`` [m].

    Parameters
    ----------
    start, end, radius
        Ends of the segment [m], shape (3,), and the radius [m].
    velocity
        Velocity [m/s], shape (3,).

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import Capsule
    >>> Capsule((0, 0, 0), (0, 0, 1), 0.5).distance(np.array([[2.0, 0.0, 0.5]])).gap  # m
    array([1.5])
    """

    start: Sequence[float]
    end: Sequence[float]
    radius: float
    velocity: Sequence[float] = (0.0, 0.0, 0.0)

    def distance(self, x: np.ndarray) -> Distance:
        """Distance from the surface of the capsule."""
        start, along = np.asarray(self.start), np.subtract(self.end, self.start)
        alpha = np.clip((x - start) @ along / max(float(along @ along), 1e-300), 0, 1)
        return _from(x - start - alpha[:, None] * along, self.radius)


@dataclass(frozen=True)
class Box:
    """Box along the axes with ``half`` sizes [m] around ``centre`` [m].

    Parameters
    ----------
    centre, half
        Its middle and half of its sides [m], shape (3,).
    velocity
        Velocity [m/s], shape (3,).

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.fem import Box
    >>> Box((0, 0, 0), (1, 1, 1)).distance(np.array([[4.0, 5.0, 0.0]])).gap  # m, to its edge
    array([5.])
    """

    centre: Sequence[float]
    half: Sequence[float]
    velocity: Sequence[float] = (0.0, 0.0, 0.0)

    def distance(self, x: np.ndarray) -> Distance:
        """Distance from the surface of the box."""
        local = x - self.centre
        q = np.abs(local) - self.half
        away, normal = _from(np.maximum(q, 0.0))
        nearest = np.eye(3)[np.argmax(q, axis=1)]  # the face that a point inside is closest to
        normal = np.where(away[:, None] > 0, normal, nearest) * np.where(local < 0, -1.0, 1.0)
        return Distance(np.where(away > 0, away, q.max(axis=1)), normal)


def obstacle_size(obstacle: Obstacle) -> float:
    """Radius of a ball or capsule, smallest half side of a box [m]; else infinite."""
    if isinstance(obstacle, Sphere | Capsule):
        return obstacle.radius
    return float(np.min(obstacle.half)) if isinstance(obstacle, Box) else np.inf


def obstacle_middle(obstacle: Obstacle) -> np.ndarray | None:
    """A point [m] in a ball, box or capsule, shape (3,); None of what has no end."""
    middle = getattr(obstacle, "centre", getattr(obstacle, "start", None))
    return None if middle is None else np.asarray(middle, dtype=float)


def gripper(
    lower: Sequence[float], upper: Sequence[float], axis: int, speed: float
) -> tuple[Plane, Plane]:
    """Two plates that face each other along an axis and close.

    Parameters
    ----------
    lower, upper
        A point of each plate [m], shape (3,).
    axis
        0, 1 or 2: x, y or z.
    speed
        Speed [m/s] of each plate towards the other.

    Returns
    -------
    tuple[Plane, Plane]
        The lower plate and the upper one.

    Examples
    --------
    >>> from autophyx_tet.fem import gripper
    >>> left, right = gripper((0, 0, 0), (1, 0, 0), axis=0, speed=0.5)
    >>> float(left.velocity[0]), float(right.velocity[0])  # m/s
    (0.5, -0.5)
    """
    direction = np.eye(3)[axis]
    return (
        Plane(tuple(lower), tuple(direction), tuple(speed * direction)),
        Plane(tuple(upper), tuple(-direction), tuple(-speed * direction)),
    )
