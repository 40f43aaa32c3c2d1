"""Krylov methods on a device: conjugate gradients, the largest eigenvalue by Lanczos."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..device import Recorder, start_warp
from ..discrete.block_matrix import BlockMatrix

# Threads of a block: inner products are summed within one before they meet in memory.
BLOCK = 256
# The largest eigenvalue comes from a few Lanczos steps, which stay a little below it.
LANCZOS_STEPS = 12
LANCZOS_MARGIN = 1.08


class Inner:
    """Inner product of two arrays of vec3d, added to a scalar that stays on the device.

    On the CPU numpy's is several times faster than a kernel's.
    """

    def __init__(self, a: Any, b: Any, out: Any, slot: int) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        x, y = (v.view(wp.float64).flatten() for v in (a, b))
        self.slot, self.on_device = slot, a.device.is_cuda
        if self.on_device:
            size = -(-x.shape[0] // BLOCK) * BLOCK
            self.command = Recorder(size, a.device)(k.inner, [x, y, slot, out])
        else:
            self.left, self.right, self.total = x.numpy(), y.numpy(), out.numpy()

    def add(self, slot: int | None = None) -> None:
        """Add the product to the scalar ``slot``, by default the one given at construction."""
        where = self.slot if slot is None else slot
        if not self.on_device:
            self.total[where] += self.left @ self.right
            return
        if slot is not None:
            self.command.set_param_at_index(2, slot)
        self.command.launch()


class ConjugateGradients:
    """Preconditioned CG for ``matrix``; vectors and scalars live on the device.

    ``preconditioner.apply()`` computes z from r. ``run`` starts at x = 0 with the right-hand side
    in ``r``, and may be called again after these, or the values of the matrix, have changed: on a
    GPU the whole loop is one graph. ``lower`` holds the blocks that scale a residual back.
    """

    def __init__(
        self, matrix: BlockMatrix, lower: Any, preconditioner: Any, r: Any, z: Any
    ) -> None:
        from . import kernels_krylov as k

        wp = start_warp()
        self.preconditioner, self.device = preconditioner, r.device
        self.scalars = wp.zeros(6, dtype=wp.float64, device=r.device)
        self.state = wp.zeros(4, dtype=wp.int32, device=r.device)
        self.x, self.p, q, unscaled = (wp.zeros_like(r) for _ in range(4))
        self.z, self.graph = z, None
        launch = Recorder(matrix.nodes, r.device)
        self.multiply = matrix.product(self.p, q)
        advance = [self.p, q, lower, self.scalars, self.x, r, unscaled]
        self.advance = launch(k.cg_advance, advance)
        self.direction = launch(k.cg_direction, [z, self.scalars, self.p])
        self.close = launch(k.cg_close, [self.scalars, self.state], size=1)
        self.first, self.curvature, self.norm, self.next = (
            Inner(a, b, self.scalars, slot)
            for a, b, slot in ((r, z, 0), (self.p, q, 1), (unscaled, unscaled, 3), (r, z, 2))
        )

    def step(self) -> None:
        """One iteration, from a direction p to the next."""
        self.multiply.launch()
        self.curvature.add()
        self.advance.launch()
        self.norm.add()
        self.preconditioner.apply()
        self.next.add()
        self.direction.launch()
        self.close.launch()

    def _loop(self) -> None:
        wp = start_warp()
        self.preconditioner.apply()
        wp.copy(self.p, self.z)
        self.first.add()
        wp.capture_while(self.state[:1], self.step)

    def run(self, target: float, limit: int) -> int:
        """Iterate until the unscaled residual is below ``target``; return the iterations."""
        wp = start_warp()
        self.x.zero_()
        self.scalars.assign(np.array([0, 0, 0, 0, target**2, 0]))
        self.state.assign(np.array([1, 0, limit, 0], dtype=np.int32))
        if self.device.is_cuda:
            if self.graph is None:
                with wp.ScopedCapture(device=self.device) as capture:
                    self._loop()
                self.graph = capture.graph
            wp.capture_launch(self.graph)
        else:
            self._loop()
        _, iterations, _, indefinite = self.state.numpy()
        self.indefinite = bool(indefinite)
        self.reached = not indefinite and bool(self.scalars.numpy()[5] <= target**2)
        return int(iterations)


def largest_eigenvalue(matrix: BlockMatrix) -> float:
    """Largest eigenvalue of a symmetric ``matrix`` by Lanczos, with a margin; NaN if it has one."""
    from . import kernels_krylov as k

    wp = start_warp()
    steps = min(LANCZOS_STEPS, 3 * matrix.nodes)
    device = matrix.values.device
    v, old, w = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device=device) for _ in range(3))
    # Entry k of `along` is v A v of step k, of `square` the squared length of w before it.
    along, square = (wp.zeros(steps + 1, dtype=wp.float64, device=device) for _ in range(2))
    launch = Recorder(matrix.nodes, device)
    direction = launch(k.lanczos_direction, [w, square, 0, v, old])
    multiply = matrix.product(v, w)
    residual = launch(k.lanczos_residual, [v, old, along, square, 0, w])
    length, curvature = Inner(w, w, square, 0), Inner(w, v, along, 0)
    launch(k.lanczos_start, [w]).launch()
    for step in range(steps):
        direction.set_param_at_index(2, step)
        residual.set_param_at_index(4, step)
        length.add(step)
        direction.launch()
        multiply.launch()
        curvature.add(step)
        residual.launch()
    off = np.sqrt(square.numpy()[1:steps])
    # A vector that vanished ended the search: what came after it is no number.
    good = int(np.argmin(off > 1e-12)) if (off <= 1e-12).any() else len(off)
    T = np.diag(along.numpy()[: good + 1]) + np.diag(off[:good], 1) + np.diag(off[:good], -1)
    if not np.isfinite(T).all():
        return np.nan
    return LANCZOS_MARGIN * float(np.linalg.eigvalsh(T)[-1])
