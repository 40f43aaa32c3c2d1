"""Loads on a body as nodal forces: gravity, body force, surface traction; masses of nodes.

Pressures and torques turn with the faces they act on, and stiffen the body by that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..device import start_warp
from ..errors import InputError
from ..mesh import TetMesh, face_areas, face_normals, material_of
from ..note import Note
from ..scene.loads import Traction, resultant, turning_traction
from ..scene.supports import Supports
from ..validation import checked_rows, checked_vector
from .assembly import Discretisation
from .space import TET_POINTS, Space, duffy_rule, extend_linear, shape_functions


def sum_at_nodes(
    space: Space, local: Float[np.ndarray, "tets k *axes"]
) -> Float[np.ndarray, "nodes *axes"]:
    """Sum at the nodes what every tet has at its own."""
    flat = local.reshape(space.elements.size, -1)
    sums = [np.bincount(space.elements.ravel(), x, len(space.nodes)) for x in flat.T]
    return np.stack(sums, axis=1).reshape(-1, *local.shape[2:])


def nodal_integral(grid: Discretisation, density: Any) -> np.ndarray:
    """Integral of a device array of numbers or vectors, constant on every tet, at the nodes."""
    from . import kernels_field as k

    wp, vector = start_warp(), density.dtype is start_warp().vec3d
    fraction = shape_functions(grid.space.order, TET_POINTS).mean(axis=0)
    fraction = wp.array(fraction, dtype=wp.float64, device=grid.device)
    total = wp.zeros(len(grid.space.nodes), dtype=density.dtype, device=grid.device)
    inputs = [grid.tets, density, fraction, total]
    kernel = k.spread_vector if vector else k.spread_scalar
    wp.launch(kernel, len(density), inputs=inputs, device=grid.device)
    return total.numpy()


def body_force(
    mesh: TetMesh, grid: Discretisation, density: np.ndarray | Callable[[np.ndarray], np.ndarray]
) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces [N] of a force ``density`` [N/m^3]: (3,), (tets, 3), or a function of x [m]."""
    space = grid.space
    if callable(density):
        N = shape_functions(space.order, TET_POINTS)  # (quadrature, nodes of an element)
        x = np.einsum("qk,tkd->tqd", TET_POINTS, mesh.points[mesh.tets])
        f = np.asarray(density(x.reshape(-1, 3))).reshape(x.shape)
        return sum_at_nodes(space, np.einsum("t,tqd,qi->tid", mesh.volumes / 4, f, N))
    wp = start_warp()
    each = np.ascontiguousarray(np.broadcast_to(density, (len(mesh.tets), 3)), dtype=float)
    each = wp.array(each, dtype=wp.vec3d, device=grid.device, copy=grid.device != "cpu")
    return nodal_integral(grid, each)


def traction_force(mesh: TetMesh, space: Space, load: Traction) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces [N] of a surface traction, constant on what it acts on of every face."""
    faces = np.asarray(load.faces)
    if np.ndim(load.value) == 0:
        raise InputError("forces.traction_pa", value=load.value)
    total = np.broadcast_to(load.value, faces.shape) * face_areas(mesh.points, faces)[:, None]
    nodes, fractions = faces, load.fractions(space.order)
    if space.order == 2:
        nodes = np.hstack([faces, edge_nodes(space, faces[:, [[0, 1], [1, 2], [2, 0]]])])
    force = np.zeros((len(space.nodes), 3))
    for k in np.flatnonzero(fractions.any(axis=0)):
        np.add.at(force, nodes[:, k], total * fractions[:, k, None])
    return force


def edge_nodes(space: Space, ends: Int[np.ndarray, "*n 2"]) -> Int[np.ndarray, "*n"]:
    """Node of the quadratic ``space`` between every two points; ``InputError`` where none is."""
    count = space.points
    key = space.edges[:, 0] * count + space.edges[:, 1]  # sorted, by construction
    ends = np.sort(ends.astype(np.int64), axis=-1)
    keys = ends[..., 0] * count + ends[..., 1]
    index = np.minimum(np.searchsorted(key, keys), len(key) - 1)
    if (key[index] != keys).any():
        raise InputError("forces.traction_face")
    return count + index


def load_vector(
    mesh: TetMesh,
    grid: Discretisation,
    *,
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    body: np.ndarray | Callable[[np.ndarray], np.ndarray] | None = None,
    traction: Traction | Sequence[Traction] = (),
    forces: np.ndarray | None = None,
) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces [N] of all loads together.

    ``gravity_vector`` [m/s^2] (3,), ``body`` force [N/m^3] as in ``body_force``, ``traction`` [Pa],
    nodal ``forces`` [N] of the points or of all nodes, (points, 3) or (nodes, 3).
    """
    space = grid.space
    gravity = checked_vector("gravity_vector", gravity_vector, "m/s^2")
    total = np.zeros((len(space.nodes), 3))
    if gravity.any():
        mass = nodal_integral(grid, *grid.constants(material_of(mesh).rho))
        for axis in np.flatnonzero(gravity):  # a few times faster than all at once
            total[:, axis] = mass * gravity[axis]
    if body is not None:
        total += body_force(mesh, grid, body)
    for load in [traction] if isinstance(traction, Traction) else traction:
        total += traction_force(mesh, space, load)
    if forces is not None:
        rows = checked_rows("forces", forces, node_counts(space), "N")
        total[: len(rows)] += rows
    if not np.isfinite(total).all():
        raise InputError("forces.load_finite")
    return total


