"""Tets in which three or four regions meet: cones from a point in their middle."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ....fem.scene.mesh import signed_volumes
from .stencils import CUT, cut_face

FACES = ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2))
FACE_CENTRE, CENTRE = 10, 14  # after the corners and the cuts: points of the four faces and the tet


class Junctions(NamedTuple):
    """``tets`` (n, 4) with their ``region`` (n,) and orientation, on ``points`` (m, 3)."""

    tets: np.ndarray
    region: np.ndarray
    mirrored: np.ndarray
    points: np.ndarray


@cache
def cone(regions: tuple[int, ...]) -> tuple[tuple[tuple[int, ...], int], ...]:
    """Tets with their region for at least three regions at A, B, C, D, -1 on a surface.

    Each face is divided as its other tet divides it: where it has two regions by the rule of the
    stencils, where three around its centre.
    """
    faces = [_face(face, regions, FACE_CENTRE + number) for number, face in enumerate(FACES)]
    return tuple(((*triangle, CENTRE), region) for face in faces for triangle, region in face)


def _face(
    face: tuple[int, ...], regions: tuple[int, ...], centre: int
) -> list[tuple[tuple[int, ...], int]]:
    mine = [regions[i] for i in face]
    if min(mine) < 0:
        wild = face[mine.index(-1)]
        a, b = (i for i in face if i != wild)
        return [((end, CUT[a, b], wild), regions[end]) for end in (a, b)]
    if len(set(mine)) == 3:
        return [((i, CUT[i, j], centre), regions[i]) for i in face for j in face if i != j]
    tip = next(i for i in face if mine.count(regions[i]) == 1)
    a, b = (i for i in face if i != tip)
    rest = [(triangle, regions[a]) for triangle in cut_face(tip, a, b)]
    return [((tip, CUT[tip, a], CUT[tip, b]), regions[tip]), *rest]


def junction_tets(
    local: Int[np.ndarray, "tets 10"],
    regions: Int[np.ndarray, "tets 4"],
    points: Float[np.ndarray, "points 3"],
) -> Junctions:
    """Divide tets by their corners' ``regions``; ``local`` are their points, -1 where none is."""
    local, points = _with_centres(local, regions, points)
    rows, group = np.unique(regions, axis=0, return_inverse=True)
    tets, region = [np.zeros((0, 4), np.int64)], [np.zeros(0, np.int64)]
    for number, row in enumerate(rows.tolist()):
        mine = local[group.reshape(-1) == number]
        for tet, inside in cone(tuple(row)):
            tets.append(mine[:, tet])
            region.append(np.full(len(mine), inside))
    found = np.concatenate(tets)
    mirrored = signed_volumes(points, found) < 0
    return Junctions(found, np.concatenate(region), mirrored, points)


def _with_centres(
    local: Int[np.ndarray, "tets 10"],
    regions: Int[np.ndarray, "tets 4"],
    points: Float[np.ndarray, "points 3"],
) -> tuple[Int[np.ndarray, "tets 15"], Float[np.ndarray, "more 3"]]:
    """Add a point in every face of three regions, one for both its tets, and one in every tet."""
    faces = np.full((len(local), 4), -1)
    corners = local[:, FACES]
    mine = np.sort(regions[:, FACES], axis=-1)
    three = (mine[..., 0] >= 0) & (np.diff(mine, axis=-1) > 0).all(axis=-1)
    found, number = np.unique(np.sort(corners[three], axis=-1), axis=0, return_inverse=True)
    faces[three] = len(points) + number.reshape(-1)
    cuts = np.stack([local[:, [CUT[a, b], CUT[b, c], CUT[a, c]]] for a, b, c in FACES], axis=1)
    middle = np.zeros((len(found), 3))
    middle[number.reshape(-1)] = points[cuts[three]].mean(axis=1)
    points = np.concatenate([points, middle])
    centre = len(points) + np.arange(len(local))
    on = np.concatenate([regions < 0, local[:, 4:] >= 0], axis=1)
    weight = on / np.maximum(on.sum(axis=1), 1)[:, None]
    inner = np.einsum("tk,tki->ti", weight, points[local])
    return np.column_stack([local, faces, centre]), np.concatenate([points, inner])
