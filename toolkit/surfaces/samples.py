"""Points on surfaces, from which distances and volumes are sampled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.scene.boundary import FACES, equal_faces

SAMPLES = 20_000  # points on a surface: the distances of a smooth field to 3 digits


class Samples(NamedTuple):
    """Points on a surface: ``where`` (n, 3) [m] and the unit ``normal`` (n, 3) there."""

    where: np.ndarray
    normal: np.ndarray


def sample(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    *,
    rng: np.random.Generator,
    count: int = SAMPLES,
) -> Samples:
    """Random points of uniform density on a surface, and its vertices."""
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(area, np.finfo(float).tiny)[:, None]
    # Faces without any area are drawn like each other.
    share = area / area.sum() if area.sum() > 0 else None
    face = rng.choice(len(area), size=count, p=share)
    u, v = np.sort(rng.random((2, count)), axis=0)
    weight = np.stack([u, v - u, 1 - v], axis=1)
    where = np.einsum("nk,nki->ni", weight, corners[face])
    _, first = np.unique(faces, return_index=True)
    some = first if len(first) <= count else rng.choice(first, size=count, replace=False)
    vertices = faces.reshape(-1)[some]
    return Samples(
        np.concatenate([where, points[vertices]]),
        np.concatenate([normal[face], normal[some // 3]]),
    )


class Facets(NamedTuple):
    """Triangles between two tets: ``faces`` (n, 3) sorted, the tets ``left``, ``right``."""

    faces: np.ndarray
    left: np.ndarray
    right: np.ndarray


def facets(tets: Int[np.ndarray, "tets 4"]) -> Facets:
    """All inner faces of a tet mesh, once each."""
    faces = tets[:, FACES].reshape(-1, 3)
    order, same = equal_faces(faces)
    left, right = order[:-1][same], order[1:][same]
    return Facets(np.sort(faces[left], axis=1), left // 4, right // 4)


def interface_faces(
    tets: Int[np.ndarray, "tets 4"], region: Int[np.ndarray, "tets"]
) -> Int[np.ndarray, "faces 3"]:
    """Faces between two tets of different regions, once each."""
    faces, left, right = facets(tets)
    return faces[region[left] != region[right]]


FLATTEST = 1e-3  # of its length: a flatter box is sampled a little beyond its sides


def stratified(
    bounds: Float[np.ndarray, "2 3"], *, rng: np.random.Generator, count: int = 64_000
) -> tuple[Float[np.ndarray, "n 3"], float]:
    """One random point in each of about ``count`` equal boxes that fill ``bounds`` [m].

    Returns the points [m] and the volume [m^3] of a box.
    """
    lo, size = bounds[0], bounds[1] - bounds[0]
    size = np.maximum(size, FLATTEST * size.max())
    shape = np.maximum(np.round(size * (count / size.prod()) ** (1 / 3)), 1).astype(int)
    corner = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    return lo + (corner + rng.random(corner.shape)) * size / shape, float((size / shape).prod())
