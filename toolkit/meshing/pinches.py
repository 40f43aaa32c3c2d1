"""Boundary vertices where several fans of faces meet, mended so that each has one.

Where tets around a vertex hang together by faces, but two hollows touch in it, no node can be
doubled as it is. Either the tip of a hollow is filled, from its rim to the vertex; or the tets
beside it get a node of their own, a little towards it, and new tets fill the wedge between both.
The edges from the rim to others are cut before, so that a ring of faces lies between the two.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fem.mesh import altitudes, boundary_faces, signed_volumes
from ..asset.repair import least_area_cap
from ..asset.triangles import Points, Tets
from .guarantees import Separated, separate
from .quality import corner_nodes, dihedral_angles

# A tet's vertices in an order of the same sign that begins with the first, second ...
FIRST = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
STEPS = (1.0, 0.5, 0.3, 0.15)  # of the reach: how far a new node may lie from the old one
SHARES = (0.3, 0.5, 0.7)  # of an edge from a rim: where it is cut
FLAT = 1e-6  # of the reach: an altitude below is of a tet without a volume to divide by
MOST = 40  # vertices that are mended, each by looks at the whole mesh; more are told alone
TURNS = 200  # of the search for a direction that all faces of a ring are seen from


def manifold(points: Points, tets: Tets, *, reach: float, worst: float) -> Separated:
    """Separate what meets without a face, and give every vertex one fan of the boundary.

    Its faces move by at most ``reach`` [m]. Where that takes a tet with a dihedral angle nearer to
    0 or 180 than ``worst`` [degrees], and nearer than those around, the vertex stays pinched.
    """
    mesh = separate(points, tets)
    vertex = corner_nodes(boundary_faces(mesh.tets).faces)[1]
    left = []
    found = np.unique(vertex[:-1][vertex[1:] == vertex[:-1]]).tolist()
    if len(found) > MOST:
        return mesh._replace(pinched=mesh.points[found])
    for one in found:
        while len(rims := _rims(mesh.tets, one) or []) > 1:
            tries = [w for rim in rims for w in _ways(mesh.points, mesh.tets, one, rim, reach)]
            best = max(tries, key=lambda way: way.worst, default=None)
            if best is None or best.worst < min(worst, best.before):
                left.append(mesh.points[one])
                break
            kept = np.delete(np.arange(len(mesh.tets)), best.gone)
            mesh = mesh._replace(
                points=np.concatenate([mesh.points, best.points]),
                tets=np.concatenate([mesh.tets[kept], best.tets]).astype(np.int32),
                origin=mesh.origin[np.concatenate([kept, best.origin])],
                mended=mesh.mended + 1,
            )
    return mesh._replace(pinched=np.array(left).reshape(-1, 3))


def _link(star: Int[np.ndarray, "star 4"], vertex: int) -> Int[np.ndarray, "faces 3"]:
    """Faces opposite to a vertex in its tets, wound so that a tet is the vertex and its face."""
    turned = FIRST[(star == vertex).argmax(axis=1)]
    return np.take_along_axis(star, turned, axis=1)[:, 1:]


def _sides(faces: Int[np.ndarray, "faces 3"]) -> Int[np.ndarray, "sides 2"]:
    """Directed edges of faces, three each."""
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def _rims(tets: Tets, vertex: int) -> list[list[int]] | None:
    """Cycles of vertices around the hollows that touch a vertex; None where edges are bare."""
    star = tets[(tets == vertex).any(axis=1)]
    sides = set(map(tuple, _sides(_link(star, vertex)).tolist()))
    rim = [(a, b) for a, b in sides if (b, a) not in sides]
    after, rims = dict(rim), []
    if len(after) < len(rim):
        return None
    while after:
        cycle = [next(iter(after))]
        while (nearest := after.pop(cycle[-1])) != cycle[0]:
            cycle.append(nearest)
        rims.append(cycle)
    return rims


class _Way(NamedTuple):
    """New ``points`` and ``tets`` for those that are ``gone``; each is of or beside an ``origin``.

    ``worst`` is how near to 0 or 180 [degrees] a dihedral angle of theirs is, ``before`` of others.
    """

    points: np.ndarray
    tets: np.ndarray
    gone: np.ndarray
    origin: np.ndarray
    worst: float
    before: float


def _ways(points: Points, tets: Tets, vertex: int, rim: list[int], reach: float) -> Iterator[_Way]:
    """Take a rim's hollow away from a vertex, in every way that there is room for."""
    star = np.flatnonzero((tets == vertex).any(axis=1))
    around = np.flatnonzero(np.isin(tets, tets[star]).sum(axis=1) > 1)
    before = _worst(points, tets[around])
    faces = np.array(rim)[least_area_cap(points[rim]).faces]
    tip = np.column_stack([np.full(len(faces), vertex), faces[:, ::-1]])
    if _fits(points, tets, tip, reach):
        beside = star[[np.isin(tets[star], tet).sum(axis=1).argmax() for tet in tip]]
        nothing = np.zeros(0, np.int64)
        yield _Way(np.zeros((0, 3)), tip, nothing, beside, _worst(points, tip), before)
    link = _sides(_link(tets[star], vertex))
    outline = {frozenset(side) for side in pairwise([*rim, rim[0]])}
    spokes = {frozenset(side) for side in link[np.isin(link, rim).any(axis=1)].tolist()} - outline
    for share in SHARES:
        patch, origin, where = tets[around], around, points
        for a, b in (sorted(spoke, key=lambda end: end not in rim) for spoke in spokes):
            both = ((patch == a) | (patch == b)).sum(axis=1) == 2
            halves = [np.where(patch[both] == end, len(where), patch[both]) for end in (a, b)]
            patch = np.concatenate([patch[~both], *halves])
            origin = np.concatenate([origin[~both], origin[both], origin[both]])
            where = np.concatenate([where, [points[a] + share * (points[b] - points[a])]])
        beside = (patch == vertex).any(axis=1) & np.isin(patch, rim).any(axis=1)
        pairs = _sides(_link(patch[beside], vertex))
        ring = ~np.isin(pairs, rim).any(axis=1)
        pairs, owner = pairs[ring], origin[beside].repeat(3)[ring]
        way = _seen_by_all(where, vertex, pairs)
        if way is None:
            continue
        ends = np.full((len(pairs), 1), vertex), np.full((len(pairs), 1), len(where))
        patch = np.where((patch == vertex) & beside[:, None], len(where), patch)
        patch = np.concatenate([patch, np.column_stack([ends[0], pairs, ends[1]])])
        origin = np.concatenate([origin, owner])
        for step in STEPS:
            placed = np.concatenate([where, [where[vertex] + step * reach * way]])
            if (signed_volumes(placed, patch) > 0).all():
                new = placed[len(points) :]
                yield _Way(new, patch, around, origin, _worst(placed, patch), before)


