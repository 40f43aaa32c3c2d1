"""Outlines of obstacles: lines that a picture draws around them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ...fem.scene.obstacles import Box, Capsule, Obstacle, Plane, Sphere

# Lines of a circle.
SIDES = 32
# A plane is drawn as a square that reaches this many sizes of the body from under its middle.
REACH = 0.75


def outline(obstacle: Obstacle, bounds: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "lines 6"]:
    """Ends [m] of lines around an ``obstacle`` beside a body with these ``bounds`` [m]."""
    if isinstance(obstacle, Plane):
        return _square(obstacle, bounds)
    if isinstance(obstacle, Box):
        return _edges(obstacle)
    if isinstance(obstacle, Sphere):
        return _ball(np.asarray(obstacle.centre, dtype=float), obstacle.radius)
    if isinstance(obstacle, Capsule):
        ends = np.array([obstacle.start, obstacle.end], dtype=float)
        balls = [_ball(end, obstacle.radius) for end in ends]
        return np.concatenate([*balls, ends.reshape(1, 6)])
    return np.zeros((0, 6))


def _square(plane: Plane, bounds: np.ndarray) -> np.ndarray:
    normal = np.asarray(plane.normal, dtype=float) / np.linalg.norm(plane.normal)
    middle = bounds.mean(axis=0)
    middle = middle - ((middle - np.asarray(plane.point)) @ normal) * normal
    across = np.linalg.svd(normal[None])[2][1:] * REACH * float(np.ptp(bounds, axis=0).max())
    corners = middle + np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) @ across
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def _edges(box: Box) -> np.ndarray:
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
    i, j = np.triu_indices(8, 1)
    edge = np.abs(signs[i] - signs[j]).sum(axis=1) == 2
    corners = np.asarray(box.centre) + signs * np.asarray(box.half)
    return np.hstack([corners[i[edge]], corners[j[edge]]])


def _ball(centre: np.ndarray, radius: float) -> np.ndarray:
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    circle = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros(SIDES)], axis=1)
    rings = [centre + np.roll(circle, k, axis=1) for k in range(3)]
    return np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])
