"""What a body's coordinates should move: vibrations, responses to weight, and how both bend on.

The vector basis of a held body: linear modes alone lock, since a mode that bends far needs another
to go with it. Those are the derivatives (Idelsohn & Cardona 1985; Barbic & James 2005), by the
internal force's mixed second difference: K d_ij = -f''(x_i, x_j).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import known_factor
from ..discrete.assembly import Discretisation, discretise, linear_stiffness
from ..discrete.constraints import apply_supports, node_supports
from ..discrete.elastic import ElasticBody
from ..discrete.mass import lumped_mass
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.solver import MOST_ENTRIES, solve_system
from ..result import Modes
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from ..solve.modal import natural_modes
from ..solve.statics import check_held

# Modes of the vector basis; of the first so many, and of the responses to loads, derivatives, of
# which so many principal fields are kept.
MODES, BENT, DERIVED = 10, 5, 21
# Fields that add less than this to the span of the others, as a share of the first, are dropped.
DEPENDENT = 1e-6
# Size of the second difference, as a share of the body's: the cubic part is then 1e-6 of it.
PROBE = 1e-3
# Relative residual of a static response.
TOLERANCE = 1e-8


class LinearBody(NamedTuple):
    """A body about rest: linear elements, lumped ``mass`` [kg] (points,), and its ``modes``.

    ``compliance`` gives the displacement (points, 3) [m] of forces (points, 3) [N] on a held body.
    """

    mesh: TetMesh
    held: Supports
    grid: Discretisation
    mass: np.ndarray
    modes: Modes
    compliance: Callable[[np.ndarray], np.ndarray]

    @property
    def is_free(self) -> bool:
        """Whether nothing holds it."""
        return not (self.held.fixed.any() or self.held.springs.any())

    @property
    def size(self) -> float:
        """Longest side [m]."""
        return float(np.ptp(self.mesh.bounds, axis=0).max())


def linear_body(mesh: TetMesh, supports: Supports | None, modes: int = MODES) -> LinearBody:
    """Vibrations and compliance of ``mesh`` with linear elements and lumped mass.

    Raises
    ------
    InputError
        Where a prescribed displacement is not zero, or the material has a grain.
    """
    held = supports or Supports.none(len(mesh.points))
    if (held.values * held.fixed).any():
        raise InputError("a reduced body cannot be moved by its supports: prescribe zero, or fem")
    if material_of(mesh).tensor is not None:
        raise InputError("a reduced body knows no grain: wanted an isotropic material")
    if held.fixed.any() or held.springs.any():
        check_held(mesh, held)
    grid = discretise(mesh, 1)
    found = natural_modes(mesh, modes, supports=held, order=1, lumped=True)
    mass = lumped_mass(mesh, grid.space)
    return LinearBody(mesh, held, grid, mass, found, _compliance(mesh, held, grid))


def _compliance(
    mesh: TetMesh, held: Supports, grid: Discretisation
) -> Callable[[np.ndarray], np.ndarray]:
    on_nodes = node_supports(held, grid.space)

    def solve(forces: np.ndarray) -> np.ndarray:
        matrix = linear_stiffness(grid, material_of(mesh))
        apply_supports(matrix, on_nodes.fixed, on_nodes.springs)
        b = np.where(on_nodes.fixed, 0.0, forces)
        plan = planned_elimination(matrix, grid.space.edges)
        if plan.entries <= MOST_ENTRIES:  # the factor that the modes were found with
            return known_factor(matrix, plan).solve(b)
        known = {"points": grid.space.nodes, "fixed": on_nodes.fixed, "edges": grid.space.edges}
        solution = solve_system(matrix, b, **known, tolerance=TOLERANCE)
        if not solution.reached(TOLERANCE):
            raise ConvergenceError(f"a response was found to {solution.residual:.2g} only")
        return solution.x

    return solve


def load_responses(
    body: LinearBody, forces: Float[np.ndarray, "points 3"] | None = None
) -> Float[np.ndarray, "loads points 3"]:
    """Displacements [m] of a held body under 1 m/s^2 along x, y, z, and under ``forces`` [N]."""
    loads = [body.mass[:, None] * axis for axis in np.eye(3)]
    if forces is not None and np.any(forces):
        loads.append(forces)
    return np.stack([body.compliance(load) for load in loads])


def derivatives(
    body: LinearBody, fields: Float[np.ndarray, "fields points 3"]
) -> Float[np.ndarray, "pairs points 3"]:
    """How every two of ``fields`` bend on together, under the neo-Hookean law.

    Linear in each of the two; ``fields`` are taken at a thousandth of the body's size.
    """
    elastic = ElasticBody(body.grid, material_of(body.mesh), Law.NEO_HOOKEAN)
    scale = PROBE * body.size / np.abs(fields).max(axis=(1, 2))
    probes = fields * scale[:, None, None]

    def force(u: np.ndarray) -> np.ndarray:
        return elastic.response(u).force

    found = []
    for i, a in enumerate(probes):
        for j, b in enumerate(probes[i:], i):
            mixed = force(a + b) - force(a - b) - force(b - a) + force(-a - b)
            found.append(-body.compliance(mixed / (4 * scale[i] * scale[j])))
    return np.stack(found)


def vector_basis(
    body: LinearBody, forces: Float[np.ndarray, "points 3"] | None = None, derived: int = DERIVED
) -> Float[np.ndarray, "points 3 dofs"]:
    """Modes, responses to loads and derivatives of a held body, as fields of vectors.

    At most 34 coordinates with 21 ``derived`` fields, 49 with all 36; with the response to
    ``forces`` [N] beside those to weight one more, and 9 more derivatives. Which are kept is said
    by principal components, of modes as large as the same force makes them (Barbic & James 2005).
    """
    if body.is_free:
        raise InputError("a free body turns, which no fields of vectors follow: take skinning")
    shapes, responses = body.modes.shapes, load_responses(body, forces)
    share = (body.modes.frequencies[0] / body.modes.frequencies[:BENT]) ** 2
    size = np.sqrt(np.einsum("n,kni,kni->k", body.mass, responses, responses))
    bending = np.concatenate(
        [shapes[:BENT] * share[:, None, None], responses / size[:, None, None]]
    )
    linear = np.moveaxis(np.concatenate([shapes, responses]), 0, 2)
    second = np.moveaxis(derivatives(body, bending), 0, 2)
    kept = principal_fields(second, orthonormal_fields(linear, body.mass), body.mass, derived)
    return orthonormal_fields(np.concatenate([linear, kept], axis=2), body.mass)


def principal_fields(
    fields: Float[np.ndarray, "points 3 fields"],
    beside: Float[np.ndarray, "points 3 known"],
    mass: Float[np.ndarray, "points"],
    most: int,
) -> Float[np.ndarray, "points 3 kept"]:
    """First ``most`` principal components of what ``fields`` have outside M-orthonormal ones."""
    root = np.sqrt(mass).repeat(3)[:, None]
    known, A = (root * f.reshape(len(root), -1) for f in (beside, fields))
    U, sizes, _ = np.linalg.svd(A - known @ (known.T @ A), full_matrices=False)
    U = U[:, : min(most, int((sizes > DEPENDENT * sizes[0]).sum()))]  # the others are round-off
    return np.where(root > 0, U / np.where(root > 0, root, 1), 0.0).reshape(len(fields), 3, -1)


def orthonormal_fields(
    fields: Float[np.ndarray, "points *components dofs"],
    mass: Float[np.ndarray, "points"],
    tolerance: float = DEPENDENT,
) -> Float[np.ndarray, "points *components kept"]:
    """M-orthonormal fields of the same span, by QR with pivots; what depends on others goes."""
    from scipy.linalg import qr

    count, shape = fields.shape[-1], fields.shape[:-1]
    root = np.sqrt(mass).repeat(int(np.prod(shape[1:])))
    scaled = root[:, None] * fields.reshape(-1, count)
    size = np.linalg.norm(scaled, axis=0)
    scaled = scaled[:, size > 0] / size[size > 0]
    Q, R = (np.asarray(a) for a in qr(scaled, mode="economic", pivoting=True)[:2])
    diagonal = np.abs(np.diag(R))
    kept = int((diagonal > tolerance * diagonal[0]).sum())
    out = np.zeros((len(root), kept))
    out[root > 0] = Q[root > 0, :kept] / root[root > 0, None]
    return out.reshape(*shape, kept)
