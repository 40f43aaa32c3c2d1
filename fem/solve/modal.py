"""Natural frequencies and shapes of a body, free or held; the load that buckles it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..device import Recorder, checked_device, single_threaded, start_warp
from ..elements.assembly import (
    BlockMatrix,
    add_blocks,
    add_diagonal,
    apply_supports,
    discretise,
    node_supports,
)
from ..elements.elastic import (
    ElasticBody,
    constrained_stiffness,
    displacement_gradients,
    linear_stress,
)
from ..elements.forces import FollowingLoads, consistent_mass, diagonal_mass, lumped_mass
from ..elements.space import Space, affordable_order, element_points, extend_linear
from ..errors import ConvergenceError, InputError, UsageError
from ..laws.law import Law
from ..linalg.cholesky import NotPositive, cached_factor, find_factor, planned_elimination
from ..linalg.krylov import RitzPairs, lanczos
from ..linalg.multigrid import TwoLevel, scale
from ..linalg.solver import MOST_ENTRIES, PIVOT, Inverse, rough_factor, rough_inverse
from ..mesh import TetMesh, free_motions, material_of, rigid_motions
from ..note import Note
from ..scene.loads import Traction
from ..scene.scene import Scene
from ..scene.supports import Supports
from ..validation import checked_count
from .mesh_error import estimate_factor_error, estimate_frequency_error
from .method import FrameProgress
from .result import LoadFactor, Modes, StaticResult

# Relative residual of a mode: its frequency is then good to the square of it.
TOLERANCE = 1e-3
MAX_ITERATIONS = 200
# Lanczos stops when the error of every mode in mass is this share of it; blocks are this wide and
# at most so many: one run through the factor costs little more for a few vectors than for one.
CONVERGED = 1e-6
# A load that changes the squares of frequencies by more than this share is told of.
NOTICED = 1e-2
# Up to this share others do not come before them: they follow by so many corrections at most, to
# this residual; else they are found anew.
FOLLOWED, CORRECTIONS, SETTLED = 0.1, 4, TOLERANCE / 3
WIDEST, MOST_BLOCKS = 8, 60
# The shift of a body that can move freely: a share of the square of its slowest wave's frequency.
SHIFT = 0.05
# A share of a free motion below this is round-off of the others.
FREE = 1e-5
# Operations of a factorisation that takes a few seconds.
QUICK = 5e10


class Vibrations(NamedTuple):
    """A generalised eigenproblem K x = w^2 M x on the nodes that are ``free`` (nodes, 3).

    ``held`` are its supports on the nodes, ``mass`` is M of one component [kg], ``slow`` the square
    of a low frequency [1/s^2], ``motions`` (nodes, 3, k) what meets no resistance; ``rest`` about
    which it vibrates, and the loads on its faces there.
    """

    mesh: TetMesh
    body: ElasticBody
    held: Supports
    free: np.ndarray
    mass: Any
    slow: float
    motions: np.ndarray
    rest: StaticResult | None = None
    tractions: Sequence[Traction] = ()

    def stiffness(self, shift: float = 0.0) -> BlockMatrix:
        """K + shift M [N/m], held; M in its own blocks. At ``rest`` what its stress adds to K."""
        grid, rest, springs = self.body.grid, self.rest, None
        if rest is None or rest.law == Law.LINEAR:
            matrix = constrained_stiffness(self.body, self.held)
            if rest is None and not shift:
                return matrix
            matrix = BlockMatrix(matrix.rows, matrix.columns, start_warp().clone(matrix.values))
        else:
            matrix, springs = rest.body.tangent(rest.node_displacement), self.held.springs
        values = matrix.values.numpy()
        values += shift * self.mass.data[:, None, None] * np.eye(3)
        if rest is not None and rest.law == Law.LINEAR:
            values += rest.stressed.values.numpy()
        matrix.values.assign(values)
        if rest is not None:
            lies = rest.node_displacement * (rest.law != Law.LINEAR)
            following = FollowingLoads(self.mesh, grid.space, self.tractions, self.held.fixed)
            add_blocks(matrix, *following.stiffness(lies))
        apply_supports(matrix, self.held.fixed, springs)
        return matrix

    def weigh(self, x: np.ndarray) -> np.ndarray:
        """M x on the free unknowns, shape (3 nodes, vectors)."""
        out = (self.mass @ x.reshape(len(self.free), -1)).reshape(x.shape)
        out *= self.free.reshape(-1, 1)
        return out


@single_threaded
def natural_modes(
    mesh: TetMesh,
    count: int = 6,
    *,
    supports: Supports | None = None,
    order: int = 2,
    lumped: bool = False,
    device: str = "cpu",
    rest: StaticResult | None = None,
    tractions: Sequence[Traction] = (),
) -> Modes:
    """Slowest natural vibrations of ``mesh``, free in space without ``supports``.

    What meets no resistance (six motions of every free piece, hinges) is no vibration.

    Parameters
    ----------
    mesh
        Tets [m] with E [Pa], nu [1] and rho [kg/m^3].
    count
        How many vibrations.
    supports
        What holds the body; None: nothing does.
    order
        1: linear tets, 2: quadratic tets.
    lumped
        Whether the mass is the lumped one of motions, not the consistent one.
    device
        'cpu' or 'cuda'.
    rest, tractions
        Rest of the same mesh, elements, device and supports about which it vibrates, and its loads
        on faces [Pa]: stress and pressures change the stiffness.

    Returns
    -------
    Modes
        Frequencies [Hz], shape (count,), and shapes (count, nodes, 3).

    Raises
    ------
    InputError
        If the space has too few unknowns for so many modes.
    ConvergenceError
        If the eigensolver does not reach its tolerance, or the ``rest`` is not stable.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, box_mesh, natural_modes
    >>> box = box_mesh((1, 1, 1), (1, 1, 1))
    >>> made = (ElementMaterial.uniform(6, E=E, nu=0.3, rho=1e3) for E in (1e6, 4e6))
    >>> soft, stiff = (natural_modes(box.with_material(one), 1).frequencies[0] for one in made)
    >>> round(float(stiff / soft), 6)  # four times as stiff: twice as fast
    2.0
    """
    checked_count("modes", count)
    if rest is None:
        grid = discretise(mesh, order, checked_device(device))
        body = ElasticBody(grid, material_of(mesh), Law.LINEAR)
    elif rest.order != order:
        raise InputError("modal.rest_of_order", order=rest.order, wanted=order)
    else:
        body, grid = rest.body, rest.body.grid
    space = grid.space
    held = node_supports(supports or Supports.none(len(mesh.points)), space)
    used = np.ones(len(space.nodes), dtype=bool)
    used[space.unused] = False
    free = ~held.fixed & used[:, None]
    stopped = (held.fixed | (held.springs > 0))[: space.points]
    try:
        motions = free_motions(mesh, stopped).motions
    except InputError:  # too many pieces: what the whole can do
        whole = rigid_motions(mesh.points - mesh.points.mean(axis=0))
        motions = whole[..., : 0 if stopped.any() else 6]
    mass = (diagonal_mass if lumped else consistent_mass)(mesh, grid)
    speed2 = float((body.material.lame.mu / body.material.rho).min())
    problem = Vibrations(
        mesh,
        body,
        held,
        free,
        mass,
        (speed2 / float((np.ptp(mesh.bounds, axis=0) ** 2).sum())),
        extend_linear(space, motions),
    )
    unknowns, rigid = int(problem.free.sum()), problem.motions.shape[2]
    if count + rigid >= unknowns // 2:
        raise InputError("modal.modes_body", count=count, unknowns=unknowns)
    matrix = problem.stiffness()
    plan = planned_elimination(matrix, space.edges)
    solve = _factored if plan.entries <= MOST_ENTRIES else _lobpcg
    square, x = solve(problem, matrix, count)
    noticed = False
    if rest is not None:
        # What the load changes of the slowest vibrations, among themselves and what they lack
        problem = problem._replace(rest=rest, tractions=tractions)
        loaded, matrix = problem.stiffness().to("cpu"), matrix.to("cpu")
        noticed, square, x = _loaded(problem, matrix, loaded, square, x)
        if x is None:
            square, x = solve(problem, loaded, count)
        matrix = loaded
        if not square[0] > 0:
            raise ConvergenceError("modal.not_stable")
    weighed = problem.weigh(x)
    wrong = matrix.to("cpu").to_scipy() @ x - weighed * square
    size = np.linalg.norm(weighed * np.maximum(square, problem.slow), axis=0)
    residual = float((np.linalg.norm(wrong, axis=0) / size).max())
    if not residual < TOLERANCE:
        raise ConvergenceError("modal.modes_residual", residual=residual, tolerance=TOLERANCE)
    shapes = np.ascontiguousarray(x.T).reshape(count, -1, 3)
    frequencies, holds = np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi), bool(stopped.any())
    free_names = _named(mesh, motions)
    return Modes(frequencies, shapes, residual, order, noticed, free_names, holds)


def _named(mesh: TetMesh, motions: np.ndarray) -> tuple[str, ...]:
    """Names of free ``motions`` (points, 3, k): turns about axes, ways along them, then all else.

    A turn may be about any axis of that direction. What pieces do against each other has no name.
    """
    used, count = np.unique(mesh.tets), motions.shape[2]
    if not count:
        return ()
    size = float(np.ptp(mesh.bounds, axis=0).max())
    whole = rigid_motions((mesh.points[used] - mesh.bounds.mean(axis=0)) / size)
    whole = whole[:, :, [3, 4, 5, 0, 1, 2]].reshape(-1, 6)  # turns first: ways in them are left out
    basis = np.linalg.qr(motions[used].reshape(-1, count))[0]
    stopped = np.linalg.qr(whole - basis @ (basis.T @ whole), mode="r")
    *_, size_of, right = np.linalg.svd(stopped)
    rows, names = right[size_of < FREE * np.sqrt(len(whole))], []
    for column in range(6):  # to echelon form: a row a motion, with as few parts as can be
        here = len(names)
        if here == len(rows) or not abs(rows[here:, column]).max() > FREE:
            continue
        pivot = here + int(abs(rows[here:, column]).argmax())
        rows[[here, pivot]] = rows[[pivot, here]]
        rows[here] /= rows[here, column]
        others = np.arange(len(rows)) != here
        rows[others] -= np.outer(rows[others, column], rows[here])
        names.append(column)
    words = []
    for row, column in zip(rows, names, strict=True):
        kind, part = ("about", row[:3]) if column < 3 else ("along", row[3:])
        axes = [axis for axis, share in zip("xyz", part, strict=True) if abs(share) > FREE]
        slanted = f"({', '.join(f'{x:.2g}' for x in part)})"
        words.append(f"{kind} {axes[0] if len(axes) == 1 else slanted}")
    return (*words, *[Note("modal.pieces")] * (count - len(words)))


class ModalMethod:
    """Natural vibrations of a body as it is held, without loads."""

    laws: tuple[str, ...] = (Law.LINEAR,)

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> Modes:
        """First ``scene.modes`` vibrations; see ``natural_modes`` for what may fail.

        Raises UsageError: Under a law that is not linear: they are small.
        """
        if law not in (None, *self.laws):
            raise UsageError("modal.small_vibrations", law=law)
        order = order or (2 if factor_fits(scene.mesh) else 1)
        options: dict[str, Any] = {"supports": scene.held, "order": order, "device": device}
        modes = natural_modes(scene.mesh, scene.modes, **options)
        if order == 1:
            return modes
        grid = discretise(scene.mesh, 2)
        held = node_supports(scene.held, grid.space)
        body = ElasticBody(grid, material_of(scene.mesh), Law.LINEAR)
        matrix = constrained_stiffness(body, held)
        raised = BlockMatrix(matrix.rows, matrix.columns, start_warp().clone(matrix.values))
        square = float((2 * np.pi * modes.frequencies[0]) ** 2)
        mass = lumped_mass(scene.mesh, grid.space)
        add_diagonal(raised, SHIFT * square * mass[:, None] * ~held.fixed)
        known = {"points": grid.space.nodes, "fixed": held.fixed, "edges": grid.space.edges}
        stiffness = Inverse(matrix.times, rough_factor(raised, **known).near)
        error = estimate_frequency_error(scene.mesh, grid.space, held, stiffness, modes)
        return replace(modes, error=error)


METHOD = ModalMethod()


def factor_fits(mesh: TetMesh, *, order: int = 2, most: float = np.inf) -> bool:
    """Whether a factor of such elements fits the memory, in at most so many operations."""
    if affordable_order(mesh) < order:
        return False
    grid = discretise(mesh, order)
    plan = planned_elimination(grid.pattern, grid.space.edges)
    return plan.entries <= MOST_ENTRIES and plan.operations <= most


def _factored(
    problem: Vibrations, matrix: BlockMatrix, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Lowest squares of frequencies [1/s^2], and shapes (3 nodes, count), by a factor."""
    rigid, shift, factor = problem.motions.shape[2], 0.0, None
    plan = planned_elimination(matrix, problem.body.grid.space.edges)
    if not rigid:  # statics may have made the factor
        try:
            factor = cached_factor(matrix.to("cpu"), plan)
        except NotPositive:
            pass
    if factor is None or not factor.smallest_pivot > PIVOT:  # K is singular
        shift = SHIFT * problem.slow
        if problem.rest is not None and not rigid:
            raise ConvergenceError("modal.not_stable")
        factor = cached_factor(problem.stiffness(shift).to("cpu"), plan)

    def inverse(x: np.ndarray) -> np.ndarray:
        return factor.solve(x.reshape(len(problem.free), 3, -1)).reshape(x.shape)

    def enough(pairs: RitzPairs) -> bool:
        total = rigid + count
        error = pairs.errors[:total] / np.abs(pairs.values[:total])
        return len(error) == total and bool(error.max() < CONVERGED)

    width = min(count + 3, WIDEST)
    start = np.random.default_rng(0).normal(size=(problem.free.size, width))
    start *= problem.free.reshape(-1, 1)
    pairs = lanczos(inverse, problem.weigh, start, enough=enough, steps=MOST_BLOCKS)
    square = 1 / pairs.values[: rigid + count] - shift
    return square[rigid:], pairs.vectors(rigid + count)[:, rigid:]


