"""From a mesh to its reduced model: a basis, cells to sum over, and how good they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ..device import single_threaded
from ..elements.assembly import (
    Discretisation,
    add_diagonal,
    apply_supports,
    discretise,
    linear_stiffness,
    node_supports,
)
from ..elements.elastic import ElasticBody, displacement_gradients
from ..elements.forces import load_vector, lumped_mass, weighing_mass
from ..elements.space import Space, element_points, extend_linear, make_space
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.cholesky import CholeskyFactor, cached_factor, planned_elimination
from ..linalg.solver import MOST_ENTRIES, solve_system
from ..mesh import TetMesh, material_of, tet_area_vectors
from ..note import Note
from ..scene.loads import Traction
from ..scene.supports import Supports
from ..solve.error import motion_elements
from ..solve.modal import natural_modes
from ..solve.nonlinear import solve_nonlinear
from ..solve.result import MOTION_LIMIT, Modes, too_coarse
from ..solve.statics import check_held
from ..validation import checked_count
from .cubature import CELLS, drawn_cells, with_cells
from .elasticity import ReducedElasticity, held_rest, lowest_frequency
from .model import Accuracy, ReducedModel, Subspace

# What a body's coordinates should move: vibrations, responses to weight, and how both bend on.
#
# The vector basis of a held body: linear modes alone lock, since a mode that bends far needs
# another to go with it. Those are the derivatives (Idelsohn & Cardona 1985; Barbic & James 2005),
# by the internal force's mixed second difference: K d_ij = -f''(x_i, x_j).

# Modes of the vector basis; of the first so many, and of the responses to loads, derivatives, of
# which so many principal fields are kept.
MODES, BENT, DERIVED = 10, 5, 21
# Fields that add less than this to the span of the others, over the first, are dropped.
DEPENDENT = 1e-6
# Size of the second difference, over the body's: the cubic part is then 1e-6 of it.
PROBE = 1e-3
# A free body's stiffness is raised by its mass times this fraction of its first frequency's square.
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

    def weight(self, gravity_vector: Sequence[float] | np.ndarray) -> np.ndarray:
        """Forces [N] of ``gravity_vector`` (3,) [m/s^2] on the nodes, (nodes, 3)."""
        mass = weighing_mass(self.mesh, self.grid, self.held)
        return mass[:, None] * np.asarray(gravity_vector, dtype=float)

    @property
    def size(self) -> float:
        """Longest side [m]."""
        return float(np.ptp(self.mesh.bounds, axis=0).max())


def linear_body(mesh: TetMesh, supports: Supports | None, *, order: int = 1) -> LinearBody:
    """Vibrations and compliance of ``mesh`` with elements of ``order`` and lumped mass.

    Raises InputError: Where a prescribed displacement is not zero, or the material has a grain.
    """
    held, material = supports or Supports.none(len(mesh.points)), material_of(mesh)
    if (held.values * held.fixed).any():
        raise InputError("basis.reduced_body")
    if material.tensor is not None:
        raise InputError("basis.reduced_body_knows")
    free = not (held.fixed.any() or held.springs.any())
    if not free:
        check_held(mesh, held)
    grid = discretise(mesh, order)
    held = node_supports(held, grid.space)
    vibrations = natural_modes(mesh, MODES, supports=held, order=order, lumped=True)
    mass = lumped_mass(mesh, grid.space)
    raised = RAISED * (2 * np.pi * vibrations.frequencies[0]) ** 2 * mass

    def compliance(forces: np.ndarray) -> np.ndarray:
        matrix = linear_stiffness(grid, material)
        if free:
            add_diagonal(matrix, raised[:, None, None] * np.eye(3))
        apply_supports(matrix, held.fixed, held.springs)
        b = np.where(held.fixed, 0.0, forces)
        plan = planned_elimination(matrix, grid.space.edges)
        if plan.entries <= MOST_ENTRIES:  # the factor that the modes were found with
            together = np.ascontiguousarray(np.moveaxis(b, 0, 2))
            return np.moveaxis(cached_factor(matrix, plan).solve(together), 2, 0)
        options = {"points": grid.space.nodes, "fixed": held.fixed, "edges": grid.space.edges}
        solved = [solve_system(matrix, load, **options, tolerance=TOLERANCE) for load in b]
        if wrong := [s.residual for s in solved if not s.reached(TOLERANCE)]:
            raise ConvergenceError("basis.response_found", wrong=max(wrong))
        return np.stack([s.x for s in solved])

    return LinearBody(mesh, held, grid, mass, vibrations, compliance)


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

    alone, pushes = [even(a) for a in probes], []
    for i, a in enumerate(probes):
        for j, b in enumerate(probes[i:], i):
            mixed = alone[i] if i == j else (even(a + b) - alone[i] - alone[j]) / 2
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
        raise InputError("basis.free_body")
    responses = unit_responses(body, forces)
    linear = np.moveaxis(np.concatenate([body.modes.shapes, responses]), 0, 2)
    second = bent_fields(body, responses)
    kept = principal_fields(second, orthonormal_fields(linear, body.mass), body.mass, derived)
    return orthonormal_fields(np.concatenate([linear, kept], axis=2), body.mass)


def unit_responses(
    body: LinearBody, forces: Float[np.ndarray, "nodes 3"] | None = None
) -> Float[np.ndarray, "loads nodes 3"]:
    """Responses of a held body to weight along x, y, z and to ``forces`` [N], of unit norm in mass.

    Displacements over the root of the mass [1/sqrt(kg)].
    """
    loads = [body.weight(axis) for axis in np.eye(3)]
    if forces is not None and np.any(forces):
        loads.append(forces)
    responses = body.compliance(np.stack(loads))
    size = np.sqrt(np.einsum("n,kni,kni->k", body.mass, responses, responses))
    return responses / size[:, None, None]


def bent_fields(
    body: LinearBody, responses: Float[np.ndarray, "loads nodes 3"]
) -> Float[np.ndarray, "nodes 3 fields"]:
    """Derivatives of the first modes, as large as the same force makes them, and ``responses``."""
    softness = (body.modes.frequencies[0] / body.modes.frequencies[:BENT]) ** 2
    modes = body.modes.shapes[:BENT] * softness[:, None, None]
    return np.moveaxis(derivatives(body, np.concatenate([modes, responses])), 0, 2)


def principal_fields(
    fields: Float[np.ndarray, "points *components fields"],
    beside: Float[np.ndarray, "points *components others"],
    mass: Float[np.ndarray, "points"],
    most: int,
) -> Float[np.ndarray, "points *components kept"]:
    """First ``most`` principal components of what ``fields`` have outside M-orthonormal ones."""
    shape = fields.shape[:-1]
    root = np.sqrt(mass).repeat(int(np.prod(shape[1:])))[:, None]
    B, A = (root * f.reshape(len(root), -1) for f in (beside, fields))
    U, sizes, _ = np.linalg.svd(A - B @ (B.T @ A), full_matrices=False)
    some = int((sizes > DEPENDENT * sizes.max(initial=0.0)).sum())  # the others are round-off
    U = U[:, : min(most, some)]
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


# Skinning weights: what a body's handles carry, u = sum_h w_h(x) T_h (x, y, z, 1).
#
# Modal skinning: weights by alternating least squares, so that the handles can make the body's
# modes, its response to weight, and how these bend on. Given the weights, the transforms T are
# linear least squares; given the transforms, the weights of every point are. Laplacian eigenmodes,
# which it starts from, lock: w (x, y, z, 1) has no anticlastic curvature.

# Scalar functions of a free body beside (x, y, z, 1): as many as ten handles have.
HANDLES, FUNCTIONS = 10, 40
# Modes that weights are fitted to: the best of these is kept, more spoil them.
FITTED = (3, 4, 6)
# Principal derivatives that weights are fitted to, and their size beside a mode's.
BENDS, BEND_SIZE = 4, 0.3
SWEEPS = 30
# Of the normal matrices' mean diagonal: transforms, and the change of the weights in a sweep.
RIDGE_TRANSFORMS, RIDGE_WEIGHTS = 1e-8, 1e-4
# Scalar functions that depend on others to this fraction of the first are dropped.
SKINNING_DEPENDENT = 1e-7


def affine_coordinates(
    mesh: TetMesh, nodes: Float[np.ndarray, "nodes 3"]
) -> Float[np.ndarray, "nodes 4"]:
    """(x, y, z, 1) of every node, about the middle and over the body's longest side."""
    middle, side = mesh.bounds.mean(axis=0), np.ptp(mesh.bounds, axis=0).max()
    return np.concatenate([(nodes - middle) / side, np.ones((len(nodes), 1))], axis=1)


