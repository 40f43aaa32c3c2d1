"""P1 tets with nodal pressures, for nearly incompressible materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..device import start_warp
from ..elements.assembly import BlockMatrix, Discretisation, stiffness
from ..elements.constraints import reduced_load
from ..elements.elastic import ElasticBody, displacement_gradients
from ..elements.space import CENTROID
from ..laws.law import Law
from ..linalg.solver import solve_system
from ..mesh import TetMesh, material_of
from ..scene.supports import Supports
from .result import StaticResult
from .statics import TOLERANCE, check_solution, discrete_problem, static_result

# Tets around a node share a pressure where their first Lame parameters differ less than this
# factor: a soft filling must not take the pressure of a stiff shell.
SIMILAR = 3.0


class Pressures(NamedTuple):
    """Volume strains of groups of tets around a node.

    ``mean`` (groups, 3 nodes) maps displacements to the mean volume strain of every group,
    ``stiffness`` (groups,) [J] is its lam times volume, ``group`` (tets, 4) that of every corner.
    """

    mean: Any
    stiffness: np.ndarray
    group: np.ndarray


def nodal_pressures(mesh: TetMesh, lam: np.ndarray) -> Pressures:
    """Group the tets around every node by similar ``lam`` [Pa] and average their volume strain."""
    from scipy.sparse import csr_array

    tets, volumes = mesh.tets.astype(np.int64), mesh.volumes
    bucket = np.round(np.log(np.maximum(lam, 1e-300)) / np.log(SIMILAR)).astype(np.int64)
    bucket -= bucket.min()
    key = tets * (int(bucket.max()) + 1) + bucket[:, None]
    group = np.unique(key, return_inverse=True)[1].reshape(-1, 4)
    share = np.repeat(volumes / 4, 4)
    total = np.bincount(group.ravel(), share)
    stiff = np.bincount(group.ravel(), share * np.repeat(lam, 4))
    # Row of a tet: its volume strain, sum over corners of grad lambda_a . u_a.
    corner = mesh.points[tets]
    edges = corner[:, 1:] - corner[:, :1]
    gradients = np.linalg.inv(edges).transpose(0, 2, 1)
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    columns = (3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), 12)
    starts = np.arange(len(tets) + 1) * 12
    size = (len(tets), 3 * len(mesh.points))
    divergence = csr_array((gradients.ravel(), columns.ravel(), starts), shape=size)
    weight = share / total[group.ravel()]
    owner = np.repeat(np.arange(len(tets)), 4)
    average = csr_array((weight, (group.ravel(), owner)), shape=(len(total), len(tets)))
    return Pressures(average @ divergence, stiff, group)


def _matrix(grid: Discretisation, mesh: TetMesh, pressures: Pressures) -> BlockMatrix:
    wp = start_warp()
    mu = material_of(mesh).lame.mu
    shear = stiffness(grid, np.zeros_like(mu), mu).to_scipy()
    mean = pressures.mean
    whole = (shear + mean.T @ (mean * pressures.stiffness[:, None])).tobsr(blocksize=(3, 3))
    whole.sort_indices()
    return BlockMatrix(
        wp.array(whole.indptr, dtype=wp.int32, device=grid.device),
        wp.array(whole.indices, dtype=wp.int32, device=grid.device),
        wp.array(whole.data, dtype=wp.mat33d, device=grid.device),
    )


def solve_averaged(
    mesh: TetMesh,
    supports: Supports,
    *,
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    body=None,
    traction=(),
    forces: np.ndarray | None = None,
    device: str = "cpu",
    tolerance: float = TOLERANCE,
) -> StaticResult:
    """Solve as ``solve_static`` with order 1, the volume strain averaged around every node.

    One constraint a node instead of one a tet: P1 tets do not lock as nu -> 0.5 (Bonet & Burton
    1998). The pressure in ``stress`` is the averaged one.
    """
    material = material_of(mesh)
    loads = {"gravity_vector": gravity_vector, "body": body, "traction": traction, "forces": forces}
    grid, held, load = discrete_problem(mesh, supports, order=1, device=device, **loads)
    pressures = nodal_pressures(mesh, material.lame.lam)
    matrix = _matrix(grid, mesh, pressures)
    prescribed = np.where(held.fixed, held.values, 0.0)
    rhs = reduced_load(matrix, load, held, prescribed)
    nodes = grid.space.nodes
    solution = solve_system(matrix, rhs, points=nodes, fixed=held.fixed, tolerance=tolerance)
    check_solution(mesh, held, solution, tolerance)
    u = np.where(held.fixed, prescribed, solution.x)
    plain = static_result(
        mesh, ElasticBody(grid, material, Law.LINEAR), u, load, held,
        solution.residual, solution.iterations,
    )  # fmt: skip
    internal = _matrix(grid, mesh, pressures).times(u)
    H = displacement_gradients(grid, u, CENTROID)[:, 0]
    volume_strain = (pressures.mean @ u.reshape(-1))[pressures.group].mean(axis=1)
    lift = material.lame.lam * (volume_strain - np.trace(H, axis1=1, axis2=2))
    return replace(
        plain,
        stress=plain.stress + lift[:, None, None] * np.eye(3),
        reaction=np.where(held.fixed, internal - load, 0.0) - held.springs * u,
        energy=float((u * internal).sum() / 2),
        averaged=True,
    )
