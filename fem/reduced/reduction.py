"""From a mesh to its reduced model: a basis, cells to sum over, and how good they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ..cholesky.elimination import planned_elimination
from ..cholesky.factor import CholeskyFactor
from ..device import single_threaded
from ..discrete.constraints import apply_supports
from ..discrete.elastic import ElasticBody
from ..discrete.forces import load_vector
from ..discrete.space import element_points
from ..laws.law import Law
from ..linalg.solver import MOST_ENTRIES
from ..model_error import MOTION_LIMIT, too_coarse
from ..scene.loads import Traction
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from ..solve.discretisation_error import motion_elements
from ..solve.nonlinear import solve_nonlinear
from ..validation import checked_count
from .cubature import CELLS, drawn_cells, with_cells
from .elasticity import ReducedElasticity, basis_gradients
from .model import Accuracy, ReducedModel, Subspace
from .rest import held_rest, lowest_frequency
from .skinning import (
    FITTED,
    HANDLES,
    bent_beside,
    modal_weights,
    skinned_basis,
    skinned_functions,
    turning_functions,
)
from .subspace import (
    DERIVED,
    LinearBody,
    linear_body,
    orthonormal_fields,
    principal_fields,
    vector_basis,
)

GRAVITY = (0.0, 0.0, -9.81)
# A body swings far whose linear response to SWINGS of its load is beyond this share of its size.
SWINGS, FAR = (1.0, 2.0), 0.25
# Of quadratic elements that are reduced where linear ones lock: some ten CPU seconds.
MOST_UNKNOWNS = 60_000
# Beyond these the model is not what it says: its frequency and its sag against the full body's.
FREQUENCY_LIMIT, SAG_LIMIT = 0.01, 0.03


@single_threaded
def reduce_body(
    mesh: TetMesh,
    supports: Supports | None = None,
    *,
    gravity_vector=GRAVITY,
    traction: Traction | Sequence[Traction] = (),
    forces: Float[np.ndarray, "points 3"] | None = None,
    order: int | None = None,
    kind: Subspace = Subspace.VECTOR,
    derived: int = DERIVED,
    handles: int = HANDLES,
    most_cells: int = CELLS[-1],
    seed: int = 0,
) -> ReducedModel:
    """Reduced model of ``mesh`` as it is held, with the neo-Hookean law.

    Parameters
    ----------
    supports
        What holds it; None: nothing does.
    gravity_vector, traction, forces
        What will act: gravity [m/s^2], shape (3,), forces per area [Pa] on faces, and other forces
        [N] at the points, shape (points, 3). A held body's basis can follow them, and the cells are
        accepted by them.
    order
        Of the elements; None: quadratic where linear ones lock, up to ``MOST_UNKNOWNS``.
    kind
        What the coordinates move: fields of vectors, of a free body their components; or handles.
    derived
        Fields of a vector basis that say how others bend on: 21 make 34 coordinates, 36 make 49.
    handles
        Handles of a skinned body; beside these a free one has its affine motion.
    most_cells
        Most cells that the energy is summed over; 0: as many as the full body's.
    seed
        Of the states that the cells are chosen by.

    Raises
    ------
    InputError
        Where supports move, a point is half held (skinning), or the material has a grain.
    ConvergenceError
        Where a piece of a held body can move freely.
    """
    used, stiffening = motion_elements(mesh, supports, order, most=MOST_UNKNOWNS)
    body = linear_body(mesh, supports, order=used)
    dead = load_vector(mesh, body.grid, traction=traction, forces=forces)
    acting = body.mass[:, None] * np.asarray(gravity_vector, dtype=float) + dead
    if kind is not Subspace.SKINNING and not body.is_free:
        whole = _vector(body, dead, acting, checked_count("derived", derived))
    else:
        wanted = (checked_count("handles", handles), dead, acting)
        skin = _skinning(body, *wanted) if kind is Subspace.SKINNING else turning_functions(body)
        whole = whole_model(body, skinned_basis(skin), Subspace.SKINNING)
    stiffening = 1.0 if used == 2 else stiffening
    return on_few_cells(whole, acting, most_cells, stiffening=stiffening, seed=seed)


def on_few_cells(
    whole: ReducedModel,
    acting: Float[np.ndarray, "nodes 3"],
    most_cells: int,
    *,
    stiffening: float,
    seed: int = 0,
) -> ReducedModel:
    """The model with its ``stiffening``, on cells accepted by the forces ``acting`` [N]; 0: all."""
    whole = replace(whole, accuracy=whole.accuracy._replace(stiffening=stiffening))
    if not most_cells:
        return whole
    return with_cells(whole, whole.pull_back(acting), most_cells, seed=seed)


def whole_model(
    body: LinearBody, basis: Float[np.ndarray, "nodes 3 dofs"], kind: Subspace
) -> ReducedModel:
    """Model of an M-orthonormal ``basis`` whose energy is summed as that of the full body."""
    mesh, space, material = body.mesh, body.space, material_of(body.mesh)
    count = len(element_points(space.order))
    cells = np.repeat(np.arange(len(mesh.tets)), count)
    flat = basis.reshape(-1, basis.shape[2])
    model = ReducedModel(
        points=space.nodes,
        edges=space.edges,
        faces=mesh.boundary.faces.astype(np.int64),
        mass=body.mass,
        basis=basis,
        kind=kind,
        cells=cells,
        weights=mesh.volumes[cells] / count,
        gradients=basis_gradients(mesh, space, basis),
        E=material.E[cells],
        nu=material.nu[cells],
        region=mesh.region[cells].astype(np.int64),
        region_names=mesh.region_names,
        springs=flat.T @ (body.held.springs.reshape(-1, 1) * flat),
    ).checked()
    ratio = lowest_frequency(ReducedElasticity(model).tangent(np.zeros(model.dofs))) / float(
        body.modes.frequencies[0]
    )
    return replace(model, accuracy=Accuracy(frequency=ratio))


def measured(
    model: ReducedModel, mesh: TetMesh, supports: Supports, gravity_vector=GRAVITY
) -> ReducedModel:
    """The same model with its sag measured against the full body's, which is solved for it.

    Both under their own weight, with the same elements and the neo-Hookean law.
    """
    forces = model.mass[:, None] * np.asarray(gravity_vector, dtype=float)
    full = solve_nonlinear(mesh, supports, forces=forces, order=model.order).node_displacement
    rest = held_rest(ReducedElasticity(model), model.weight(gravity_vector))
    error = np.inf if rest is None else relative_error(model, model.displacement(rest), full)
    return replace(model, accuracy=model.accuracy._replace(sag=error))


def relative_error(
    model: ReducedModel,
    found: Float[np.ndarray, "*frames nodes 3"],
    wanted: Float[np.ndarray, "*frames nodes 3"],
) -> float:
    """Error of displacements over the wanted ones [1], in the norm of mass, all frames together."""
    mass = model.mass[:, None]
    error, size = (mass * (found - wanted) ** 2).sum(), (mass * wanted**2).sum()
    return float(np.sqrt(error / size)) if size > 0 else 0.0 if error == 0 else np.inf


def accuracy_warnings(model: ReducedModel) -> tuple[str, ...]:
    """What to say where a model is not as good as it should be."""
    ratio, sag, cell_ratio, cell_sag, motion, stiffening = model.accuracy
    found = [] if (coarse := too_coarse(stiffening)) is None else [f"{coarse}; convert it finer"]
    if model.kind is Subspace.VECTOR and np.isfinite(cell_ratio) and np.isnan(cell_sag):
        found.append(
            f"{len(model.cells)} cells were chosen by the frequency alone: nothing loads the body, "
            "or no rest under its load was found"
        )
    if abs(ratio - 1) > FREQUENCY_LIMIT:
        found.append(f"the reduced body's lowest frequency is {ratio:.3f} times the full one's")
    if sag > SAG_LIMIT:
        found.append(f"the reduced body sags otherwise than the full one, by {sag:.1%}")
    if cell_sag > SAG_LIMIT:
        found.append(f"{len(model.cells)} cells sag otherwise than all tets, by {cell_sag:.1%}")
    if motion > MOTION_LIMIT:
        found.append(f"the reduced body moves otherwise than the full one, by about {motion:.1%}")
    return tuple(found)


def _vector(body: LinearBody, dead: np.ndarray, acting: np.ndarray, derived: int) -> ReducedModel:
    """Model of a vector basis with all tets; of as many coordinates where the body swings far."""
    whole = whole_model(body, vector_basis(body, dead, derived), Subspace.VECTOR)
    linear = body.compliance(acting[None])[0]
    if SWINGS[-1] * np.abs(linear).max() < FAR * body.size:
        return whole
    swung = swung_fields(body, whole, acting)
    kept = vector_basis(body, dead, max(0, derived - swung.shape[2]))
    far = principal_fields(swung, kept, body.mass, swung.shape[2])
    basis = orthonormal_fields(np.concatenate([kept, far], axis=2), body.mass)
    return whole_model(body, basis, Subspace.VECTOR)


def swung_fields(
    body: LinearBody, model: ReducedModel, acting: Float[np.ndarray, "nodes 3"]
) -> Float[np.ndarray, "nodes 3 states"]:
    """Displacements [m] under the forces ``acting`` [N] and twice these, nearly at rest.

    A body let go under its load swings to twice its sag. Each is the rest of the reduced body and
    one step of Newton of the full one from there: what bends far needs fields that derivatives at
    rest, of the second order, do not have.
    """
    few = ReducedElasticity(drawn_cells(model))
    elastic = ElasticBody(body.grid, material_of(body.mesh), Law.NEO_HOOKEAN)
    plan = planned_elimination(body.grid.pattern, body.space.edges)
    found, q = [], None
    for share in SWINGS:
        q = held_rest(few, share * model.pull_back(acting), start=q)
        if q is None or plan.entries > MOST_ENTRIES:
            break
        u = model.displacement(q)
        left = share * acting - elastic.response(u).force - body.held.springs * u
        matrix = elastic.tangent(u, projected=True)
        apply_supports(matrix, body.held.fixed, body.held.springs)
        factor = CholeskyFactor(matrix, plan)
        found.append(u + factor.solve(np.where(body.held.fixed, 0.0, left)))
    return np.stack(found, axis=2) if found else np.zeros((*acting.shape, 0))


def _skinning(
    body: LinearBody, handles: int, forces: np.ndarray, acting: np.ndarray
) -> Float[np.ndarray, "nodes _"]:
    """Scalar functions of the modal weights that come nearest to the linear body."""
    best: tuple[float, np.ndarray] | None = None
    beside = bent_beside(body, forces)
    for fitted in FITTED:
        weights = modal_weights(body, handles, fitted, beside=beside)
        functions = skinned_functions(body, weights, free=body.is_free)
        model = whole_model(body, skinned_basis(functions), Subspace.SKINNING)
        error = abs(model.accuracy.frequency - 1) + _linear_error(body, model, acting)
        if best is None or error < best[0]:
            best = error, functions
    assert best is not None
    return best[1]


def _linear_error(body: LinearBody, model: ReducedModel, acting: np.ndarray) -> float:
    """Relative error of the linear response to the forces ``acting`` (nodes, 3) [N]."""
    if body.is_free or not acting.any():
        return 0.0
    K = ReducedElasticity(model).tangent(np.zeros(model.dofs))
    found = model.displacement(np.linalg.solve(K, model.pull_back(acting)))
    return relative_error(model, found, body.compliance(acting[None])[0])