def skinned_functions(
    body: LinearBody, weights: Float[np.ndarray, "nodes handles"], *, free: bool
) -> Float[np.ndarray, "nodes functions"]:
    """M-orthonormal scalar functions of the span of w_h (x, y, z, 1).

    ``free``: and of (x, y, z, 1) itself, so that the body can turn and deform as a whole.
    """
    affine = affine_coordinates(body.mesh, body.space.nodes)
    products = (weights[:, :, None] * affine[:, None, :]).reshape(len(weights), -1)
    functions = np.concatenate([affine, products], axis=1) if free else products
    return orthonormal_fields(functions, body.mass, SKINNING_DEPENDENT)


def turning_functions(
    body: LinearBody, most: int = FUNCTIONS
) -> Float[np.ndarray, "nodes functions"]:
    """M-orthonormal scalar functions of a free body: (x, y, z, 1) and at most so many others.

    Those are the principal components of the x, y and z of its modes and of how they bend on. Along
    all three axes each, they hold every turn of what they hold: no frame has to follow the body.
    """
    affine = orthonormal_fields(affine_coordinates(body.mesh, body.space.nodes), body.mass)
    modes = body.modes.shapes * (body.modes.frequencies[0] / body.modes.frequencies[:, None, None])
    bent = bent_fields(body, np.zeros((0, *body.space.nodes.shape)))
    bent = principal_fields(bent, np.zeros((*body.space.nodes.shape, 0)), body.mass, len(modes))
    fields = np.concatenate([np.moveaxis(modes, 0, 2), BEND_SIZE * bent], axis=2)
    apart = fields.reshape(len(body.mass), -1)
    functions = principal_fields(apart, affine, body.mass, most)
    return orthonormal_fields(np.concatenate([affine, functions], axis=1), body.mass)


