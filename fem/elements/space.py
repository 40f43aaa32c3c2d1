"""The finite-element space on a tet mesh, P1 (corners) or P2 (and edge middles); quadrature."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..errors import InputError
from ..mesh import TetMesh, boundary_faces

# Edges of a tet in the order of VTK's quadratic tetrahedron: node 4 + k lies on edge k.
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])

# Unknowns of a P2 space above which a rest takes linear elements: CG takes half a minute of a core
# and 1.1 GB at 700,000. Motions and vibrations, of many solves, take them above the other number.
LARGEST_P2 = 1_000_000
LARGEST_MOVING = 150_000


@dataclass(frozen=True, eq=False)
class Space:
    """Continuous piecewise polynomials of degree ``order`` on straight-sided tets.

    order: 1 or 2.
    nodes: Node positions [m], shape (nodes, 3); the first ones are the points of the mesh.
    elements: Node ids, shape (tets, 4) or (tets, 10) in VTK's order, int32.
    edges: Points at the ends of every edge node, shape (nodes - points, 2).
    """

    order: int
    nodes: Float[np.ndarray, "nodes 3"]
    elements: Int[np.ndarray, "tets _"]
    edges: Int[np.ndarray, "edges 2"]

    @property
    def points(self) -> int:
        """Number of mesh points, which are the first nodes."""
        return len(self.nodes) - len(self.edges)

    @cached_property
    def outer_edges(self) -> Bool[np.ndarray, "edges"]:
        """Whether an edge lies on the surface of the body."""
        outer = np.zeros(len(self.edges), dtype=bool)
        if self.order == 2:
            faces, tet = boundary_faces(self.elements[:, :4])
            around = [[k for k, ends in enumerate(EDGES) if f not in ends] for f in range(4)]
            opposite = self.elements[tet, :4]
            face = (opposite[:, :, None] != faces[:, None]).all(axis=2).argmax(axis=1)
            outer[self.elements[tet[:, None], 4 + np.array(around)[face]] - self.points] = True
        return outer

    @property
    def unused(self) -> Int[np.ndarray, "unused"]:
        """Nodes that belong to no element."""
        used = np.zeros(len(self.nodes), dtype=bool)
        used[self.elements] = True
        return np.flatnonzero(~used)


def shape_functions(order: int, barycentric: np.ndarray) -> np.ndarray:
    """Shape functions (..., 4 or 10) of a tet at barycentric coordinates (..., 4)."""
    lam = np.asarray(barycentric)
    if order == 1:
        return lam
    edge = 4 * lam[..., EDGES[:, 0]] * lam[..., EDGES[:, 1]]
    return np.concatenate([lam * (2 * lam - 1), edge], axis=-1)


def make_space(mesh: TetMesh, order: int) -> Space:
    """P1 or P2 space on ``mesh``."""
    if order == 1:
        return Space(1, mesh.points, mesh.tets, np.zeros((0, 2), dtype=np.int64))
    if order != 2:
        raise InputError("space.order_wanted", order=order)
    count = len(mesh.points)
    ends = np.sort(mesh.tets[:, EDGES].astype(np.int64), axis=-1).reshape(-1, 2)
    key, index = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    edges = np.stack([key // count, key % count], axis=1)
    middle = (count + index.reshape(-1, 6)).astype(np.int32)
    nodes = np.concatenate([mesh.points, mesh.points[edges].mean(axis=1)])
    return Space(2, nodes, np.ascontiguousarray(np.hstack([mesh.tets, middle])), edges)


def extend_linear(space: Space, values: np.ndarray) -> np.ndarray:
    """Values at mesh points (points, ...) continued linearly to all nodes (nodes, ...)."""
    a, b = space.edges.T  # a mean over an axis of two takes numpy several times longer
    return np.concatenate([values, (values[a] + values[b]) / 2])


def p2_unknowns(mesh: TetMesh) -> int:
    """Unknowns of the P2 space of ``mesh``, by Euler's formula (exact for one ball-like piece)."""
    faces = (4 * len(mesh.tets) + len(mesh.boundary.faces)) // 2
    used = len(np.unique(mesh.tets))
    edges = used + faces - len(mesh.tets) - 1
    return 3 * (used + edges)


def affordable_order(mesh: TetMesh, most: int | None = None) -> int:
    """Quadratic elements up to ``most`` unknowns: linear ones are far too stiff on thin parts.

    None: what a rest affords.
    """
    return 2 if p2_unknowns(mesh) <= (LARGEST_P2 if most is None else most) else 1


class Quadrature(NamedTuple):
    """Barycentric ``points`` (n, 4) and ``weights`` (n,), which sum to 1."""

    points: np.ndarray
    weights: np.ndarray


CENTROID = np.full((1, 4), 0.25)
# Four-point rule of equal weights, exact for degree 2: barycentric coordinates of point q are b
# everywhere but a at corner q.
_A, _B = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
TET_POINTS = np.full((4, 4), _B) + (_A - _B) * np.eye(4)


def element_points(order: int) -> np.ndarray:
    """Points (n, 4) of equal weights that integrate the stiffness of P1 or P2 tets exactly."""
    return TET_POINTS if order == 2 else CENTROID


def duffy_rule(count: int = 4) -> Quadrature:
    """Rule that is exact to degree 2 ``count`` - 3: Duffy's map of Gauss points."""
    t, w = np.polynomial.legendre.leggauss(count)
    t, w = (t + 1) / 2, w / 2
    a, b, c = (v.ravel() for v in np.meshgrid(t, t, t, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel() * (1 - a) ** 2 * (1 - b) * 6
    x, y, z = a, (1 - a) * b, (1 - a) * (1 - b) * c
    return Quadrature(np.stack([1 - x - y - z, x, y, z], axis=1), weight)
