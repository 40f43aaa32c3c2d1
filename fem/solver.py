"""Linear solver for symmetric positive block matrices: direct when small, two-level CG above."""

from __future__ import annotations

import logging
from typing import Any, NamedTuple

import numpy as np

from .blocks import BlockMatrix
from .device import start_warp
from .multigrid import Recorder, Scaled, TwoLevel, coarsen, largest_eigenvalue, scale

logger = logging.getLogger(__name__)

# Below this many unknowns a direct factor is faster than the set-up of the hierarchy.
DIRECT = 6_000
# Above this many a direct factor would not fit as a second chance.
DIRECT_RESCUE = 150_000
MAX_ITERATIONS = 600
# Compact bodies take 15-30 iterations. One that needs more is thin or slender: there a direct
# factor has little fill (24k unknowns of a chair: .3 s, against 600 iterations in 20 s).
PATIENCE = 60
# On a GPU reading the residual waits for the device: so many iterations go unread.
GPU_STRIDE = 4
# A pivot this small, of a matrix scaled to a unit diagonal, may be round-off of a zero: a body that
# is not held. (Slender bodies with contrasts of 1e8 reach 1e-10.)
PIVOT = 1e-11


class Solution(NamedTuple):
    """Solution ``x`` (nodes, 3), relative ``residual`` |b - A x| / |b|, ``iterations``.

    ``floor`` is the relative residual that round-off alone leaves; ``suspect`` says that the matrix
    looks singular.
    """

    x: np.ndarray
    residual: float
    iterations: int
    floor: float
    suspect: bool = False


def solve(
    matrix: BlockMatrix, b: np.ndarray, *, points: np.ndarray, fixed: np.ndarray, tolerance: float
) -> Solution:
    """Solve A x = b for ``b`` (nodes, 3) to a relative residual; ``matrix`` is used up.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes to the coarse space.
    """
    if b.size <= DIRECT:
        return solve_direct(matrix.to_scipy(), b)
    system = scale(matrix)
    if not np.isfinite(system.lower.numpy()).all():  # a diagonal block is not positive
        return Solution(np.full_like(b, np.nan), np.inf, 0, 0.0, True)
    solution = solve_iterative(system, b, points=points, fixed=fixed, tolerance=tolerance)
    failed = not solution.residual <= max(tolerance, solution.floor)
    if failed and b.size <= DIRECT_RESCUE:
        logger.info("CG stopped at %.3g: factoring the matrix instead", solution.residual)
        return _rescue(system, b, solution)
    return solution._replace(suspect=failed)


def _rescue(system: Scaled, b: np.ndarray, tried: Solution) -> Solution:
    lower = system.lower.numpy()
    scaled_b = np.einsum("nij,nj->ni", system.inverse.numpy(), b)
    direct = solve_direct(system.matrix.to_scipy(), scaled_b)
    x = np.linalg.solve(lower.transpose(0, 2, 1), direct.x[..., None])[..., 0]
    return direct._replace(x=x, iterations=tried.iterations, floor=tried.floor)


def solve_direct(A: Any, b: np.ndarray) -> Solution:
    """Sparse LU of ``A`` (scipy) with diagonal pivots and iterative refinement."""
    from scipy.sparse.linalg import splu

    A = A.tocsc()
    scale = 1 / np.sqrt(A.diagonal())
    scaled = A.multiply(scale[:, None]).multiply(scale[None, :]).tocsc()
    # A symmetric positive matrix needs no pivoting: minimum degree on the pattern, diagonal pivots.
    options = {"SymmetricMode": True}
    lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    rhs = b.reshape(-1)
    x = scale * lu.solve(scale * rhs)
    for _ in range(2):  # iterative refinement: round-off of high contrasts
        x += scale * lu.solve(scale * (rhs - A @ x))
    suspect = bool(np.abs(lu.U.diagonal()).min() < PIVOT)
    residual = _relative(rhs - A @ x, rhs)
    return Solution(x.reshape(-1, 3), residual, 0, round_off(A, x, rhs), suspect)


def _relative(r: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(r) / (np.linalg.norm(b) or 1.0))


def round_off(A: Any, x: np.ndarray, b: np.ndarray) -> float:
    """Relative residual that evaluating b - A x in fp64 leaves: cancellation of |A| |x| terms."""
    return 64 * np.finfo(float).eps * _relative(abs(A) @ np.abs(x), b)