def skinned_basis(
    functions: Float[np.ndarray, "nodes functions"],
) -> Float[np.ndarray, "nodes 3 dofs"]:
    """The same functions along x, y and z, axis by axis."""
    return np.einsum("ij,na->nija", np.eye(3), functions).reshape(len(functions), 3, -1)


def laplacian_weights(
    mesh: TetMesh, count: int, held: Bool[np.ndarray, "points"]
) -> Float[np.ndarray, "points count"]:
    """Lowest eigenmodes of L_E w = lambda M w, zero where ``held``, of unit mass.

    L_E is the Laplacian with E of every tet; of a free body the constant one is left out
    (skinning eigenmodes: Benchekroun et al. 2023, here with our stiffness).
    """
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import eigsh

    E, faces = material_of(mesh).E, tet_area_vectors(mesh.points, mesh.tets)
    local = np.einsum("ait,bit->tab", faces, faces) * (E / (9 * mesh.volumes))[:, None, None]
    rows, columns = np.repeat(mesh.tets, 4, axis=1).ravel(), np.tile(mesh.tets, (1, 4)).ravel()
    size = len(mesh.points)
    L = coo_array((local.ravel(), (rows, columns)), shape=(size, size)).tocsc()
    mass = lumped_mass(mesh, make_space(mesh, 1))
    free = (mass > 0) & ~held
    rigid = 0 if held.any() else 1
    shift = -1e-3 * E.min() * mesh.volume / (np.ptp(mesh.bounds, axis=0).max() ** 2 * mass.sum())
    start = np.random.default_rng(0).normal(size=int(free.sum()))
    inner, M = L[free][:, free].tocsc(), diags_array(mass[free]).tocsc()
    values, vectors = eigsh(inner, k=count + rigid, M=M, sigma=shift, v0=start)
    out = np.zeros((size, count))
    out[free] = vectors[:, np.argsort(values)[rigid:]]
    return out


def modal_weights(
    body: LinearBody,
    handles: int,
    fitted: int,
    *,
    beside: Float[np.ndarray, "nodes 3 fields"] | None = None,
) -> Float[np.ndarray, "nodes handles"]:
    """Weights of so many ``handles`` that can make the first ``fitted`` modes.

    And the fields ``beside`` [1/sqrt(kg)], by default ``bent_beside``; they vanish on what holds
    the body.

    Raises InputError: Where a point is held in some directions only.
    """
    fixed = np.asarray(body.held.fixed.any(axis=1))
    if (fixed & ~body.held.fixed.all(axis=1)).any():
        raise InputError("basis.point_held")
    laplacian = laplacian_weights(body.mesh, handles, fixed[: len(body.mesh.points)])
    weights = extend_linear(body.space, laplacian)
    # Modes, as large as in a motion by f1 / f, and what is beside them, as (x, y, z)
    modes = body.modes
    fields = modes.shapes[:fitted] * (modes.frequencies[0] / modes.frequencies[:fitted, None, None])
    beside = bent_beside(body) if beside is None else beside
    targets = np.concatenate([np.moveaxis(fields, 0, 2), beside], axis=2)
    targets = targets.swapaxes(1, 2).reshape(len(body.mass), -1)
    affine = affine_coordinates(body.mesh, body.space.nodes)
    root = np.sqrt(body.mass)[:, None]
    free = (body.mass > 0) & ~fixed
    for _ in range(SWEEPS):
        # Transforms (handles, 4, targets) of the given weights; that of the whole comes last
        products = (weights[:, :, None] * affine[:, None, :]).reshape(len(weights), -1)
        if body.is_free:
            products = np.concatenate([products, affine], axis=1)
        A = root * products
        normal = A.T @ A
        normal += RIDGE_TRANSFORMS * np.trace(normal) / len(normal) * np.eye(len(normal))
        maps = np.linalg.solve(normal, A.T @ (root * targets)).reshape(-1, 4, targets.shape[1])
        # Weights of every node for these transforms: a small least squares each
        made = np.einsum("na,has->nsh", affine, maps, optimize=True)
        left = targets - made[:, :, handles:].sum(axis=2)
        B = made[:, :, :handles]
        normal = B.swapaxes(1, 2) @ B
        ridge = RIDGE_WEIGHTS * np.trace(normal.mean(axis=0)) / handles
        right = (B.swapaxes(1, 2) @ left[:, :, None])[..., 0] + ridge * weights
        solved = np.linalg.solve(normal + ridge * np.eye(handles), right[..., None])[..., 0]
        weights[free] = solved[free]
    return weights


