"""Linear solver for symmetric positive block matrices: a factor where it fills little, else CG."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..device import Recorder, start_warp
from ..elements.assembly import BlockMatrix
from ..note import Note
from .cholesky import (
    CholeskyFactor,
    Elimination,
    NotPositive,
    cached_factor,
    find_factor,
    planned_elimination,
)
from .krylov import ConjugateGradients, DeviceVector, length, norm
from .multigrid import Scaled, TwoLevel, corner_pattern, scale

logger = logging.getLogger(__name__)

# What a core does a second, measured on two: only the ratio of the three matters.
FACTOR_RATE = 12e9  # operations of a factorisation
FACTOR_ENTRIES = 1.2e8  # entries of a factor made, and read twice by each solve
CG_RATE = 1.6e7  # blocks of the matrix in one iteration of two-level CG, set-up included
# Iterations that CG takes on bodies of good tets, or over linear elements; slivers and thin parts
# take more. CG is given as long as the factor would have taken, and the factor comes then.
USUAL = 60
# Below this many unknowns a factor is made before anything is estimated.
DIRECT = 6_000
# Numbers of a factor above which it is not made: 3.2 GB, 5 GB at most with all that it takes.
MOST_ENTRIES = 400_000_000
# The iterations grow as 1 / sqrt(1 - 2 nu): P2 at nu = .4999 takes about 600.
MAX_ITERATIONS = 1000
# A pivot this small a fraction of its diagonal entry may be round-off of a zero: a body that is not
# held. (Slender bodies with contrasts of 1e8 reach 1e-10.)
PIVOT = 1e-11
CHOLESKY = "sparse Cholesky"
CG_AGGREGATES, CG_LINEAR = Note("solver.cg_over"), Note("solver.cg_over_linear")
CG_BOTH = Note("solver.cg_over_both")
# A residual of round-off alone says nothing of x (a slab of aspect 10,000 had 2.9, and moved 4e-5
# of what it should): its last correction does. Slabs of 2e11 Pa were off by up to ten times it.
KNOWN = 1e-3
# That correction is found to this fraction of itself.
CORRECTED = 0.1
# Steps of iterative refinement (round-off of high contrasts); after a correction of this share the
# next would be its square, below round-off.
REFINEMENTS = 2
SETTLED = 1e-8


class Solution(NamedTuple):
    """Solution ``x`` (nodes, 3), relative ``residual`` |b - A x| / |b|, ``iterations``.

    ``floor`` is the relative residual that round-off alone leaves, ``change`` what one more
    correction of such an x adds to it, as a share; ``suspect`` says that the matrix looks singular;
    ``solver`` names what found it, and what was tried before in vain; ``cycle`` is that of CG.
    """

    x: np.ndarray
    residual: float
    iterations: int
    floor: float
    suspect: bool = False
    change: float = 0.0
    solver: str = ""
    cycle: Inverse | None = None

    def reached(self, tolerance: float) -> bool:
        """Whether x is as good as wanted, or as fp64 allows and still known well enough."""
        known = self.residual <= self.floor and self.change <= KNOWN
        return bool(self.residual <= tolerance or known)


def solve_system(
    matrix: BlockMatrix,
    b: np.ndarray,
    *,
    points: np.ndarray,
    fixed: np.ndarray,
    tolerance: float,
    edges: np.ndarray | None = None,
) -> Solution:
    """Solve A x = b for ``b`` (nodes, 3) to a relative residual; ``matrix`` is used up.

    ``points`` (nodes, 3) [m] and ``fixed`` (nodes, 3) describe the nodes to the coarse space,
    ``edges`` (nodes - corners, 2) those of a P2 space to the elimination and the coarse level.
    """
    failed = Solution(np.full_like(b, np.nan), np.inf, 0, 0.0, True)
    if b.size <= DIRECT:
        return solve_direct(matrix, b, planned_elimination(matrix, edges), tolerance)
    patience = MAX_ITERATIONS
    if not matrix.values.device.is_cuda:
        plan = planned_elimination(matrix, edges)
        if plan.entries <= MOST_ENTRIES:
            patience = iterations_worth(plan, matrix)
            if patience <= USUAL:
                return solve_direct(matrix, b, plan, tolerance)
    system = cached_system(matrix) or scale(matrix)
    if np.isnan(system.largest):  # a diagonal block is not positive
        return failed
    options: dict[str, Any] = {"tolerance": tolerance, "limit": min(patience, MAX_ITERATIONS)}
    options |= {"points": points, "fixed": fixed, **_level_below(matrix, edges)}
    try:
        solution = solve_iterative(system, b, **options)
    except NotPositive:
        return failed
    if solution.reached(tolerance):
        return solution
    plan = planned_elimination(matrix, edges)
    if plan.entries > MOST_ENTRIES:
        return solution._replace(suspect=True)
    logger.info("CG stopped at %.3g: factoring the matrix instead", solution.residual)
    lower = system.lower.numpy()
    scaled_b = np.einsum("nij,nj->ni", system.inverse.numpy(), b)
    direct = solve_direct(system.matrix, scaled_b, plan, tolerance=0.0)
    x = np.linalg.solve(lower.transpose(0, 2, 1), direct.x[..., None])[..., 0]
    solver = Note(
        "solver.after_iterations",
        solver=direct.solver,
        iterations=solution.iterations,
        solver_2=solution.solver,
    )
    return direct._replace(x=x, iterations=solution.iterations, floor=solution.floor, solver=solver)


def _level_below(matrix: BlockMatrix, edges: np.ndarray | None) -> dict[str, Any]:
    """Options of ``TwoLevel``: whether the linear functions of the corners are ``factored``."""
    if edges is None or not len(edges):
        return {"edges": None}
    if matrix.values.device.is_cuda:
        return {"edges": edges, "factored": False}
    plan = planned_elimination(corner_pattern(edges, matrix.nodes))
    fits = plan.entries <= MOST_ENTRIES and iterations_worth(plan, matrix) <= USUAL
    return {"edges": edges, "factored": fits}


def iterations_worth(plan: Elimination, matrix: BlockMatrix) -> int:
    """Iterations of two-level CG that take as long as the factor."""
    factor = plan.operations / FACTOR_RATE + plan.entries / FACTOR_ENTRIES
    return int(factor * CG_RATE / len(matrix.columns))


def solve_direct(
    matrix: BlockMatrix, b: np.ndarray, plan: Elimination, tolerance: float
) -> Solution:
    """Cholesky factor of ``matrix`` by ``plan``, and iterative refinement."""
    matrix = matrix.to("cpu")
    try:
        factor = cached_factor(matrix, plan)
    except NotPositive:
        return Solution(np.full_like(b, np.nan), np.inf, 0, 0.0, True, np.inf, CHOLESKY)
    x, change = factor.solve(b), 1.0
    for _ in range(REFINEMENTS):
        correction = factor.solve(b - matrix.times(x))
        x = x + correction
        change = _length(correction) / (_length(x) or 1.0)
        if change < SETTLED:
            break
    error = _length(b - matrix.times(x)) / (_length(b) or 1.0)
    floor = 0.0
    if error > tolerance:  # what evaluating b - A x in fp64 leaves: cancellation of |A| |x| terms
        terms = abs(matrix.to_scipy()) @ np.abs(x).reshape(-1)
        floor = 64 * np.finfo(float).eps * _length(terms) / (_length(b) or 1.0)
    suspect = bool(factor.smallest_pivot < PIVOT)
    return Solution(x, error, 0, floor, suspect, change, CHOLESKY)


def _length(v: np.ndarray) -> float:
    """Euclidean length without BLAS, whose threads take milliseconds to meet."""
    return float(np.sqrt(np.square(v).sum()))


def solve_iterative(
    system: Scaled,
    b: np.ndarray,
    *,
    points: np.ndarray,
    fixed: np.ndarray,
    tolerance: float,
    limit: int,
    edges: np.ndarray | None = None,
    factored: bool = True,
) -> Solution:
    """Conjugate gradients on the scaled system with the two-level preconditioner.

    ``edges`` of a P2 space: linear elements are its coarse level, ``factored`` or over aggregates;
    else these are.
    """
    from . import kernels_krylov as k

    wp = start_warp()
    name = CG_AGGREGATES if edges is None else CG_LINEAR if factored else CG_BOTH
    cycle, cg = _prepared(system, points, fixed, edges=edges, factored=factored)
    launch = Recorder(system.matrix.nodes, cycle.device)
    size = _length(b) or 1.0
    # The V-cycle may be in single precision, whose range is small.
    load = wp.array(b / size, dtype=wp.vec3d, device=cycle.device)
    launch(k.block_multiply, [system.inverse, load, False, cycle.r]).launch()
    cg.start(tolerance, limit)
    solution, rest = wp.empty_like(load), wp.empty_like(load)
    launch(k.block_multiply, [system.inverse, cg.x, True, solution]).launch()
    # The true residual, not the recursive one.
    system.matrix.multiply(cg.x, cycle.z)
    launch(k.remainder, [load, system.lower, cycle.z, rest]).launch()
    error, iterations = norm(rest), cg.finish()
    x = size * solution.numpy()
    if error <= tolerance:
        kept = None if cycle.device.is_cuda else _cycle_inverse(system, cycle)
        return Solution(x, error, iterations, 0.0, solver=name, cycle=kept)
    weight = (abs(system.matrix.to_scipy()) @ np.abs(cg.x.numpy()).reshape(-1)).reshape(-1, 3)
    total = np.einsum("nij,nj->ni", np.abs(system.lower.numpy()), weight)
    floor = 64 * np.finfo(float).eps * float(np.linalg.norm(total))
    if error > floor:
        return Solution(x, error, iterations, floor, solver=name)
    launch(k.block_multiply, [system.inverse, rest, False, cycle.r]).launch()
    iterations += cg.run(CORRECTED * error, limit)
    launch(k.block_multiply, [system.inverse, cg.x, True, solution]).launch()
    change = size * _length(solution.numpy()) / (_length(x) or 1.0) if cg.reached else np.inf
    return Solution(x, error, iterations, floor, change=change, solver=name)


def rough_inverse(
    matrix: BlockMatrix,
    *,
    points: np.ndarray,
    fixed: np.ndarray,
    edges: np.ndarray | None,
    tolerance: float,
) -> Callable[[np.ndarray], np.ndarray]:
    """Solves A x = b (nodes, 3) by CG to a relative residual, or as far as it comes.

    It is made ready once for many b. ``matrix`` stays; the rest is as in ``solve_system``.
    """
    from . import kernels_krylov as k

    wp = start_warp()
    system = scale(BlockMatrix(matrix.rows, matrix.columns, wp.clone(matrix.values)))
    cycle, cg = _prepared(system, points, fixed, **_level_below(matrix, edges))
    launch = Recorder(matrix.nodes, cycle.device)

    def solve(b: np.ndarray) -> np.ndarray:
        size = _length(b) or 1.0
        load = wp.array(b / size, dtype=wp.vec3d, device=cycle.device)
        launch(k.block_multiply, [system.inverse, load, False, cycle.r]).launch()
        cg.run(tolerance, MAX_ITERATIONS)
        launch(k.block_multiply, [system.inverse, cg.x, True, load]).launch()
        return size * load.numpy()

    return solve


class Inverse(NamedTuple):
    """Product ``times`` with a matrix, and ``near`` its inverse; both of vectors (nodes, 3)."""

    times: Callable[[np.ndarray], np.ndarray]
    near: Callable[[np.ndarray], np.ndarray]


def _cycle_inverse(system: Scaled, cycle: TwoLevel) -> Inverse:
    """One V-cycle, and the matrix that ``system`` was made of, on the CPU."""
    from . import kernels_krylov as k

    wp, nodes, A = start_warp(), system.matrix.nodes, system.matrix
    launch = Recorder(nodes, cycle.device)
    x, y = (wp.zeros(nodes, dtype=wp.vec3d, device="cpu") for _ in range(2))
    into = launch(k.block_multiply, [system.inverse, x, False, cycle.r])
    out = launch(k.block_multiply, [system.inverse, cycle.z, True, y])
    scaled = launch(k.block_multiply, [system.lower, x, True, cycle.r])
    product = A.product(cycle.r, cycle.z)
    back = launch(k.block_multiply, [system.lower, cycle.z, False, y])

    def run(b: np.ndarray, *work: Callable[[], None]) -> np.ndarray:
        x.assign(b)
        for each in work:
            each()
        return y.numpy().copy()

    return Inverse(
        lambda b: run(b, scaled.launch, product.launch, back.launch),
        lambda b: run(b, into.launch, cycle.apply, out.launch),
    )


def rough_factor(
    matrix: BlockMatrix, *, points: np.ndarray, fixed: np.ndarray, edges: np.ndarray | None
) -> Inverse:
    """One V-cycle for a ``matrix``, which stays; the factor of a small one, or where it is known.

    The rest is as in ``solve_system``.
    """
    matrix = matrix.to("cpu")
    plan = planned_elimination(matrix, edges)
    factor = find_factor(matrix, plan)
    if factor is None and 3 * matrix.nodes <= DIRECT:
        factor = cached_factor(matrix, plan)
    if factor is not None:
        return Inverse(matrix.times, factor.solve)
    system = scale(BlockMatrix(matrix.rows, matrix.columns, start_warp().clone(matrix.values)))
    cycle = TwoLevel(system, points, fixed, **_level_below(matrix, edges))
    return _cycle_inverse(system, cycle)


# What solved the last system on a GPU, if any: graphs of launches on arrays that the next one of
# the same pattern can take.
_RECENT: list[tuple[Scaled, TwoLevel, ConjugateGradients]] = []


def cached_system(matrix: BlockMatrix) -> Scaled | None:
    """The last system of the pattern of ``matrix`` on a GPU, with its numbers; None: there is none.

    What is known of an older system in the same arrays is no longer true.
    """
    for system, *_ in _RECENT:
        if system.matrix.columns is matrix.columns:
            system.take(matrix)
            return system
    return None


def _prepared(
    system: Scaled, points: np.ndarray, fixed: np.ndarray, **below: Any
) -> tuple[TwoLevel, ConjugateGradients]:
    """Preconditioner and CG of a ``system``: those of its arrays where they fit it, or new ones."""
    for kept, cycle, cg in [*_RECENT]:
        if kept is system:
            if cycle.take(system, points, fixed):
                return cycle, cg
            _RECENT.clear()
    cycle = TwoLevel(system, points, fixed, **below)
    cg = ConjugateGradients(system.matrix, system.lower, cycle, cycle.r, cycle.z)
    if system.matrix.values.device.is_cuda:
        _RECENT[:] = [(system, cycle, cg)]
    return cycle, cg


# Unknowns up to which the preconditioner is a direct factor without anything being estimated.
REUSED_DIRECT = 4_000
# Degree of the smoother: inertia makes the matrix better than that of statics, and a lower degree
# costs less in all than the few iterations that it adds.
DEGREE = 2
# The preconditioner is made anew when CG takes so many more iterations than right after it was.
STALE = 4
# Iterations after which a system counts as not solvable: Newton then tries another Hessian.
LIMIT = 600
# Relative residuals of a linear system: never looser, so that Newton converges fast, nor tighter
# than fp64 allows.
LOOSEST, TIGHTEST = 1e-2, 1e-11


class FactorCycle:
    """Factor of a scaled matrix as the preconditioner z = M r, on the CPU."""

    def __init__(self, scaled: Scaled) -> None:
        wp = start_warp()
        matrix = scaled.matrix
        self.factor = CholeskyFactor(matrix, planned_elimination(matrix))
        self.r, self.z = (wp.zeros(matrix.nodes, dtype=wp.vec3d, device="cpu") for _ in range(2))

    def apply(self) -> None:
        """Compute ``z`` from ``r``."""
        self.z.numpy()[:] = self.factor.solve(self.r.numpy())


class RepeatedSolver:
    """Solves A x = b to the accuracy that Newton needs, keeping what is expensive.

    points: Node positions [m], shape (nodes, 3).
    fixed: Prescribed components, shape (nodes, 3).
    factors: Whether the preconditioner is a factor, as two levels were seen to take longer.
    """

    def __init__(self, points: np.ndarray, fixed: np.ndarray) -> None:
        self.points, self.fixed = points, fixed
        # What is expensive: scaling and preconditioner of a system, CG of the matrix of now
        self._kept: tuple[Scaled, ConjugateGradients] | None = None
        self._usual = 0
        self.factors = False

    def __call__(self, matrix: BlockMatrix, b: Any, goal: float) -> Any:
        """Return x with |b - A x| <= ``goal`` [N], within the limits; NaN if A is not positive.

        Both are arrays (nodes, 3), or vectors on the device of the matrix.
        """
        size = length(b)
        target = float(np.clip(0.3 * goal / max(size, 1e-300), TIGHTEST, LOOSEST) * size)
        if self._kept is not None:
            system, cg = self._kept
            if cg.matrix.columns is not matrix.columns:
                cg = _around(matrix, system, cg.preconditioner)
                self._kept = system, cg
            x, iterations = self._iterate(system, cg, matrix, b, target, self._usual + STALE)
            if x is not None:
                return x
            self._kept = None
            if iterations == 0:  # not positive: another preconditioner will not help
                return np.nan * b
        # Solve with a fresh preconditioner: two levels until they take as long as a factor
        worth = _factor_worth(matrix)
        self.factors |= worth == 0
        for limit in (LIMIT,) if self.factors else (min(worth, LIMIT), LIMIT):
            # Preconditioner of the matrix; none if it is seen not to be positive.
            copy = BlockMatrix(matrix.rows, matrix.columns, start_warp().clone(matrix.values))
            system, self._kept = scale(copy), None
            if np.isnan(system.largest):
                break
            try:
                two = None if self.factors else TwoLevel(system, self.points, self.fixed, DEGREE)
                cycle = two or FactorCycle(system)
            except NotPositive:
                break
            self._kept = system, _around(matrix, system, cycle)
            x, self._usual = self._iterate(*self._kept, matrix, b, target, limit)
            if x is not None:
                return x
            if self._usual == 0 or worth > LIMIT:
                break
            self.factors = True
        return np.nan * b

    @staticmethod
    def _iterate(
        system: Scaled,
        cg: ConjugateGradients,
        matrix: BlockMatrix,
        b: Any,
        target: float,
        limit: int,
    ) -> tuple[Any, int]:
        from . import kernels_krylov as k

        wp, r = start_warp(), cg.preconditioner.r
        launch = Recorder(matrix.nodes, r.device)
        wp.copy(cg.matrix.values, matrix.values)
        pattern = [matrix.rows, matrix.columns]
        launch(k.scale_blocks, [*pattern, system.inverse, cg.matrix.values]).launch()
        size = length(b) or 1.0  # the V-cycle may be in single precision, whose range is small
        if isinstance(b, DeviceVector):
            b.write(r, 1 / size)
        else:
            r.assign(b / size)
        launch(k.block_multiply, [system.inverse, r, False, r]).launch()
        cg.start(target / size, limit)
        x = wp.empty_like(cg.x)
        launch(k.block_multiply, [system.inverse, cg.x, True, x]).launch()
        iterations = cg.finish()
        if not cg.reached:
            return None, 0 if cg.indefinite else iterations
        solution = DeviceVector(x) if isinstance(b, DeviceVector) else x.numpy()
        return size * solution, iterations


def _factor_worth(matrix: BlockMatrix) -> int:
    """Iterations of the two levels that a factor is worth; above ``LIMIT`` where none is made.

    Steps of a body of good tets take some ten, slats of concrete took more than 600.
    """
    if matrix.values.device.is_cuda:  # a graph of a GPU could not call it
        return LIMIT + 1
    if 3 * matrix.nodes <= REUSED_DIRECT:
        return 0
    plan = planned_elimination(matrix)
    return min(iterations_worth(plan, matrix), LIMIT) if plan.entries <= MOST_ENTRIES else LIMIT + 1


def _around(matrix: BlockMatrix, system: Scaled, cycle: Any) -> ConjugateGradients:
    """CG with the preconditioner ``cycle`` of ``system`` for matrices of the pattern of ``matrix``.

    It has a matrix of its own, whose values are those of every new system in turn.
    """
    current = BlockMatrix(matrix.rows, matrix.columns, start_warp().empty_like(matrix.values))
    return ConjugateGradients(current, system.lower, cycle, cycle.r, cycle.z)
