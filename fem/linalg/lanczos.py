"""Lowest vibrations by block Lanczos on the inverse of a factored matrix."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

Operator = Callable[[np.ndarray], np.ndarray]

# Directions that a step adds count while they are longer than this share of what made them: less is
# round-off of those already there.
DEPENDENT = 1e-12


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
    until ``enough`` or ``steps`` blocks; the pairs say which it was.
    """
    basis = np.zeros((len(start), 0))
    images, projected = basis, np.zeros((0, 0))
    block = operator(mass(start))
    scale = np.sqrt(max((block * mass(block)).sum(axis=0).max(), 1e-300))
    block, weighed = _orthonormal(block, basis, images, mass, scale)
    while True:
        basis, images = np.hstack([basis, block]), np.hstack([images, weighed])
        image = operator(weighed)
        column = images.T @ image
        size, width = column.shape
        grown = np.zeros((size, size))
        grown[: size - width, : size - width] = projected
        grown[:, size - width :] = column
        grown[size - width :, :] = column.T
        projected = grown
        rest = image - basis @ column
        rest -= basis @ (images.T @ rest)
        pairs = _ritz(projected, basis, rest, mass)
        steps -= 1
        if not steps or enough(pairs):
            return pairs
        block, weighed = _orthonormal(rest, basis, images, mass, np.abs(pairs.values).max())
        if not block.shape[1]:  # the space is invariant: there is nothing more to find
            return pairs


def _ritz(projected: np.ndarray, basis: np.ndarray, rest: np.ndarray, mass: Operator) -> RitzPairs:
    values, y = np.linalg.eigh((projected + projected.T) / 2)
    values, y = values[::-1], y[:, ::-1]
    last = y[-rest.shape[1] :]
    gram = rest.T @ mass(rest)
    errors = np.sqrt(np.maximum(np.einsum("ip,ij,jp->p", last, gram, last), 0.0))

    def vectors(first: int) -> np.ndarray:
        return basis @ y[:, :first] + rest @ (last[:, :first] / values[:first])

    return RitzPairs(values, errors, vectors)


def _orthonormal(
    block: np.ndarray, basis: np.ndarray, images: np.ndarray, mass: Operator, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions of ``block`` away from ``basis``, and their mass times them."""
    for least in (DEPENDENT * scale, 0.5):  # once more: short directions were not orthogonal yet
        block = block - basis @ (images.T @ block)
        square, turn = np.linalg.eigh(block.T @ mass(block))
        keep = square > least**2
        block = block @ (turn[:, keep] / np.sqrt(square[keep]))
    return block, mass(block)