def node_counts(space: Space) -> dict[int, str]:
    """What an array may have a row for: every node of the space, or every point of the mesh."""
    return {
        len(space.nodes): Note("forces.nodes_order", order=space.order),
        space.points: Note("forces.points_mesh"),
    }


def node_velocities(given: Any, space: Space) -> Float[np.ndarray, "nodes 3"]:
    """Velocity [m/s] of every node from one for all, (3,), for every point, or for every node."""
    if np.ndim(given) < 2:
        vector = checked_vector("velocity", given, "m/s")
        return np.broadcast_to(vector, (len(space.nodes), 3))
    rows = checked_rows("velocity", given, node_counts(space), "m/s")
    return rows if len(rows) == len(space.nodes) else extend_linear(space, rows)


# Diagonal of the P2 mass matrix (6 at corners, 32 at edges, times V / 420) scaled to the mass of
# the tet: Hinton, Rock & Zienkiewicz (1976).
_HRZ = np.array([6.0] * 4 + [32.0] * 6) / 216


def mass_fractions(order: int) -> Float[np.ndarray, "_"]:
    """Share of the mass of a tet that every one of its nodes carries."""
    return np.full(4, 0.25) if order == 1 else _HRZ


def lumped_mass(mesh: TetMesh, space: Space) -> Float[np.ndarray, "nodes"]:
    """Mass [kg] of every node, from the density of every tet."""
    mass = material_of(mesh).rho * mesh.volumes
    return sum_at_nodes(space, mass[:, None] * mass_fractions(space.order))


def weighing_mass(
    mesh: TetMesh, grid: Discretisation, supports: Supports
) -> Float[np.ndarray, "nodes"]:
    """Mass [kg] by which every node weighs: by the shape functions, where something holds the body.

    Of a free body it is the lumped one: it falls as a whole then.
    """
    if not (supports.fixed.any() or supports.springs.any()):
        return lumped_mass(mesh, grid.space)
    return nodal_integral(grid, *grid.constants(material_of(mesh).rho))


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


# Gauss points along a side of a triangle, by Duffy's map: exact to degree 5, that of N dx x dx.
GAUSS = 3


# A pressure with a free edge has an energy but for what happens there: the edge gives its stiffness
# a skew part of more than round-off. Where it pushes one way by more than this fraction, as on the
# end of a column, the edge is all that matters: its stiffness is left out.
ROUND_OFF, ONE_WAY = 1e-9, 0.5


class _Pressed(NamedTuple):
    """``pressure`` (faces,) [Pa] on the ``nodes`` (faces, k) of faces, and if it has an energy."""

    nodes: Int[np.ndarray, "faces k"]
    pressure: Float[np.ndarray, "faces"]
    conserves: bool = True


