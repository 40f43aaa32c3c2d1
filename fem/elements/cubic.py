"""Cubic tets above quadratic ones: the surplus of their functions, tet by tet."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ..device import start_warp
from ..mesh import FACES, TetMesh, equal_faces, face_areas, material_of
from ..scene.loads import Traction
from .space import EDGES, Space, duffy_rule, shape_functions


@lru_cache(maxsize=1)
def _slopes_at_nodes() -> Float[np.ndarray, "20 10 4"]:
    """Derivatives by barycentric coordinates of 20 functions at the ten nodes of a tet.

    Ten quadratic ones, then the surplus: Li Lj (Li - Lj) of every edge and Li Lj Lk of every face,
    which are zero at all nodes.
    """
    corners = np.eye(4)
    at = np.concatenate([corners, corners[EDGES].mean(axis=1)])
    out = np.zeros((20, len(at), 4))
    for i in range(4):
        out[i, :, i] = 4 * at[:, i] - 1
    for k, (i, j) in enumerate(EDGES):
        one, two = at[:, i], at[:, j]
        out[4 + k, :, i], out[4 + k, :, j] = 4 * two, 4 * one
        out[10 + k, :, i], out[10 + k, :, j] = 2 * one * two - two**2, one**2 - 2 * one * two
    for k, (i, j, m) in enumerate(FACES):
        for one, two, three in ((i, j, m), (j, m, i), (m, i, j)):
            out[16 + k, :, one] = at[:, two] * at[:, three]
    return out


def _slopes() -> Float[np.ndarray, "10 4 20"]:
    """The same as numbers of a basis that is orthonormal over a tet of volume one.

    Its first four polynomials are linear, the others of second degree.
    """
    N = shape_functions(2, (rule := duffy_rule()).points)
    corners = np.concatenate([np.eye(4), np.eye(4)[EDGES].mean(axis=1)])
    basis = np.hstack([corners, *(corners[:, [i]] * corners[:, [j]] for i, j in EDGES)])
    gram = np.einsum("q,qi,qj->ij", rule.weights, N @ basis, N @ basis)
    numbers = np.linalg.cholesky(gram).T @ np.linalg.inv(basis)  # of values at the nodes
    return np.einsum("ni,aim->nma", numbers, _slopes_at_nodes())


@lru_cache(maxsize=1)
def _mass() -> Float[np.ndarray, "20 20"]:
    """Consistent mass of a cubic tet of mass one."""
    L, weights = duffy_rule(5)
    edges = [L[:, i] * L[:, j] * (L[:, i] - L[:, j]) for i, j in EDGES]
    N = np.column_stack([shape_functions(2, L), *edges, *(L[:, f].prod(axis=1) for f in FACES)])
    return np.einsum("q,qi,qj->ij", weights, N, N)


class CubicElements:
    """What cubic functions add to the quadratic ones of ``space``, on the CPU.

    The surplus has three numbers for every edge, then for every face. ``fixed`` (surplus, 3) are
    those that the supports of the nodes, ``held`` (nodes, 3), hold: of edges whose middle is held,
    and of faces between three of these.
    """

    def __init__(self, mesh: TetMesh, space: Space, held: Bool[np.ndarray, "nodes 3"]) -> None:
        from ..laws.kernels_tensor import Tets
        from . import kernels_cubic as k
        from .kernels_elastic import mat66d

        wp, tets = start_warp(), mesh.tets
        self.mesh, self.space, self.material = mesh, space, material_of(mesh)
        corners = np.sort(tets[:, FACES].reshape(-1, 3), axis=1)
        order, same = equal_faces(corners)
        first = np.concatenate([[True], ~same])
        face = np.empty(len(corners), dtype=np.int64)
        face[order] = np.cumsum(first) - 1
        self.faces = corners[order[first]]
        edge, edges = space.elements[:, 4:] - space.points, len(space.edges)
        self.numbers = np.hstack([edge, edges + face.reshape(-1, 4)]).astype(np.int32)
        self.count = edges + len(self.faces)
        around = [[k for k, ends in enumerate(EDGES) if f not in ends] for f in range(4)]
        borders = edge[:, around].reshape(-1, 3)[order[first]]
        middles = held[space.points :]
        self.fixed = np.concatenate([middles, middles[borders].all(axis=1)])
        self._arrays = c = k.Cubic()
        c.tets = Tets()
        c.tets.points = wp.array(space.nodes, dtype=wp.vec3d, device="cpu")
        c.tets.elements = wp.array(space.elements, dtype=wp.int32, device="cpu")
        c.tets.quadrature = wp.array(np.full((1, 4), 0.25), dtype=wp.vec4d, device="cpu")
        c.surplus = wp.array(self.numbers, dtype=wp.int32, device="cpu")
        lam, mu = self.material.lame
        c.lam, c.mu = (wp.array(m, dtype=wp.float64, device="cpu") for m in (lam, mu))
        if self.material.tensor is not None:
            c.tensors = wp.array(self.material.tensor, dtype=mat66d, device="cpu")
        c.quadratic, c.cubic = (
            wp.array(np.ascontiguousarray(part), dtype=k.vec10d, device="cpu")
            for part in (_slopes()[:4, :, :10], _slopes()[..., 10:])
        )

    def _launch(self, kernel: Any, *arrays: Any) -> None:
        inputs = [self._arrays, *arrays]
        start_warp().launch(kernel, len(self.numbers), inputs=inputs, device="cpu")

    def forces(self, x: Float[np.ndarray, "surplus 3"]) -> tuple[np.ndarray, np.ndarray]:
        """Forces [N] on the nodes and on the surplus of its numbers ``x`` [m]."""
        from . import kernels_cubic as k

        wp = start_warp()
        own = wp.array(x, dtype=wp.vec3d, device="cpu")
        nodes = wp.zeros(len(self.space.nodes), dtype=wp.vec3d, device="cpu")
        surplus = wp.zeros(self.count, dtype=wp.vec3d, device="cpu")
        self._launch(k.surplus_force, own, nodes, surplus)
        return nodes.numpy(), surplus.numpy()

    def nodal_forces(self, u: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "surplus 3"]:
        """Forces [N] on the surplus of a displacement ``u`` [m] of the nodes."""
        from . import kernels_cubic as k

        wp = start_warp()
        out = wp.zeros(self.count, dtype=wp.vec3d, device="cpu")
        self._launch(k.nodal_force, wp.array(u, dtype=wp.vec3d, device="cpu"), out)
        return out.numpy()

    def energies(
        self, u: Float[np.ndarray, "nodes 3"], x: Float[np.ndarray, "surplus 3"]
    ) -> Float[np.ndarray, "tets"]:
        """Energy [J] of every tet, times two, of both parts of a displacement [m] together."""
        from . import kernels_cubic as k

        wp = start_warp()
        fields = (wp.array(v, dtype=wp.vec3d, device="cpu") for v in (u, x))
        out = wp.zeros(len(self.numbers), dtype=wp.float64, device="cpu")
        self._launch(k.surplus_energy, *fields, out)
        return out.numpy()

    def inverse_blocks(self) -> Float[np.ndarray, "surplus 3 3"]:
        """Inverse diagonal blocks [m/N] of the surplus, of no grain; zero where it is fixed."""
        from . import kernels_cubic as k

        wp = start_warp()
        made = wp.zeros(self.count, dtype=wp.mat33d, device="cpu")
        self._launch(k.surplus_blocks, made)
        blocks = made.numpy()
        stopped, axes = np.nonzero(self.fixed)
        blocks[stopped, axes] = blocks[stopped, :, axes] = 0
        blocks[stopped, axes, axes] = 1
        inverse = np.linalg.inv(blocks)
        inverse[stopped, axes, axes] = 0
        return inverse

    def load(
        self, gravity_vector: Sequence[float] | np.ndarray, tractions: Sequence[Traction]
    ) -> Float[np.ndarray, "surplus 3"]:
        """Forces [N] on the surplus, on that of faces alone: an edge's functions have no mean."""
        first = self.count - len(self.faces)
        mass = np.repeat(self.material.rho * self.mesh.volumes / 120, 4)
        weight = np.bincount(self.numbers[:, 6:].ravel(), mass, self.count)
        total = weight[:, None] * np.asarray(gravity_vector, dtype=float)
        size = int(self.faces.max()) + 1
        keys = [np.sort(f, axis=1).astype(np.int64) @ [size**2, size, 1] for f in
                (self.faces, *(one.faces for one in tractions))]  # fmt: skip
        for one, key in zip(tractions, keys[1:], strict=True):
            area = face_areas(self.mesh.points, one.faces)[:, None]
            at = first + np.searchsorted(keys[0], key)
            np.add.at(total, at, np.broadcast_to(one.value, one.faces.shape) * area / 60)
        return total

    def gradients(
        self,
        u: Float[np.ndarray, "nodes 3"],
        x: Float[np.ndarray, "surplus 3"],
        tets: np.ndarray,
        where: Float[np.ndarray, "points 4"],
    ) -> Float[np.ndarray, "some points 3 3"]:
        """Gradients [1] of both parts together at barycentric points of some ``tets``."""
        slopes, g = self._gradients(tets, where)
        return np.einsum("tac,qam,tmd->tqcd", self._local(u, x, tets), slopes, g, optimize=True)

    def flux_forces(
        self, flux: Float[np.ndarray, "tets points 3 3"], where: Float[np.ndarray, "points 4"]
    ) -> Float[np.ndarray, "surplus 3"]:
        """Forces [N] on the surplus of a ``flux`` [Pa] at points of equal weights of every tet."""
        slopes, g = self._gradients(slice(None), where)
        flux = flux * (self.mesh.volumes / len(where))[:, None, None, None]
        own = np.einsum("tqcd,qam,tmd->tac", flux, slopes[:, 10:], g, optimize=True)
        return self._gathered(own)

    def _gradients(self, tets: Any, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slopes (points, 20, 4) by barycentric coordinates; their gradients (some, 4, 3) [1/m]."""
        corners = self.mesh.points[self.mesh.tets[tets]]
        inner = np.linalg.inv(corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
        g = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
        return np.einsum("qi,aim->qam", shape_functions(2, where), _slopes_at_nodes()), g

    def _gathered(self, own: Float[np.ndarray, "tets 10 3"]) -> Float[np.ndarray, "surplus 3"]:
        """Sums on the surplus of what its ten functions have in every tet."""
        own, ids = own * self._signs(slice(None)), self.numbers.ravel()
        sums = [np.bincount(ids, own[..., axis].ravel(), self.count) for axis in range(3)]
        return np.stack(sums, axis=1)

    def weigh(
        self, u: Float[np.ndarray, "nodes 3"], x: Float[np.ndarray, "surplus 3"]
    ) -> tuple[np.ndarray, float]:
        """Mass of cubic elements times both parts: on the surplus [kg m]; times both [kg m^2]."""
        local = self._local(u, x)
        mass = self.material.rho * self.mesh.volumes
        pushed = mass[:, None, None] * (_mass() @ local)
        return self._gathered(pushed[:, 10:]), float((local * pushed).sum())

    def _signs(self, tets: Any) -> Float[np.ndarray, "some 10 1"]:
        """An edge's function changes its sign with the way along it: up in the mesh's points."""
        corners = self.mesh.tets[tets]
        signs = np.ones((len(corners), 10, 1))
        signs[:, :6, 0] -= 2.0 * (corners[:, EDGES[:, 0]] > corners[:, EDGES[:, 1]])
        return signs

    def _local(self, u: np.ndarray, x: np.ndarray, tets: Any = slice(None)) -> np.ndarray:
        """Numbers (some, 20, 3) of the functions of some tets."""
        own = x[self.numbers[tets]] * self._signs(tets)
        return np.concatenate([u[self.space.elements[tets]], own], axis=1)