def _loaded(
    problem: Vibrations,
    unloaded: BlockMatrix,
    matrix: BlockMatrix,
    square: np.ndarray,
    x: np.ndarray,
) -> tuple[bool, np.ndarray, np.ndarray | None]:
    """Whether a load changes vibrations by more than ``NOTICED``, and which they are under it.

    ``square`` and ``x`` (3 nodes, count) are those of the ``unloaded`` stiffness. Their residual
    under the loaded ``matrix``, through the factor of the unloaded one, is what they lack: the
    lowest in the span of both are taken. Without a factor, or where that is not enough: None.
    """
    from scipy.linalg import eigh

    count, K = x.shape[1], matrix.to_scipy()
    pushed, root = K @ x, np.sqrt(np.outer(square, square))
    change = float(np.abs((x.T @ pushed - np.diag(square)) / root).max())
    factor = find_factor(unloaded, planned_elimination(unloaded, problem.body.grid.space.edges))
    for _ in range(CORRECTIONS if change < FOLLOWED else 0):
        weighed = problem.weigh(x)
        square, along = (part[..., :count] for part in eigh(x.T @ pushed, x.T @ weighed))
        x, weighed = x @ along, weighed @ along * square
        wrong = pushed @ along - weighed
        if (np.linalg.norm(wrong, axis=0) / np.linalg.norm(weighed, axis=0)).max() < SETTLED:
            return change > NOTICED, square, x
        if factor is None:
            break
        lacks = factor.solve(wrong.reshape(len(problem.free), 3, -1)).reshape(x.shape)
        x = np.linalg.qr(np.column_stack([x, lacks]))[0]
        pushed = K @ x
    return change > NOTICED, square, None


