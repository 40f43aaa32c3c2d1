"""Static equilibrium under large deformation: the minimum of an energy.

By Newton's method with backtracking, and by dynamic relaxation.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ..device import single_threaded
from ..elements.assembly import BlockMatrix, add_diagonal, apply_supports
from ..elements.elastic import ElasticBody, displacement_gradients
from ..elements.forces import FollowingLoads, lumped_mass
from ..elements.space import EDGES, element_points
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.krylov import inner_product, length
from ..linalg.solver import solve_system
from ..mesh import TetMesh, material_of
from ..scene.loads import Traction
from ..scene.obstacles import Obstacle
from ..scene.supports import Supports
from .contact import Contact
from .path import Path
from .result import StaticResult
from .statics import check_held, discrete_problem, static_result

logger = logging.getLogger(__name__)

MAX_ITERATIONS = 100
# The step is halved until the energy falls by this fraction of the slope (Armijo).
SUFFICIENT = 1e-4
HALVINGS = 30
# An energy is known to this fraction of its terms: below it, a step is judged by its residual.
ENERGY_NOISE = 1e-12
# Steps of dynamic relaxation.
RELAXATIONS = 400
# A step that went all its way is followed by one of so many times its time; one that the tangent
# forbids is tried again in a shorter one.
LONGER, SHORTER = 2.0, 0.5
# A step cut below this share was too long, though its direction was right.
CUT = 0.3


class Point(NamedTuple):
    """What an objective is at a place.

    ``energy`` [J], infinite where the place is not allowed; ``gradient`` [N] (nodes, 3), zero at
    prescribed components; ``scale``, the size of the forces [N] that the gradient is a balance of.
    """

    energy: float
    gradient: Any
    scale: float

    @property
    def residual(self) -> float:
        """Size of the unbalanced force [N]."""
        return length(self.gradient)


@runtime_checkable
class Objective(Protocol):
    """An energy of nodal displacements (nodes, 3), or of other coordinates.

    Both are arrays, or a ``DeviceVector`` that never leaves its device.
    Its Hessian is of the kind that the linear solver takes.
    """

    def evaluate(self, u: Any, /) -> Point:
        """Energy, gradient and scale."""
        ...

    def hessian(self, u: Any, /, *, projected: bool) -> Any:
        """Hessian [N/m] with prescribed rows dropped; ``projected``: positive semi-definite."""
        ...

    def longest_step(self, u: Any, step: Any, /) -> float:
        """Largest share of ``step`` that stays allowed."""
        ...


# Solves H step = b so that |b - H step| is well below the goal [N] of Newton.
LinearSolve = Callable[[Any, Any, float], Any]


class Minimum(NamedTuple):
    """Where Newton ended: ``u`` (nodes, 3) [m], ``residual`` |gradient| [N], ``iterations``."""

    u: Any
    residual: float
    iterations: int


def minimise(
    objective: Objective,
    u: Any,
    *,
    solve: LinearSolve,
    tolerance: float,
    limit: int = MAX_ITERATIONS,
) -> Minimum:
    """Minimise ``objective`` from ``u`` until |gradient| <= ``tolerance`` times its scale.

    The exact Hessian is used where it gives a descent direction, the projected one elsewhere.
    """
    here = objective.evaluate(u)
    projected = False
    for iteration in range(limit):
        size, goal = here.residual, tolerance * here.scale
        if size <= goal:
            return Minimum(u, size, iteration)
        step = solve(objective.hessian(u, projected=projected), -here.gradient, goal)
        moved = backtrack(objective, u, step, here)
        if moved is not None:
            (u, here), projected = moved, False
            logger.debug("Newton %d: residual %.3e N", iteration, size)
        elif projected:
            raise ConvergenceError("nonlinear.newtons_line", size=size)
        else:
            projected = True
    raise ConvergenceError(
        "nonlinear.newton_ended",
        residual=here.residual,
        limit=limit,
        tolerance=tolerance * here.scale,
    )


def backtrack(objective: Objective, u: Any, step: Any, here: Point) -> tuple[Any, Point] | None:
    """First of the halved ``step`` that lowers the energy; none if it does not descend."""
    slope = inner_product(here.gradient, step)  # no number where the step has one that is none
    if not (np.isfinite(slope) and slope < 0):
        return None
    fraction = min(1.0, objective.longest_step(u, step))
    # A quadratic energy does not show a step below the root of round-off: its residual does
    unseen = inner_product(step, step) <= np.finfo(float).eps * inner_product(u, u)
    for _ in range(HALVINGS):
        trial = u + fraction * step
        there = objective.evaluate(trial)
        change = there.energy - here.energy
        unclear = unseen or abs(change) <= ENERGY_NOISE * max(abs(here.energy), -slope)
        if change <= SUFFICIENT * fraction * slope or (unclear and there.residual < here.residual):
            return trial, there
        fraction /= 2
    return None


def relax(
    objective: Objective,
    u: Float[np.ndarray, "nodes 3"],
    *,
    mass: Float[np.ndarray, "nodes"],
    fixed: np.ndarray,
    dt: float,
    solve: LinearSolve,
    tolerance: float,
) -> Minimum:
    """Minimise ``objective`` from ``u`` [m] by dynamic relaxation of ``mass`` [kg].

    Each is one Newton step of (H + M / dt^2) x = -g, first in ``dt`` [s], in longer ones as it goes
    well: the energy only falls, so that a body that buckles comes to lie where it can
    (pseudo-transient continuation, Kelley & Keyes 1998). ``fixed`` (nodes, 3) stay.

    Raises ConvergenceError: If it does not come to rest.
    """
    here = objective.evaluate(u)
    for step in range(RELAXATIONS):
        goal = tolerance * here.scale
        if here.residual <= goal:
            return Minimum(u, here.residual, step)
        matrix = objective.hessian(u, projected=False)
        add_diagonal(matrix, (mass / dt**2)[:, None, None] * np.eye(3))
        apply_supports(matrix, fixed)
        move = solve(matrix, -here.gradient, goal)
        moved = backtrack(objective, u, move, here)
        if moved is None:
            dt *= SHORTER
            continue
        fraction = float(np.linalg.norm(moved[0] - u) / (np.linalg.norm(move) or 1.0))
        u, here = moved
        dt *= SHORTER if fraction < CUT else LONGER if fraction > 1 - CUT else 1.0
        logger.debug("relaxation %d: dt %.2g s, residual %.3g N", step, dt, here.residual)
    raise ConvergenceError(
        "nonlinear.come_rest", relaxations=RELAXATIONS, residual=here.residual / here.scale
    )


# Relative residual of the equilibrium |internal - external| / |external|.
TOLERANCE = 1e-8
# Newton's linear systems are solved this well: far beyond what its convergence needs.
LINEAR_TOLERANCE = 1e-5
# First step of the relaxation, as a fraction of the time of a fall across the body.
FALL_SHARE = 0.05
# A body that buckles is pushed along its softest way by this share of the forces in play until it
# has bent: a straight column has no other reason to.
PUSHED = 1e-3
# Pressures that follow are frozen while it relaxes, so often.
FROZEN = 3


class Potential:
    """Total potential of a held elastic body: W(u) - f . u + springs + barrier of obstacles.

    ``scale`` is the size of the forces in play [N].
    """

    def __init__(
        self,
        body: ElasticBody,
        load: np.ndarray,
        held: Supports,
        scale: float,
        contact: Contact | None = None,
    ) -> None:
        self.body, self.load, self.held, self.scale = body, load, held, scale
        self.contact = contact

    def evaluate(self, u: np.ndarray) -> Point:
        """Energy, infinite on contact; gradient (zero at prescribed components) and scale."""
        barrier, push = 0.0, 0.0
        if self.contact:
            barrier = self.contact.value(u)
            if not np.isfinite(barrier):
                return Point(np.inf, np.full_like(u, np.inf), self.scale)
            push = -self.contact.forces(u, len(u))
        held, elastic = self.held, self.body.response(u)
        springs = held.springs * u
        energy = elastic.energy + 0.5 * float((springs * u).sum()) - float((self.load * u).sum())
        gradient = np.where(held.fixed, 0.0, elastic.force + springs + push - self.load)
        return Point(energy + barrier, gradient, self.scale)

    def hessian(self, u: np.ndarray, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        matrix = self.body.tangent(u, projected=projected)
        if self.contact:
            matrix = self.contact.with_hessian(u, matrix)
        apply_supports(matrix, self.held.fixed, self.held.springs)
        return matrix

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """Share of ``step`` that keeps the body out of the obstacles."""
        return self.contact.longest_step(u, step) if self.contact else np.inf


@single_threaded
def solve_nonlinear(
    mesh: TetMesh,
    supports: Supports,
    *,
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    body=None,
    traction=(),
    forces: np.ndarray | None = None,
    law: str = Law.NEO_HOOKEAN,
    order: int | None = None,
    device: str = "cpu",
    tolerance: float = TOLERANCE,
    start: np.ndarray | None = None,
    iterations: int = MAX_ITERATIONS,
    obstacles: Sequence[Obstacle] = (),
    relaxation: bool = True,
) -> StaticResult:
    """Find the equilibrium of ``mesh`` by Newton's method, as its load grows.

    The path of stable rests is followed from no load on; where it ends, because the body snaps or
    buckles, and where there are obstacles, dynamic relaxation goes on. Pressures and torques turn
    with their faces.

    Parameters
    ----------
    mesh, supports, gravity_vector, body, traction, forces, order, device, tolerance
        As in ``solve_static``: metres, m/s^2, N/m^3, Pa and N.
    law
        Name of the elastic law in ``LAWS``.
    start
        First guess of the displacement [m], shape (nodes, 3): Newton's method goes on from there.
    iterations
        Most steps of Newton from such a guess.
    obstacles
        Rigid obstacles, which push without friction and stand still.
    relaxation
        Whether dynamic relaxation goes on where the path ends or Newton stops.

    Returns
    -------
    StaticResult
        Displacement [m], reactions [N]; ``strain`` is Green's [1], ``stress`` Cauchy's [Pa].

    Raises
    ------
    ConvergenceError
        If the body is not held, no rest was found, or a tet would be inside out.
    InputError
        If the body starts inside an obstacle.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, solve_nonlinear
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> sleeve = Supports.none(8).with_fixed(slice(None), (0, 1))  # its sides stay where they are
    >>> pulled = sleeve.with_fixed(block.points[:, 2] == 0, 2)
    >>> pulled = pulled.with_fixed(block.points[:, 2] == 1, 2, 0.5)
    >>> rest = solve_nonlinear(block, pulled, order=1)
    >>> round(float(rest.reaction[block.points[:, 2] == 1, 2].sum()), 3)  # N: (lam + 2 mu) e
    500000.0
    """
    loads = {"gravity_vector": gravity_vector, "body": body, "traction": traction, "forces": forces}
    grid, held, load = discrete_problem(mesh, supports, order=order, device=device, **loads)
    check_held(mesh, held)
    elastic = ElasticBody(grid, material_of(mesh), law)
    nodes = grid.space.nodes
    tractions = [traction] if isinstance(traction, Traction) else traction
    following = FollowingLoads(mesh, grid.space, tractions, held.fixed)

    def linear(matrix: BlockMatrix, b: np.ndarray, goal: float) -> np.ndarray:
        held_at = {"points": nodes, "fixed": held.fixed, "edges": grid.space.edges}
        return solve_system(matrix, b, tolerance=LINEAR_TOLERANCE, **held_at).x

    u = np.zeros_like(load) if start is None else start.copy()
    u[held.fixed] = held.values[held.fixed]
    contact = Contact(mesh, grid.space, obstacles, friction=0.0) if obstacles else None
    if contact and not contact.gap(u) > 0:
        raise InputError("nonlinear.body_starts", gap=-contact.gap(u))
    # The load, or what the prescribed motion makes.
    scale = float(max(np.linalg.norm(load), np.linalg.norm(elastic.response(u).force))) or 1.0
    potential = Potential(elastic, load, held, scale, contact)
    options = {"solve": linear, "tolerance": tolerance}
    path, minimum = None, None
    if start is None and contact is None:
        follow = partial(Path, elastic, mesh, held, following=following, tolerance=tolerance)
        path = follow(load, scale=scale)
        path.follow()
        if path.end < 1 and not relaxation:
            raise ConvergenceError("nonlinear.path_ends", end=path.end)
        u, rests = path.rests[-1].u, path.rests[-1].fraction >= 1
        if not rests and not path.turns:  # it buckles: a little pushed, it bends that way
            bent = follow(load + PUSHED * scale * path.softest(), scale=scale)
            bent.follow()
            u, path.iterations = bent.rests[-1].u, path.iterations + bent.iterations
            rests = bent.rests[-1].fraction >= 1 and path.arrives(u)
        if rests:
            minimum = Minimum(path.rests[-1].u, path.residual * scale, path.iterations)
    else:
        try:
            minimum = minimise(potential, u, limit=iterations, **options)
        except ConvergenceError as error:
            if not relaxation:
                raise
            logger.info("%s: dynamic relaxation goes on", error)
    if minimum is None:
        mass = lumped_mass(mesh, grid.space)
        size = float(np.linalg.norm(np.ptp(nodes, axis=0)))
        force = float(np.abs(load.sum(axis=0)).max()) or scale
        dt = FALL_SHARE * float(np.sqrt(size * mass.sum() / force))
        known: dict[str, Any] = {"mass": mass, "fixed": held.fixed, "dt": dt}
        minimum = relax(potential, u, **known, **options)
        for _ in range(FROZEN if following else 0):
            potential.load = load + following.force(minimum.u) - following.force(0 * u)
            minimum = relax(potential, minimum.u, **known, **options)
    u = minimum.u
    # No tet may be inside out in a corner, along an edge, or where it was integrated
    middles = np.eye(4)[EDGES].mean(axis=1)
    where = np.concatenate([np.eye(4), middles, element_points(grid.space.order)])
    J = np.linalg.det(displacement_gradients(grid, u, where) + np.eye(3)).min(axis=1)
    if not (J > 0).all():
        raise ConvergenceError(
            "nonlinear.tets_end", count=int((~(J > 0)).sum()), count_2=len(J), min=J.min()
        )
    pushed = load + (following.force(u) - following.force(0 * u) if following else 0.0)
    pushed = pushed + contact.forces(u, len(u)) if contact else pushed
    residual = minimum.residual / scale
    result = static_result(mesh, elastic, u, pushed, held, residual, minimum.iterations)
    return replace(result, path=path)
