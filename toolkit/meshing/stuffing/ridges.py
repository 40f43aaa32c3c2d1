"""Chamfers along sharp edges, which snapping leaves between two nodes on an edge: filled by tets.

Where a chamfer has nodes p, r on the sharp edge and the mesh has an edge qs across, the tet p, q,
r, s is all that it lacks. Where no node came near, one is added on the sharp edge above qs, with a
tet on either face at qs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....fem.scene.boundary import boundary_faces
from ....fem.scene.mesh import signed_volumes
from ..lattice_guarantees import BLUNTEST, SHARPEST
from ..quality import dihedral_angles
from .cut import CutMesh
from .features import FeatureFinder, shared_edges
from .lattice import edges_of

ROUNDS = 3  # beside a tet that was added another may be missing
FLAT = 1e-3  # cubes of a long edge: a tet with less volume is flat
NEAR = 1.0  # long edges: farther from sharp edges no chamfer has an end
REACH = 0.7  # long edges: how far above an edge of the mesh a node is added

RegionAt = Callable[[Float[np.ndarray, "n 3"]], np.ndarray]


class Ridge(NamedTuple):
    """Edges (n, 2) of the boundary: the ``faces`` (n, 2, 3) at each, their ``tips``, the region."""

    edges: np.ndarray
    faces: np.ndarray
    tips: np.ndarray
    region: np.ndarray


def filled_ridges(
    mesh: CutMesh,
    on_edge: Bool[np.ndarray, "points"],
    features: FeatureFinder,
    region: RegionAt,
) -> CutMesh:
    """Add the tets that chamfers lack, where they are good and lie in the ``region`` beside them.

    ``on_edge`` tells the points that lie on sharp edges.
    """
    near = np.flatnonzero(~mesh.free)
    near = near[np.isfinite(features.on_edges(mesh.points[near], NEAR).distance)]
    for _ in range(ROUNDS):
        before = len(mesh.tets)
        mesh = _added(mesh, *_between(mesh, _ridges(mesh, near), on_edge), region)
        mesh = _added(*_above(mesh, _ridges(mesh, near), on_edge, features), region)
        on_edge = np.r_[on_edge, np.ones(len(mesh.points) - len(on_edge), dtype=bool)]
        near = np.unique(mesh.tets[before:])  # what was refused elsewhere is refused again
        if not len(near):
            break
    return mesh


def _ridges(mesh: CutMesh, near: Int[np.ndarray, "near"]) -> Ridge:
    """Edges of the boundary between two faces of one region, at the points ``near``."""
    at = np.zeros(len(mesh.points), dtype=bool)
    at[near] = True
    some = np.flatnonzero(at[mesh.tets].any(axis=1))
    faces, owner = boundary_faces(mesh.tets[some])
    true = at[faces].any(axis=1)  # others only bound the chosen tets
    faces, owner = faces[true], some[owner[true]]
    edges, left, right = shared_edges(faces)
    same = at[edges].any(axis=1) & (mesh.region[owner[left]] == mesh.region[owner[right]])
    edges, sides = edges[same], np.stack([left[same], right[same]], axis=1)
    tips = faces[sides].sum(axis=-1) - edges.sum(axis=1, keepdims=True)
    return Ridge(edges, faces[sides], tips, mesh.region[owner[sides[:, 0]]])


def _between(
    mesh: CutMesh, ridge: Ridge, on_edge: Bool[np.ndarray, "points"]
) -> tuple[Int[np.ndarray, "n 1 4"], Int[np.ndarray, "n"]]:
    """Tets on edges that run across between two points on a sharp edge which are not linked."""
    key = np.array([len(mesh.points), 1])
    new = np.flatnonzero(on_edge[ridge.tips].all(axis=1))
    along = mesh.tets[on_edge[mesh.tets].sum(axis=1) > 1]
    known = edges_of(along, len(mesh.points))[0]
    new = new[~np.isin(np.sort(ridge.tips[new], axis=1) @ key, known @ key)]
    tets = np.column_stack([ridge.faces[new, 0], ridge.tips[new, 1]])
    return tets[:, None], ridge.region[new]


def _above(
    mesh: CutMesh, ridge: Ridge, on_edge: Bool[np.ndarray, "points"], features: FeatureFinder
) -> tuple[CutMesh, Int[np.ndarray, "n 2 4"], Int[np.ndarray, "n"]]:
    """Pairs of tets from edges that run across to new points on the sharp edge above them."""
    middle = mesh.points[ridge.edges].mean(axis=1)
    across = np.flatnonzero(~on_edge[ridge.edges].any(axis=1))
    found = features.on_edges(middle[across], REACH)
    near = np.isfinite(found.distance)
    across, where = across[near], found.point[near]
    number = len(mesh.points) + np.arange(len(across))
    faces = ridge.faces[across]
    tets = np.concatenate([faces, np.repeat(number[:, None, None], 2, axis=1)], axis=-1)
    grown = mesh._replace(
        points=np.concatenate([mesh.points, where]),
        free=np.concatenate([mesh.free, np.zeros(len(where), dtype=bool)]),
    )
    return grown, tets, ridge.region[across]


def _added(
    mesh: CutMesh,
    groups: Int[np.ndarray, "n k 4"],
    regions: Int[np.ndarray, "n"],
    region: RegionAt,
) -> CutMesh:
    """Add the groups of tets that are good all together, the fattest of those in each other's way.

    A face of the boundary that comes first gives positive volume where the fourth point is above.
    """
    count, size = groups.shape[:2]
    tets = groups.reshape(-1, 4)
    solid = (signed_volumes(mesh.points, tets) > FLAT).reshape(count, size).all(axis=1)
    groups, regions = groups[solid], regions[solid]
    angles = dihedral_angles(mesh.points, groups.reshape(-1, 4)).reshape(len(groups), 6 * size)
    good = (angles.min(axis=1) >= SHARPEST) & (angles.max(axis=1) <= BLUNTEST)
    groups, regions, fatness = groups[good], regions[good], angles[good].min(axis=1)
    middle = mesh.points[groups.reshape(-1, 4)].mean(axis=1)
    inside = (region(middle).reshape(-1, size) == regions[:, None]).all(axis=1)
    groups, regions = groups[inside], regions[inside]
    kept = _apart(groups, fatness[inside])
    return _without_unused(
        mesh._replace(
            tets=np.concatenate([mesh.tets, groups[kept].reshape(-1, 4).astype(np.int32)]),
            region=np.concatenate([mesh.region, np.repeat(regions[kept], size)]),
        )
    )


def _apart(groups: Int[np.ndarray, "n k 4"], fatness: Float[np.ndarray, "n"]) -> list[int]:
    """Of groups of tets that share a face, the fattest."""
    taken: set[tuple[int, ...]] = set()
    kept = []
    for number in np.argsort(-fatness, kind="stable").tolist():
        faces: set[tuple[int, ...]] = set()
        for a, b, c, d in np.sort(groups[number], axis=1).tolist():
            faces |= {(a, b, c), (a, b, d), (a, c, d), (b, c, d)}
        if not faces & taken:
            taken |= faces
            kept.append(number)
    return kept


def _without_unused(mesh: CutMesh) -> CutMesh:
    """Drop the points that no tet has."""
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.tets] = True
    if used.all():
        return mesh
    number = (np.cumsum(used) - 1).astype(np.int32)
    return mesh._replace(points=mesh.points[used], tets=number[mesh.tets], free=mesh.free[used])
