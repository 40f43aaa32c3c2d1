"""Frequencies of a network at rest: the lowest tell its stiffness, the highest its steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import CholeskyFactor
from ..device import start_warp
from ..discrete.block_matrix import BlockMatrix
from ..errors import InputError
from .network import SpringNetwork

# Free bodies: rigid motions, and the shift [share of the mean square of the frequencies] that makes
# their matrix regular.
RIGID, SHIFT = 6, 1e-9
# Relative error of the highest frequency's square; below so many unknowns it is exact.
PRECISE, DENSE = 1e-3, 64


def network_frequencies(
    network: SpringNetwork, stiffness: Float[np.ndarray, "springs"], count: int = 1
) -> Float[np.ndarray, "count"]:
    """First ``count`` natural frequencies [Hz] with springs of ``stiffness`` [N/m], rising.

    Without anything held, the six rigid motions are left out.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh

    anchors, wp = network.anchors, start_warp()
    free = ~anchors.fixed & (anchors.mass > 0)[:, None]
    skipped = 0 if anchors.fixed.any() else RIGID
    if count + skipped >= free.sum():
        raise InputError(f"{count} frequencies of {free.sum()} unknowns: wanted fewer")
    heavy = np.where(anchors.mass > 0, anchors.mass, np.inf)
    root, pattern = free / np.sqrt(heavy)[:, None], network.pattern
    row = np.repeat(np.arange(len(root)), np.diff(pattern.rows.numpy()))
    blocks = network.blocks(stiffness) * root[row][:, :, None]
    blocks *= root[pattern.columns.numpy()][:, None]
    middle = blocks[pattern.own][:, [0, 1, 2], [0, 1, 2]]
    typical = float(middle[free].mean())
    shift = SHIFT * typical
    blocks[pattern.own] += np.where(free, shift, typical)[:, None] * np.eye(3)
    values = wp.array(blocks, dtype=wp.mat33d, device="cpu")
    matrix = BlockMatrix(pattern.rows, pattern.columns, values)
    factor = CholeskyFactor(matrix, planned_elimination(matrix))

    def inverse(x: np.ndarray) -> np.ndarray:
        return free.ravel() * factor.solve(x.reshape(-1, 3)).ravel()

    operator = LinearOperator((free.size,) * 2, matvec=inverse, dtype=float)  # type: ignore
    start = np.random.default_rng(0).normal(size=free.size) * free.ravel()
    found = eigsh(operator, k=count + skipped, v0=start, return_eigenvectors=False)
    square = np.sort(1 / np.asarray(found))[skipped:] - shift
    return np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)


def highest_frequency(
    inverse_mass: Float[np.ndarray, "n 3"], force: Callable[[np.ndarray], np.ndarray]
) -> float:
    """Highest angular frequency [1/s] of masses whose ``inverse_mass`` [1/kg] is zero where held.

    ``force`` [N] (n, 3) is that of a displacement [m] (n, 3), linear and symmetric. By Lanczos'
    method: the plain power iteration ends well below it.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh

    root = np.sqrt(inverse_mass)

    def times(v: np.ndarray) -> np.ndarray:
        return (root * force(root * v.reshape(root.shape))).ravel()

    if root.size <= DENSE:
        dense = np.stack([times(axis) for axis in np.eye(root.size)])
        return float(np.sqrt(np.linalg.eigvalsh(dense)[-1]))
    operator = LinearOperator((root.size,) * 2, matvec=times, dtype=float)  # type: ignore
    options: dict[str, Any] = {"tol": PRECISE, "return_eigenvectors": False}
    start = np.random.default_rng(0).normal(size=root.size)
    return float(np.sqrt(eigsh(operator, k=1, which="LA", v0=start, **options)[0]))
