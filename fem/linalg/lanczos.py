"""Eigenvalues by Lanczos: lowest vibrations of a factored matrix, the largest of a matrix."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix
from .krylov import Inner

Operator = Callable[[np.ndarray], np.ndarray]

# Directions that a step adds count while they are longer than this share of what made them: less is
# round-off of those already there.
DEPENDENT = 1e-12
# The largest eigenvalue comes from a few Lanczos steps, which stay a little below it.
LANCZOS_STEPS = 12
LANCZOS_MARGIN = 1.08


class RitzPairs(NamedTuple):
    """Approximate eigenpairs of A, the largest value first.

    ``errors`` are the lengths of A x - value x; ``vectors(first)`` (n, first) have been through A
    once more than the space that ``values`` were found in.
    """

    values: Float[np.ndarray, "pairs"]
    errors: Float[np.ndarray, "pairs"]
    vectors: Callable[[int], Float[np.ndarray, "n first"]]


def lanczos(
    operator: Operator,
    mass: Operator,
    start: Float[np.ndarray, "n width"],
    *,
    enough: Callable[[RitzPairs], bool],
    steps: int,
) -> RitzPairs:
    """Eigenpairs of ``operator``, which is symmetric in the inner product of ``mass``.

    Block Lanczos with full reorthogonalisation (Golub & Underwood 1977) from the block ``start``,
    until ``enough`` or ``steps`` blocks; the pairs say which it was. What ``operator`` returns is
    written to.
    """
    basis, projected = _Columns(), np.zeros((0, 0))
    rest = operator(mass(start))
    weighed = mass(rest)
    scale = np.sqrt(max((rest * weighed).sum(axis=0).max(), 1e-300))
    block, weighed = _orthonormal(rest, weighed, basis, mass, scale)
    while True:
        basis.append(block)
        rest = operator(weighed)
        column = basis.along(mass(rest))
        size, width = column.shape
        grown = np.zeros((size, size))
        grown[: size - width, : size - width] = projected
        grown[:, size - width :] = column
        grown[size - width :, :] = column.T
        projected = grown
        basis.take_off(column, rest)
        weighed = mass(rest)
        pairs = _ritz(projected, basis, rest, weighed)
        steps -= 1
        if not steps or enough(pairs):
            return pairs
        scale = np.abs(pairs.values).max()
        block, weighed = _orthonormal(rest, weighed, basis, mass, scale)
        if not block.shape[1]:  # the space is invariant: there is nothing more to find
            return pairs


class _Columns(list):
    """Columns of vectors (n, width) in blocks: one more block moves none of those before it."""

    def along(self, x: Float[np.ndarray, "n width"]) -> Float[np.ndarray, "columns width"]:
        """Products of all columns with those of ``x``; with their mass: what lies along them."""
        return np.concatenate([np.zeros((0, x.shape[1])), *(block.T @ x for block in self)])

    def take_off(self, weights: Float[np.ndarray, "columns width"], x: np.ndarray) -> None:
        """Subtract from ``x`` (n, width) the sum of all columns by ``weights``, in place."""
        first = 0
        for block in self:
            x -= block @ weights[first : first + block.shape[1]]
            first += block.shape[1]


def _ritz(
    projected: np.ndarray, basis: _Columns, rest: np.ndarray, weighed: np.ndarray
) -> RitzPairs:
    values, y = np.linalg.eigh((projected + projected.T) / 2)
    values, y = values[::-1], y[:, ::-1]
    last = y[-rest.shape[1] :]
    gram = rest.T @ weighed
    errors = np.sqrt(np.maximum(np.einsum("ip,ij,jp->p", last, gram, last), 0.0))

    def vectors(first: int) -> np.ndarray:
        found = rest @ (last[:, :first] / values[:first])
        basis.take_off(-y[:, :first], found)
        return found

    return RitzPairs(values, errors, vectors)


def _orthonormal(
    block: np.ndarray, weighed: np.ndarray, basis: _Columns, mass: Operator, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions of ``block`` away from ``basis``, and their mass times them.

    ``weighed`` is the mass times ``block``, from which ``basis`` was taken off once: once more,
    for short directions keep of it what round-off left.
    """
    turn = _normalising(block, weighed, DEPENDENT * scale)
    block, weighed = block @ turn, weighed @ turn
    basis.take_off(basis.along(weighed), block)
    weighed = mass(block)
    turn = _normalising(block, weighed, 0.5)
    return block @ turn, weighed @ turn


def _normalising(block: np.ndarray, weighed: np.ndarray, least: float) -> np.ndarray:
    """What makes orthonormal columns of those of ``block`` that are longer than ``least``."""
    square, turn = np.linalg.eigh(block.T @ weighed)
    keep = square > least**2
    return turn[:, keep] / np.sqrt(square[keep])


class LargestEigenvalue:
    """Largest eigenvalue of a symmetric ``matrix`` by Lanczos, with a margin; NaN if it has one.

    Asked again it answers for the values that the matrix has then: on a GPU by one graph.
    """

    def __init__(self, matrix: BlockMatrix) -> None:
        from . import kernels_krylov as k

        wp, device = start_warp(), matrix.values.device
        self.steps, self.device = min(LANCZOS_STEPS, 3 * matrix.nodes), device
        v, old, w = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(3))
        # Entry k of `along` is v A v of step k, of `square` the squared length of w before it.
        count = self.steps + 1
        self.sums = wp.zeros(2 * count, dtype=wp.float64, device=device)
        self.along, self.square = self.sums[:count], self.sums[count:]
        launch = Recorder(matrix.nodes, device)
        self.start = launch(k.lanczos_start, [w])
        self.direction = launch(k.lanczos_direction, [w, self.square, 0, v, old])
        self.multiply = matrix.product(v, w)
        self.residual = launch(k.lanczos_residual, [v, old, self.along, self.square, 0, w])
        self.length, self.curvature = Inner(w, w, self.square, 0), Inner(w, v, self.along, 0)
        self.vectors, self.graph = (v, old, w), None

    def __call__(self) -> float:
        """Return the eigenvalue."""
        wp = start_warp()
        if not self.device.is_cuda:
            self._iterate()
        else:
            if self.graph is None:
                with wp.ScopedCapture(device=self.device) as capture:
                    self._iterate()
                self.graph = capture.graph
            wp.capture_launch(self.graph)
        along, square = self.sums.numpy().reshape(2, -1)
        off = np.sqrt(square[1 : self.steps])
        # A vector that vanished ended the search: what came after it is no number.
        good = int(np.argmin(off > 1e-12)) if (off <= 1e-12).any() else len(off)
        T = np.diag(along[: good + 1]) + np.diag(off[:good], 1) + np.diag(off[:good], -1)
        return LANCZOS_MARGIN * float(np.linalg.eigvalsh(T)[-1]) if np.isfinite(T).all() else np.nan

    def _iterate(self) -> None:
        for cleared in (self.sums, *self.vectors):
            cleared.zero_()
        self.start.launch()
        for step in range(self.steps):
            self.direction.set_param_at_index(2, step)
            self.residual.set_param_at_index(4, step)
            self.length.launch(step)
            self.direction.launch()
            self.multiply.launch()
            self.curvature.launch(step)
            self.residual.launch()
