"""Questions about triangle soups that libigl answers, with plain arrays on both sides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int


class Triangles(NamedTuple):
    """Triangle surface: ``points`` (n, 3) [m], ``faces`` (m, 3)."""

    points: np.ndarray
    faces: np.ndarray


def enclosed_volume(surface: Triangles) -> float:
    """Signed volume [m^3] inside a closed surface, positive where it is wound outward.

    It is taken about the centre of the box, so that small holes change it little.
    """
    corners = surface.points[surface.faces]
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    a, b, c = np.moveaxis(corners - middle, 1, 0)
    return float(np.einsum("fi,fi->", np.cross(a, b), c) / 6)


class Closest(NamedTuple):
    """``distance`` (n,) [m] to the nearest point of a surface and the ``face`` (n,) it lies on."""

    distance: np.ndarray
    face: np.ndarray


class Patches(NamedTuple):
    """``faces`` (m, 3) wound coherently within each orientable ``patch`` (m,)."""

    faces: np.ndarray
    patch: np.ndarray


class WindingNumber:
    """Generalised winding number of a surface: 1 inside a closed outward one, 0 outside.

    What it is computed from is kept, for many questions about one surface.
    """

    def __init__(
        self, points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
    ) -> None:
        """Sort triangles [m] into a tree."""
        import igl

        corners = points[faces]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        faces = faces[area.any(axis=1)]  # a point or a line winds around nothing, and crashes igl
        self._tree = igl.FastWindingNumberBVH() if len(faces) else None
        if self._tree is not None:
            self._tree.init(points, _int64(faces))

    def __call__(self, where: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Winding number at ``where`` [m]."""
        if self._tree is None or not len(where):
            return np.zeros(len(where))
        return np.asarray(self._tree.winding_number(where), dtype=np.float64)


def winding_numbers(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    where: Float[np.ndarray, "n 3"],
) -> Float[np.ndarray, "n"]:
    """Winding number of a surface at ``where`` [m], asked once."""
    return WindingNumber(points, faces)(where)


class ClosestTo:
    """Nearest points of one surface, whose tree is kept for many questions."""

    def __init__(
        self, points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
    ) -> None:
        """Sort triangles [m] into a tree."""
        import igl

        self._points, self._faces = np.ascontiguousarray(points, np.float64), _int64(faces)
        self._tree = igl.AABB()
        self._tree.init(self._points, self._faces)

    def __call__(self, where: Float[np.ndarray, "n 3"]) -> Closest:
        """Nearest point for each of ``where`` [m]."""
        if not len(where):
            return Closest(np.zeros(0), np.zeros(0, np.int64))
        where = np.ascontiguousarray(where, np.float64)
        squared, face, _ = self._tree.squared_distance(self._points, self._faces, where)
        return Closest(np.sqrt(np.maximum(squared, 0)), np.asarray(face, dtype=np.int64))


def closest(
    where: Float[np.ndarray, "n 3"],
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
) -> Closest:
    """Nearest point of a surface for each of ``where`` [m], asked once."""
    return ClosestTo(points, faces)(where)


def edge_components(faces: Int[np.ndarray, "faces 3"]) -> Int[np.ndarray, "faces"]:
    """Label from 0 on of the edge-connected component of every face."""
    import igl

    if not len(faces):
        return np.zeros(0, np.int64)
    return np.asarray(igl.facet_components(_int64(faces))[1], dtype=np.int64)


def crossing_pairs(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
) -> Int[np.ndarray, "pairs 2"]:
    """Pairs of faces that intersect and do not lie in one plane, by exact predicates."""
    from igl.predicates import find_self_intersections

    if not len(faces):
        return np.zeros((0, 2), np.int64)
    _, pairs, coplanar = find_self_intersections(points, _int64(faces))
    crossing = ~np.asarray(coplanar, dtype=bool).reshape(-1)
    return np.asarray(pairs, np.int64).reshape(-1, 2)[crossing]


class Collapsed(NamedTuple):
    """A surface with fewer triangles, and the one of the given faces that ``birth`` (m,) names."""

    points: np.ndarray
    faces: np.ndarray
    birth: np.ndarray


def collapsed(surface: Triangles, count: int) -> Collapsed:
    """Collapse edges, the flattest first, to ``count`` triangles.

    The surface must be edge-manifold and coherently wound: on others libigl may never return.
    """
    import igl

    points, faces, birth, _ = igl.qslim(surface.points, _int64(surface.faces), count)
    return Collapsed(
        np.asarray(points, np.float64),
        np.asarray(faces, np.int64),
        np.asarray(birth, np.int64).reshape(-1),
    )


def coherent_patches(faces: Int[np.ndarray, "faces 3"]) -> Patches:
    """Wind the faces of every orientable patch the same way round."""
    import igl

    if not len(faces):
        return Patches(faces, np.zeros(0, np.int64))
    coherent, patch = igl.bfs_orient(_int64(faces))
    return Patches(np.asarray(coherent, np.int64), np.asarray(patch, np.int64))


def _int64(faces: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(faces, dtype=np.int64)
