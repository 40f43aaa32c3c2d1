"""Elastic energy of a reduced model, by the same functions of the law as the full body's.

Its cells know the displacement gradients from the coordinates, and what is pulled back through
them. Of fields of vectors these are one dense matrix; of a skinned body the three axes share the
gradients of its scalar functions, which makes the stiffness four times cheaper.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ..device import Recorder, start_warp
from ..discrete.space import EDGES, Space, element_points
from ..laws.law import LAWS, Law
from ..scene.mesh import TetMesh
from .model import ReducedModel, Subspace

# Cells whose gradients are multiplied at once: these and what comes of them stay in the cache.
TOGETHER = 80
# Pairs of axes k <= l: the other blocks of a symmetric matrix follow.
_K, _L = np.triu_indices(3)


class ReducedResponse(NamedTuple):
    """Elastic ``energy`` [J] and its gradient ``force`` (dofs,) [N/sqrt(kg)]."""

    energy: float
    force: np.ndarray


class ReducedElasticity:
    """Elastic energy W(q) of a reduced model, its gradient and second derivative.

    Parameters
    ----------
    model
        The reduced model.
    law
        Name of the elastic law, one of ``LAWS``.
    """

    def __init__(self, model: ReducedModel, law: str = Law.NEO_HOOKEAN) -> None:
        from ..discrete.kernels_elastic import elastic_kernels

        wp = start_warp()
        kernels = elastic_kernels(LAWS[law])
        self.model, self.law = model, law
        self.gradients = cell_gradients(model)
        self._H, self._P = (wp.empty(len(model.cells), dtype=wp.mat33d, device="cpu") for _ in "HP")
        self._W, self._lam, self._mu = (
            wp.empty(len(model.cells), dtype=wp.float64, device="cpu") for _ in range(3)
        )
        self._A = wp.empty((len(model.cells), 81), dtype=wp.float64, device="cpu")
        # What the kernels read and write, as numpy sees it: asking each time takes as long as they.
        self._h, self._p, self._w, self._a = (
            array.numpy() for array in (self._H, self._P, self._W, self._A)
        )
        record = Recorder(len(model.cells), "cpu")
        given = [self._H, self._lam, self._mu]
        self._stress = record(kernels.stress, [*given, self._W, self._P])
        exact, projected = kernels.exact_at, kernels.projected_at
        self._exact = record(exact or projected, [*given, self._A])
        self._projected = record(projected or exact, [*given, self._A])
        self.set_moduli(model.E, model.nu)

    def set_moduli(self, E: np.ndarray, nu: np.ndarray) -> None:
        """Take other moduli ``E`` [Pa] and ``nu`` [1] of the cells, shape (cells,)."""
        self.model = self.model.with_moduli(E, nu)
        self._weigh(*self.model.lame)

    def _weigh(self, lam: np.ndarray, mu: np.ndarray) -> None:
        """Laws are linear in the Lame parameters: the weight of a cell goes in with them."""
        self._lam.assign(self.model.weights * lam)
        self._mu.assign(self.model.weights * mu)

    def stress(self, q: np.ndarray) -> np.ndarray:
        """First Piola stress times the weight of every cell [Pa m^3], shape (cells, 3, 3)."""
        self._h[:] = self.gradients.of(q)
        self._stress.launch()
        return self._p

    def force_with(self, q: np.ndarray, lam: np.ndarray, mu: np.ndarray) -> np.ndarray:
        """Elastic force (dofs,) [N/sqrt(kg)] at ``q`` with other Lame parameters (cells,) [Pa]."""
        self._weigh(lam, mu)
        force = self.gradients.pull(self.stress(q))
        self._weigh(*self.model.lame)
        return force

    def response(self, q: np.ndarray) -> ReducedResponse:
        """Energy and force at the coordinates ``q`` (dofs,) [m sqrt(kg)], springs and all."""
        force = self.gradients.pull(self.stress(q))
        springs = self.model.springs @ q
        return ReducedResponse(float(self._w.sum() + 0.5 * springs @ q), force + springs)

    def tangent(self, q: np.ndarray, *, projected: bool = False) -> np.ndarray:
        """Second derivative (dofs, dofs) [1/s^2]; ``projected``: no cell has a negative part."""
        self._h[:] = self.gradients.of(q)
        (self._projected if projected else self._exact).launch()
        return self.gradients.pull_tangent(self._a.reshape(-1, 9, 9)) + self.model.springs


@runtime_checkable
class CellGradients(Protocol):
    """Linear map from the coordinates (dofs,) to displacement gradients (cells, 3, 3)."""

    def of(self, q: np.ndarray) -> np.ndarray:
        """Displacement gradients H [1], shape (cells, 3, 3)."""
        ...

    def pull(self, stress: np.ndarray) -> np.ndarray:
        """Forces on the coordinates of ``stress`` (cells, 3, 3) [Pa m^3]."""
        ...

    def pull_tangent(self, tangent: np.ndarray) -> np.ndarray:
        """Stiffness (dofs, dofs) of the symmetric ``tangent`` (cells, 9, 9) [Pa m^3]."""
        ...


class VectorGradients:
    """Gradients of fields of vectors."""

    def __init__(self, gradients: Float[np.ndarray, "cells 3 3 dofs"]) -> None:
        self._each = np.ascontiguousarray(gradients.reshape(len(gradients), 9, -1))
        self._flat = self._each.reshape(-1, gradients.shape[3])
        self._right = np.empty_like(self._each[:TOGETHER])

    def of(self, q: np.ndarray) -> np.ndarray:
        """Displacement gradients H [1], shape (cells, 3, 3)."""
        return (self._flat @ q).reshape(-1, 3, 3)

    def pull(self, stress: np.ndarray) -> np.ndarray:
        """Forces on the coordinates of ``stress`` (cells, 3, 3) [Pa m^3]."""
        return stress.reshape(-1) @ self._flat

    def pull_tangent(self, tangent: np.ndarray) -> np.ndarray:
        """Stiffness (dofs, dofs) of the symmetric ``tangent`` (cells, 9, 9) [Pa m^3]."""
        total = np.zeros((self._flat.shape[1],) * 2)
        for first in range(0, len(tangent), TOGETHER):
            some = slice(first, first + TOGETHER)
            left = self._each[some]
            right = np.matmul(tangent[some], left, out=self._right[: len(left)])
            total += left.reshape(-1, len(total)).T @ right.reshape(-1, len(total))
        return total


class SkinnedGradients:
    """Gradients of a skinned body: H = Z G, with the same functions along the three axes."""

    def __init__(self, gradients: Float[np.ndarray, "cells 3 3 dofs"]) -> None:
        count = gradients.shape[3] // 3
        self._each = np.ascontiguousarray(gradients[:, 0, :, :count])  # (cells, 3, functions)
        self._flat = self._each.reshape(-1, count)

    def of(self, q: np.ndarray) -> np.ndarray:
        """Displacement gradients H [1], shape (cells, 3, 3)."""
        H = q.reshape(3, -1) @ self._flat.T
        return np.ascontiguousarray(H.reshape(3, -1, 3).swapaxes(0, 1))

    def pull(self, stress: np.ndarray) -> np.ndarray:
        """Forces on the coordinates of ``stress`` (cells, 3, 3) [Pa m^3]."""
        return (stress.swapaxes(0, 1).reshape(3, -1) @ self._flat).ravel()

    def pull_tangent(self, tangent: np.ndarray) -> np.ndarray:
        """Stiffness (dofs, dofs) of the symmetric ``tangent`` (cells, 9, 9) [Pa m^3]."""
        cells, count = len(self._each), self._each.shape[2]
        A = tangent.reshape(cells, 3, 3, 3, 3)[:, _K, :, _L]  # (6, cells, i, j)
        A = A.transpose(1, 2, 0, 3).reshape(cells, 18, 3)
        right = (A @ self._each).reshape(3 * cells, 6 * count)
        blocks = (self._flat.T @ right).reshape(count, 6, count).swapaxes(0, 1)
        K = np.empty((3, count, 3, count))
        K[_L, :, _K] = blocks.swapaxes(1, 2)
        K[_K, :, _L] = blocks
        return K.reshape(3 * count, 3 * count)


def cell_gradients(model: ReducedModel) -> CellGradients:
    """Gradients of ``model`` in the form that is cheapest for its kind."""
    skinned = model.kind is Subspace.SKINNING
    return (SkinnedGradients if skinned else VectorGradients)(model.gradients)


def hat_gradients(mesh: TetMesh) -> Float[np.ndarray, "tets 4 3"]:
    """Gradients [1/m] of the four linear shape functions of every tet."""
    corners = mesh.points[mesh.tets]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    inner = np.linalg.inv(edges)
    return np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)


def slopes_at_points(mesh: TetMesh, space: Space) -> Float[np.ndarray, "tets points nodes 3"]:
    """Gradients [1/m] of the shape functions of every tet at its quadrature points."""
    hats, where = hat_gradients(mesh)[:, None], element_points(space.order)
    if space.order == 1:
        return hats
    a, b = EDGES.T
    corners = (4 * where - 1)[..., None] * hats
    left, right = where[:, a, None] * hats[..., b, :], where[:, b, None] * hats[..., a, :]
    return np.concatenate([corners, 4 * (left + right)], axis=2)


def basis_gradients(
    mesh: TetMesh, space: Space, basis: Float[np.ndarray, "nodes 3 dofs"]
) -> Float[np.ndarray, "cells 3 3 dofs"]:
    """Gradients d U_a,i / d x_j of ``basis`` at the quadrature points, tet by tet."""
    slopes = np.swapaxes(slopes_at_points(mesh, space), 2, 3)  # (tets, points, j, nodes)
    nodal = basis[space.elements].swapaxes(1, 2)  # (tets, i, nodes, dofs)
    return (slopes[:, :, None] @ nodal[:, None]).reshape(-1, 3, 3, basis.shape[2])
