"""The layer under a surface: how much of a body its wall is, without a mesh of the wall."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.apparent import WallShare
from .samples import sample
from .triangles import Triangles, closest, enclosed_volume

SAMPLES = 16_000  # shares to about half a per cent
SEED = 0  # the same body has the same wall
REACHED = 1e-3  # of its depth: round-off of the distance back to the face that a point lies under


def wall_share(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    wall: float,
    *,
    samples: int = SAMPLES,
) -> WallShare:
    """Shares of volume and bending of the layer within ``wall`` [m] of a closed, outward surface.

    Points are dropped from random places of the surface to random depths; those that are nearer to
    another face count there. Exact in the mean for convex bodies; wedges behind inward edges are
    missed, each a part (wall x angle / 2) of the faces beside it. A quarter of the ``samples`` has
    twice the error.
    """
    rng = np.random.default_rng(SEED)
    found = sample(points, faces, rng=rng, count=samples)
    where, normal = found.where[:samples], found.normal[:samples]
    depth = wall * (np.arange(samples) + rng.random(samples)) / samples
    under = where - depth[:, None] * normal
    own = closest(under, points, faces).distance >= depth * (1 - REACHED)
    corners = points[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    ).sum()
    volume, centre, moment = _solid_moments(corners)
    axis = np.linalg.eigh(moment)[1][:, 0]
    z = (under[own] - centre) @ axis
    layer = area / 2 * wall / samples
    bending = layer * float(z @ z) / float(axis @ moment @ axis)
    return WallShare(min(float(layer * own.sum() / volume), 1.0), min(float(bending), 1.0))


def _solid_moments(corners: Float[np.ndarray, "faces 3 3"]):
    """Volume [m^3], centroid [m] and integral of x x^T about it [m^5] inside outward triangles."""
    origin = corners.mean(axis=(0, 1))
    corners = corners - origin
    six = np.linalg.det(corners)
    total = corners.sum(axis=1)
    volume = six.sum() / 6
    centre = (six[:, None] * total).sum(axis=0) / 24 / volume
    # Over a tet with a corner at the origin: 6 V / 120 (sum of p p^T + s s^T), s the sum of p.
    outer = np.einsum("f,fki,fkj->ij", six, corners, corners)
    outer += np.einsum("f,fi,fj->ij", six, total, total)
    return float(volume), centre + origin, outer / 120 - volume * np.outer(centre, centre)


def hull_share(points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]) -> float:
    """Volume inside a closed surface [m] by that of its convex hull: 1 of a ball."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points[np.unique(faces)])
    return abs(enclosed_volume(Triangles(points, faces))) / hull.volume
