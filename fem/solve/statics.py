"""Static linear elasticity: displacement, strain, stress and energy of a body at rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..device import checked_device, single_threaded
from ..discrete.assembly import (
    BlockMatrix,
    apply_supports,
    discretise,
    displacement_gradients,
    stiffness,
)
from ..discrete.elastic import ElasticBody, Law
from ..discrete.forces import Traction, body_force, gravity_force, traction_force
from ..discrete.space import Space
from ..discrete.strain import hooke, strain_and_stress, von_mises
from ..errors import ConvergenceError, InputError
from ..linalg.solver import Solution, solve
from ..scene.components import free_pieces
from ..scene.material import ElementMaterial
from ..scene.mesh import TetMesh
from ..scene.supports import Supports

# Relative residual of the linear solve: far below any discretisation error, reached in fp64.
TOLERANCE = 1e-8
# Poisson's ratio beyond which P1 tets answer too stiffly: use order 2, or averaged pressures.
LOCKING = 0.45
# Up to here the iterative solver is sure of bodies that are too large for a direct one.
COMPRESSIBLE = 0.499


@dataclass(frozen=True, eq=False)
class StaticResult:
    """A body at rest under its loads.

    Parameters
    ----------
    displacement
        Displacement of the mesh points [m], shape (points, 3).
    node_displacement
        Displacement of all nodes of the space [m], shape (nodes, 3); edges follow the points in P2.
    law
        Elastic law of the solution.
    strain, stress
        Strain tensor [1] (small strain, or Green's under a nonlinear law) and Cauchy stress [Pa],
        means over every tet, shape (tets, 3, 3).
    reaction
        Force of the supports on the body [N], shape (nodes, 3).
    energy
        Elastic energy [J].
    residual, iterations
        Relative residual of the linear system, and iterations (0: direct).
    """

    mesh: TetMesh
    space: Space
    displacement: Float[np.ndarray, "points 3"]
    node_displacement: Float[np.ndarray, "nodes 3"]
    law: Law
    strain: Float[np.ndarray, "tets 3 3"]
    stress: Float[np.ndarray, "tets 3 3"]
    reaction: Float[np.ndarray, "nodes 3"]
    energy: float
    residual: float
    iterations: int

    @property
    def order(self) -> int:
        """Order of the elements: 1 or 2."""
        return self.space.order

    @property
    def von_mises(self) -> Float[np.ndarray, "tets"]:
        """Von Mises stress [Pa] of every tet."""
        return von_mises(self.stress)

    @property
    def locking_share(self) -> float:
        """Share of the volume that P1 makes too stiff: nu above 0.45; zero for P2."""
        if self.order == 2:
            return 0.0
        volumes = self.mesh.volumes
        return float(volumes[material_of(self.mesh).nu > LOCKING].sum() / volumes.sum())

    @property
    def max_strain(self) -> float:
        """Largest principal strain of any tet, in size [1]."""
        return float(np.abs(np.linalg.eigvalsh(self.strain)).max())


@single_threaded
def solve_static(
    mesh: TetMesh,
    supports: Supports,
    *,
    gravity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    body: np.ndarray | Callable[[np.ndarray], np.ndarray] | None = None,
    traction: Traction | Sequence[Traction] = (),
    forces: np.ndarray | None = None,
    order: int = 1,
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
    gravity
        Acceleration of gravity [m/s^2], shape (3,).
    body
        Body force [N/m^3], shape (3,) or (tets, 3), or a function of positions (n, 3) [m].
    traction
        Force per area [Pa] on boundary faces; ``loads.pressure`` makes one of a pressure.
    forces
        Nodal forces [N], shape (points, 3) or (nodes, 3).
    order
        1: linear tets, 2: quadratic tets.
    device
        'cpu' or 'cuda'.
    tolerance
        Relative residual at which the solve is done.

    Raises
    ------
    InputError
        If the mesh has no material, or an array has the wrong shape.
    ConvergenceError
        If the body is not held, or the tolerance was not reached.
    """
    material = material_of(mesh)
    grid = discretise(mesh, order, checked_device(device))
    held = supports.on(grid.space)
    if not (held.fixed.any() or held.springs.any()):
        raise ConvergenceError("nothing holds the body: fix some points or add springs")
    load = load_vector(mesh, grid, gravity, body, traction, forces)
    prescribed = np.where(held.fixed, held.values, 0.0)
    matrix = stiffness(grid, *material.lame)
    rhs = reduced_load(matrix, load, held, prescribed)
    nodes = grid.space.nodes
    solution = solve(matrix, rhs, points=nodes, fixed=held.fixed, tolerance=tolerance)
    check_solution(mesh, held, solution, tolerance)
    u = np.where(held.fixed, prescribed, solution.x)
    body_law = ElasticBody(grid, material, Law.LINEAR)
    return static_result(mesh, body_law, u, load, held, solution.residual, solution.iterations)


def reduced_load(
    matrix: BlockMatrix, load: np.ndarray, held: Supports, prescribed: np.ndarray
) -> np.ndarray:
    """Right-hand side (nodes, 3) once prescribed components are dropped from ``matrix``, in place.

    Prescribed unknowns of the reduced system are zero: they are known, and put back afterwards.
    """
    rhs = load - (matrix.times(prescribed) if prescribed.any() else 0.0)
    rhs[held.fixed] = 0.0
    apply_supports(matrix, held.fixed, held.springs)
    return rhs


def check_solution(mesh: TetMesh, held: Supports, solution: Solution, tolerance: float) -> None:
    """Raise if the linear solve failed, naming the pieces that nothing holds."""
    if solution.suspect:
        _check_held(mesh, held)
    if not solution.residual <= max(tolerance, solution.floor):
        nu = float(material_of(mesh).nu.max())
        advice = (
            f"nu = {nu:g} is nearly incompressible: take nu <= {COMPRESSIBLE:g} or fewer tets"
            if nu > COMPRESSIBLE
            else "check that every piece is held, that no tet is nearly flat, and that E is sane"
        )
        raise ConvergenceError(
            f"linear solve ended with relative residual {solution.residual:.3g} after "
            f"{solution.iterations} iterations: wanted <= {tolerance:g}; {advice}"
        )


def _check_held(mesh: TetMesh, held: Supports) -> None:
    points = len(mesh.points)
    free = free_pieces(mesh, (held.fixed | (held.springs > 0))[:points].astype(float))
    if free.size:
        raise ConvergenceError(
            f"{free.size} piece(s) of the body can move freely (the first is piece {free[0]}): "
            "hold three points that span a plane, or tie the pieces together"
        )


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
    centre = np.full((1, 4), 0.25)  # P2 strain is linear: its mean is its value at the centroid
    H = displacement_gradients(grid, u, centre)[:, 0]
    energy, force = body.response(u)
    strain, stress = strain_and_stress(body.law, H, material_of(mesh))
    return StaticResult(
        mesh,
        grid.space,
        u[: grid.space.points],
        u,
        body.law,
        strain,
        stress,
        np.where(held.fixed, force - load, 0.0) - held.springs * u,
        energy,
        residual,
        iterations,
    )


def nodal_stress(result: StaticResult) -> Float[np.ndarray, "points 3 3"]:
    """Cauchy stress [Pa] at the mesh points: volume-weighted mean of the tets around each.

    Taken at the corners of every tet, where a P2 stress differs from its mean. Linear law only.
    """
    if result.law is not Law.LINEAR:
        raise InputError(f"nodal stress of the law {result.law.name}: wanted LINEAR")
    mesh = result.mesh
    grid = discretise(mesh, result.order)
    H = displacement_gradients(grid, result.node_displacement, np.eye(4))
    stress = hooke((H + np.swapaxes(H, -1, -2)) / 2, material_of(mesh)).reshape(-1, 9)
    ids, weight = mesh.tets.ravel(), np.repeat(mesh.volumes, 4)
    total = np.bincount(ids, weight, len(mesh.points))
    mean = [np.bincount(ids, weight * s, len(mesh.points)) for s in stress.T]
    return (np.stack(mean, axis=1) / np.where(total > 0, total, 1.0)[:, None]).reshape(-1, 3, 3)


def material_of(mesh: TetMesh) -> ElementMaterial:
    """Material of ``mesh``, which must have one."""
    if mesh.material is None:
        raise InputError("the mesh has no material yet: run `assign` first")
    return mesh.material


def load_vector(mesh, grid, gravity, body, traction, forces) -> np.ndarray:
    """Nodal forces [N] (nodes, 3) of all loads together; arguments as in ``solve_static``."""
    space = grid.space
    total = np.zeros((len(space.nodes), 3))
    if np.any(gravity):
        total += gravity_force(grid, material_of(mesh).rho, np.asarray(gravity, dtype=float))
    if body is not None:
        total += body_force(mesh, grid, body)
    for load in [traction] if isinstance(traction, Traction) else traction:
        total += traction_force(mesh, space, load)
    if forces is not None:
        if len(forces) not in (space.points, len(space.nodes)):
            raise InputError(f"forces of shape {forces.shape}: wanted ({space.points}, 3)")
        total[: len(forces)] += forces
    if not np.isfinite(total).all():
        raise InputError("a load is not finite: wanted numbers in SI units")
    return total
