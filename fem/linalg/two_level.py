"""Two-level preconditioner: Chebyshev smoothing and a coarse space of rigid aggregates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device import start_warp
from ..discrete.block_matrix import BlockMatrix
from .coarse import coarsen
from .corners import CornerLevel
from .krylov import BLOCK, Recorder, largest_eigenvalue

# Chebyshev polynomials of degree 3 damp the upper part [largest / SPREAD, largest] of the spectrum.
DEGREE = 3
SPREAD = 25.0


@dataclass(frozen=True, eq=False)
class Scaled:
    """The system with unit diagonal blocks: ``matrix`` = inv(L) A inv(L)^T, L block diagonal.

    ``largest`` is its largest eigenvalue; no number where a diagonal block is not positive.
    """

    matrix: BlockMatrix
    lower: Any
    inverse: Any
    largest: float


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
    return Scaled(matrix, lower, inverse, largest_eigenvalue(matrix))


class Rows:
    """Launches of kernels that need A x, row by row.

    On a GPU the products come first, by threads that read what lies together; the kernel is then
    given a diagonal matrix of their sums, whose product with ones is A x. ``apart`` overrules.
    """

    def __init__(self, matrix: BlockMatrix, *, apart: bool | None = None) -> None:
        wp = start_warp()
        self.arrays = [matrix.rows, matrix.columns, matrix.values]
        self.record = Recorder(matrix.nodes, matrix.values.device)
        self.apart = matrix.values.device.is_cuda if apart is None else apart
        if self.apart:
            count, device = matrix.nodes, matrix.values.device
            index = wp.array(np.arange(count + 1), dtype=wp.int32, device=device)
            sums = wp.zeros(count, dtype=wp.mat33d, device=device)
            self.ones = wp.ones(count, dtype=wp.vec3d, device=device)
            self.diagonal = [index, index, sums]

    def launch(self, kernel: Any, x: Any, after: list, before: Sequence = ()) -> list:
        """Launch commands of ``kernel``(rows, columns, values, *before, x, *after)."""
        from . import kernels_solver as k

        if not self.apart:
            return [self.record(kernel, [*self.arrays, *before, x, *after])]
        wp = start_warp()
        rows, columns, *numbers = *self.arrays, x, self.diagonal[2]
        flat = [v.view(wp.float64).flatten() for v in numbers]
        first = self.record(k.products, [rows, columns, *flat], size=9 * self.record.size)
        return [first, self.record(kernel, [*self.diagonal, *before, self.ones, *after])]


class AggregateLevel:
    """Adds P A_c^-1 P^T r to z, both of scaled unknowns; P has the rigid motions of aggregates.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes.
    """

    def __init__(
        self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray, r: Any, z: Any
    ) -> None:
        from . import kernels_solver as k

        wp, matrix = start_warp(), scaled.matrix
        self.device = matrix.values.device
        self.coarse = coarsen(matrix, scaled.lower, points, fixed, scaled.largest)
        self.residual, self.correction = (
            wp.zeros(self.coarse.count, dtype=k.vec6d, device=self.device) for _ in range(2)
        )
        P = [self.coarse.start, self.coarse.aggregates, self.coarse.transfer]
        self.restrict = self._restriction(r, P)
        self.prolong = Recorder(matrix.nodes, self.device)(k.prolong, [*P, self.correction, z])

    def _restriction(self, fine: Any, P: list) -> Any:
        """Command that adds P^T ``fine`` to the coarse residual (CPU), or writes it there (GPU)."""
        from . import kernels_solver as k

        wp = start_warp()
        if self.coarse.members is None:
            return Recorder(len(fine), self.device)(k.scatter, [*P, fine, self.residual])
        coarse = self.residual.view(wp.float64).flatten()
        return wp.launch_tiled(
            k.restrict,
            dim=[self.coarse.count],
            inputs=[*self.coarse.members, self.coarse.transfer, fine, coarse],
            block_dim=BLOCK,
            device=self.device,
            record_cmd=True,
        )

    def apply(self) -> None:
        """Correct z by what the motions can of r."""
        if self.coarse.members is None:
            self.residual.zero_()
        self.restrict.launch()
        self._solve()
        self.prolong.launch()

    def _solve(self) -> None:
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


class TwoLevel:
    """V-cycle ``z = M r`` on scaled vectors, recorded once and replayed.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes to the coarse level;
    ``degree`` is that of the smoother. With the ``edges`` of a P2 space (nodes - corners, 2) the
    linear functions of its corners are that level, else the rigid motions of aggregates.
    """

    def __init__(
        self,
        scaled: Scaled,
        points: np.ndarray,
        fixed: np.ndarray,
        degree: int = DEGREE,
        edges: np.ndarray | None = None,
    ) -> None:
        from . import kernels_solver as k

        wp, matrix = start_warp(), scaled.matrix
        self.device = matrix.values.device
        r, z, res, *d = (
            wp.zeros(matrix.nodes, dtype=wp.vec3d, device=self.device) for _ in range(5)
        )
        self.r, self.z = r, z
        if edges is None:
            self.level = AggregateLevel(scaled, points, fixed, res, z)
        else:
            self.level = CornerLevel(matrix, scaled.lower, edges, fixed, res, z)
        self.rows = rows = Rows(matrix)  # its arrays live as long as the launches
        theta, steps = chebyshev(scaled.largest, degree)
        launch = Recorder(matrix.nodes, self.device)
        smooth = []
        for i, (keep, gain) in enumerate(steps):
            old, new = d[i % 2], d[1 - i % 2]
            smooth += rows.launch(k.chebyshev_step, old, [old, keep, gain, res, new, z])
        last = d[len(steps) % 2]
        self.before = [launch(k.chebyshev_start, [r, 1 / theta, res, d[0], z]), *smooth]
        self.before += rows.launch(k.subtract, last, [res])
        self.after = rows.launch(k.chebyshev_restart, z, [1 / theta, res, d[0]], [r])
        self.after += [launch(k.add, [z, d[0]]), *smooth]

    def apply(self) -> None:
        """Compute ``z`` from ``r``."""
        for command in self.before:
            command.launch()
        self.level.apply()
        for command in self.after:
            command.launch()


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
