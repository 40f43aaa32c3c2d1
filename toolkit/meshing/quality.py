"""Quality of a tet mesh: angles, radius ratios, altitudes, and what kind of surface bounds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ...fem.material import wave_speed
from ...fem.mesh import (
    TetMesh,
    altitudes,
    boundary_faces,
    edge_vectors,
    equal_faces,
    largest_explicit_step,
    signed_volumes,
    tet_area_vectors,
)
from ..asset.surface import face_edges
from ..asset.triangles import Faces, Points, Tets, linked_groups

# Pairs of faces (opposite to vertices i and j) that meet in each of the six edges of a tet.
FACE_PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])

ROWS = ("measure", "unit", "min", "5 %", "median")
STEEL = 2.1e11, 0.3, 7850.0  # E [Pa], nu [1], rho [kg/m^3]: 6.0 km/s


@dataclass(frozen=True)
class BoundaryKind:
    """What the boundary is: closed 2-manifold when both counts are 0.

    faces: Boundary triangles.
    bad_edges: Edges that do not lie on exactly two of them.
    pinched_vertices: Vertices where several fans of them meet.
    """

    faces: int
    bad_edges: int
    pinched_vertices: int


@dataclass(frozen=True)
class Quality:
    """Numbers about the tets of a mesh, and its boundary.

    Dihedral angles are those of the sharpest edge of each tet [degrees], ``dihedral_max`` that of
    the bluntest of all; the radius ratio is three
    inradii by one circumradius [1], 1 for a regular tet; altitudes are in [m], volumes in [m^3].
    ``time_step`` [s] is the largest that explicit integration may take, smallest altitude by wave
    speed: that of E, nu and rho, and without them that of steel, which few solids exceed.
    """

    points: int
    tets: int
    volume: float
    volume_min: float
    dihedral_min: float
    dihedral_p05: float
    dihedral_median: float
    dihedral_max: float
    radius_ratio_min: float
    radius_ratio_p05: float
    radius_ratio_median: float
    altitude_min: float
    time_step: float
    components: int
    boundary: BoundaryKind

    def rows(self) -> list[dict[str, str | float | None]]:
        """Return what `convert --quality` prints: a measure, its unit, and three numbers."""
        numbers = (
            ("sharpest dihedral angle", "°", self.dihedral_min, self.dihedral_p05,
             self.dihedral_median),
            ("radius ratio", "1", self.radius_ratio_min, self.radius_ratio_p05,
             self.radius_ratio_median),
            ("altitude", "m", self.altitude_min, None, None),
            ("explicit time step", "s", self.time_step, None, None),
        )  # fmt: skip
        return [dict(zip(ROWS, row, strict=True)) for row in numbers]


def quality(mesh: TetMesh) -> Quality:
    """Measure a mesh."""
    angles = dihedral_angles(mesh.points, mesh.tets)
    low, p05, median = np.percentile(angles.min(axis=1), [0, 5, 50]).tolist()
    ratio = radius_ratios(mesh.points, mesh.tets)
    worst, ratio_p05, ratio_median = np.percentile(ratio, [0, 5, 50]).tolist()
    altitude = float(altitudes(mesh.points, mesh.tets).min())
    if mesh.material is None:
        step = altitude / float(wave_speed(*np.atleast_2d(STEEL).T)[0])
    else:
        step = largest_explicit_step(mesh)
    # Pieces that are connected through nodes
    rows, columns = np.repeat(mesh.tets[:, 0], 3), mesh.tets[:, 1:].reshape(-1)
    together = linked_groups(len(mesh.points), rows, columns)
    return Quality(
        points=len(mesh.points),
        tets=len(mesh.tets),
        volume=mesh.volume,
        volume_min=float(mesh.volumes.min()),
        dihedral_min=low,
        dihedral_p05=p05,
        dihedral_median=median,
        dihedral_max=float(angles.max()),
        radius_ratio_min=worst,
        radius_ratio_p05=ratio_p05,
        radius_ratio_median=ratio_median,
        altitude_min=altitude,
        time_step=step,
        components=vertex_count(together[mesh.tets[:, 0]]),
        boundary=boundary_kind(boundary_faces(mesh.tets).faces),
    )


def dihedral_angles(points: Points, tets: Tets) -> Float[np.ndarray, "tets 6"]:
    """Inner dihedral angles [degrees] at the six edges of every tet."""
    return np.degrees(np.arccos(dihedral_cosines(points, tets))).T


def dihedral_cosines(points: Points, tets: Tets) -> Float[np.ndarray, "6 tets"]:
    """Cosines of the inner dihedral angles; of a face without area 0."""
    normal = tet_area_vectors(points, tets)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    cosines = [-np.einsum("kt,kt->t", normal[i], normal[j]) for i, j in FACE_PAIRS]
    return np.clip(cosines, -1, 1)


def radius_ratios(points: Points, tets: Tets) -> Float[np.ndarray, "tets"]:
    """Return 3 r / R of every tet: inradius by circumradius, 1 for a regular one."""
    edges, normals = edge_vectors(points, tets), tet_area_vectors(points, tets)
    volume = signed_volumes(points, tets)
    area = np.linalg.norm(normals, axis=1).sum(axis=0)
    center = sum((e * e).sum(axis=0) * normal for e, normal in zip(edges, normals[1:], strict=True))
    circumradius = np.linalg.norm(center, axis=0) / (6 * volume)
    return 3 * (3 * volume / area) / circumradius


def boundary_kind(faces: Faces) -> BoundaryKind:
    """Count what keeps a triangle surface from being a closed 2-manifold."""
    bad_edges = int((face_edges(faces).count != 2).sum())
    return BoundaryKind(len(faces), bad_edges, len(corner_nodes(faces)[1]) - vertex_count(faces))


def vertex_count(cells: Int[np.ndarray, "*cells"]) -> int:
    """How many different vertices cells have."""
    return int(np.count_nonzero(np.bincount(cells.reshape(-1))))


def corner_nodes(cells: Int[np.ndarray, "cells k"]) -> tuple[np.ndarray, np.ndarray]:
    """Nodes such that cells share one exactly where they hang together through facets.

    ``cells`` are triangles of a closed surface (facets: edges) or tets (facets: faces). Two cells
    at a vertex get the same node when a chain of cells around that vertex, each sharing a facet
    with the next, links them; around an inner vertex of tets one always does. Returns the cells on
    the new nodes, and the old vertex of every new node, ascending.
    """
    count = int(cells.max(initial=-1)) + 1
    used = np.zeros(count, dtype=bool)
    used[cells] = True
    # Pairs of corners that a facet links, at the vertices which may have several groups
    size = cells.shape[1]
    opposite = np.array([[j for j in range(size) if j != i] for i in range(size)])
    facets = cells[:, opposite].reshape(-1, size - 1)
    order, same = equal_faces(facets)
    sides = np.stack([order[:-1][same], order[1:][same]], axis=1)
    asked = np.ones(count, dtype=bool)
    if size == 4:
        single = np.ones(len(facets), dtype=bool)
        single[sides] = False
        asked[:] = False
        asked[facets[single]] = True
    sides = sides[asked[facets[sides[:, 0]]].any(axis=1)]
    turn = np.argsort(facets[sides], axis=2)  # both sides name the vertices in the same order
    corners = sides[..., None] // size * size + opposite[sides % size]
    corners = np.take_along_axis(corners, turn, axis=2)
    shared = asked[cells.reshape(-1)[corners[:, 0]]]
    links = corners.swapaxes(1, 2)[shared]
    corner = np.flatnonzero(asked[cells])  # of all corners, cell by cell
    number = np.zeros(cells.size, dtype=np.int64)
    number[corner] = np.arange(len(corner))
    label = linked_groups(len(corner), *number[links].T)
    whole = np.flatnonzero(used & ~asked)
    vertex = np.zeros(len(whole) + label.max(initial=-1) + 1, dtype=np.int64)  # of all nodes
    vertex[: len(whole)] = whole
    vertex[len(whole) + label] = cells.reshape(-1)[corner]
    ascending = np.argsort(vertex, kind="stable")
    node = np.empty_like(ascending)
    node[ascending] = np.arange(len(ascending))
    own = np.zeros(count, dtype=np.int64)
    own[whole] = node[: len(whole)]
    new = own[cells].reshape(-1)
    new[corner] = node[len(whole) + label]
    return new.reshape(cells.shape), vertex[ascending]
