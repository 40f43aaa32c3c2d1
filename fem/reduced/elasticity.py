"""Elastic energy of a reduced model, by the same functions of the law as the full body's.

Its cells know the displacement gradients from the coordinates, and what is pulled back through
them. Of fields of vectors these are one dense matrix; of a skinned body the three axes share the
gradients of its scalar functions, which makes the stiffness four times cheaper.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import Recorder, start_warp
from ..errors import ConvergenceError
from ..laws.law import LAWS, Law
from ..linalg.krylov import length
from ..solve.nonlinear import Minimum, Point, minimise
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

    model: The reduced model.
    law: Name of the elastic law, one of ``LAWS``.
    """

    def __init__(self, model: ReducedModel, law: str = Law.NEO_HOOKEAN) -> None:
        from ..elements.kernels_elastic import elastic_kernels

        wp = start_warp()
        kernels = elastic_kernels(LAWS[law])
        self.model, self.law = model, law
        skinned = model.kind is Subspace.SKINNING
        self.gradients = (SkinnedGradients if skinned else VectorGradients)(model.gradients)
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
        inputs = [self._H, self._lam, self._mu]
        self._stress = record(kernels.stress, [*inputs, self._W, self._P])
        exact, projected = kernels.exact_at, kernels.projected_at
        self._exact = record(exact or projected, [*inputs, self._A])
        self._projected = record(projected or exact, [*inputs, self._A])
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


class VectorGradients:
    """Linear map from the coordinates to displacement gradients, of fields of vectors."""

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
    """The same of a skinned body: H = Z G, with the same functions along the three axes."""

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


# Newton's method on the coordinates, and the rest of a reduced body under a dead load.

# Unbalanced force of a rest, over the load.
TOLERANCE = 1e-9
# Squares of frequencies below this fraction of the largest are rigid motions.
RIGID = 1e-9
# An inverse Hessian serves while every move brings the gradient below this fraction of the last.
CONTRACTION = 0.5


@functools.cache
def _dense() -> Any:
    """BLAS and LAPACK: an import in a step takes as long as what it calls."""
    import scipy.linalg

    return scipy.linalg


def solve_dense(matrix: np.ndarray, b: np.ndarray, goal: float = 0.0) -> np.ndarray:
    """Solve A x = b by Cholesky; not a number where A is not positive. ``goal`` is met anyway."""
    _, x, failed = _dense().lapack.dposv(matrix, b, lower=1)
    return np.full_like(b, np.nan) if failed else x


class KeptInverse:
    """Inverse of a Hessian (dofs, dofs) that serves from step to step, and learns from the moves.

    Its lower triangle alone is kept. Between two gradients it is corrected by their secant
    (Broyden, Fletcher, Goldfarb & Shanno: Nocedal & Wright 2006, eq. 6.17); where that goes slowly,
    a new one is made.
    """

    def __init__(self) -> None:
        self.inverse: np.ndarray | None = None
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self._load, self._first = np.zeros(()), True

    def begin(self, load: np.ndarray | None = None) -> None:
        """Go on to another function of nearly the same Hessian.

        ``load``: it is the last one but for the term -load . q; none: it is any.
        """
        self._first = True
        if load is None or self._load.shape != load.shape:
            self._last = None
        elif self._last is not None:
            self._last = self._last[0], self._last[1] + self._load - load
        self._load = np.zeros(()) if load is None else load

    def renew(self, matrix: np.ndarray) -> None:
        """Take the inverse of ``matrix``; none where that is not positive."""
        lapack = _dense().lapack
        factor, failed = lapack.dpotrf(matrix.T, lower=1, clean=0)
        self.inverse = None if failed else lapack.dpotri(factor, lower=1, overwrite_c=1)[0]

    def at(
        self,
        q: np.ndarray,
        gradient: np.ndarray,
        matrix: Callable[[], np.ndarray],
        projected: bool = False,
    ) -> KeptInverse:
        """Get ready for ``q``, where the function has its ``gradient``; ``matrix`` makes a new one.

        One of a ``projected`` matrix is for this place alone.
        """
        if projected:
            self.inverse = self._last = None
            once = KeptInverse()
            once.renew(matrix())
            return once
        last, self._last, first, self._first = self._last, (q, gradient), self._first, False
        far = np.inf if first or last is None else CONTRACTION * length(last[1])
        slow = not length(gradient) < far
        if self.inverse is None or slow:
            self.renew(matrix())
        elif last is not None:
            self.learn(q - last[0], gradient - last[1])
        return self

    def learn(self, move: np.ndarray, change: np.ndarray) -> None:
        """Take in that a ``move`` changed the gradient by ``change``, unless it bends down."""
        blas = _dense().blas
        slope = float(move @ change)
        if self.inverse is not None and slope > 0:
            made = blas.dsymv(1 / slope, self.inverse, change, lower=1)
            made -= (1 + float(change @ made)) / (2 * slope) * move
            blas.dsyr2(-1.0, made, move, lower=1, a=self.inverse, overwrite_a=1)

    def solve(self, b: np.ndarray, goal: float = 0.0) -> np.ndarray:
        """Inverse times ``b``; not a number where the Hessian is not positive."""
        if self.inverse is None:
            return np.full_like(b, np.nan)
        return _dense().blas.dsymv(1.0, self.inverse, b, lower=1)


