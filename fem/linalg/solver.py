"""Linear solver for symmetric positive block matrices: direct when small, two-level CG above."""

from __future__ import annotations

import logging
from typing import Any, NamedTuple

import numpy as np

from ..device import start_warp
from ..discrete.block_matrix import BlockMatrix
from .krylov import ConjugateGradients, Recorder
from .two_level import Scaled, TwoLevel, scale

logger = logging.getLogger(__name__)

# Below this many unknowns a direct factor is faster than the set-up of the hierarchy.
DIRECT = 6_000
# Above this many a direct factor would not fit as a second chance.
DIRECT_RESCUE = 150_000
# The iterations grow as 1 / sqrt(1 - 2 nu): P2 at nu = .4999 takes about 600.
MAX_ITERATIONS = 1000
# Compact bodies take 15-30 iterations. One that needs more is thin or slender: there a direct
# factor has little fill (24k unknowns of a chair: .3 s, against 600 iterations in 20 s).
PATIENCE = 60
# A pivot this small, of a matrix scaled to a unit diagonal, may be round-off of a zero: a body that
# is not held. (Slender bodies with contrasts of 1e8 reach 1e-10.)
PIVOT = 1e-11
# A residual of round-off alone says nothing of x (a slab of aspect 10,000 had 2.9, and moved 4e-5
# of what it should): its last correction does. Slabs of 2e11 Pa were off by up to ten times it.
KNOWN = 1e-3
# That correction is found to this share of itself.
CORRECTED = 0.1


class Solution(NamedTuple):
    """Solution ``x`` (nodes, 3), relative ``residual`` |b - A x| / |b|, ``iterations``.

    ``floor`` is the relative residual that round-off alone leaves, ``change`` what one more
    correction of such an x adds to it, as a share; ``suspect`` says that the matrix looks singular.
    """

    x: np.ndarray
    residual: float
    iterations: int
    floor: float
    suspect: bool = False
    change: float = 0.0

    def reached(self, tolerance: float) -> bool:
        """Whether x is as good as wanted, or as fp64 allows and still known well enough."""
        known = self.residual <= self.floor and self.change <= KNOWN
        return bool(self.residual <= tolerance or known)


def solve_system(
    matrix: BlockMatrix, b: np.ndarray, *, points: np.ndarray, fixed: np.ndarray, tolerance: float
) -> Solution:
    """Solve A x = b for ``b`` (nodes, 3) to a relative residual; ``matrix`` is used up.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes to the coarse space.
    """
    if b.size <= DIRECT:
        return solve_direct(matrix.to_scipy(), b)
    system = scale(matrix)
    if np.isnan(system.largest):  # a diagonal block is not positive
        return Solution(np.full_like(b, np.nan), np.inf, 0, 0.0, True)
    solution = solve_iterative(system, b, points=points, fixed=fixed, tolerance=tolerance)
    failed = not solution.reached(tolerance)
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
    correction = x
    for _ in range(2):  # iterative refinement: round-off of high contrasts
        correction = scale * lu.solve(scale * (rhs - A @ x))
        x += correction
    suspect = bool(np.abs(lu.U.diagonal()).min() < PIVOT)
    residual, change = _relative(rhs - A @ x, rhs), _relative(correction, x)
    return Solution(x.reshape(-1, 3), residual, 0, round_off(A, x, rhs), suspect, change)


def _length(v: np.ndarray) -> float:
    """Euclidean length without BLAS, whose threads take milliseconds to meet."""
    return float(np.sqrt(np.square(v).sum()))


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
    cycle = TwoLevel(system, points, fixed)
    cg = ConjugateGradients(system.matrix, system.lower, cycle, cycle.r, cycle.z)
    launch = Recorder(system.matrix.nodes, cycle.device)
    given = wp.array(b, dtype=wp.vec3d, device=cycle.device)
    launch(k.block_multiply, [system.inverse, given, False, cycle.r]).launch()
    size = _length(b) or 1.0
    limit = PATIENCE if b.size <= DIRECT_RESCUE else MAX_ITERATIONS
    iterations = cg.run(tolerance * size, limit)
    solution, residual = wp.empty_like(given), wp.empty_like(given)
    launch(k.block_multiply, [system.inverse, cg.x, True, solution]).launch()
    # The true residual, not the recursive one.
    system.matrix.multiply(cg.x, cycle.z)
    launch(k.block_multiply, [system.lower, cycle.z, False, residual]).launch()
    error = _length(b - residual.numpy()) / size
    x = solution.numpy().copy()
    if error <= tolerance:
        return Solution(x, error, iterations, 0.0)
    floor = _scaled_round_off(system, cg.x.numpy()) / size
    if error > floor:
        return Solution(x, error, iterations, floor)
    rest = wp.array(b - residual.numpy(), dtype=wp.vec3d, device=cycle.device)
    launch(k.block_multiply, [system.inverse, rest, False, cycle.r]).launch()
    iterations += cg.run(CORRECTED * error * size, limit)
    launch(k.block_multiply, [system.inverse, cg.x, True, solution]).launch()
    change = _length(solution.numpy()) / (_length(x) or 1.0) if cg.reached else np.inf
    return Solution(x, error, iterations, floor, change=change)


def _scaled_round_off(system: Scaled, x: np.ndarray) -> float:
    weight = (abs(system.matrix.to_scipy()) @ np.abs(x).reshape(-1)).reshape(-1, 3)
    total = np.einsum("nij,nj->ni", np.abs(system.lower.numpy()), weight)
    return 64 * np.finfo(float).eps * float(np.linalg.norm(total))
