"""Inverse of a dense matrix on a device: what a GPU solves the coarse system with."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ..device import Recorder, start_warp
from .krylov import whole_blocks


class Inversion:
    """Inverts dense symmetric positive matrices of ``size`` on one device.

    Block Gauss-Jordan: on a GPU its hundreds of launches are one graph.
    """

    def __init__(self, size: int, device: Any) -> None:
        from .kernels_gpu import PIVOT

        wp = start_warp()
        self.matrix = wp.zeros((size, size), dtype=wp.float64, device=device)
        self.row = wp.empty((PIVOT, size), dtype=wp.float64, device=device)
        self.column = wp.empty((size, PIVOT), dtype=wp.float64, device=device)
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

        size, width = len(self.matrix), k.PIVOT
        launch = Recorder(size, self.matrix.device)
        given = [self.matrix, 0, width, self.row, self.column]
        pivot = launch(k.take_pivot, given, size=whole_blocks(width * size))
        given = [self.row, self.column, 0, width, self.matrix]
        step = launch(k.eliminate, given, size=(size, size))
        for first in range(0, size, width):
            for command, place in ((pivot, 1), (step, 2)):
                command.set_param_at_index(place, first)
                command.set_param_at_index(place + 1, min(width, size - first))
                command.launch()


@lru_cache(maxsize=4)
def inversion(size: int, device: str) -> Inversion:
    """Return what inverts matrices of this size on a device."""
    return Inversion(size, device)
