"""Static equilibrium under large deformation."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from ..contact.barrier import Contact
from ..deprecation import renamed_options
from ..device import single_threaded
from ..discrete.assembly import Discretisation
from ..discrete.block_matrix import BlockMatrix
from ..discrete.constraints import apply_supports
from ..discrete.elastic import ElasticBody
from ..discrete.mass import lumped_mass
from ..discrete.space import EDGES, element_points
from ..discrete.strain import displacement_gradients
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.solver import solve_system
from ..result import StaticResult
from ..scene.mesh import TetMesh, material_of
from ..scene.obstacles import Obstacle
from ..scene.supports import Supports
from .newton import MAX_ITERATIONS, LinearSolve, Minimum, Point, minimise, relax
from .statics import check_held, discrete_problem, static_result

logger = logging.getLogger(__name__)

# Relative residual of the equilibrium |internal - external| / |external|.
TOLERANCE = 1e-8
# Newton's linear systems are solved this well: far beyond what its convergence needs.
LINEAR_TOLERANCE = 1e-5
# Newton steps of one step of the load.
STEP_LIMIT = 15
# First step of the relaxation, as a share of the time of a fall across the body.
FALL_SHARE = 0.05


# Where Newton stops the load comes on in steps, halved at most so often.
HALVINGS = 4


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


@renamed_options(gravity="gravity_vector")
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
    """Find the equilibrium of ``mesh`` under dead loads by Newton's method.

    Where it stops, the load comes on in steps; where that stops, by dynamic relaxation.

    Parameters are those of ``solve_static``; ``law`` is the name of the elastic law, ``start`` the
    first guess of the displacement [m], shape (nodes, 3), and ``iterations`` what Newton may take;
    ``obstacles`` push without friction and stand still; without ``relaxation`` it is an error
    where Newton stops.
    ``strain`` of the result is Green's strain, ``stress`` Cauchy's.

    Raises
    ------
    ConvergenceError
        If the body is not held, no rest was found, or a tet would be inside out.
    """
    loads = {"gravity_vector": gravity_vector, "body": body, "traction": traction, "forces": forces}
    grid, held, load = discrete_problem(mesh, supports, order=order, device=device, **loads)
    check_held(mesh, held)
    elastic = ElasticBody(grid, material_of(mesh), law)
    nodes = grid.space.nodes

    def linear(matrix: BlockMatrix, b: np.ndarray, goal: float) -> np.ndarray:
        held_at = {"points": nodes, "fixed": held.fixed, "edges": grid.space.edges}
        return solve_system(matrix, b, tolerance=LINEAR_TOLERANCE, **held_at).x

    u = np.zeros_like(load) if start is None else start.copy()
    u[held.fixed] = held.values[held.fixed]
    contact = Contact(mesh, grid.space, obstacles, friction=0.0) if obstacles else None
    if contact and not contact.gap(u) > 0:
        raise InputError(f"the body starts {-contact.gap(u):g} m inside an obstacle: wanted a gap")
    # The load, or what the prescribed motion makes.
    scale = float(max(np.linalg.norm(load), np.linalg.norm(elastic.response(u).force))) or 1.0
    potential = Potential(elastic, load, held, scale, contact)
    mass = lumped_mass(mesh, grid.space)
    options = {"solve": linear, "tolerance": tolerance}
    if relaxation:
        found = _find_rest(potential, u, mass, limit=iterations, **options)
    else:
        found = minimise(potential, u, limit=iterations, **options)
    _check_orientation(grid, found.u)
    pushed = load + contact.forces(found.u, len(found.u)) if contact else load
    residual = found.residual / scale
    return static_result(mesh, elastic, found.u, pushed, held, residual, found.iterations)


def _find_rest(
    potential: Potential,
    u: np.ndarray,
    mass: np.ndarray,
    *,
    solve: LinearSolve,
    tolerance: float,
    limit: int,
) -> Minimum:
    """Rest by Newton at once; by Newton in steps of the load; by dynamic relaxation."""
    try:
        return minimise(potential, u, solve=solve, tolerance=tolerance, limit=limit)
    except ConvergenceError as error:
        logger.info("%s: the load comes on in steps", error)
    load, count = potential.load, 0
    done, step, halvings = 0.0, 0.5, 1
    while done < 1 and halvings <= HALVINGS:
        potential.load = min(1.0, done + step) * load
        try:
            found = minimise(potential, u, solve=solve, tolerance=tolerance, limit=STEP_LIMIT)
            u, count, done = found.u, count + found.iterations, min(1.0, done + step)
        except ConvergenceError:
            step, halvings = step / 2, halvings + 1
    potential.load = load
    if done >= 1:
        return found._replace(iterations=count)
    logger.info("Newton stopped at %.0f %% of the load: dynamic relaxation", 100 * done)
    size = float(np.linalg.norm(np.ptp(potential.body.grid.space.nodes, axis=0)))
    force = float(np.abs(load.sum(axis=0)).max()) or potential.scale
    dt = FALL_SHARE * float(np.sqrt(size * mass.sum() / force))
    held = potential.held.fixed
    found = relax(potential, u, mass=mass, fixed=held, dt=dt, solve=solve, tolerance=tolerance)
    return found._replace(iterations=count + found.iterations)


def _check_orientation(grid: Discretisation, u: np.ndarray) -> None:
    """Raise if a tet is inside out in a corner, along an edge, or where it was integrated."""
    middles = np.eye(4)[EDGES].mean(axis=1)
    where = np.concatenate([np.eye(4), middles, element_points(grid.space.order)])
    J = np.linalg.det(displacement_gradients(grid, u, where) + np.eye(3)).min(axis=1)
    if not (J > 0).all():
        raise ConvergenceError(
            f"{int((~(J > 0)).sum())} of {len(J)} tets end inside out (J down to {J.min():.2g}): "
            "the mesh is too coarse for so large a deformation, or it folds onto itself"
        )
