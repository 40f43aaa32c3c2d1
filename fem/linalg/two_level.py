"""Two-level preconditioner: Chebyshev smoothing and a coarse space of rigid aggregates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix
from .coarse import coarsen, coarsen_again
from .corners import CornerLevel
from .krylov import BLOCK
from .lanczos import LargestEigenvalue
from .smoother import DEGREE, SingleSmoother, Smoother

# A smoother serves matrices whose largest eigenvalue is this near: its margin covers as much.
LIKE = 0.97


@dataclass(eq=False)
class Scaled:
    """The system with unit diagonal blocks: ``matrix`` = inv(L) A inv(L)^T, L block diagonal.

    ``largest`` is its largest eigenvalue; no number where a diagonal block is not positive.
    """

    matrix: BlockMatrix
    lower: Any
    inverse: Any
    commands: list[Any]
    eigenvalue: LargestEigenvalue
    largest: float

    def take(self, matrix: BlockMatrix) -> None:
        """Become the system of another ``matrix`` of the same pattern, in the same arrays."""
        start_warp().copy(self.matrix.values, matrix.values)
        self.refresh()

    def refresh(self) -> None:
        """Scale the numbers that the matrix has."""
        for command in self.commands:
            command.launch()
        self.largest = self.eigenvalue()


def scale(matrix: BlockMatrix) -> Scaled:
    """Scale ``matrix`` in place with the Cholesky factors of its diagonal blocks."""
    from . import kernels_solver as k

    wp = start_warp()
    device = matrix.values.device
    lower = wp.empty(matrix.nodes, dtype=wp.mat33d, device=device)
    inverse = wp.empty(matrix.nodes, dtype=wp.mat33d, device=device)
    arrays = [matrix.rows, matrix.columns]
    launch = Recorder(matrix.nodes, device)
    commands = [
        launch(k.factor_diagonal, [*arrays, matrix.values, lower, inverse]),
        launch(k.scale_blocks, [*arrays, inverse, matrix.values]),
    ]
    system = Scaled(matrix, lower, inverse, commands, LargestEigenvalue(matrix), np.nan)
    system.refresh()
    return system


class AggregateLevel:
    """Adds P A_c^-1 P^T r to z, both of scaled unknowns; P has the rigid motions of aggregates.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes; r and z are of vec3d or,
    on a GPU, flat and single.
    """

    def __init__(
        self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray, r: Any, z: Any
    ) -> None:
        from . import kernels_solver as k

        wp = start_warp()
        self.device = scaled.matrix.values.device
        self.coarse = coarse = coarsen(scaled.matrix, scaled.lower, points, fixed, scaled.largest)
        self.given, self.found = (
            wp.zeros(coarse.count, dtype=k.vec6d, device=self.device) for _ in range(2)
        )
        self.flat = [v.view(wp.float64).flatten() for v in (self.given, self.found)]
        if coarse.members is None:
            self.restrict, self.prolong = self._launches(r, z)
        else:
            self.restrict, self.prolong = self._single_launches(r, z, coarse.members)

    def _launches(self, r: Any, z: Any) -> list[Any]:
        """Restriction, which adds to the coarse residual, and prolongation."""
        from . import kernels_solver as k

        P = [self.coarse.start, self.coarse.aggregates, self.coarse.transfer]
        launch = Recorder(len(r), self.device)
        return [launch(k.scatter, [*P, r, self.given]), launch(k.prolong, [*P, self.found, z])]

    def _single_launches(self, r: Any, z: Any, members: tuple) -> list[Any]:
        """Restriction, which writes the coarse residual, and prolongation."""
        from . import kernels_gpu as k

        wp, coarse = start_warp(), self.coarse
        launch = Recorder(len(z), self.device)
        given = coarse.transfer.view(wp.float64).flatten()
        transfer = wp.empty(len(given), dtype=wp.float32, device=self.device)
        self.narrow = launch(k.narrow, [given, transfer], size=len(given))
        self.narrow.launch()
        restrict = wp.launch_tiled(
            k.single_restrict,
            dim=[coarse.count],
            inputs=[*members, transfer, r, self.flat[0]],
            block_dim=BLOCK,
            device=self.device,
            record_cmd=True,
        )
        P = [coarse.start, coarse.aggregates, transfer]
        return [restrict, launch(k.single_prolong, [*P, self.flat[1], z])]

    def take(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> bool:
        """Become the level of another system of the same pattern, in the same arrays, on a GPU.

        False where it has other groups of nodes.
        """
        known = (scaled.matrix, scaled.lower, points, fixed)
        if not coarsen_again(self.coarse, *known, scaled.largest):
            return False
        self.narrow.launch()
        return True

    def apply(self) -> None:
        """Correct z by what the motions can of r."""
        if self.coarse.members is None:
            self.given.zero_()
        self.restrict.launch()
        self._solve()
        self.prolong.launch()

    def _solve(self) -> None:
        from . import kernels_gpu as k

        if self.coarse.factor is not None:
            from scipy.linalg import cho_solve

            given, found = (v.numpy() for v in self.flat)
            found[:] = cho_solve(self.coarse.factor, given, check_finite=False)
            return
        start_warp().launch_tiled(
            k.dense_multiply,
            dim=[6 * self.coarse.count],
            inputs=[self.coarse.inverse, *self.flat],
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
        on_gpu, self.largest = scaled.matrix.values.device.is_cuda, scaled.largest
        smoother = SingleSmoother if on_gpu else Smoother
        self.smoother = smoother(scaled.matrix, scaled.largest, degree)
        self.r, self.z, self.device = self.smoother.r, self.smoother.z, self.smoother.r.device
        vectors = self.smoother.residual, self.smoother.correction
        if edges is None:
            self.level = AggregateLevel(scaled, points, fixed, *vectors)
        else:
            self.level = CornerLevel(scaled.matrix, scaled.lower, edges, fixed, *vectors)

    def take(self, scaled: Scaled, points: np.ndarray, fixed: np.ndarray) -> bool:
        """Become the cycle of another system of the same pattern, in the same arrays, on a GPU.

        False where its polynomials or groups of nodes would be others: make a new one then.
        """
        level, smoother = self.level, self.smoother
        if not (isinstance(level, AggregateLevel) and isinstance(smoother, SingleSmoother)):
            return False
        known = LIKE * self.largest <= scaled.largest <= self.largest / LIKE
        if not known or not level.take(scaled, points, fixed):
            return False
        smoother.sliced.refresh()
        return True

    def apply(self) -> None:
        """Compute ``z`` from ``r``."""
        for command in self.smoother.before:
            command.launch()
        self.level.apply()
        for command in self.smoother.after:
            command.launch()
