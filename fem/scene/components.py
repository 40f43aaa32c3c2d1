"""Components of a mesh: what is joined firmly enough to move as one body."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from .boundary import FACES
from .mesh import TetMesh

# Points are on one line when they leave it by less than this share of their extent.
FLATNESS = 1e-6
# Above this many components the dense matrix of their rigid motions is not worth making.
MAX_COMPONENTS = 300


def face_components(mesh: TetMesh) -> Int[np.ndarray, "tets"]:
    """Component of every tet: tets that share a face are in one; the first tet is in component 0.

    Tets that share only a corner or an edge form a hinge, not one body.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces = np.sort(mesh.tets[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T)
    same = np.flatnonzero((faces[order][1:] == faces[order][:-1]).all(axis=1))
    a, b = order[same] // 4, order[same + 1] // 4
    count = len(mesh.tets)
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def spans_plane(points: Float[np.ndarray, "n 3"]) -> bool:
    """Whether the points are at least three and not on one line."""
    if len(points) < 3:
        return False
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(extent[1] > FLATNESS * extent[0])


def free_components(mesh: TetMesh, held: Float[np.ndarray, "points 3"]) -> Int[np.ndarray, "free"]:
    """Components that can still move as rigid bodies where the entries ``held > 0`` are stopped.

    Every component has six rigid motions; supports, and points shared with others, resist them.
    A component is free where a motion meets no resistance.
    """
    labels = face_components(mesh)
    count = int(labels.max()) + 1
    if count > MAX_COMPONENTS:
        return np.zeros(0, dtype=np.int64)
    pairs = np.unique(np.stack([mesh.tets.ravel(), np.repeat(labels, 4)], axis=1), axis=0)
    scale = np.ptp(mesh.bounds, axis=0).max()
    motion = rigid_motions((mesh.points - mesh.bounds[0]) / scale)
    rows = []
    owner = dict(pairs[::-1])  # the first component around every point
    for point, component in pairs:
        row = np.zeros((3, count, 6))
        row[:, component] = motion[point]
        if owner[point] == component:
            rows.append(row[held[point] > 0])
        else:
            row[:, owner[point]] -= motion[point]
            rows.append(row)
    resistance = np.concatenate(rows).reshape(-1, 6 * count)
    value, mode = np.linalg.eigh(resistance.T @ resistance)
    loose = mode[:, value < FLATNESS**2 * max(value[-1], 1.0)].reshape(count, -1)
    return np.flatnonzero(np.abs(loose).max(axis=1, initial=0.0) > FLATNESS)


def rigid_motions(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 6"]:
    """Displacement of every point in three unit translations and rotations about the origin."""
    x, y, z = points.T
    motion = np.zeros((len(points), 3, 6))
    motion[:, [0, 1, 2], [0, 1, 2]] = 1
    motion[:, 1, 3], motion[:, 2, 3] = -z, y
    motion[:, 0, 4], motion[:, 2, 4] = z, -x
    motion[:, 0, 5], motion[:, 1, 5] = -y, x
    return motion
