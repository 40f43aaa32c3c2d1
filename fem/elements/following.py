"""Loads that turn with the faces they act on: pressures and torques, and what they stiffen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..mesh import TetMesh, face_areas, face_normals
from ..scene.loads import Traction, resultant, turning_traction
from .forces import edge_nodes
from .space import Space

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
