"""Two-level preconditioner: Chebyshev smoothing and a coarse space of rigid aggregates."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from .aggregation import boxes, rigid_basis, split_weak
from .blocks import BlockMatrix
from .device import start_warp
from .errors import ConvergenceError
from .krylov import BLOCK, Recorder, largest_eigenvalue

logger = logging.getLogger(__name__)

# Chebyshev polynomials of degree 3 damp the upper part [largest / SPREAD, largest] of the spectrum.
DEGREE = 3
SPREAD = 25.0
# Boxes of the coarse space: six unknowns each, a dense factor of 1536 takes 50 ms.
BOXES = 256
NODES_PER_BOX = 100


@dataclass(frozen=True, eq=False)
class Scaled:
    """The system with unit diagonal blocks: ``matrix`` = inv(L) A inv(L)^T, L block diagonal."""

    matrix: BlockMatrix
    lower: Any
    inverse: Any


def scale(matrix: BlockMatrix) -> Scaled:
    """Scale ``matrix`` in place with the Cholesky factors of its diagonal blocks."""
    from . import kernels_solver as k

    wp = start_warp()
    device = matrix.values.device
    lower = wp.empty(matrix.nodes, dtype=wp.mat33d, device=device)
    inverse = wp.empty(matrix.nodes, dtype=wp.mat33d, device=device)
    arrays = [matrix.rows, matrix.columns]
    inputs = [*arrays, matrix.values, lower, inverse]
    wp.launch(k.factor_diagonal, matrix.nodes, inputs=inputs, device=device)
    inputs = [*arrays, inverse, matrix.values]
    wp.launch(k.scale_blocks, matrix.nodes, inputs=inputs, device=device)
    return Scaled(matrix, lower, inverse)


@dataclass(frozen=True, eq=False)
class Coarse:
    """Prolongation P (block CSR of 3 x 6) on the device and the factored coarse matrix."""

    start: Any
    aggregates: Any
    transfer: Any
    count: int
    factor: tuple | None
    inverse: Any


def aggregate(A: Any, points: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Aggregate of every node of the scaled matrix ``A``; nodes not ``moving`` join any."""
    count = min(BOXES, max(1, len(points) // NODES_PER_BOX))
    rows = np.repeat(np.arange(len(points)), np.diff(A.indptr))
    strength = np.sqrt(np.einsum("bij,bij->b", A.data, A.data) / 3)
    strength[~(moving[rows] & moving[A.indices])] = 1.0
    return split_weak(boxes(points, count), rows, A.indices, strength)


def _cholesky(matrix: np.ndarray):
    """Cholesky factor of the coarse matrix, its diagonal raised as little as makes it positive.

    Aggregates of one or two nodes have dependent rigid modes, so the matrix may be singular to
    round-off; a preconditioner may be that much off.
    """
    from scipy.linalg import LinAlgError, cho_factor

    diagonal = matrix.diagonal().copy()
    for shift in (0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4):
        np.fill_diagonal(matrix, (1 + shift) * diagonal)
        try:
            return cho_factor(matrix, lower=True)
        except LinAlgError:
            logger.info("coarse matrix is not positive with a shift of %g", shift)
    raise ConvergenceError("the stiffness matrix is not positive definite: is the body held?")


def coarsen(scaled: Scaled, points: np.ndarray, fixed: np.ndarray, largest: float) -> Coarse:
    """Smoothed aggregation with rigid-body modes, for nodes at ``points`` (nodes, 3) [m]."""
    from scipy.sparse import bsr_array

    from . import kernels_solver as k

    wp = start_warp()
    A, device = scaled.matrix.to_scipy(), scaled.matrix.values.device
    free = ~fixed
    label = aggregate(A, points, np.asarray(free.any(axis=1)))
    count, nodes = int(label.max()) + 1, len(points)
    scaling = scaled.lower.numpy().transpose(0, 2, 1) * free[:, None, :]
    basis = rigid_basis(points, label, scaling)
    P = bsr_array((basis, label, np.arange(nodes + 1)), shape=(3 * nodes, 6 * count))
    smoothing = A @ P
    smoothing.data *= -4 / (3 * largest)
    P = (P + smoothing).tobsr(blocksize=(3, 6))
    del smoothing
    matrix = (P.T @ (A @ P)).toarray()
    empty = matrix.diagonal() <= 0
    matrix[empty, empty] = 1.0
    factor, inverse = _cholesky(matrix), None
    if device.is_cuda:
        from scipy.linalg import cho_solve

        whole = cho_solve(factor, np.eye(6 * count))
        factor, inverse = None, wp.array(whole, dtype=wp.float64, device=device)
    return Coarse(
        wp.array(P.indptr, dtype=wp.int32, device=device),
        wp.array(P.indices, dtype=wp.int32, device=device),
        wp.array(P.data, dtype=k.mat36d, device=device, copy=device.is_cuda),
        count,
        factor,
        inverse,
    )


class TwoLevel:
    """V-cycle ``z = M r`` on scaled vectors, recorded once and replayed.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes to the coarse space.
    """

    def __init__(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> None:
        from . import kernels_solver as k

        wp = start_warp()
        matrix = scaled.matrix
        self.device = matrix.values.device
        largest = largest_eigenvalue(matrix)
        self.coarse = coarsen(scaled, points, fixed, largest)
        self.residual, self.correction = (
            wp.zeros(self.coarse.count, dtype=k.vec6d, device=self.device) for _ in range(2)
        )
        r, z, res, *d = (
            wp.zeros(matrix.nodes, dtype=wp.vec3d, device=self.device) for _ in range(5)
        )
        self.r, self.z = r, z
        A = [matrix.rows, matrix.columns, matrix.values]
        P = [self.coarse.start, self.coarse.aggregates, self.coarse.transfer]
        theta, steps = chebyshev(largest, DEGREE)
        launch = Recorder(matrix.nodes, self.device)
        smooth = [
            launch(k.chebyshev_step, [*A, d[i % 2], keep, gain, res, d[1 - i % 2], z])
            for i, (keep, gain) in enumerate(steps)
        ]
        last = d[len(steps) % 2]
        self.before = [launch(k.chebyshev_start, [r, 1 / theta, res, d[0], z]), *smooth]
        self.before.append(launch(k.restrict_residual, [*A, res, last, *P, self.residual]))
        self.after = [launch(k.prolong, [*P, self.correction, z])]
        self.after.append(launch(k.chebyshev_restart, [*A, r, z, 1 / theta, res, d[0]]))
        self.after += [launch(k.add, [z, d[0]]), *smooth]

    def apply(self) -> None:
        """Compute ``z`` from ``r``."""
        self.residual.zero_()
        for command in self.before:
            command.launch()
        self._solve_coarse()
        for command in self.after:
            command.launch()

    def _solve_coarse(self) -> None:
        from . import kernels_solver as k

        wp = start_warp()
        if self.coarse.factor is not None:
            from scipy.linalg import cho_solve

            r = self.residual.numpy().reshape(-1)
            x = cho_solve(self.coarse.factor, r, check_finite=False)
            self.correction.numpy()[:] = x.reshape(-1, 6)
            return
        flat = [v.view(wp.float64).flatten() for v in (self.residual, self.correction)]
        wp.launch_tiled(
            k.dense_multiply,
            dim=[6 * self.coarse.count],
            inputs=[self.coarse.inverse, *flat],
            block_dim=BLOCK,
            device=self.device,
        )


def chebyshev(largest: float, degree: int) -> tuple[float, list[tuple[float, float]]]:
    """Centre theta of the interval and the (keep, gain) factors of the steps after the first."""
    low = largest / SPREAD
    theta, delta = (largest + low) / 2, (largest - low) / 2
    sigma = theta / delta
    rho, steps = 1 / sigma, []
    for _ in range(degree - 1):
        new = 1 / (2 * sigma - rho)
        steps.append((new * rho, 2 * new / delta))
        rho = new
    return theta, steps
