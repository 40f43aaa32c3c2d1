"""From a mesh to its reduced model: a basis, cells to sum over, and how good they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import single_threaded
from ..discrete.forces import load_vector
from ..discrete.space import element_points
from ..errors import ConvergenceError
from ..model_error import MOTION_LIMIT, too_coarse
from ..scene.loads import Traction
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from ..solve.discretisation_error import motion_elements
from ..solve.nonlinear import solve_nonlinear
from ..validation import checked_count
from .cubature import RIGID, Cubature, select_cells, training
from .elasticity import ReducedElasticity
from .gradients import basis_gradients
from .model import Accuracy, ReducedModel, Subspace
from .rest import reduced_frequencies, reduced_rest
from .skinning import (
    FITTED,
    HANDLES,
    bent_beside,
    modal_weights,
    skinned_basis,
    skinned_functions,
    turning_functions,
)
from .subspace import DERIVED, LinearBody, linear_body, vector_basis

GRAVITY = (0.0, 0.0, -9.81)
# Cells that are tried, until frequency and sag agree with all tets to this share.
CELLS = (60, 90, 120, 180, 250, 320, 400)
ACCEPTED = 2e-3
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
        fields = vector_basis(body, dead, checked_count("derived", derived))
        whole = whole_model(body, fields, Subspace.VECTOR)
    else:
        wanted = (checked_count("handles", handles), dead, acting)
        skin = _skinning(body, *wanted) if kind is Subspace.SKINNING else turning_functions(body)
        whole = whole_model(body, skinned_basis(skin), Subspace.SKINNING)
    known = whole.accuracy._replace(stiffening=1.0 if used == 2 else stiffening)
    whole = replace(whole, accuracy=known)
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
    )
    ratio = _lowest(ReducedElasticity(model)) / float(body.modes.frequencies[0])
    return replace(model, accuracy=Accuracy(frequency=ratio))


def with_cells(
    whole: ReducedModel,
    load: Float[np.ndarray, "dofs"],
    most: int,
    *,
    seed: int = 0,
    accepted: float = ACCEPTED,
) -> ReducedModel:
    """Model of few cells, at most so many: as few as agree with ``whole`` in frequency and sag.

    The sag is that under ``load``, forces on the coordinates [N/sqrt(kg)]. Where none do, the one
    with the most cells is returned; its ``accuracy`` tells.
    """
    elasticity = ReducedElasticity(whole)
    found = training(elasticity, load, size=_size(whole), seed=seed)
    known = _Reference(_lowest(elasticity), _rest(elasticity, load))
    cubature: Cubature | None = None
    model = whole
    for count in [n for n in CELLS if n < most] + [most]:
        if count >= len(whole.cells):
            break
        cubature = select_cells(found, count, start=cubature)
        model = _checked(whole, found.cells[cubature.cells], cubature.factor, load, known)
        if model.accuracy.cell_error <= accepted:
            return model
    return whole if cubature is None else model


class _Reference(NamedTuple):
    """Lowest frequency [Hz] and coordinates at rest of the model with all tets; None: no rest."""

    frequency: float
    rest: np.ndarray | None


def _checked(
    whole: ReducedModel,
    cells: np.ndarray,
    factor: np.ndarray,
    load: np.ndarray,
    known: _Reference,
) -> ReducedModel:
    model = whole.on_cells(cells, factor * whole.weights[cells])
    elasticity = ReducedElasticity(model)
    ratio, sag = _lowest(elasticity) / known.frequency, np.nan
    if known.rest is not None:
        rest = _rest(elasticity, load, known.rest)
        size = float(np.linalg.norm(known.rest))
        sag = np.inf if rest is None else float(np.linalg.norm(rest - known.rest)) / size
    accuracy = whole.accuracy._replace(cell_frequency=ratio, cell_sag=sag)
    return replace(model, accuracy=accuracy._replace(frequency=whole.accuracy.frequency * ratio))


def measured(
    model: ReducedModel, mesh: TetMesh, supports: Supports, gravity_vector=GRAVITY
) -> ReducedModel:
    """The same model with its sag measured against the full body's, which is solved for it.

    Both under their own weight, with the same elements and the neo-Hookean law.
    """
    forces = model.mass[:, None] * np.asarray(gravity_vector, dtype=float)
    full = solve_nonlinear(mesh, supports, forces=forces, order=model.order).node_displacement
    rest = _rest(ReducedElasticity(model), model.weight(gravity_vector))
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


def _lowest(elasticity: ReducedElasticity) -> float:
    """Lowest frequency [Hz] that is no rigid motion."""
    frequencies = reduced_frequencies(elasticity)
    return float(frequencies[frequencies > np.sqrt(RIGID) * frequencies[-1]][0])


def _rest(
    elasticity: ReducedElasticity, load: np.ndarray, start: np.ndarray | None = None
) -> np.ndarray | None:
    """Coordinates at rest under the load; None of a free body, or where none is found."""
    K = elasticity.tangent(np.zeros(len(load)))
    if not load.any() or np.linalg.eigvalsh(K)[0] < RIGID * np.abs(K).max():
        return None
    try:
        return reduced_rest(elasticity, load, start=start).u
    except ConvergenceError:
        return None


def _size(model: ReducedModel) -> float:
    """Longest side of the body [m]."""
    return float(np.ptp(model.points[model.mass > 0], axis=0).max())
