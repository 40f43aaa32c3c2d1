"""Inverse of a dense matrix on a device: what a GPU solves the coarse system with."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ..device import Recorder, start_warp


class Inversion:
    """Inverts dense symmetric positive matrices of ``size``, 6 x 6 blocks, on one device.

    Block Gauss-Jordan: on a GPU its hundreds of launches are one graph.
    """

    def __init__(self, size: int, device: Any) -> None:
        wp = start_warp()
        self.matrix = wp.zeros((size, size), dtype=wp.float64, device=device)
        self.row = wp.empty((6, size), dtype=wp.float64, device=device)
        self.column = wp.empty((size, 6), dtype=wp.float64, device=device)
        self.graph = None

    def __call__(self, matrix: Any) -> Any:
        """Invert ``matrix`` in place."""
        wp = start_warp()
        wp.copy(self.matrix, matrix)
        if matrix.device.is_cuda:
            self._replay()
        else:
            self._sweep()
        wp.copy(matrix, self.matrix)
        return matrix

    def _replay(self) -> None:
        wp = start_warp()
        if self.graph is None:
            with wp.ScopedCapture(device=self.matrix.device) as capture:
                self._sweep()
            self.graph = capture.graph
        wp.capture_launch(self.graph)

    def _sweep(self) -> None:
        from . import kernels_gpu as k

        size = len(self.matrix)
        launch = Recorder(size, self.matrix.device)
        pivot = launch(k.take_pivot, [self.matrix, 0, self.row, self.column])
        step = launch(k.eliminate, [self.row, self.column, 0, self.matrix], size=(size, size))
        for block in range(size // 6):
            pivot.set_param_at_index(1, block)
            step.set_param_at_index(2, block)
            pivot.launch()
            step.launch()


@lru_cache(maxsize=4)
def inversion(size: int, device: str) -> Inversion:
    """Return what inverts matrices of this size on a device."""
    return Inversion(size, device)
