"""The boundary of a body of tets: its outward faces, their areas and normals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

# Outward faces of a positively oriented tet (vertex i is opposite to face i).
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class Boundary(NamedTuple):
    """Outward faces of the boundary: ``faces`` (faces, 3) point ids, ``tet`` (faces,) owners."""

    faces: np.ndarray
    tet: np.ndarray


def boundary_faces(tets: Int[np.ndarray, "tets 4"]) -> Boundary:
    """Faces that belong to one tet only, oriented outward for positively oriented tets."""
    faces = tets[:, FACES].reshape(-1, 3)
    order, same = equal_faces(faces)
    single = np.ones(len(faces), dtype=bool)
    single[order[1:][same]] = single[order[:-1][same]] = False
    index = np.flatnonzero(single)
    return Boundary(faces[index], index // 4)


class EqualFaces(NamedTuple):
    """An ``order`` (n,) of faces in which equal ones are neighbours; ``same`` (n - 1,) says which.

    Rising by their sorted corners, and by their number where those are equal.
    """

    order: np.ndarray
    same: np.ndarray


def equal_faces(faces: Int[np.ndarray, "n k"]) -> EqualFaces:
    """Find the faces, or edges, that have the same corners in any order."""
    corners = np.sort(faces, axis=1).astype(np.int64, copy=False)
    size, count = int(corners.max(initial=0)) + 1, corners.shape[1]
    if size**count > np.iinfo(np.int64).max:
        order = np.lexsort(corners.T[::-1])
        return EqualFaces(order, (corners[order][1:] == corners[order][:-1]).all(axis=1))
    key = corners @ size ** np.arange(count)[::-1]  # far faster to sort
    order = np.argsort(key, kind="stable")
    return EqualFaces(order, np.diff(key[order]) == 0)


def area_vectors(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "*faces 3"]
) -> Float[np.ndarray, "*faces 3"]:
    """Area vector [m^2] of every face: its area along its normal.

    The four outward faces of every tet are ``tets[:, FACES]``.
    """
    return np.stack(cross(*edge_vectors(points, faces)), axis=-1) / 2


def edge_vectors(
    points: Float[np.ndarray, "points 3"], cells: Int[np.ndarray, "*cells k"]
) -> list[Float[np.ndarray, "3 *cells"]]:
    """Vectors [m] from the first corner of every cell to each other one, component by component.

    Long rows of one component are gathered and multiplied several times faster than short vectors.
    """
    rows = np.ascontiguousarray(points.T)
    first, *others = (rows.take(corner, axis=1) for corner in np.moveaxis(cells, -1, 0))
    return [other - first for other in others]


def cross(
    u: Float[np.ndarray, "3 *cells"], v: Float[np.ndarray, "3 *cells"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Components of the vector products of vectors given component by component."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def tet_area_vectors(
    points: Float[np.ndarray, "points 3"], tets: Int[np.ndarray, "tets 4"]
) -> Float[np.ndarray, "4 3 tets"]:
    """Area vectors [m^2] of the four outward ``FACES`` of every tet, component by component."""
    b, c, d = edge_vectors(points, tets)
    out = np.array([np.zeros_like(b), cross(d, c), cross(b, d), cross(c, b)]) / 2
    out[0] = -out[1:].sum(axis=0)  # the surface is closed
    return out


def face_areas(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
) -> Float[np.ndarray, "faces"]:
    """Area [m^2] of every face."""
    return np.linalg.norm(area_vectors(points, faces), axis=1)


def face_normals(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
) -> Float[np.ndarray, "faces 3"]:
    """Unit normal of every face, outward where the faces are those of ``mesh.boundary``."""
    vectors = area_vectors(points, faces)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