def _lobpcg(problem: Vibrations, matrix: BlockMatrix, count: int) -> tuple[np.ndarray, np.ndarray]:
    """As ``_factored``, by iterating on a block of vectors with one V-cycle.

    The cycle is that of K raised by the mass, on the free unknowns.
    """
    from scipy.sparse import kron
    from scipy.sparse.linalg import LinearOperator, lobpcg

    from ..linalg import kernels_krylov as k

    free = problem.free.reshape(-1)
    K = matrix.to("cpu").to_scipy().tocsr()[free][:, free]
    M = kron(problem.mass, np.eye(3), format="csr")[free][:, free]
    motions = problem.motions.reshape(free.size, -1)[free]
    start = np.random.default_rng(0).normal(size=(K.shape[0], count + 4))
    system = scale(problem.stiffness(problem.slow))
    cycle = TwoLevel(system, problem.body.grid.space.nodes, problem.held.fixed)
    r, z = cycle.r, cycle.z
    launch = Recorder(system.matrix.nodes, r.device)
    scaled = launch(k.block_multiply, [system.inverse, r, False, r])
    unscaled = launch(k.block_multiply, [system.inverse, z, True, z])

    def apply(vector: np.ndarray) -> np.ndarray:
        full = np.zeros(free.size)
        full[free] = vector.reshape(-1)
        r.assign(full.reshape(-1, 3))
        scaled.launch()
        cycle.apply()
        unscaled.launch()
        return z.numpy().reshape(-1)[free].copy()

    inverse = LinearOperator(K.shape, matvec=apply, dtype=float)  # type: ignore
    options = {"B": M, "M": inverse, "largest": False, "tol": None}
    if motions.shape[1]:
        options["Y"] = np.linalg.qr(motions)[0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # it warns of residuals: ours are checked
        square, modes = lobpcg(K, start, maxiter=MAX_ITERATIONS, **options)
    order = np.argsort(square)[:count]
    x = np.zeros((free.size, count))
    x[free] = modes[:, order]
    return square[order], x


# Operations of a factor above which it is not made for this alone: half a minute of a core.
MOST_OPERATIONS = 1e12


class ConstrainedInverse(NamedTuple):
    """``stiffness`` [N/m] with supports, and what ``solve`` finds for forces (nodes, 3) [N].

    Those must be zero where it is held. A ``direct`` one is by a factor, and its solves are cheap.
    """

    stiffness: BlockMatrix
    solve: Callable[[np.ndarray], np.ndarray]
    direct: bool = True


def constrained_inverse(
    stiffness: BlockMatrix, space: Space, held: Supports, *, rough: float = 0.0
) -> ConstrainedInverse | None:
    """Inverse of a ``stiffness`` with the supports ``held`` (of nodes of ``space``), on the CPU.

    Where no factor is affordable by CG to the relative residual ``rough``; None if that is zero.
    """
    matrix = stiffness.to("cpu")
    plan = planned_elimination(matrix, space.edges)
    if plan.entries <= MOST_ENTRIES:
        if plan.operations <= MOST_OPERATIONS:
            return ConstrainedInverse(matrix, cached_factor(matrix, plan).solve)
        if (factor := find_factor(matrix, plan)) is not None:
            return ConstrainedInverse(matrix, factor.solve)
    if not rough:
        return None
    known = {"points": space.nodes, "fixed": held.fixed, "edges": space.edges}
    return ConstrainedInverse(matrix, rough_inverse(matrix, tolerance=rough, **known), direct=False)


# Relative accuracy of a load factor up to the second, far below that of the elements; that of a
# larger one is less as it grows, for it is told to be far.
FACTOR_TOLERANCE, NEAR = 1e-4, 10.0
# Most steps of Lanczos, and the least before it says that there is nothing to find.
STEPS, LEAST = 80, 10
# Where no factor is affordable CG solves to this relative residual, while there are so many tets: a
# minute of a core for a compact body, which wants the least number of steps.
ROUGH, MOST_TETS = 1e-7, 150_000
# What the mesh leaves of a larger factor is not estimated: it is told to be far, and is.
FAR = 30.0
# A load factor beyond this is as good as infinite, and its own eigenvalue is in a crowd.
LARGEST = 1000.0


@single_threaded
def find_load_factor(
    result: StaticResult, supports: Supports, *, traction: Sequence[Traction] = ()
) -> LoadFactor:
    """Smallest multiple of all that acts at which the body of a linear ``result`` buckles.

    What acts are loads and prescribed displacements, which grow together.

    The lowest eigenvalue above zero of (K + factor K_sigma) x = 0, with the geometric stiffness
    K_sigma of the stress of ``result`` (Bathe, Finite Element Procedures, section 6.8.2; and
    ``result.stressed``). ``supports`` are those of the result; pressures in ``traction`` follow
    their faces, which K_sigma has beside the stress. Beyond ``LARGEST`` the factor is infinite.

    Raises InputError: Where the result is not linear.
    Raises ConvergenceError: If the mesh is too large for it, or the eigensolver does not reach its
        tolerance.
    """
    if result.law != Law.LINEAR:
        raise InputError("buckling.load_factor_under", law=result.law, value=Law.LINEAR.value)
    body, grid, u = result.body, result.body.grid, result.node_displacement
    held, points = node_supports(supports, grid.space), element_points(grid.space.order)
    affordable = len(result.mesh.tets) <= MOST_TETS
    matrix = constrained_stiffness(body, held)
    inverse = constrained_inverse(matrix, grid.space, held, rough=ROUGH if affordable else 0.0)
    if inverse is None:
        raise ConvergenceError("buckling.tets_shape", count=len(result.mesh.tets))
    free = ~held.fixed
    free[grid.space.unused] = False
    start = np.where(free, np.random.default_rng(0).normal(size=free.shape), 0.0)
    following = FollowingLoads(result.mesh, grid.space, traction, held.fixed)
    i, j, turning = following.stiffness(np.zeros_like(start))

    def push(x: np.ndarray) -> np.ndarray:
        """Force [N] that all that acts makes of a displacement ``x`` [m]."""
        force = -result.stressed.times(x)
        np.subtract.at(force, i, np.einsum("nij,nj->ni", turning, x[j]))
        return np.where(free, force, 0.0)

    eigenvalue, shape = _largest_eigenvalue(inverse, push, start)
    if not eigenvalue > 0:
        return LoadFactor(np.inf, np.zeros_like(result.displacement))
    factor, error = 1 / eigenvalue, np.nan
    if grid.space.order == 2 and inverse.direct and factor < FAR:
        stiffness = Inverse(matrix.times, inverse.solve)
        turned, strained = (displacement_gradients(grid, v, points) for v in (shape, u))
        pull = factor * (turned @ linear_stress(strained, body.material))
        error = estimate_factor_error(result.mesh, grid.space, held, stiffness, shape, pull)
    shape = shape[: grid.space.points]
    return LoadFactor(factor, shape / (np.linalg.norm(shape, axis=1).max() or 1.0), error)


def _largest_eigenvalue(
    K: ConstrainedInverse, push: Callable[[np.ndarray], np.ndarray], start: np.ndarray
) -> tuple[float, np.ndarray]:
    """Largest eigenvalue of push(x) = value K x, and its x (nodes, 3); zero if hardly any.

    By Lanczos in the inner product of K, every vector made orthogonal to all before it.
    """
    v = K.solve(start)
    basis, images = np.zeros((2, STEPS, *v.shape))  # of every vector v, and K v
    along, across = np.zeros(STEPS), np.zeros(STEPS)
    image = K.stiffness.times(v)
    for step in range(STEPS):
        across[step] = np.sqrt(max(float((v * image).sum()), 0.0))
        if across[step] == 0:  # nothing is free, or nothing is stressed
            return 0.0, v
        basis[step], images[step] = v / across[step], image / across[step]
        pushed = push(basis[step])
        along[step] = (basis[step] * pushed).sum()
        v = K.solve(pushed)
        for _ in range(2):  # once leaves what round-off brought back
            known = np.tensordot(images[: step + 1], v, axes=([1, 2], [0, 1]))
            v = v - np.tensordot(known, basis[: step + 1], axes=1)
        image = K.stiffness.times(v)
        rest = np.sqrt(max(float((v * image).sum()), 0.0))
        T = np.diag(along[: step + 1]) + np.diag(across[1 : step + 1], 1)
        value, mode = np.linalg.eigh(T + np.triu(T, 1).T)
        error = rest * abs(mode[-1, -1])
        if value[-1] + error < 1 / LARGEST and step + 1 >= LEAST:
            return 0.0, v
        if error <= FACTOR_TOLERANCE * max(value[-1], 1 / NEAR):
            return float(value[-1]), np.tensordot(mode[:, -1], basis[: step + 1], axes=1)
    raise ConvergenceError("buckling.load_factor", steps=STEPS, value=1 / value[-1])
