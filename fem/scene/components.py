"""Components of a mesh: what is joined firmly enough to move as one body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..errors import InputError
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


def point_components(mesh: TetMesh) -> Int[np.ndarray, "points"]:
    """Piece of every point: tets that share a point are in one; -1 for points of no tet.

    Pieces are numbered by their first point.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = np.repeat(mesh.tets[:, 0], 3), mesh.tets[:, 1:].ravel()
    count = len(mesh.points)
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    used = np.unique(mesh.tets)
    order, first = np.unique(label[used], return_index=True)
    number = np.full(label.max() + 1, -1, dtype=np.int64)
    number[order[np.argsort(first)]] = np.arange(len(order))
    return number[label]


def piece_names(mesh: TetMesh) -> tuple[str, ...]:
    """Names of the parts in every piece of ``point_components``, the first three of each."""
    piece, names = point_components(mesh)[mesh.tets[:, 0]], []
    for k in range(int(piece.max()) + 1):
        inside = [mesh.region_names[i] for i in np.unique(mesh.region[piece == k])]
        names.append(" + ".join([*inside[:3], *(["..."] if len(inside) > 3 else [])]))
    return tuple(names)


def spans_plane(points: Float[np.ndarray, "n 3"]) -> bool:
    """Whether the points are at least three and not on one line."""
    if len(points) < 3:
        return False
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(extent[1] > FLATNESS * extent[0])


class FreeMotions(NamedTuple):
    """What a body may do without resistance.

    ``motions`` (points, 3, k) is a basis of the displacements, rigid in every component, that meet
    none; ``components`` (free,) are those that take part.
    """

    motions: Float[np.ndarray, "points 3 k"]
    components: Int[np.ndarray, "free"]


def free_motions(mesh: TetMesh, held: Bool[np.ndarray, "points 3"]) -> FreeMotions:
    """Rigid motions of the components of ``mesh`` that the entries ``held`` do not stop.

    Every component has six; supports, and points shared with others, resist them.

    Raises
    ------
    InputError
        If the mesh has more than ``MAX_COMPONENTS`` components.
    """
    labels = face_components(mesh)
    count = int(labels.max()) + 1
    if count > MAX_COMPONENTS:
        raise InputError(f"{count} separate pieces: wanted at most {MAX_COMPONENTS}")
    pairs = np.unique(np.stack([mesh.tets.ravel(), np.repeat(labels, 4)], axis=1), axis=0)
    point, component = pairs.T
    owner = np.zeros(len(mesh.points), dtype=np.int64)
    owner[point[::-1]] = component[::-1]  # the first component around every point
    scale = np.ptp(mesh.bounds, axis=0).max()
    motion = rigid_motions((mesh.points - mesh.bounds[0]) / scale)
    resistance = np.zeros((count, count, 6, 6))
    own = component == owner[point]
    stopped = motion[point[own]] * held[point[own], :, None]
    np.add.at(resistance, (component[own],) * 2, stopped.transpose(0, 2, 1) @ stopped)
    tied, first = component[~own], owner[point[~own]]
    tie = motion[point[~own]].transpose(0, 2, 1) @ motion[point[~own]]
    for a, b, sign in ((tied, tied, 1), (first, first, 1), (tied, first, -1), (first, tied, -1)):
        np.add.at(resistance, (a, b), sign * tie)
    square = resistance.transpose(0, 2, 1, 3).reshape(6 * count, 6 * count)
    value, mode = np.linalg.eigh(square)
    loose = mode[:, value < FLATNESS**2 * max(value[-1], 1.0)].reshape(count, 6, -1)
    moved = np.einsum("pim,pmk->pik", motion, loose[owner])
    moved[np.setdiff1d(np.arange(len(moved)), point)] = 0.0
    return FreeMotions(
        moved, np.flatnonzero(np.abs(loose).max(axis=(1, 2), initial=0.0) > FLATNESS)
    )


def rigid_motions(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 6"]:
    """Displacement of every point in three unit translations and rotations about the origin."""
    x, y, z = points.T
    motion = np.zeros((len(points), 3, 6))
    motion[:, [0, 1, 2], [0, 1, 2]] = 1
    motion[:, 1, 3], motion[:, 2, 3] = -z, y
    motion[:, 0, 4], motion[:, 2, 4] = z, -x
    motion[:, 0, 5], motion[:, 1, 5] = -y, x
    return motion
