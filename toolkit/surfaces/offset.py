"""Parallel surfaces: a thickness for sheets, a wall for solids that stand for hollow things."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from .solids import Shell, Solids
from .surface import Surface, boundary_edges
from .triangles import Triangles, closest, edge_components

# Faces at a vertex whose normals spread by less than about 25 degrees are one smooth surface: the
# smaller eigenvalues of their normals' covariance, (1 - cos 25) / 2, then are noise, not edges.
SMOOTH = 0.05
LONGEST_MITER = 3.0  # distances: a sharper spike is cut, as in a drawing
KEPT_DEPTH = 0.9  # of the wall: an inner face nearer to the outer surface is none (thin places)


def vertex_offsets(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
) -> Float[np.ndarray, "points 3"]:
    """Move of each vertex that moves all faces around it outward by one: mitred, not averaged."""
    corners = points[faces]
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    length = np.maximum(np.linalg.norm(edges, axis=-1), np.finfo(float).tiny)
    cosine = -np.einsum("fki,fki->fk", edges, np.roll(edges, 1, axis=1))
    angle = np.arccos(np.clip(cosine / (length * np.roll(length, 1, axis=1)), -1, 1))
    vertex, weight = faces.reshape(-1), angle.reshape(-1)
    normal = np.repeat(normal, 3, axis=0)
    size = len(points)
    right = _gathered(vertex, weight[:, None] * normal, size)
    outer = np.einsum("ci,cj->cij", normal, normal).reshape(-1, 9)
    matrix = _gathered(vertex, weight[:, None] * outer, size).reshape(-1, 3, 3)
    inverse = np.linalg.pinv(matrix, rcond=SMOOTH, hermitian=True)
    move = np.einsum("vij,vj->vi", inverse, right)
    norm = np.linalg.norm(move, axis=1, keepdims=True)
    return move * np.minimum(1, LONGEST_MITER / np.maximum(norm, np.finfo(float).tiny))


def _gathered(vertex: np.ndarray, values: np.ndarray, size: int) -> np.ndarray:
    """Sum of the rows of ``values`` over the corners of each vertex."""
    return np.stack([np.bincount(vertex, weights=v, minlength=size) for v in values.T], axis=1)


def thickened(surface: Surface, sheet: Bool[np.ndarray, "faces"], thickness: float) -> Surface:
    """Replace the faces ``sheet`` by closed plates of ``thickness`` [m] around them."""
    plate = Surface(
        surface.points, surface.faces[sheet], surface.part[sheet], surface.component[sheet]
    )
    move = vertex_offsets(plate.points, plate.faces) * thickness / 2
    size = len(plate.points)
    rim, owner = boundary_edges(plate)
    u, v = rim.T
    sides = np.concatenate(
        [np.stack([v, u, u + size], axis=1), np.stack([v, u + size, v + size], axis=1)]
    )
    faces = np.concatenate([plate.faces, plate.faces[:, ::-1] + size, sides])
    part = np.concatenate([plate.part, plate.part, np.tile(plate.part[owner], 2)])
    rest = surface.faces[~sheet] + 2 * size
    points = np.concatenate([plate.points + move, plate.points - move, surface.points])
    faces = np.concatenate([faces, rest])
    part = np.concatenate([part, surface.part[~sheet]])
    return Surface(points, faces, part, edge_components(faces))


def hollowed(solids: Solids, walls: Mapping[int, float]) -> Solids:
    """Give the shells of the parts in ``walls`` a cavity that leaves a wall [m] of that thickness.

    Where a shell is thinner than two walls it stays solid.
    """
    shells, surface = [], solids.surface
    for shell in solids.shells:
        wall = max((walls.get(int(part), 0.0) for part in np.unique(shell.part)), default=0.0)
        if wall > 0:
            inner, kept = inner_surface(shell, wall)
            surface = _with_cavity(surface, inner, shell.part, kept)
            shell = replace(shell, cavity=inner)
        shells.append(shell)
    return replace(solids, shells=tuple(shells), surface=surface)


def inner_surface(shell: Shell, wall: float) -> tuple[Triangles, Bool[np.ndarray, "faces"]]:
    """Surface parallel to a shell's, a ``wall`` [m] inside; which faces bound a real cavity.

    Those are inside and a wall away from the shell.
    """
    inner = Triangles(shell.points - wall * vertex_offsets(shell.points, shell.faces), shell.faces)
    middle = inner.points[inner.faces].mean(axis=1)
    deep = closest(middle, shell.points, shell.faces).distance >= KEPT_DEPTH * wall
    return inner, deep & shell.contains(middle)


def _with_cavity(
    surface: Surface, inner: Triangles, part: np.ndarray, kept: Bool[np.ndarray, "faces"]
) -> Surface:
    faces = np.concatenate([surface.faces, inner.faces[kept][:, ::-1] + len(surface.points)])
    points = np.concatenate([surface.points, inner.points])
    part = np.concatenate([surface.part, part[kept]])
    return Surface(points, faces, part, edge_components(faces))
