"""Which way out, where edges with more than two faces leave winding ambiguous: counting crossings.

A ray crosses a closed surface an odd number of times from inside and an even number from outside,
however the surface is wound; where it has fins or inner walls, the outside is what a ray leaves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from .rows import face_edges

DIRECTIONS = 24  # rays from each point
MAJORITY = 0.75  # of the rays that must agree
DEPTH = 1e-5  # share of the size at which the sides of a face are probed
PROBES = 8  # faces of a patch that are asked, the largest ones


class Sides(NamedTuple):
    """Of each patch: whether ``below`` and ``above`` its faces is inside the surface."""

    below: np.ndarray
    above: np.ndarray


class SeenShares(NamedTuple):
    """Of each patch: the share of directions that points ``below`` and ``above`` it see out in."""

    below: np.ndarray
    above: np.ndarray


def patch_sides(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    patch: Int[np.ndarray, "asked"],
) -> Sides:
    """Ask on both sides of the largest faces of every patch for inside.

    ``patch`` numbers, from 0, those of the first faces; the others only bound.
    """
    below, above, patch = _probed(points, faces, patch)
    inside = _inside_hull if _odd_edges(faces) else _inside
    return Sides(inside(below, faces, patch), inside(above, faces, patch))


def patch_views(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    patch: Int[np.ndarray, "asked"],
) -> SeenShares:
    """Share of all directions that each side of every patch sees out; ``patch`` as above.

    After Takayama, Jacobson, Kavan and Sorkine-Hornung 2014, "A simple method for correcting facet
    orientations in polygon meshes based on ray casting".
    """
    below, above, patch = _probed(points, faces, patch)
    return SeenShares(
        *(
            np.bincount(patch, weights=np.mean(side == 0, axis=0)) / np.bincount(patch)
            for side in (below, above)
        )
    )


def _probed(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    patch: Int[np.ndarray, "asked"],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Crossings below and above the largest faces of each patch, and the patch of each of them."""
    a, b, c = (points[faces[: len(patch), i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    order = np.lexsort([-area, patch])
    start = np.unique(patch[order], return_index=True)[1]
    asked = order[np.arange(len(order)) - start[patch[order]] < PROBES]
    step = normal[asked] / np.maximum(area[asked], np.finfo(float).tiny)[:, None]
    step *= DEPTH * np.ptp(points[faces].reshape(-1, 3), axis=0).max()
    middle = (a + b + c)[asked] / 3
    counts = crossings(points, faces, np.concatenate([middle - step, middle + step]))
    below, above = np.split(counts, 2, axis=1)
    return below, above, patch[asked]


def _odd_edges(faces: Int[np.ndarray, "faces 3"]) -> bool:
    """Whether walls of three, five ... faces meet in an edge: crossings then have no parity."""
    times = _faces_by_edge(faces)
    return bool(((times > 1) & (times % 2 == 1)).any())


def _faces_by_edge(faces: Int[np.ndarray, "faces 3"]) -> Int[np.ndarray, "edges"]:
    return face_edges(faces).count


def _inside(
    counts: Int[np.ndarray, "directions n"],
    faces: Int[np.ndarray, "faces 3"],
    patch: Int[np.ndarray, "n"],
) -> Bool[np.ndarray, "patches"]:
    """Whether most points of each patch are inside: by the parity of a clear majority of rays.

    Else, near fins, by whether no ray leaves without crossing anything.
    """
    odd = np.mean(counts % 2, axis=0)
    agreed = np.maximum(odd, 1 - odd) >= MAJORITY
    inside = np.where(agreed, odd > 0.5, np.all(counts > 0, axis=0))
    return np.bincount(patch, weights=inside) > np.bincount(patch) / 2


def _inside_hull(
    counts: Int[np.ndarray, "directions n"],
    faces: Int[np.ndarray, "faces 3"],
    patch: Int[np.ndarray, "n"],
) -> Bool[np.ndarray, "patches"]:
    """Whether each patch is enclosed: no ray leaves, but for a few through holes if there are any.

    The side of a patch is on one cell, so that one ray which leaves a closed surface tells.
    """
    stopped = np.bincount(patch, weights=np.mean(counts > 0, axis=0)) / np.bincount(patch)
    closed = _faces_by_edge(faces).min() > 1
    return stopped >= (1.0 if closed else MAJORITY)


def crossings(points, faces, where) -> Int[np.ndarray, "directions n"]:
    """How often each of ``DIRECTIONS`` rays from each point crosses the surface."""
    rays = _shot(points, faces, where)
    return np.bincount(rays.hit, minlength=DIRECTIONS * len(where)).reshape(DIRECTIONS, -1)


def enclosed_shares(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    where: Float[np.ndarray, "n 3"],
) -> Float[np.ndarray, "n"]:
    """Share of all directions in which each point lies on the inner side of the surface.

    There a ray leaves it more often than it enters it, or the reverse where that is usual. The
    winding number is the mean of the difference: walls that overlap in some directions make up for
    others in which there are none.
    """
    rays = _shot(points, faces, where)
    corners = points[faces[rays.face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    way = np.sign(np.einsum("hi,hi->h", normal, _spread(DIRECTIONS)[rays.hit // len(where)]))
    net = np.bincount(rays.hit, weights=way, minlength=DIRECTIONS * len(where))
    net = net.reshape(DIRECTIONS, -1)
    return np.mean(net * np.sign(net.sum(axis=0)) > 0, axis=0)


class _Rays(NamedTuple):
    """Crossings: the ray that ``hit``, numbered direction * points + point, and which ``face``."""

    hit: np.ndarray
    face: np.ndarray


def _shot(points, faces, where) -> _Rays:
    """Where ``DIRECTIONS`` rays from each point cross the surface."""
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
    found = caster.intersects_id(origins, directions, multiple_hits=True)
    return _Rays(np.asarray(found[1], np.int64), np.asarray(found[0], np.int64))


def _spread(count: int) -> Float[np.ndarray, "count 3"]:
    """Unit vectors spread evenly over the sphere along a golden spiral, none along an axis."""
    i = np.arange(count) + 0.5
    height, turn = 1 - 2 * i / count, i * np.pi * (1 + np.sqrt(5))
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
