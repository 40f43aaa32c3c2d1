"""Points embedded in a tetrahedral mesh: barycentric weights that carry its motion to them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.scene.mesh import TetMesh

# A point counts as inside down to this barycentric coordinate: on a face it belongs to either tet.
ON_FACE = -1e-9
# Pairs of point and tet that are tested at a time: 30 MB.
CHUNK = 200_000
# Boxes of tets reach this share of a cell further, so that round-off loses no point on a face.
ON_CELL = 1e-6


@dataclass(frozen=True, eq=False)
class Embedding:
    """Where points lie in a mesh.

    Parameters
    ----------
    mesh
        The mesh at rest.
    tet
        Tet of every point, shape (n,): the one around it, or the nearest.
    weights
        Barycentric coordinates in it, shape (n, 4); some are negative outside.
    outside
        Points in no tet, shape (n,): they follow the affine map of the nearest one.
    away
        Distance of such a point from the surface [m], shape (n,); 0 of points inside.
    """

    mesh: TetMesh
    tet: Int[np.ndarray, "n"]
    weights: Float[np.ndarray, "n 4"]
    outside: Bool[np.ndarray, "n"]
    away: Float[np.ndarray, "n"]

    @cached_property
    def _used(self) -> tuple[Int[np.ndarray, "used"], Int[np.ndarray, "n"]]:
        """The tets that hold a point, and which of them every point has."""
        tets, of = np.unique(self.tet, return_inverse=True)
        return tets, of

    @cached_property
    def _rest(self) -> Float[np.ndarray, "used 3 3"]:
        """Inverse of the edge matrix of the used tets at rest."""
        return np.linalg.inv(self._edges(self.mesh.points))

    def _edges(self, points: np.ndarray) -> np.ndarray:
        corners = points[self.mesh.tets[self._used[0]]]
        return (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)

    @property
    def of_point(self) -> Int[np.ndarray, "n"]:
        """Row of every point in what ``gradients`` returns."""
        return self._used[1]

    def positions(self, displacement: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "n 3"]:
        """Positions [m] of the points when the mesh points are moved by ``displacement`` [m]."""
        moved = self.mesh.points + displacement
        return np.einsum("nk,nki->ni", self.weights, moved[self.mesh.tets[self.tet]])

    def gradients(
        self, displacement: Float[np.ndarray, "points 3"]
    ) -> Float[np.ndarray, "used 3 3"]:
        """Deformation gradient F of every tet that holds a point; ``of_point`` says which."""
        return self._edges(self.mesh.points + displacement) @ self._rest


def embed(mesh: TetMesh, positions: Float[np.ndarray, "n 3"]) -> Embedding:
    """Find the tet around every position [m], or the nearest one where there is none."""
    tet, weights = np.full(len(positions), -1), np.zeros((len(positions), 4))
    inverse, start = _barycentric_maps(mesh)
    for points, tets in _candidates(mesh, positions):
        inside = np.einsum("nij,nj->ni", inverse[tets], positions[points] - start[tets])
        all_four = np.column_stack([1 - inside.sum(axis=1), inside])
        found = all_four.min(axis=1) >= ON_FACE
        tet[points[found]], weights[points[found]] = tets[found], all_four[found]
    outside, distance = tet < 0, np.zeros(len(positions))
    if outside.any():
        nearest, away = _nearest(mesh, positions[outside])
        tet[outside], distance[outside] = nearest, away
        three = np.einsum("nij,nj->ni", inverse[nearest], positions[outside] - start[nearest])
        weights[outside] = np.column_stack([1 - three.sum(axis=1), three])
    return Embedding(mesh, tet, weights, outside, distance)


def _barycentric_maps(mesh: TetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (tets, 3, 3) and origins (tets, 3): M (x - o) are the last three coordinates."""
    corners = mesh.points[mesh.tets]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    return np.linalg.inv(edges), corners[:, 0]


def _candidates(
    mesh: TetMesh, positions: np.ndarray
) -> Iterator[tuple[Int[np.ndarray, "pairs"], Int[np.ndarray, "pairs"]]]:
    """Pairs of points and tets whose boxes they may lie in: no tet around a point is missed.

    A grid of cells as large as the boxes of the tets in the mean; every cell knows its tets.
    """
    corners = mesh.points[mesh.tets]
    low, high = corners.min(axis=1), corners.max(axis=1)
    size = float(np.cbrt((high - low).prod(axis=1).mean()))
    origin = low.min(axis=0) - 0.5 * size
    first = np.floor((low - ON_CELL * size - origin) / size).astype(np.int64)
    last = np.floor((high + ON_CELL * size - origin) / size).astype(np.int64)
    shape = last.max(axis=0) + 1
    tets, cells = _cells_of_boxes(first, last - first + 1, shape)
    order = np.argsort(cells, kind="stable")
    tets, cells = tets[order], cells[order]
    at = np.floor((positions - origin) / size).astype(np.int64)
    near = np.flatnonzero(((at >= 0) & (at < shape)).all(axis=1))
    keys = _cell(at[near], shape)
    begin, end = np.searchsorted(cells, keys), np.searchsorted(cells, keys, side="right")
    counts = end - begin
    ends = np.cumsum(counts)
    cuts = np.searchsorted(ends, np.arange(CHUNK, ends[-1] + CHUNK, CHUNK)) if len(ends) else []
    for a, b in zip([0, *cuts], [*cuts, len(near)], strict=True):
        repeats = counts[a:b]
        starts = np.repeat(begin[a:b] - np.cumsum(repeats) + repeats, repeats)
        yield np.repeat(near[a:b], repeats), tets[starts + np.arange(len(starts))]


def _cells_of_boxes(
    first: np.ndarray, extent: np.ndarray, shape: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ids of tets and of the cells that their boxes touch, in pairs."""
    counts = extent.prod(axis=1)
    owner = np.repeat(np.arange(len(first)), counts)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    wide, deep = extent[owner, 2], extent[owner, 1]
    local = np.stack([rank // (wide * deep), rank // wide % deep, rank % wide], axis=1)
    return owner, _cell(first[owner] + local, shape)


def _cell(place: Int[np.ndarray, "n 3"], shape: Int[np.ndarray, "3"]) -> Int[np.ndarray, "n"]:
    """Number of a cell of a grid."""
    return (place[:, 0] * shape[1] + place[:, 1]) * shape[2] + place[:, 2]


def _nearest(mesh: TetMesh, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tet behind the nearest boundary face of every position, and the distance [m]."""
    import igl

    boundary = mesh.boundary
    given = np.ascontiguousarray(positions), mesh.points, boundary.faces.astype(np.int64)
    squared, face = map(np.asarray, igl.point_mesh_squared_distance(*given)[:2])
    return boundary.tet[face], np.sqrt(squared)
