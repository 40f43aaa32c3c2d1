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
from ..discrete.block_matrix import add_diagonal
from ..discrete.constraints import apply_supports, node_supports
from ..discrete.elastic import ElasticBody
from ..discrete.mass import lumped_mass
from ..discrete.space import Space
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
# A free body's stiffness is raised by its mass times this share of its first frequency's square.
RAISED = 1e-3
# Relative residual of a static response.
TOLERANCE = 1e-8


class LinearBody(NamedTuple):
    """A body about rest on the nodes of ``grid``, which the points of ``mesh`` are the first of.

    Lumped ``mass`` [kg] (nodes,), its ``modes``, and what holds the nodes. ``compliance`` gives the
    displacements [m] of forces [N], each (loads, nodes, 3), of a free body but for rigid motions.
    """

    mesh: TetMesh
    held: Supports
    grid: Discretisation
    mass: np.ndarray
    modes: Modes
    compliance: Callable[[np.ndarray], np.ndarray]

    @property
    def space(self) -> Space:
        """Nodes and elements."""
        return self.grid.space

    @property
    def is_free(self) -> bool:
        """Whether nothing holds it."""
        return not (self.held.fixed.any() or self.held.springs.any())

    @property
    def size(self) -> float:
        """Longest side [m]."""
        return float(np.ptp(self.mesh.bounds, axis=0).max())


def linear_body(
    mesh: TetMesh, supports: Supports | None, modes: int = MODES, *, order: int = 1
) -> LinearBody:
    """Vibrations and compliance of ``mesh`` with elements of ``order`` and lumped mass.

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
    grid = discretise(mesh, order)
    held = node_supports(held, grid.space)
    found = natural_modes(mesh, modes, supports=held, order=order, lumped=True)
    mass = lumped_mass(mesh, grid.space)
    free = not (held.fixed.any() or held.springs.any())
    raised = RAISED * (2 * np.pi * found.frequencies[0]) ** 2 * mass if free else 0 * mass
    return LinearBody(mesh, held, grid, mass, found, _compliance(mesh, held, grid, raised))


def _compliance(
    mesh: TetMesh, held: Supports, grid: Discretisation, raised: np.ndarray
) -> Callable[[np.ndarray], np.ndarray]:
    def solve(forces: np.ndarray) -> np.ndarray:
        matrix = linear_stiffness(grid, material_of(mesh))
        if raised.any():
            add_diagonal(matrix, raised[:, None, None] * np.eye(3))
        apply_supports(matrix, held.fixed, held.springs)
        b = np.where(held.fixed, 0.0, forces)
        plan = planned_elimination(matrix, grid.space.edges)
        if plan.entries <= MOST_ENTRIES:  # the factor that the modes were found with
            together = np.ascontiguousarray(np.moveaxis(b, 0, 2))
            return np.moveaxis(known_factor(matrix, plan).solve(together), 2, 0)
        known = {"points": grid.space.nodes, "fixed": held.fixed, "edges": grid.space.edges}
        found = [solve_system(matrix, load, **known, tolerance=TOLERANCE) for load in b]
        if wrong := [s.residual for s in found if not s.reached(TOLERANCE)]:
            raise ConvergenceError(f"a response was found to {max(wrong):.2g} only")
        return np.stack([s.x for s in found])

    return solve


def load_responses(
    body: LinearBody, forces: Float[np.ndarray, "nodes 3"] | None = None
) -> Float[np.ndarray, "loads nodes 3"]:
    """Displacements [m] of a held body under 1 m/s^2 along x, y, z, and under ``forces`` [N]."""
    loads = [body.mass[:, None] * axis for axis in np.eye(3)]
    if forces is not None and np.any(forces):
        loads.append(forces)
    return body.compliance(np.stack(loads))


def derivatives(
    body: LinearBody, fields: Float[np.ndarray, "fields nodes 3"]
) -> Float[np.ndarray, "pairs nodes 3"]:
    """How every two of ``fields`` bend on together, under the neo-Hookean law.

    Linear in each of the two; ``fields`` are taken at a thousandth of the body's size.
    """
    elastic = ElasticBody(body.grid, material_of(body.mesh), Law.NEO_HOOKEAN)
    scale = PROBE * body.size / np.abs(fields).max(axis=(1, 2))
    probes = fields * scale[:, None, None]

    def even(u: np.ndarray) -> np.ndarray:
        """f''(u, u), since what is odd in u cancels."""
        return elastic.response(u).force + elastic.response(-u).force

    own, pushes = [even(a) for a in probes], []
    for i, a in enumerate(probes):
        for j, b in enumerate(probes[i:], i):
            mixed = own[i] if i == j else (even(a + b) - own[i] - own[j]) / 2
            pushes.append(-mixed / (scale[i] * scale[j]))
    return body.compliance(np.stack(pushes))


def vector_basis(
    body: LinearBody, forces: Float[np.ndarray, "nodes 3"] | None = None, derived: int = DERIVED
) -> Float[np.ndarray, "nodes 3 dofs"]:
    """Modes, responses to loads and derivatives of a held body, as fields of vectors.

    At most 34 coordinates with 21 ``derived`` fields, 49 with all 36; with the response to
    ``forces`` [N] beside those to weight one more, and 9 more derivatives. Which are kept is said
    by principal components, of modes as large as the same force makes them (Barbic & James 2005).
    """
    if body.is_free:
        raise InputError("a free body turns, which no fields of vectors follow: take functions")
    responses = unit_responses(body, forces)
    linear = np.moveaxis(np.concatenate([body.modes.shapes, responses]), 0, 2)
    second = bent_fields(body, responses)
    kept = principal_fields(second, orthonormal_fields(linear, body.mass), body.mass, derived)
    return orthonormal_fields(np.concatenate([linear, kept], axis=2), body.mass)


def unit_responses(
    body: LinearBody, forces: Float[np.ndarray, "nodes 3"] | None = None
) -> Float[np.ndarray, "loads nodes 3"]:
    """``load_responses`` of unit norm in mass [1/sqrt(kg)]."""
    responses = load_responses(body, forces)
    size = np.sqrt(np.einsum("n,kni,kni->k", body.mass, responses, responses))
    return responses / size[:, None, None]


def bent_fields(
    body: LinearBody, responses: Float[np.ndarray, "loads nodes 3"]
) -> Float[np.ndarray, "nodes 3 fields"]:
    """Derivatives of the first modes, as large as the same force makes them, and ``responses``."""
    share = (body.modes.frequencies[0] / body.modes.frequencies[:BENT]) ** 2
    modes = body.modes.shapes[:BENT] * share[:, None, None]
    return np.moveaxis(derivatives(body, np.concatenate([modes, responses])), 0, 2)


def principal_fields(
    fields: Float[np.ndarray, "points *components fields"],
    beside: Float[np.ndarray, "points *components known"],
    mass: Float[np.ndarray, "points"],
    most: int,
) -> Float[np.ndarray, "points *components kept"]:
    """First ``most`` principal components of what ``fields`` have outside M-orthonormal ones."""
    shape = fields.shape[:-1]
    root = np.sqrt(mass).repeat(int(np.prod(shape[1:])))[:, None]
    known, A = (root * f.reshape(len(root), -1) for f in (beside, fields))
    U, sizes, _ = np.linalg.svd(A - known @ (known.T @ A), full_matrices=False)
    U = U[:, : min(most, int((sizes > DEPENDENT * sizes[0]).sum()))]  # the others are round-off
    return np.where(root > 0, U / np.where(root > 0, root, 1), 0.0).reshape(*shape, -1)


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
