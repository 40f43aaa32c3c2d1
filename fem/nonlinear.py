"""Static equilibrium under large deformation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .blocks import BlockMatrix, apply_supports, discretise
from .device import checked_device, start_warp
from .elastic import ElasticBody, Law
from .errors import ConvergenceError
from .mesh import TetMesh
from .newton import MAX_ITERATIONS, minimise
from .solver import solve
from .statics import StaticResult, load_vector, material_of, static_result
from .supports import Supports

# Relative residual of the equilibrium |internal - external| / |external|.
TOLERANCE = 1e-8
# Newton's linear systems are solved this well: far beyond what its convergence needs.
LINEAR_TOLERANCE = 1e-5


class Potential:
    """Total potential of a held elastic body: W(u) - f . u + springs."""

    def __init__(self, body: ElasticBody, load: np.ndarray, held: Supports) -> None:
        self.body, self.load, self.held = body, load, held
        self._wp = start_warp()

    def _array(self, u: np.ndarray):
        return self._wp.array(u, dtype=self._wp.vec3d, device=self.body.grid.device)

    def value(self, u: np.ndarray) -> float:
        """Energy [J]."""
        springs = 0.5 * float((self.held.springs * u**2).sum())
        return self.body.energy(self._array(u)) + springs - float((self.load * u).sum())

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Gradient [N], zero at prescribed components."""
        field = self._array(u)
        force = self._wp.zeros_like(field)
        self.body.add_force(field, force)
        return np.where(self.held.fixed, 0.0, force.numpy() + self.held.springs * u - self.load)

    def hessian(self, u: np.ndarray, *, projected: bool) -> BlockMatrix:
        """Hessian [N/m] with prescribed rows dropped."""
        matrix = self.body.tangent(self._array(u), projected=projected)
        apply_supports(matrix, self.held.fixed, self.held.springs)
        return matrix

    def longest_step(self, u: np.ndarray, step: np.ndarray) -> float:
        """No step is too long for a potential without contact."""
        return np.inf


def solve_nonlinear(
    mesh: TetMesh,
    supports: Supports,
    *,
    gravity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    body=None,
    traction=(),
    forces: np.ndarray | None = None,
    law: Law = Law.NEO_HOOKEAN,
    order: int = 1,
    device: str = "cpu",
    tolerance: float = TOLERANCE,
    start: np.ndarray | None = None,
    iterations: int = MAX_ITERATIONS,
) -> StaticResult:
    """Find the equilibrium of ``mesh`` under dead loads by Newton's method.

    Parameters are those of ``solve_static``; ``law`` is the elastic law, ``start`` the first guess
    of the displacement [m], shape (nodes, 3), and ``iterations`` what Newton may take. ``strain``
    of the result is Green's strain, ``stress`` Cauchy's.

    Raises
    ------
    ConvergenceError
        If the body is not held, or no equilibrium was found.
    """
    material = material_of(mesh)
    grid = discretise(mesh, order, checked_device(device))
    held = supports.on(grid.space)
    if not (held.fixed.any() or held.springs.any()):
        raise ConvergenceError("nothing holds the body: fix some points or add springs")
    load = load_vector(mesh, grid.space, gravity, body, traction, forces)
    elastic = ElasticBody(grid, material, law)
    potential = Potential(elastic, load, held)
    nodes = grid.space.nodes

    def linear(matrix: BlockMatrix, b: np.ndarray, goal: float) -> np.ndarray:
        return solve(matrix, b, points=nodes, fixed=held.fixed, tolerance=LINEAR_TOLERANCE).x

    u = np.zeros_like(load) if start is None else start.copy()
    u[held.fixed] = held.values[held.fixed]
    size = _force_scale(potential, u, load)
    found = minimise(potential, u, solve=linear, target=tolerance * size, limit=iterations)
    residual = found.residual / size
    return static_result(mesh, elastic, found.u, load, held, residual, found.iterations)


def _force_scale(potential: Potential, u: np.ndarray, load: np.ndarray) -> float:
    """Size of the forces in play [N]: the load, or what the prescribed motion makes."""
    field = potential._array(u)
    force = start_warp().zeros_like(field)
    potential.body.add_force(field, force)
    return float(max(np.linalg.norm(load), np.linalg.norm(force.numpy()))) or 1.0
