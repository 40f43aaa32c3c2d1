"""Which way out, where edges with more than two faces leave winding ambiguous: counting crossings.

A ray crosses a closed surface an odd number of times from inside and an even number from outside,
however the surface is wound; where it has fins or inner walls, the outside is what a ray leaves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

DIRECTIONS = 24  # rays from each point
MAJORITY = 0.75  # of the rays that must agree on the parity
DEPTH = 1e-5  # share of the size at which the sides of a face are probed


class Sides(NamedTuple):
    """Of each patch: whether ``below`` and ``above`` its faces is inside the surface."""

    below: np.ndarray
    above: np.ndarray


def patch_sides(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    patch: Int[np.ndarray, "faces"],
) -> Sides:
    """Ask on both sides of the largest face of every patch (numbered from 0) for inside."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    order = np.lexsort([-area, patch])
    largest = order[np.unique(patch[order], return_index=True)[1]]
    step = normal[largest] / np.maximum(area[largest], np.finfo(float).tiny)[:, None]
    step *= DEPTH * np.ptp(points[faces].reshape(-1, 3), axis=0).max()
    middle = (a + b + c)[largest] / 3
    inside = is_inside(points, faces, np.concatenate([middle - step, middle + step]))
    return Sides(*inside.reshape(2, -1))


def is_inside(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    where: Float[np.ndarray, "n 3"],
) -> Bool[np.ndarray, "n"]:
    """Whether points [m] are inside, whatever the winding of the faces.

    By the parity of crossings where a clear majority of the rays agrees; else, near fins and inner
    walls, by whether no ray leaves without crossing anything.
    """
    counts = crossings(points, faces, where)
    odd = np.mean(counts % 2, axis=0)
    agreed = np.maximum(odd, 1 - odd) >= MAJORITY
    return np.where(agreed, odd > 0.5, np.all(counts > 0, axis=0))


def crossings(points, faces, where) -> Int[np.ndarray, "directions n"]:
    """How often each of ``DIRECTIONS`` rays from each point crosses the surface."""
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    # Embree computes in single precision: centred, at unit size.
    used, faces = np.unique(faces, return_inverse=True)
    corners, faces = points[used], faces.reshape(-1, 3)
    lo, hi = corners.min(axis=0), corners.max(axis=0)
    centre, scale = (lo + hi) / 2, (hi - lo).max()
    caster = RayMeshIntersector(
        trimesh.Trimesh((corners - centre) / scale, faces, process=False), scale_to_box=False
    )
    origins = np.tile((where - centre) / scale, (DIRECTIONS, 1))
    directions = np.repeat(_spread(DIRECTIONS), len(where), axis=0)
    ray = np.asarray(caster.intersects_id(origins, directions, multiple_hits=True)[1], np.int64)
    return np.bincount(ray, minlength=len(origins)).reshape(DIRECTIONS, -1)


def _spread(count: int) -> Float[np.ndarray, "count 3"]:
    """Unit vectors spread evenly over the sphere along a golden spiral, none along an axis."""
    i = np.arange(count) + 0.5
    height, turn = 1 - 2 * i / count, i * np.pi * (1 + np.sqrt(5))
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
