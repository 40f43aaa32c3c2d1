"""Chebyshev polynomials of a scaled matrix: before a coarse level, and after it.

Degree 3 by default, damping the upper part [largest / SPREAD, largest] of the spectrum.
"""

from __future__ import annotations

from typing import Any

from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix
from .krylov import SlicedMatrix

DEGREE = 3
SPREAD = 25.0


class Smoother:
    """Launches on vectors of vec3d: of ``r`` what is left is ``residual``, what is done ``z``.

    A coarse level corrects ``z`` by the ``residual`` between ``before`` and ``after``.
    """

    def __init__(self, matrix: BlockMatrix, largest: float, degree: int = DEGREE) -> None:
        from . import kernels_solver as k

        wp, A = start_warp(), [matrix.rows, matrix.columns, matrix.values]
        device = matrix.values.device
        self.r, self.z, res, *d = (
            wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(5)
        )
        self.residual, self.correction = res, self.z
        theta, steps = chebyshev(largest, degree)
        launch = Recorder(matrix.nodes, device)
        smooth = [
            launch(k.chebyshev_step, [*A, old, keep, gain, res, new, self.z])
            for (old, new), (keep, gain) in zip(_turns(d), steps, strict=False)
        ]
        last = d[len(steps) % 2]
        self.before = [
            launch(k.chebyshev_start, [self.r, 1 / theta, res, d[0], self.z]),
            *smooth,
            launch(k.subtract, [*A, last, res]),
        ]
        self.after = [
            launch(k.chebyshev_restart, [*A, self.r, self.z, 1 / theta, res, d[0]]),
            launch(k.add, [self.z, d[0]]),
            *smooth,
        ]


class SingleSmoother:
    """The same in single precision, a thread a scalar: several times faster on a GPU.

    ``residual`` and ``correction`` are flat and single, ``r`` and ``z`` double.
    """

    def __init__(self, matrix: BlockMatrix, largest: float, degree: int = DEGREE) -> None:
        from . import kernels_gpu as k

        wp = start_warp()
        device, size = matrix.values.device, 3 * matrix.nodes
        launch = Recorder(size, device)
        self.sliced = SlicedMatrix(matrix, wp.float32)
        self.sliced.refresh()
        A = self.sliced.arrays
        self.r, self.z = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(2))
        r, z = (v.view(wp.float64).flatten() for v in (self.r, self.z))
        res, x, *d = (wp.zeros(size, dtype=wp.float32, device=device) for _ in range(4))
        self.residual, self.correction = res, x
        theta, steps = chebyshev(largest, degree)

        def smooth(owed: float) -> list[Any]:
            """Launch commands of the steps after the first, which ``x`` may still be owed."""
            return [
                launch(
                    k.single_step, [*A, old, keep, gain, owed if i == 0 else 0.0, res, new, x, z]
                )
                for i, ((old, new), (keep, gain)) in enumerate(zip(_turns(d), steps, strict=False))
            ]

        last = d[len(steps) % 2]
        self.before = [
            launch(k.single_start, [r, 1 / theta, res, d[0], x]),
            *smooth(0.0),
            launch(k.single_subtract, [*A, last, res]),
        ]
        self.after = [
            launch(k.single_restart, [*A, r, x, 1 / theta, res, d[0]]),
            *smooth(1.0),
        ]


def _turns(pair: list[Any]):
    """Forever (old, new) and (new, old)."""
    while True:
        yield pair
        pair = pair[::-1]


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
