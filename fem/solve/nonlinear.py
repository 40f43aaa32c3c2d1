"""Static equilibrium under large deformation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..deprecation import renamed_options
from ..device import single_threaded
from ..discrete.block_matrix import BlockMatrix
from ..discrete.constraints import apply_supports
from ..discrete.elastic import ElasticBody
from ..laws.law import Law
from ..linalg.solver import solve_system
from ..result import StaticResult
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from .newton import MAX_ITERATIONS, Point, minimise
from .statics import check_held, discrete_problem, static_result

# Relative residual of the equilibrium |internal - external| / |external|.
TOLERANCE = 1e-8
# Newton's linear systems are solved this well: far beyond what its convergence needs.
LINEAR_TOLERANCE = 1e-5


class Potential:
    """Total potential of a held elastic body: W(u) - f . u + springs.

    ``scale`` is the size of the forces in play [N].
    """

    def __init__(self, body: ElasticBody, load: np.ndarray, held: Supports, scale: float) -> None:
        self.body, self.load, self.held, self.scale = body, load, held, scale

    def evaluate(self, u: np.ndarray) -> Point:
        """Energy, gradient (zero at prescribed components) and scale."""
        held, elastic = self.held, self.body.response(u)
        springs = held.springs * u
        energy = elastic.energy + 0.5 * float((springs * u).sum()) - float((self.load * u).sum())
        gradient = np.where(held.fixed, 0.0, elastic.force + springs - self.load)
        return Point(energy, gradient, self.scale)

    def hessian(self, u: np.ndarray, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        matrix = self.body.tangent(u, projected=projected)
        apply_supports(matrix, self.held.fixed, self.held.springs)
        return matrix

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """No step is too long for a potential without contact."""
        return np.inf


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
) -> StaticResult:
    """Find the equilibrium of ``mesh`` under dead loads by Newton's method.

    Parameters are those of ``solve_static``; ``law`` is the name of the elastic law, ``start`` the
    first guess of the displacement [m], shape (nodes, 3), and ``iterations`` what Newton may take.
    ``strain`` of the result is Green's strain, ``stress`` Cauchy's.

    Raises
    ------
    ConvergenceError
        If the body is not held, or no equilibrium was found.
    """
    loads = {"gravity_vector": gravity_vector, "body": body, "traction": traction, "forces": forces}
    grid, held, load = discrete_problem(mesh, supports, order=order, device=device, **loads)
    check_held(mesh, held)
    elastic = ElasticBody(grid, material_of(mesh), law)
    nodes = grid.space.nodes

    def linear(matrix: BlockMatrix, b: np.ndarray, goal: float) -> np.ndarray:
        held_at = {"points": nodes, "fixed": held.fixed}
        return solve_system(matrix, b, tolerance=LINEAR_TOLERANCE, **held_at).x

    u = np.zeros_like(load) if start is None else start.copy()
    u[held.fixed] = held.values[held.fixed]
    # The load, or what the prescribed motion makes.
    scale = float(max(np.linalg.norm(load), np.linalg.norm(elastic.response(u).force))) or 1.0
    potential = Potential(elastic, load, held, scale)
    found = minimise(potential, u, solve=linear, tolerance=tolerance, limit=iterations)
    residual = found.residual / scale
    return static_result(mesh, elastic, found.u, load, held, residual, found.iterations)
