"""Mass of the nodes: lumped for dynamics, consistent for modes."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from ..scene.mesh import TetMesh
from ..solve.statics import material_of
from .forces import sum_at_nodes
from .space import Space, shape_functions

# Diagonal of the P2 mass matrix (6 at corners, 32 at edges, times V / 420) scaled to the mass of
# the tet: Hinton, Rock & Zienkiewicz (1976).
_HRZ = np.array([6.0] * 4 + [32.0] * 6) / 216


def mass_shares(order: int) -> Float[np.ndarray, "_"]:
    """Share of the mass of a tet that every one of its nodes carries."""
    return np.full(4, 0.25) if order == 1 else _HRZ


def lumped_mass(mesh: TetMesh, space: Space) -> Float[np.ndarray, "nodes"]:
    """Mass [kg] of every node, from the density of every tet."""
    share = mass_shares(space.order)
    mass = (material_of(mesh).rho * mesh.volumes)[:, None] * np.ones(3)
    return sum_at_nodes(space, lambda i: share[i] * mass)[:, 0]


def _quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Barycentric points (n, 4) and weights of a tet, exact to degree 5: Duffy's map of Gauss."""
    t, w = np.polynomial.legendre.leggauss(4)
    t, w = (t + 1) / 2, w / 2
    a, b, c = (v.ravel() for v in np.meshgrid(t, t, t, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel() * (1 - a) ** 2 * (1 - b) * 6
    x, y, z = a, (1 - a) * b, (1 - a) * (1 - b) * c
    return np.stack([1 - x - y - z, x, y, z], axis=1), weight


def consistent_mass(mesh: TetMesh, space: Space) -> Any:
    """Consistent mass matrix [kg] of one component, ``scipy.sparse.csr_array`` (nodes, nodes)."""
    from scipy.sparse import coo_array

    where, weight = _quadrature()
    N = shape_functions(space.order, where)
    local = np.einsum("q,qi,qj->ij", weight, N, N)
    mass = material_of(mesh).rho * mesh.volumes
    size, count = space.elements.shape[1], len(space.nodes)
    rows = np.repeat(space.elements, size, axis=1).ravel()
    columns = np.tile(space.elements, (1, size)).ravel()
    values = (mass[:, None, None] * local).ravel()
    return coo_array((values, (rows, columns)), shape=(count, count)).tocsr()