def _worst(points: Points, tets: Int[np.ndarray, "some 4"]) -> float:
    """How near to 0 or 180 a dihedral angle is [degrees]."""
    angles = dihedral_angles(points, tets)
    return float(np.minimum(angles, 180 - angles).min())


def _fits(points: Points, tets: Tets, tip: Int[np.ndarray, "tip 4"], reach: float) -> bool:
    """Whether tets from a vertex to a cap of a rim fill nothing but air, no deeper than ``reach``.

    The vertices of the rim get no second fan.
    """
    heights = altitudes(points, tip)
    if (signed_volumes(points, tip) <= 0).any() or heights.min() < FLAT * reach:
        return False
    if heights[:, 0].max() > reach:
        return False
    places = np.vstack([points.T, np.ones(len(points))])
    for tet in tip:
        weight = np.linalg.solve(np.vstack([points[tet].T, np.ones(4)]), places)
        if np.delete((weight > 0).all(axis=0), tet).any():
            return False
    both = np.concatenate([tets, tip])
    rims = [_rims(both, vertex) for vertex in np.unique(tip[:, 1:]).tolist()]
    return all(rim is not None and len(rim) < 2 for rim in rims)


def _seen_by_all(
    points: Points, vertex: int, pairs: Int[np.ndarray, "ring 2"]
) -> Float[np.ndarray, "3"] | None:
    """Unit vector from a vertex to the upper side of every face between it and a pair of a ring."""
    rays = points[pairs] - points[vertex]
    normal = np.cross(rays[:, 0], rays[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    way = normal.mean(axis=0)
    for _ in range(TURNS):  # the perceptron: ends where there is such a vector
        way += normal[(normal @ way).argmin()] / len(normal)
    way /= max(float(np.linalg.norm(way)), np.finfo(float).tiny)
    return way if (normal @ way).min() > 0 else None