def solve_iterative(
    system: Scaled, b: np.ndarray, *, points: np.ndarray, fixed: np.ndarray, tolerance: float
) -> Solution:
    """Conjugate gradients on the scaled system with the two-level preconditioner."""
    from . import kernels_solver as k

    wp = start_warp()
    device, nodes = system.matrix.values.device, system.matrix.nodes
    largest = largest_eigenvalue(system.matrix.to_scipy())
    coarse = coarsen(system, points, fixed, largest)
    r = wp.array(b, dtype=wp.vec3d, device=device)
    x, z, y = wp.zeros_like(r), wp.zeros_like(r), wp.zeros_like(r)
    launch = Recorder(wp, nodes, device)
    launch(k.block_multiply, [system.inverse, r, False, r]).launch()
    cg = ConjugateGradients(system, TwoLevel(system, coarse, largest, r, z), x, r, z)
    size = float(np.linalg.norm(b)) or 1.0
    limit = PATIENCE if b.size <= DIRECT_RESCUE else MAX_ITERATIONS
    iterations = cg.run(tolerance * size, limit)
    launch(k.block_multiply, [system.inverse, x, True, y]).launch()
    solution = y.numpy().copy()
    # The true residual, not the recursive one.
    system.matrix.multiply(x, r)
    launch(k.block_multiply, [system.lower, r, False, r]).launch()
    residual = float(np.linalg.norm(b - r.numpy())) / size
    floor = _scaled_round_off(system, x.numpy()) / size if residual > tolerance else 0.0
    return Solution(solution, residual, iterations, floor)


def _scaled_round_off(system: Scaled, x: np.ndarray) -> float:
    weight = (abs(system.matrix.to_scipy()) @ np.abs(x).reshape(-1)).reshape(-1, 3)
    total = np.einsum("nij,nj->ni", np.abs(system.lower.numpy()), weight)
    return 64 * np.finfo(float).eps * float(np.linalg.norm(total))


class ConjugateGradients:
    """Preconditioned CG on a scaled system; vectors and scalars live on the device.

    ``preconditioner.apply()`` computes z from r; ``x`` starts at zero, ``r`` at the scaled right-
    hand side. ``reached`` and ``indefinite`` say how the loop ended.
    """

    def __init__(self, system: Scaled, preconditioner: Any, x: Any, r: Any, z: Any) -> None:
        from . import kernels_linear, kernels_solver

        wp = self.wp = start_warp()
        self.preconditioner = preconditioner
        self.reached = self.indefinite = False
        self.scalars = wp.zeros(4, dtype=wp.float64, device=r.device)
        p, q, unscaled = wp.zeros_like(r), wp.zeros_like(r), wp.zeros_like(r)
        launch = Recorder(wp, system.matrix.nodes, r.device)
        A = [system.matrix.rows, system.matrix.columns, system.matrix.values]
        self.multiply = launch(kernels_linear.multiply, [*A, p, q])
        advance = [p, q, system.lower, self.scalars, x, r, unscaled]
        self.advance = launch(kernels_solver.cg_advance, advance)
        self.direction = launch(kernels_solver.cg_direction, [z, self.scalars, p])
        self.shift = launch(kernels_solver.cg_shift, [self.scalars], size=1)
        vectors = {"p": p, "q": q, "r": r, "z": z, "u": unscaled}
        self.flat = {name: v.view(wp.float64).flatten() for name, v in vectors.items()}
        self.host = None if r.device.is_cuda else {n: v.numpy() for n, v in self.flat.items()}
        self.p, self.z = p, z

    def _dot(self, a: str, b: str, slot: int) -> None:
        if self.host is not None:
            self.scalars.numpy()[slot] = self.host[a] @ self.host[b]
            return
        out = self.scalars[slot : slot + 1]
        self.wp.utils.array_inner(self.flat[a], self.flat[b], out=out)

    def step(self) -> None:
        """One iteration, from a direction p to the next."""
        self.multiply.launch()
        self._dot("p", "q", 1)
        self.advance.launch()
        self._dot("u", "u", 3)
        self.preconditioner.apply()
        self._dot("r", "z", 2)
        self.direction.launch()
        self.shift.launch()

    def run(self, target: float, limit: int | None = None) -> int:
        """Iterate until the unscaled residual is below ``target``; return the iterations."""
        limit = MAX_ITERATIONS if limit is None else limit
        self.preconditioner.apply()
        self.wp.copy(self.p, self.z)
        self._dot("r", "z", 0)
        device = self.p.device
        if not device.is_cuda:
            return self._loop(self.step, 1, target, limit)
        with self.wp.ScopedCapture(device=device) as capture:
            for _ in range(GPU_STRIDE):
                self.step()
        graph = capture.graph
        return self._loop(lambda: self.wp.capture_launch(graph), GPU_STRIDE, target, limit)

    def _loop(self, advance: Any, stride: int, target: float, limit: int) -> int:
        for done in range(stride, limit + stride, stride):
            advance()
            curvature, square = self.scalars.numpy()[[1, 3]]
            self.indefinite = bool(curvature < 0)
            if self.indefinite or not square > target**2:  # also ends on NaN
                self.reached = bool(square <= target**2) and not self.indefinite
                return done
        return limit
