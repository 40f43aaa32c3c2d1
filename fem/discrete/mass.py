"""Mass of the nodes: lumped for dynamics, consistent for modes."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from ..scene.mesh import TetMesh, material_of
from .assembly import Discretisation
from .forces import sum_at_nodes
from .space import Space, duffy_rule, shape_functions

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


def consistent_mass(mesh: TetMesh, grid: Discretisation) -> Any:
    """Consistent mass matrix [kg] of one component, ``scipy.sparse.csr_array`` (nodes, nodes).

    Its entries are those of the stiffness of ``grid``, block by block.
    """
    from scipy.sparse import csr_array

    local = _local_mass(grid.space.order).ravel()
    values = (material_of(mesh).rho * mesh.volumes)[:, None] * local
    rows, columns, slots = (a.numpy() for a in grid.pattern)
    data = np.bincount(slots.ravel(), values.ravel(), minlength=len(columns))
    count = len(grid.space.nodes)
    return csr_array((data, columns, rows), shape=(count, count))


def squared_masses(
    mesh: TetMesh, space: Space, x: Float[np.ndarray, "nodes 3"]
) -> Float[np.ndarray, "tets"]:
    """Share of every tet in x . M x, with the consistent mass M [kg]."""
    local = x[space.elements]
    each = np.einsum("tic,tic->t", local, _local_mass(space.order) @ local)
    return material_of(mesh).rho * mesh.volumes * each


def _local_mass(order: int) -> Float[np.ndarray, "k k"]:
    """Consistent mass of a tet of mass one."""
    where, weight = duffy_rule()
    N = shape_functions(order, where)
    return np.einsum("q,qi,qj->ij", weight, N, N)


def diagonal_mass(mesh: TetMesh, grid: Discretisation) -> Any:
    """Lumped mass matrix [kg] of one component, in the form of ``consistent_mass``."""
    from scipy.sparse import csr_array

    rows, columns = (a.numpy() for a in grid.pattern[:2])
    count = len(grid.space.nodes)
    on_diagonal = columns == np.repeat(np.arange(count), np.diff(rows))
    data = np.where(on_diagonal, lumped_mass(mesh, grid.space)[columns], 0.0)
    return csr_array((data, columns, rows), shape=(count, count))
