"""Stability of a rest: the multiple of the load at which a body buckles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..device import single_threaded
from ..elements.assembly import node_supports
from ..elements.elastic import constrained_stiffness, displacement_gradients, linear_stress
from ..elements.following import FollowingLoads
from ..elements.space import element_points
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.solver import Inverse
from ..scene.loads import Traction
from ..scene.supports import Supports
from .mesh_error import estimate_factor_error
from .modal import ConstrainedInverse, constrained_inverse
from .result import LoadFactor, StaticResult

# Relative accuracy of a load factor up to the second, far below that of the elements; that of a
# larger one is less as it grows, for it is told to be far.
TOLERANCE, NEAR = 1e-4, 10.0
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
        if error <= TOLERANCE * max(value[-1], 1 / NEAR):
            return float(value[-1]), np.tensordot(mode[:, -1], basis[: step + 1], axes=1)
    raise ConvergenceError("buckling.load_factor", steps=STEPS, value=1 / value[-1])