def bent_beside(
    body: LinearBody, forces: Float[np.ndarray, "nodes 3"] | None = None
) -> Float[np.ndarray, "nodes 3 fields"]:
    """Responses of a held body to weight and ``forces`` [N], and how it bends on; of others none.

    These are the principal components of the derivatives.
    """
    none = np.zeros((*body.space.nodes.shape, 0))
    if body.is_free:
        return none
    responses = unit_responses(body, forces)
    bent = principal_fields(bent_fields(body, responses), none, body.mass, BENDS)
    return np.concatenate([np.moveaxis(responses, 0, 2), BEND_SIZE * bent], axis=2)


GRAVITY = (0.0, 0.0, -9.81)
# A body swings far whose linear response to SWINGS of its load is beyond this fraction of its size.
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
    mesh
        Tets [m] with E [Pa], nu [1] and rho [kg/m^3].
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

    Returns
    -------
    ReducedModel
        Basis (nodes, 3, dofs), mass [kg] and the cells that the elastic energy [J] is summed over.

    Raises
    ------
    InputError
        Where supports move, a point is half held (skinning), or the material has a grain.
    ConvergenceError
        Where a piece of a held body can move freely.

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial, Supports, box_mesh, reduce_body
    >>> bar = box_mesh((0.1, 0.1, 0.4), (1, 1, 4))
    >>> bar = bar.with_material(ElementMaterial.uniform(24, E=1e6, nu=0.3, rho=1e3))
    >>> held = Supports.clamp(len(bar.points), bar.points[:, 2] == 0)
    >>> model = reduce_body(bar, held)
    >>> round(float(model.mass.sum()), 9), model.dofs < 3 * len(bar.points)  # kg: rho V
    (4.0, True)
    """
    used, stiffening = motion_elements(mesh, supports, order, most=MOST_UNKNOWNS)
    body = linear_body(mesh, supports, order=used)
    dead = load_vector(mesh, body.grid, traction=traction, forces=forces)
    acting = body.weight(gravity_vector) + dead
    if kind is Subspace.SKINNING:
        functions = _modal_functions(body, checked_count("handles", handles), dead, acting)
        whole = whole_model(body, skinned_basis(functions), Subspace.SKINNING)
    elif body.is_free:
        checked_count("handles", handles)
        whole = whole_model(body, skinned_basis(turning_functions(body)), Subspace.SKINNING)
    else:
        derived = checked_count("derived", derived)
        whole = whole_model(body, vector_basis(body, dead, derived), Subspace.VECTOR)
        linear = body.compliance(acting[None])[0]
        if SWINGS[-1] * np.abs(linear).max() >= FAR * body.size:  # as many coordinates, for swings
            swung = swung_fields(body, whole, acting)
            kept = vector_basis(body, dead, max(0, derived - swung.shape[2]))
            far = principal_fields(swung, kept, body.mass, swung.shape[2])
            basis = orthonormal_fields(np.concatenate([kept, far], axis=2), body.mass)
            whole = whole_model(body, basis, Subspace.VECTOR)
    accuracy = whole.accuracy._replace(stiffening=1.0 if used == 2 else stiffening)
    whole = replace(whole, accuracy=accuracy)
    return with_cells(whole, whole.pull_back(acting), most_cells, seed=seed)


def whole_model(
    body: LinearBody, basis: Float[np.ndarray, "nodes 3 dofs"], kind: Subspace
) -> ReducedModel:
    """Model of an M-orthonormal ``basis`` whose energy is summed as that of the full body."""
    mesh, space, material = body.mesh, body.space, material_of(body.mesh)
    count = len(element_points(space.order))
    cells = np.repeat(np.arange(len(mesh.tets)), count)
    flat, fields = basis.reshape(-1, basis.shape[2]), np.moveaxis(basis, 2, 0)
    slopes = [displacement_gradients(body.grid, u, element_points(space.order)) for u in fields]
    model = ReducedModel(
        points=space.nodes,
        edges=space.edges,
        faces=mesh.boundary.faces.astype(np.int64),
        mass=body.mass,
        basis=basis,
        kind=kind,
        cells=cells,
        weights=mesh.volumes[cells] / count,
        gradients=np.stack(slopes, axis=-1).reshape(-1, 3, 3, len(slopes)),
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
    mass = weighing_mass(mesh, discretise(mesh, model.order), supports)
    forces = mass[:, None] * np.asarray(gravity_vector, dtype=float)
    full = solve_nonlinear(mesh, supports, forces=forces, order=model.order).node_displacement
    rest = held_rest(ReducedElasticity(model), model.pull_back(forces))
    error = np.inf if rest is None else relative_error(model, model.displacement(rest), full)
    return replace(model, accuracy=model.accuracy._replace(sag=error))


def relative_error(
    model: ReducedModel,
    u: Float[np.ndarray, "*frames nodes 3"],
    target: Float[np.ndarray, "*frames nodes 3"],
) -> float:
    """Error of displacements over the target [1], in the norm of mass, all frames together."""
    mass = model.mass[:, None]
    error, size = (mass * (u - target) ** 2).sum(), (mass * target**2).sum()
    return float(np.sqrt(error / size)) if size > 0 else 0.0 if error == 0 else np.inf


def accuracy_warnings(model: ReducedModel) -> tuple[str, ...]:
    """What to say where a model is not as good as it should be."""
    ratio, sag, cell_ratio, cell_sag, motion, stiffening = model.accuracy
    warnings = (
        []
        if (coarse := too_coarse(stiffening)) is None
        else [Note("basis.convert_finer", coarse=coarse)]
    )
    if model.kind is Subspace.VECTOR and np.isfinite(cell_ratio) and np.isnan(cell_sag):
        warnings.append(Note("basis.cells_chosen", count=len(model.cells)))
    if abs(ratio - 1) > FREQUENCY_LIMIT:
        warnings.append(Note("basis.reduced_bodys", ratio=ratio))
    if sag > SAG_LIMIT:
        warnings.append(Note("basis.reduced_body_sags", sag=sag))
    if cell_sag > SAG_LIMIT:
        warnings.append(Note("basis.cells_sag", count=len(model.cells), cell_sag=cell_sag))
    if motion > MOTION_LIMIT:
        warnings.append(Note("basis.reduced_body_moves", motion=motion))
    return tuple(warnings)


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
    fields, q = [], None
    for times in SWINGS:
        q = held_rest(few, times * model.pull_back(acting), start=q)
        if q is None or plan.entries > MOST_ENTRIES:
            break
        u = model.displacement(q)
        left = times * acting - elastic.response(u).force - body.held.springs * u
        matrix = elastic.tangent(u, projected=True)
        apply_supports(matrix, body.held.fixed, body.held.springs)
        factor = CholeskyFactor(matrix, plan)
        fields.append(u + factor.solve(np.where(body.held.fixed, 0.0, left)))
    return np.stack(fields, axis=2) if fields else np.zeros((*acting.shape, 0))


def _modal_functions(
    body: LinearBody, handles: int, forces: np.ndarray, acting: np.ndarray
) -> Float[np.ndarray, "nodes _"]:
    """Scalar functions of the modal weights that come nearest to the linear body."""
    best: tuple[float, np.ndarray] | None = None
    beside = bent_beside(body, forces)
    loaded = acting.any() and not body.is_free
    response = body.compliance(acting[None])[0] if loaded else acting
    for fitted in FITTED:
        weights = modal_weights(body, handles, fitted, beside=beside)
        functions = skinned_functions(body, weights, free=body.is_free)
        model = whole_model(body, skinned_basis(functions), Subspace.SKINNING)
        error = abs(model.accuracy.frequency - 1)
        if loaded:  # and of the linear response
            K = ReducedElasticity(model).tangent(np.zeros(model.dofs))
            u = model.displacement(np.linalg.solve(K, model.pull_back(acting)))
            error += relative_error(model, u, response)
        if best is None or error < best[0]:
            best = error, functions
    assert best is not None
    return best[1]
