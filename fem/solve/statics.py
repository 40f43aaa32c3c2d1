"""Static linear elasticity: displacement, strain, stress and energy of a body at rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from ..device import checked_device, single_threaded
from ..elements.assembly import Discretisation, discretise, node_supports
from ..elements.elastic import (
    ElasticBody,
    constrained_stiffness,
    displacement_gradients,
    keep_stiffness,
    strain_and_stress,
)
from ..elements.forces import load_vector
from ..elements.space import CENTROID, affordable_order
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.solver import CHOLESKY, Solution, solve_system
from ..mesh import MAX_COMPONENTS, TetMesh, face_components, free_motions, material_of
from ..note import Note
from ..scene.loads import Traction
from ..scene.supports import Supports
from .result import StaticResult

# Relative residual of the linear solve: far below any discretisation error, reached in fp64.
TOLERANCE = 1e-8
# Up to here the iterative solver is sure of bodies that are too large for a direct one.
COMPRESSIBLE = 0.499


def discrete_problem(
    mesh: TetMesh, supports: Supports, *, order: int | None, device: str, **loads: Any
) -> tuple[Discretisation, Supports, np.ndarray]:
    """Grid, supports and load [N] of its nodes (nodes, 3); ``loads`` as in ``solve_static``.

    Raises ConvergenceError: If nothing holds the body.
    """
    grid = discretise(mesh, order or affordable_order(mesh), checked_device(device))
    held = node_supports(supports, grid.space)
    if not (held.fixed.any() or held.springs.any()):
        raise ConvergenceError("statics.nothing_holds")
    return grid, held, load_vector(mesh, grid, **loads)


@single_threaded
def solve_static(
    mesh: TetMesh,
    supports: Supports,
    *,
    gravity_vector: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    body: np.ndarray | Callable[[np.ndarray], np.ndarray] | None = None,
    traction: Traction | Sequence[Traction] = (),
    forces: np.ndarray | None = None,
    order: int | None = None,
    device: str = "cpu",
    tolerance: float = TOLERANCE,
) -> StaticResult:
    """Solve div sigma + f = 0 with Hooke's law for the displacement of ``mesh``.

    Parameters
    ----------
    mesh
        Tets with a material.
    supports
        Prescribed components and springs, on the points of the mesh or the nodes of the space.
    gravity_vector
        Acceleration of gravity [m/s^2], shape (3,).
    body
        Body force [N/m^3], shape (3,) or (tets, 3), or a function of positions (n, 3) [m].
    traction
        Force per area [Pa] on boundary faces; ``pressure`` makes one of a pressure.
    forces
        Nodal forces [N], shape (points, 3) or (nodes, 3).
    order
        1: linear tets, 2: quadratic tets; None: quadratic while they are affordable.
    device
        'cpu' or 'cuda'.
    tolerance
        Relative residual at which the solve is done.

    Returns
    -------
    StaticResult
        Displacement [m] of every point, strain [1] and stress [Pa] of every tet, reactions [N].

    Raises
    ------
    InputError
        If the mesh has no material, or an array has the wrong shape.
    ConvergenceError
        If the body is not held, or the tolerance was not reached.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, solve_static
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> held = Supports.clamp(len(block.points), block.points[:, 2] == 0)
    >>> u = solve_static(block, held, gravity_vector=(0, 0, -10), order=2).displacement
    >>> round(float(-u[:, 2].min()), 9)  # m: rho g L^2 / (2 E)
    0.005
    """
    loads = {"gravity_vector": gravity_vector, "body": body, "traction": traction, "forces": forces}
    grid, held, load = discrete_problem(mesh, supports, order=order, device=device, **loads)
    prescribed = np.where(held.fixed, held.values, 0.0)
    elastic = ElasticBody(grid, material_of(mesh), Law.LINEAR)
    rhs = load - (elastic.response(prescribed).force if prescribed.any() else 0.0)
    matrix = constrained_stiffness(elastic, held)
    rhs = np.where(held.fixed, 0.0, rhs)
    nodes = grid.space.nodes
    known = {"points": nodes, "fixed": held.fixed, "edges": grid.space.edges}
    solution = solve_system(matrix, rhs, **known, tolerance=tolerance)
    check_solution(mesh, held, solution, tolerance)
    if solution.solver == CHOLESKY:  # else it was used up
        keep_stiffness(elastic, held, matrix)
    u = np.where(held.fixed, prescribed, solution.x)
    result = static_result(mesh, elastic, u, load, held, solution.residual, solution.iterations)
    return replace(result, solver=solution.solver, cycle=solution.cycle)


def check_solution(mesh: TetMesh, held: Supports, solution: Solution, tolerance: float) -> None:
    """Raise if the linear solve failed, naming the components that nothing holds."""
    if solution.suspect:
        check_held(mesh, held)
    if not solution.reached(tolerance):
        nu = float(material_of(mesh).nu.max())
        advice = (
            Note("statics.nu_nearly", nu=nu, compressible=COMPRESSIBLE)
            if nu > COMPRESSIBLE
            else Note("statics.check_every")
        )
        thin = Note("statics.body_too")
        if not np.isfinite(solution.residual):
            raise ConvergenceError("statics.fp_cannot", thin=thin)
        if solution.residual <= solution.floor:
            raise ConvergenceError("statics.round_off", change=solution.change, thin=thin)
        raise ConvergenceError(
            "statics.linear_solve",
            residual=solution.residual,
            iterations=solution.iterations,
            tolerance=tolerance,
            advice=advice,
        )


def check_held(mesh: TetMesh, held: Supports) -> None:
    """Raise ``ConvergenceError`` if a piece of ``mesh`` can move as a rigid body."""
    if len(np.unique(face_components(mesh))) > MAX_COMPONENTS:
        return
    points = len(mesh.points)
    free = free_motions(mesh, (held.fixed | (held.springs > 0))[:points]).components
    if free.size:
        raise ConvergenceError("statics.piece_body", size=free.size, free=free[0])


def static_result(
    mesh: TetMesh,
    body: ElasticBody,
    u: np.ndarray,
    load: np.ndarray,
    held: Supports,
    residual: float,
    iterations: int,
) -> StaticResult:
    """Strain, stress, reaction and energy of the nodal displacement ``u`` (nodes, 3) [m]."""
    grid = body.grid
    # P2 strain is linear: its mean is its value at the centroid.
    H = displacement_gradients(grid, u, CENTROID)[:, 0]
    energy, force = body.response(u)
    strain, stress = strain_and_stress(body.law, H, body.material)
    return StaticResult(
        mesh,
        body,
        u[: grid.space.points],
        u,
        strain,
        stress,
        np.where(held.fixed, force - load, 0.0) - held.springs * u,
        energy,
        residual,
        iterations,
    )


def corner_stresses(result: StaticResult) -> Float[np.ndarray, "tets 4 3 3"]:
    """Cauchy stress [Pa] at the corners of every tet, where a P2 stress differs from its mean."""
    body = result.body
    H = displacement_gradients(body.grid, result.node_displacement, np.eye(4))
    return np.stack(
        [strain_and_stress(body.law, H[:, k], body.material).stress for k in range(4)], axis=1
    )


def nodal_stress(result: StaticResult) -> Float[np.ndarray, "points 3 3"]:
    """Cauchy stress at the mesh points: volume-weighted mean of the tets around each.

    Taken at the corners of every tet, where a P2 stress differs from its mean. Linear law only.

    Parameters
    ----------
    result
        Rest of a body under the linear law.

    Returns
    -------
    array
        Stress [Pa], shape (points, 3, 3).

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, nodal_stress, solve_static
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> bottom, top = block.points[:, 2] == 0, block.points[:, 2] == 1
    >>> pulled = Supports.clamp(8, bottom).with_fixed(top, 2, 0.01)
    >>> nodal_stress(solve_static(block, pulled))[:, 2, 2].round(3).tolist()[:2]  # Pa: E e
    [10000.0, 10000.0]
    """
    if result.law != Law.LINEAR:
        raise InputError("statics.nodal_stress", law=result.law, value=Law.LINEAR.value)
    mesh = result.mesh
    stress = corner_stresses(result).reshape(-1, 9)
    ids, weight = mesh.tets.ravel(), np.repeat(mesh.volumes, 4)
    total = np.bincount(ids, weight, len(mesh.points))
    mean = [np.bincount(ids, weight * s, len(mesh.points)) for s in stress.T]
    return (np.stack(mean, axis=1) / np.where(total > 0, total, 1.0)[:, None]).reshape(-1, 3, 3)
