"""Skinning weights: what a body's handles carry, u = sum_h w_h(x) T_h (x, y, z, 1).

Modal skinning: weights by alternating least squares, so that the handles can make the body's modes,
its response to weight, and how these bend on. Given the weights, the transforms T are linear least
squares; given the transforms, the weights of every point are. Laplacian eigenmodes, which it starts
from, lock: w (x, y, z, 1) has no anticlastic curvature.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from ..discrete.mass import lumped_mass
from ..discrete.space import extend_linear, make_space
from ..errors import InputError
from ..scene.mesh import TetMesh, material_of
from .elasticity import hat_gradients
from .subspace import (
    LinearBody,
    bent_fields,
    orthonormal_fields,
    principal_fields,
    unit_responses,
)

# Scalar functions of a free body beside (x, y, z, 1): as many as ten handles have.
HANDLES, FUNCTIONS = 10, 40
# Modes that weights are fitted to: the best of these is kept, more spoil them.
FITTED = (3, 4, 6)
# Principal derivatives that weights are fitted to, and their size beside a mode's.
BENDS, BEND_SIZE = 4, 0.3
SWEEPS = 30
# Of the normal matrices' mean diagonal: transforms, and the change of the weights in a sweep.
RIDGE_TRANSFORMS, RIDGE_WEIGHTS = 1e-8, 1e-4
# Scalar functions that depend on others to this share of the first are dropped.
DEPENDENT = 1e-7


def affine_coordinates(
    mesh: TetMesh, nodes: Float[np.ndarray, "nodes 3"]
) -> Float[np.ndarray, "nodes 4"]:
    """(x, y, z, 1) of every node, about the middle and in shares of the body's longest side."""
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
    return orthonormal_fields(functions, body.mass, DEPENDENT)


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
    nodes, count = functions.shape
    basis = np.zeros((nodes, 3, 3, count))
    for axis in range(3):
        basis[:, axis, axis] = functions
    return basis.reshape(nodes, 3, 3 * count)


def laplacian_weights(
    mesh: TetMesh, count: int, held: Bool[np.ndarray, "points"]
) -> Float[np.ndarray, "points count"]:
    """Lowest eigenmodes of L_E w = lambda M w, zero where ``held``, of unit mass.

    L_E is the Laplacian with E of every tet; of a free body the constant one is left out
    (skinning eigenmodes: Benchekroun et al. 2023, here with our stiffness).
    """
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import eigsh

    hats, E = hat_gradients(mesh), material_of(mesh).E
    local = np.einsum("tai,tbi->tab", hats, hats) * (mesh.volumes * E)[:, None, None]
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
    sweeps: int = SWEEPS,
) -> Float[np.ndarray, "nodes handles"]:
    """Weights of so many ``handles`` that can make the first ``fitted`` modes.

    And the fields ``beside`` [1/sqrt(kg)], by default ``bent_beside``; they vanish on what holds
    the body.
    """
    held, points = held_nodes(body), len(body.mesh.points)
    weights = extend_linear(body.space, laplacian_weights(body.mesh, handles, held[:points]))
    snapshots = _snapshots(body, fitted, bent_beside(body) if beside is None else beside)
    affine = affine_coordinates(body.mesh, body.space.nodes)
    root = np.sqrt(body.mass)[:, None]
    free = (body.mass > 0) & ~held
    for _ in range(sweeps):
        maps = _fitted_transforms(weights, affine, snapshots, root, whole=body.is_free)
        weights[free] = _fitted_weights(weights, maps, affine, snapshots)[free]
    return weights


def held_nodes(body: LinearBody) -> Bool[np.ndarray, "nodes"]:
    """Nodes that are held, in all directions; ``InputError`` where one is in some only."""
    fixed = body.held.fixed
    if (fixed.any(axis=1) & ~fixed.all(axis=1)).any():
        raise InputError(
            "a point is held in some directions only, and handles vanish on it in all or in none: "
            "wanted the vector basis"
        )
    return np.asarray(fixed.any(axis=1))


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


def _snapshots(body: LinearBody, fitted: int, beside) -> Float[np.ndarray, "nodes shots"]:
    """Modes, as large as their share f1 / f of a motion, and what is ``beside``, as (x, y, z)."""
    modes = body.modes
    fields = modes.shapes[:fitted] * (modes.frequencies[0] / modes.frequencies[:fitted, None, None])
    both = np.concatenate([np.moveaxis(fields, 0, 2), beside], axis=2)
    return both.swapaxes(1, 2).reshape(len(body.mass), -1)


def _fitted_transforms(weights, affine, snapshots, root, *, whole: bool) -> np.ndarray:
    """Transforms (handles, 4, shots) of the given weights; a ``whole`` one comes last."""
    products = (weights[:, :, None] * affine[:, None, :]).reshape(len(weights), -1)
    if whole:
        products = np.concatenate([products, affine], axis=1)
    A = root * products
    normal = A.T @ A
    normal += RIDGE_TRANSFORMS * np.trace(normal) / len(normal) * np.eye(len(normal))
    return np.linalg.solve(normal, A.T @ (root * snapshots)).reshape(-1, 4, snapshots.shape[1])


def _fitted_weights(weights, maps, affine, snapshots) -> np.ndarray:
    """Weights of every node for the given transforms: a small least squares each."""
    handles = weights.shape[1]
    made = np.einsum("na,has->nsh", affine, maps, optimize=True)
    left = snapshots - made[:, :, handles:].sum(axis=2)
    B = made[:, :, :handles]
    normal = B.swapaxes(1, 2) @ B
    ridge = RIDGE_WEIGHTS * np.trace(normal.mean(axis=0)) / handles
    right = (B.swapaxes(1, 2) @ left[:, :, None])[..., 0] + ridge * weights
    return np.linalg.solve(normal + ridge * np.eye(handles), right[..., None])[..., 0]
