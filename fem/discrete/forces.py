"""Loads on a body as nodal forces: body force, gravity, surface traction, pressure."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..device import start_warp
from ..errors import InputError
from ..scene.mesh import TetMesh
from .assembly import Discretisation
from .space import TET_POINTS, Space, shape_functions


class Traction(NamedTuple):
    """Force per area ``value`` (faces, 3) [Pa] on boundary ``faces`` (faces, 3)."""

    faces: np.ndarray
    value: np.ndarray


def pressure(mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], value: float) -> Traction:
    """Pressure ``value`` [Pa] on outward ``faces``: the traction -p n."""
    return Traction(faces, -value * _area_vectors(mesh.points, faces) / _areas(mesh, faces))


def _area_vectors(points, faces) -> np.ndarray:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def _areas(mesh, faces) -> np.ndarray:
    return np.linalg.norm(_area_vectors(mesh.points, faces), axis=1, keepdims=True)


def scatter(space: Space, local: Float[np.ndarray, "tets k 3"]) -> Float[np.ndarray, "nodes 3"]:
    """Sum of element vectors (tets, nodes of an element, 3) at the nodes."""
    return sum_at_nodes(space, lambda i: local[:, i])


def sum_at_nodes(space: Space, local: Callable[[int], np.ndarray]) -> Float[np.ndarray, "nodes 3"]:
    """Sum ``local(i)`` (tets, 3) of the i-th node of every tet; little memory on large meshes."""
    total = np.zeros((len(space.nodes), 3))
    for i, ids in enumerate(space.elements.T):
        part = local(i)
        for k in range(3):
            total[:, k] += np.bincount(ids, part[:, k], minlength=len(total))
    return total


def gravity_force(
    grid: Discretisation, rho: Float[np.ndarray, "tets"], gravity: np.ndarray
) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces [N] of ``gravity`` [m/s^2] (3,) on tets of density ``rho`` [kg/m^3]."""
    from . import kernels_linear as k

    wp = start_warp()
    given = wp.array(rho, dtype=wp.float64, device=grid.device)
    share = shape_functions(grid.space.order, TET_POINTS).mean(axis=0)
    share = wp.array(share, dtype=wp.float64, device=grid.device)
    mass = wp.zeros(len(grid.space.nodes), dtype=wp.float64, device=grid.device)
    inputs = [grid.points, grid.elements, given, share, mass]
    wp.launch(k.spread, len(rho), inputs=inputs, device=grid.device)
    return mass.numpy()[:, None] * gravity


def body_force(
    mesh: TetMesh, grid: Discretisation, density: np.ndarray | Callable[[np.ndarray], np.ndarray]
) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces [N] of a force ``density`` [N/m^3]: (3,), (tets, 3), or a function of x [m]."""
    space = grid.space
    N = shape_functions(space.order, TET_POINTS)  # (quadrature, nodes of an element)
    if callable(density):
        x = np.einsum("qk,tkd->tqd", TET_POINTS, mesh.points[mesh.tets])
        f = np.asarray(density(x.reshape(-1, 3))).reshape(x.shape)
        return scatter(space, np.einsum("t,tqd,qi->tid", mesh.volumes / 4, f, N))
    from . import kernels_linear as k

    wp = start_warp()
    each = np.ascontiguousarray(np.broadcast_to(density, (len(mesh.tets), 3)), dtype=float)
    each = wp.array(each, dtype=wp.vec3d, device=grid.device, copy=grid.device != "cpu")
    share = wp.array(N.mean(axis=0), dtype=wp.float64, device=grid.device)
    force = wp.zeros(len(space.nodes), dtype=wp.vec3d, device=grid.device)
    inputs = [grid.points, grid.elements, each, share, force]
    wp.launch(k.body_force, len(mesh.tets), inputs=inputs, device=grid.device)
    return force.numpy()


def traction_force(mesh: TetMesh, space: Space, load: Traction) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces [N] of a surface traction, constant on every face."""
    faces = np.asarray(load.faces)
    total = np.broadcast_to(load.value, faces.shape) * _areas(mesh, faces)
    if space.order == 2:  # all weight sits at the middles of the edges, a third each
        faces = _edge_nodes(space, faces[:, [[0, 1], [1, 2], [2, 0]]])
    force = np.zeros((len(space.nodes), 3))
    for k in range(3):
        np.add.at(force, faces[:, k], total / 3)
    return force


def _edge_nodes(space: Space, ends: np.ndarray) -> np.ndarray:
    count = space.points
    key = space.edges[:, 0] * count + space.edges[:, 1]  # sorted, by construction
    ends = np.sort(ends.astype(np.int64), axis=-1)
    wanted = ends[..., 0] * count + ends[..., 1]
    index = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
    if (key[index] != wanted).any():
        raise InputError("a traction face is no face of the mesh: take faces from mesh.boundary")
    return count + index
