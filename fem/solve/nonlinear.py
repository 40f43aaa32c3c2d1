"""Static equilibrium under large deformation: the minimum of an energy.

By Newton's method with backtracking, and by dynamic relaxation. The path of rests as the load
grows is followed by load steps, and past hard places by arc length: a rest is stable while its
tangent is positive, which Cholesky's factor says at every step. Where the path turns back (a snap)
or another one leaves it (buckling) the tangent is singular: arc length comes as near to that as is
wanted, and dynamic relaxation goes on from there.
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
from ..elements.assembly import BlockMatrix, add_blocks, add_diagonal, apply_supports
from ..elements.elastic import (
    ElasticBody,
    displacement_gradients,
    geometric_stiffness,
    linear_stress,
)
from ..elements.forces import FollowingLoads, lumped_mass
from ..elements.space import EDGES, element_points
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.cholesky import NotPositive, planned_elimination
from ..linalg.krylov import RitzPairs, inner_product, lanczos, length
from ..linalg.solver import solve_system
from ..mesh import TetMesh, material_of
from ..scene.loads import Traction
from ..scene.obstacles import Obstacle
from ..scene.supports import Supports
from .contact import Contact
from .modal import LARGEST, ConstrainedInverse, constrained_inverse
from .result import LoadFactor, StaticResult
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

    def hessian(self, u: Any, /, *, projected: bool) -> Any:
        """Hessian [N/m] with prescribed rows dropped; ``projected``: positive semi-definite."""

    def longest_step(self, u: Any, step: Any, /) -> float:
        """Largest share of ``step`` that stays allowed."""


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


# Newton steps of a load step. A path is given up after so many factors, or as many as take so many
# operations, some minutes of a core.
STEPS, MOST_FACTORS, LEAST_FACTORS, BUDGET = 12, 250, 30, 1e12
# A load step grows where Newton took fewer steps than this, at most so many times.
EASY, GROWTH, RETRIED = 8, 3.0, 0.4
# A step of Newton below this share of the displacement is the last: the next would be its square.
SMALL = 1e-6
# Where a torque turns: steps of GMRES, a solve each, and unknowns up to which the tangent may be
# indefinite, since a stable body's may be where forces have no energy.
KRYLOV, INDEFINITE = 30, 30_000
# A step has left the path where it is longer than by the rates of both its ends, or where a body
# that grew softer is harder at once.
LEAP, HARDER = 1.25, 0.5
# Two load steps in a row that fail are followed by arc length.
FAILURES, MOST_FAILURES = 2, 6
# How near the path goes to where it ends, as a share of the load, and how many halved steps of arc
# length say that it does.
NEAR, CERTAIN = 1e-3, 4
# Points that a step is foreseen from.
POINTS = 3
# Step of the load by which the tangent is differenced; load factors below so much are followed to,
# and below more where the softest way takes this share of the work of the load: tangents fall much
# faster than linearly to where a path turns back.
CHANGE, FOLLOWED, FOLLOWED_TURN, TURNS = 1e-4, 3.0, 15.0, 0.1
# A body that moves so many times as far by a little of its load as it did at first, and less again
# beyond, has buckled there, though its path goes on: a column that is not quite straight.
KNEE = 3.0
# Vibrations that tell how near it is to buckling, found to this share in at most so many blocks,
# and the share of the work of the way that it pushes which is none of theirs.
SLOWEST, SETTLED, MOST_BLOCKS, OWN = 6, 1e-2, 12, 1e-6
# CG's relative residual where no factor is affordable.
ROUGH = 1e-6


class Rest(NamedTuple):
    """Displacement ``u`` (nodes, 3) [m] under the ``fraction`` [1] of all that acts.

    ``rate`` (nodes, 3) [m] is its derivative by the fraction.
    """

    fraction: float
    u: np.ndarray
    rate: np.ndarray


class _Failed(Exception):
    """Newton did not arrive: the step was too long, or no stable rest is near."""


class Path:
    """Rests of an elastic ``body`` from no load on: all that acts is 1.

    ``held`` and ``load`` [N] are on its nodes, the load that of the body at rest; of that
    ``following`` turns with the faces. ``scale`` [N] is the size of the forces in play.
    """

    def __init__(
        self,
        body: ElasticBody,
        mesh: TetMesh,
        held: Supports,
        load: np.ndarray,
        *,
        following: FollowingLoads,
        scale: float,
        tolerance: float,
    ) -> None:
        self.body, self.mesh, self.held, self.following = body, mesh, held, following
        self.turned = bool(following) and bool(following.turned)
        self.grid, self.points = body.grid, element_points(body.grid.space.order)
        self.goal, self.scale = tolerance * scale, scale
        self.prescribed = np.where(held.fixed, held.values, 0.0)
        nothing = np.zeros_like(load)
        self.dead = load - following.force(nothing) if following else load
        plan = planned_elimination(self.grid.pattern, self.grid.space.edges)
        self.most = int(np.clip(BUDGET / plan.operations, LEAST_FACTORS, MOST_FACTORS))
        self.iterations, self.residual = 0, 0.0
        # Fraction of the load at which its rest is stable no more, and whether it turns back there
        self.end, self.turns = np.inf, False
        inverse, push = self.tangent(nothing, 0.0, None)
        self.rests = [Rest(0.0, nothing, inverse.solve(push) + self.prescribed)]

    def load(self, u: np.ndarray) -> np.ndarray:
        """All of the load [N] on the body as it lies."""
        return self.dead + self.following.force(u) if self.following else self.dead

    def unbalanced(self, u: np.ndarray, fraction: float) -> np.ndarray:
        """What is missing to a rest [N]."""
        force = fraction * self.load(u) - self.body.response(u).force - self.held.springs * u
        return np.where(self.held.fixed, 0.0, force)

    def square(self, u: np.ndarray) -> np.ndarray:
        """Half the square of the gradient of ``u``: what Green's strain has beyond a linear one."""
        H = displacement_gradients(self.grid, u, self.points)
        return H.swapaxes(-1, -2) @ H / 2

    def tangent(
        self, u: np.ndarray, fraction: float, beyond: np.ndarray | None, *, definite: bool = True
    ) -> tuple[ConstrainedInverse, np.ndarray]:
        """Inverse of the held tangent [N/m] at ``u`` under a load, and the push of all of it [N].

        The strain ``beyond`` what the linear step to ``u`` foresaw is none of the rest that it
        leads to, and its stress is taken off the geometric stiffness: steps that turn a thin part
        stay well, however long (Magisano, Leonetti & Garcea 2017, mixed integration points).
        """
        matrix = self.free_tangent(u, fraction)
        if beyond is not None:
            K_sigma = geometric_stiffness(self.grid, linear_stress(beyond, material_of(self.mesh)))
            values = matrix.values.numpy()
            values -= K_sigma.data[:, None, None] * np.eye(3)
            matrix.values.assign(values)
        push = self.load(u) - (matrix.times(self.prescribed) if self.prescribed.any() else 0.0)
        apply_supports(matrix, self.held.fixed, self.held.springs)
        push = np.where(self.held.fixed, 0.0, push)
        if not definite:
            from scipy.sparse.linalg import splu

            factor = splu(matrix.to_scipy().tocsc())
            solve = lambda f: factor.solve(f.ravel()).reshape(f.shape)  # noqa: E731
            return ConstrainedInverse(matrix, solve), push
        inverse = constrained_inverse(matrix, self.grid.space, self.held, rough=ROUGH)
        assert inverse is not None  # it may be rough
        return inverse, push

    def free_tangent(self, u: np.ndarray, fraction: float) -> BlockMatrix:
        """Tangent [N/m] at ``u`` under a load, without supports."""
        matrix = self.body.tangent(u)
        if self.following:
            i, j, blocks = self.following.stiffness(u)
            add_blocks(matrix, i, j, fraction * blocks)
        return matrix

    def solved(
        self, inverse: ConstrainedInverse, force: np.ndarray, u: np.ndarray, fraction: float
    ) -> np.ndarray:
        """What a ``force`` [N] adds to ``u`` [m], with what torques that turn have of stiffness.

        That is not in the tangent, whose ``inverse`` preconditions GMRES here: without it Newton
        creeps from a radian on.
        """
        if not self.turned:
            return inverse.solve(force)
        from scipy.sparse.linalg import LinearOperator, gmres

        def nodal(v: np.ndarray) -> np.ndarray:
            return np.asarray(v, dtype=float).reshape(-1, 3)

        def times(flat: np.ndarray) -> np.ndarray:
            v = nodal(flat)
            h = CHANGE * np.abs(u).max() / np.abs(v).max() if u.any() and v.any() else 0.0
            turned = inverse.stiffness.times(v)
            if h:
                ahead, behind = (self.following.torques(u + s * v) for s in (h, -h))
                turned -= np.where(self.held.fixed, 0.0, fraction * (ahead - behind) / (2 * h))
            return turned.ravel()

        solve = lambda v: inverse.solve(nodal(v)).ravel()  # noqa: E731
        first, shape = inverse.solve(force), (force.size, force.size)
        whole, before = LinearOperator(shape, times), LinearOperator(shape, solve)
        told = {"x0": first.ravel(), "M": before, "rtol": SMALL, "restart": KRYLOV, "maxiter": 1}
        return gmres(whole, force.ravel(), **told)[0].reshape(-1, 3)

    def newton(
        self,
        u: np.ndarray,
        fraction: float,
        *,
        along: np.ndarray | None = None,
        beyond: np.ndarray | None = None,
    ) -> tuple[Rest, int]:
        """Rest near ``u`` under ``fraction`` of the load; ``along``: on the plane across that."""
        inverse, push, rest = None, self.dead, self.unbalanced(u, fraction)
        for iteration in range(STEPS):
            if self.iterations >= self.most:
                done = self.rests[-1].fraction
                raise ConvergenceError("path.too_long", factors=self.most, done=done)
            self.iterations += 1
            try:
                inverse, push = self.tangent(u, fraction, beyond)
            except NotPositive:
                try:  # what is taken off may be too much
                    inverse, push = self.tangent(u, fraction, None)
                except NotPositive:
                    if not self.turned or u.size > INDEFINITE:
                        raise _Failed from None
                    inverse, push = self.tangent(u, fraction, None, definite=False)
            step = self.solved(inverse, rest, u, fraction)
            if along is not None:
                more = self.solved(inverse, push, u, fraction) + self.prescribed
                change = -float((along * step).sum() / (along * more).sum())
                step, fraction = step + change * more, fraction + change
            u, beyond = u + step, self.square(step)
            moved, largest = (float(np.abs(x).max()) for x in (step, u))
            if not np.isfinite(moved):
                raise _Failed
            rest = self.unbalanced(u, fraction)
            size = float(np.linalg.norm(rest))
            logger.debug("Newton %d at %.5f of the load: %.2e N left", iteration, fraction, size)
            if moved <= SMALL * largest or size <= self.goal:
                self.residual = size / self.scale
                rate = self.solved(inverse, push, u, fraction) + self.prescribed
                return Rest(float(fraction), u, rate), iteration + 1
        raise _Failed

    def foreseen(
        self, at: float, places: list[float], pace: float = 1.0
    ) -> tuple[np.ndarray, float, np.ndarray]:
        """Displacement and fraction of the load where the last rests lead, ``at`` a place ahead.

        By the polynomial through them, whose ``places`` are given, and along the rate of the last,
        where the fraction grows at ``pace``; and the strain there beyond that of such a polynomial
        through their strains.
        """
        last, x = self.rests[-POINTS:], np.array(places[-POINTS:])
        span = at - x[0]
        x, powers = (x - x[0]) / span, np.arange(len(last) + 1)
        slope = powers * x[-1] ** np.maximum(powers - 1, 0) / span
        rows = np.vstack([x[:, None] ** powers, slope])
        *weights, leads = np.linalg.solve(rows.T, np.ones(len(powers)))
        rate = leads * pace * last[-1].rate
        u = np.tensordot(weights, [rest.u for rest in last], axes=1) + rate
        H, G = (displacement_gradients(self.grid, v, self.points) for v in (last[-1].u, rate))
        beyond = self.square(u) - (H.swapaxes(-1, -2) @ G + G.swapaxes(-1, -2) @ H) / 2
        for weight, rest in zip(weights, last, strict=True):
            beyond -= weight * self.square(rest.u)
        fraction = float(np.dot(weights, [rest.fraction for rest in last])) + leads * pace
        return u, fraction, beyond

    def follow(self, goal: float = 1.0) -> None:
        """Go on to the fraction ``goal`` of the load, or to where the path ``end``s."""
        step, failures = goal, 0
        while (here := self.rests[-1].fraction) < goal and failures < MOST_FAILURES:
            if failures >= FAILURES and len(self.rests) > 1:
                self.follow_arc(goal)
                return
            target = min(here + step, goal)
            guess, _, beyond = self.foreseen(target, [rest.fraction for rest in self.rests])
            try:
                rest, taken = self.newton(guess, target, beyond=beyond)
                way = float(np.linalg.norm(rest.u - self.rests[-1].u))
                *before, last, new = (float(np.linalg.norm(x.rate)) for x in (*self.rests, rest))
                fell = bool(before) and before[-1] < last and new < HARDER * last
                if fell or way > LEAP * (target - here) * max(last, new):
                    raise _Failed  # it has left the path
            except _Failed:
                step, failures = RETRIED * (target - here), failures + 1
                continue
            self.rests.append(rest)
            failures = 0
            step = (target - here) * float(np.clip(EASY / taken, 1.0, GROWTH))
        if here < goal:
            raise ConvergenceError("path.no_start")

    def follow_arc(self, goal: float) -> None:
        """As ``follow``, by arc length, until it is clear where the path ends."""
        length = lambda a, b: float(np.linalg.norm(b.u - a.u))  # noqa: E731
        step, failures = length(*self.rests[-2:]), 0
        while self.rests[-1].fraction < goal:
            here, way = self.rests[-1], length(*self.rests[-2:])
            before, slope = (float(1 / np.linalg.norm(x.rate)) for x in self.rests[-2:])
            places = np.cumsum([0.0, *map(length, self.rests, self.rests[1:])]).tolist()
            guess, fraction, beyond = self.foreseen(places[-1] + step, places, slope)
            along = (guess - here.u) / np.linalg.norm(guess - here.u)
            try:
                rest, taken = self.newton(guess, fraction, along=along, beyond=beyond)
                if not rest.fraction > here.fraction:
                    raise _Failed
                if rest.fraction > goal:
                    guess, _, beyond = self.foreseen(goal, [x.fraction for x in self.rests])
                    rest, taken = self.newton(guess, goal, beyond=beyond)
            except _Failed:
                # It turns back where the slope of the load over the path would be zero
                rise = slope**2 * way / (2 * (before - slope)) if before > slope else np.inf
                if failures > CERTAIN and min(rise, slope * step) < NEAR * here.fraction:
                    if self.turned:
                        raise ConvergenceError("path.torque") from None
                    self.turns = rise < slope * step
                    self.end = here.fraction + min(rise, slope * step / 2)
                    return
                step, failures = step / 2, failures + 1
                continue
            self.rests.append(rest)
            failures = 0
            step *= float(np.clip(EASY / taken, 1.0, GROWTH))

    def slowest_modes(self) -> RitzPairs:
        """Slowest vibrations of the last stable rest, (3 nodes, modes), with the lumped mass."""
        free = ~self.held.fixed
        free[self.grid.space.unused] = False
        for rest in reversed(self.rests):  # the last may be a little beyond where it is stable
            try:
                inverse, _ = self.tangent(rest.u, rest.fraction, None)
                break
            except NotPositive:
                if self.turned:
                    raise ConvergenceError("path.torque") from None
        else:
            raise ConvergenceError("path.no_start")
        mass = np.where(free, lumped_mass(self.mesh, self.grid.space)[:, None], 0.0).reshape(-1, 1)
        start = np.random.default_rng(0).normal(size=(len(mass), SLOWEST)) * free.reshape(-1, 1)
        return lanczos(
            lambda x: _each(inverse.solve, x),
            lambda x: mass * x,
            start,
            enough=lambda p: p.errors[:SLOWEST].max() < SETTLED * abs(p.values[:SLOWEST]).min(),
            steps=MOST_BLOCKS,
        )

    def softest(self) -> np.ndarray:
        """Slowest vibration of the last rest (nodes, 3) of length one, to where its load pushes."""
        shape = self.slowest_modes().vectors(1).reshape(-1, 3)
        side = 1.0 if (shape * self.load(self.rests[-1].u)).sum() >= 0 else -1.0
        return side * shape / np.linalg.norm(shape)

    def arrives(self, u: np.ndarray) -> bool:
        """Whether there is a rest under all of the load near ``u``, which is then the last one."""
        try:
            self.rests.append(self.newton(u, 1.0)[0])
        except _Failed:
            return False
        return True

    def load_factor(self) -> LoadFactor:
        """Multiple of the load at which the rest under all of it would go on to buckle or snap.

        By what the load takes off the stiffness of the slowest vibrations and of the way that it
        pushes, which may be none of them (a balloon's); where that says that it is near, by
        following the path there: a tangent falls faster than linearly to a snap.
        """
        rest = self.rests[-1]
        ahead = self.free_tangent(rest.u + CHANGE * rest.rate, rest.fraction + CHANGE)
        here = self.free_tangent(rest.u, rest.fraction)
        pairs = self.slowest_modes()
        values = pairs.values[:SLOWEST]
        x = pairs.vectors(len(values)) * np.sqrt(np.abs(values))  # x . K x is one
        way = np.where(self.held.fixed, 0.0, rest.rate).reshape(-1, 1)
        own = way - x @ (x.T @ _each(here.times, way))
        whole, hard = ((v * _each(here.times, v)).sum() for v in (way, own))
        if hard > OWN * whole:
            x = np.hstack([x, own / np.sqrt(hard)])
        falls = x.T @ (_each(here.times, x) - _each(ahead.times, x)) / CHANGE
        rates, along = np.linalg.eigh((falls + falls.T) / 2)
        shape_of_all = (x @ along[:, -1]).reshape(-1, 3)
        shape = shape_of_all[: self.grid.space.points]
        if not 1 / LARGEST < rates[-1]:
            return LoadFactor(np.inf, np.zeros_like(shape))
        factor = rest.fraction + 1 / float(rates[-1])
        # The load works on a way that it turns back on, and not on one that another path takes
        work = float((shape_of_all * self.load(rest.u)).sum())
        turns = work**2 > TURNS * float((rest.rate * self.load(rest.u)).sum())
        goal = rest.fraction * (FOLLOWED_TURN if turns else FOLLOWED)
        if self.turned and factor < FOLLOWED:
            raise ConvergenceError("path.torque")
        passed = False
        if factor < goal and not self.turned:
            try:
                self.follow_arc(goal)
            except ConvergenceError as error:
                logger.info("the path was not followed to %g times the load: %s", goal, error)
            passed = bool(np.isinf(self.end) and self.rests[-1].fraction > factor)
            factor = float(np.fmin(self.end, max(factor, self.rests[-1].fraction)))
        rates = np.array([np.linalg.norm(rest.rate) for rest in self.rests])
        softest = int(rates.argmax())
        if np.isinf(self.end) and softest < len(rates) - 1 and rates[softest] > KNEE * rates[0]:
            factor, passed = self.rests[softest].fraction, False  # it gives way there, and goes on
        return LoadFactor(factor, shape / np.linalg.norm(shape, axis=1).max(), passed=passed)


def _each(of: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """What ``of`` makes of every column of ``x`` (3 nodes, n), as columns."""
    return np.stack([of(v.reshape(-1, 3)).ravel() for v in x.T], axis=1) if x.shape[1] else x