class FollowingLoads:
    """Those of ``tractions`` that follow their faces, on the nodes of ``space``.

    ``fixed`` (nodes, 3) are the components that are held.
    """

    def __init__(
        self,
        mesh: TetMesh,
        space: Space,
        tractions: Sequence[Traction],
        fixed: Bool[np.ndarray, "nodes 3"],
    ) -> None:
        self.rest, self.pressed, self.turned = space.nodes, [], []
        for load in tractions:
            faces = np.asarray(load.faces)
            nodes = faces
            if space.order == 2:
                ends = faces[:, [[0, 1], [1, 2], [2, 0]]]
                nodes = np.hstack([faces, edge_nodes(space, ends)])
            if load.follows == "pressure":
                value = np.broadcast_to(load.value, faces.shape)
                p = -np.einsum("fd,fd->f", value, face_normals(mesh.points, faces))
                self.pressed.append(_Pressed(nodes, p))
            elif load.follows == "torque":
                turned = (load, nodes, load.fractions(space.order), resultant(mesh, load).torque)
                self.turned.append(turned)
        # Shape functions (points, k) and their derivatives (points, k, 2) at weighted points
        t, w = np.polynomial.legendre.leggauss(GAUSS)
        t, w = (t + 1) / 2, w / 2
        a, b = (x.ravel() for x in np.meshgrid(t, t, indexing="ij"))
        self.weights = np.outer(w, w).ravel() * (1 - a)
        L = np.stack([1 - a - (1 - a) * b, a, (1 - a) * b], axis=1)
        D = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
        self.N, self.D = L, np.broadcast_to(D, (len(L), 3, 2))
        if space.order == 2:
            i, j = [0, 1, 2], [1, 2, 0]
            self.N = np.hstack([L * (2 * L - 1), 4 * L[:, i] * L[:, j]])
            edges = 4 * (L[:, i, None] * D[j] + L[:, j, None] * D[i])
            self.D = np.concatenate([(4 * L - 1)[:, :, None] * D, edges], axis=1)

        free = ~fixed.ravel()
        for number, load in enumerate(self.pressed):
            K = self._stiffness(load, np.zeros_like(space.nodes))[free][:, free]
            closed = abs(K - K.T).sum() <= ROUND_OFF * abs(K).sum()
            areas = face_areas(mesh.points, load.nodes[:, :3])
            ways = areas[:, None] * face_normals(mesh.points, load.nodes[:, :3])
            closed |= np.linalg.norm(ways.sum(axis=0)) <= ONE_WAY * areas.sum()
            self.pressed[number] = load._replace(conserves=bool(closed))

    def __bool__(self) -> bool:
        """Whether anything follows."""
        return bool(self.pressed or self.turned)

    def force(self, u: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
        """Nodal forces [N] at the displacement ``u`` [m]."""
        total, x = np.zeros_like(u), self.rest + u
        for nodes, p, _ in self.pressed:
            across = np.cross(*np.einsum("qks,fkd->sfqd", self.D, x[nodes]))
            np.add.at(total, nodes, -np.einsum("f,q,qk,fqd->fkd", p, self.weights, self.N, across))
        return total + self.torques(u)

    def torques(self, u: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
        """Those of them [N] that torques make."""
        total, x = np.zeros_like(u), self.rest + u
        for load, nodes, fractions, torque in self.turned:
            each = turning_traction(x, load, torque) * face_areas(x, load.faces)[:, None]
            np.add.at(total, nodes, fractions[:, :, None] * each[:, None])
        return total

    def stiffness(
        self, u: Float[np.ndarray, "nodes 3"]
    ) -> tuple[Int[np.ndarray, "n"], Int[np.ndarray, "n"], Float[np.ndarray, "n 3 3"]]:
        """Minus the derivative of the force of pressures [N/m]: nodes i, j, and their blocks.

        Its symmetric part, which is all of it where the edge of what is pressed is held or there is
        none. A torque that turns has none but a skew one.
        """
        total = sum(self._stiffness(load, u) for load in self.pressed if load.conserves)
        if not self.pressed or isinstance(total, int):
            return np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros((0, 3, 3))
        blocks = ((total + total.T) / 2).tobsr((3, 3))
        rows = np.repeat(np.arange(len(u)), np.diff(blocks.indptr))
        return rows, blocks.indices, blocks.data

    def _stiffness(self, load: _Pressed, u: np.ndarray) -> Any:
        """Minus the derivative of the force of one pressure [N/m], a csr_array (3 nodes, 3 nodes).

        d(along x other) = [along] d other - [other] d along, with [v] w = v x w.
        """
        from scipy.sparse import csr_array

        nodes, p, _ = load
        along, other = np.einsum("qks,fkd->sfqd", self.D, (self.rest + u)[nodes])
        skew = lambda v: np.cross(np.eye(3), v[..., None, :])  # noqa: E731
        change = np.einsum("qb,fqij->fqbij", self.D[..., 1], skew(along))
        change -= np.einsum("qb,fqij->fqbij", self.D[..., 0], skew(other))
        blocks = np.einsum("f,q,qa,fqbij->faibj", p, self.weights, self.N, change)
        unknowns = 3 * nodes[..., None] + np.arange(3)
        i, j = np.broadcast_arrays(unknowns[..., None, None], unknowns[:, None, None])
        shape = (self.rest.size, self.rest.size)
        return csr_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=shape)