class DeadLoad:
    """Total potential W(q) - f . q of a reduced body under the forces f (dofs,) [N/sqrt(kg)]."""

    def __init__(
        self, elasticity: ReducedElasticity, load: np.ndarray, kept: KeptInverse | None = None
    ) -> None:
        self.elasticity, self.load = elasticity, load
        self.scale = float(np.linalg.norm(load)) or 1.0
        self._gradient, self._kept = np.zeros_like(load), kept or KeptInverse()
        self._kept.begin()

    def evaluate(self, q: np.ndarray) -> Point:
        """Energy, gradient, and the size of the load."""
        energy, force = self.elasticity.response(q)
        self._gradient = force - self.load
        return Point(energy - float(self.load @ q), self._gradient, self.scale)

    def hessian(self, q: np.ndarray, *, projected: bool) -> KeptInverse:
        """Inverse of the second derivative (dofs, dofs) [s^2] at ``q``, the last one evaluated."""
        return self._kept.at(
            q, self._gradient, lambda: self.elasticity.tangent(q, projected=projected), projected
        )

    def longest_step(self, q: np.ndarray, step: np.ndarray) -> float:
        """Any: nothing is in the way."""
        return np.inf


def reduced_rest(
    elasticity: ReducedElasticity,
    load: Float[np.ndarray, "dofs"],
    *,
    start: Float[np.ndarray, "dofs"] | None = None,
    kept: KeptInverse | None = None,
    tolerance: float = TOLERANCE,
) -> Minimum:
    """Coordinates [m sqrt(kg)] at rest under the dead ``load`` [N/sqrt(kg)].

    ``kept`` is the inverse Hessian of a body that is nearly this one, for instance of few cells.

    Raises ConvergenceError: If Newton's method does not find it.
    """
    first = np.zeros_like(load) if start is None else start
    potential = DeadLoad(elasticity, load, kept)
    return minimise(potential, first, solve=KeptInverse.solve, tolerance=tolerance)


def held_rest(
    elasticity: ReducedElasticity,
    load: Float[np.ndarray, "dofs"],
    *,
    start: Float[np.ndarray, "dofs"] | None = None,
    kept: KeptInverse | None = None,
) -> np.ndarray | None:
    """``reduced_rest``'s coordinates; None where nothing loads or holds it, or none is found."""
    if not load.any():
        return None
    if kept is None:
        stiffness = elasticity.tangent(np.zeros(len(load)))
        if np.linalg.eigvalsh(stiffness)[0] < RIGID * np.abs(stiffness).max():
            return None
    try:
        return reduced_rest(elasticity, load, start=start, kept=kept).u
    except ConvergenceError:
        return None


def lowest_frequency(stiffness: Float[np.ndarray, "dofs dofs"]) -> float:
    """Lowest frequency [Hz] that is no rigid motion, of the ``stiffness`` [1/s^2] about rest."""
    square = np.linalg.eigvalsh(stiffness)
    return float(np.sqrt(square[square > RIGID * square[-1]][0])) / (2 * np.pi)


def reduced_frequencies(elasticity: ReducedElasticity) -> Float[np.ndarray, "dofs"]:
    """Natural frequencies [Hz] of the coordinates about rest, the lowest first."""
    square = np.linalg.eigvalsh(elasticity.tangent(np.zeros(elasticity.model.dofs)))
    return np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)
