"""Skinning weights: what a body's handles carry, u = sum_h w_h(x) T_h (x, y, z, 1).

Modal skinning: weights by alternating least squares, so that the handles can make the body's modes
and its response to weight. Given the weights, the transforms T are linear least squares; given the
transforms, the weights of every point are. Laplacian eigenmodes, which it starts from, lock:
w (x, y, z, 1) has no anticlastic curvature.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from ..discrete.mass import lumped_mass
from ..discrete.space import make_space
from ..errors import InputError
from ..scene.mesh import TetMesh, material_of
from .gradients import hat_gradients
from .subspace import LinearBody, load_responses, orthonormal_fields

HANDLES = 10
# Modes that weights are fitted to: the best of these is kept, more spoil them.
FITTED = (3, 4, 6)
SWEEPS = 30
# Of the normal matrices' mean diagonal: transforms, and the change of the weights in a sweep.
RIDGE_TRANSFORMS, RIDGE_WEIGHTS = 1e-8, 1e-4
# Scalar functions that depend on others to this share of the first are dropped.
DEPENDENT = 1e-7


def affine_coordinates(mesh: TetMesh) -> Float[np.ndarray, "points 4"]:
    """(x, y, z, 1) of every point, about the middle and in shares of the body's longest side."""
    middle, side = mesh.bounds.mean(axis=0), np.ptp(mesh.bounds, axis=0).max()
    return np.concatenate([(mesh.points - middle) / side, np.ones((len(mesh.points), 1))], axis=1)


def skinned_functions(
    mesh: TetMesh, weights: Float[np.ndarray, "points handles"], *, free: bool
) -> Float[np.ndarray, "points functions"]:
    """M-orthonormal scalar functions of the span of w_h (x, y, z, 1).

    ``free``: and of (x, y, z, 1) itself, so that the body can turn and deform as a whole.
    """
    affine = affine_coordinates(mesh)
    products = (weights[:, :, None] * affine[:, None, :]).reshape(len(weights), -1)
    mass = lumped_mass(mesh, make_space(mesh, 1))
    functions = np.concatenate([affine, products], axis=1) if free else products
    return orthonormal_fields(functions, mass, DEPENDENT)


def skinned_basis(
    functions: Float[np.ndarray, "points functions"],
) -> Float[np.ndarray, "points 3 dofs"]:
    """The same functions along x, y and z, axis by axis."""
    points, count = functions.shape
    basis = np.zeros((points, 3, 3, count))
    for axis in range(3):
        basis[:, axis, axis] = functions
    return basis.reshape(points, 3, 3 * count)


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
    forces: Float[np.ndarray, "points 3"] | None = None,
    sweeps: int = SWEEPS,
) -> Float[np.ndarray, "points handles"]:
    """Weights of so many ``handles`` that can make the first ``fitted`` modes.

    Of a held body the responses to weight and ``forces`` [N] too; they vanish on what holds it.
    """
    held = held_points(body)
    weights = laplacian_weights(body.mesh, handles, held)
    snapshots = _snapshots(body, fitted, forces)
    affine, root = affine_coordinates(body.mesh), np.sqrt(body.mass)[:, None]
    free = (body.mass > 0) & ~held
    for _ in range(sweeps):
        maps = _fitted_transforms(weights, affine, snapshots, root, whole=body.is_free)
        weights[free] = _fitted_weights(weights, maps, affine, snapshots)[free]
    return weights


def held_points(body: LinearBody) -> Bool[np.ndarray, "points"]:
    """Points that are held, in all directions; ``InputError`` where one is in some only."""
    fixed = body.held.fixed
    if (fixed.any(axis=1) & ~fixed.all(axis=1)).any():
        raise InputError(
            "a point is held in some directions only, and handles vanish on it in all or in none: "
            "wanted the vector basis"
        )
    return np.asarray(fixed.any(axis=1))


def _snapshots(body: LinearBody, fitted: int, forces) -> Float[np.ndarray, "points shots"]:
    """Modes, as large as their share f1 / f of a motion, and responses to loads, as (x, y, z)."""
    modes = body.modes
    fields = modes.shapes[:fitted] * (modes.frequencies[0] / modes.frequencies[:fitted, None, None])
    if not body.is_free:
        responses = load_responses(body, forces)
        size = np.sqrt(np.einsum("n,kni,kni->k", body.mass, responses, responses))
        fields = np.concatenate([fields, responses / size[:, None, None]])
    return fields.transpose(1, 0, 2).reshape(len(body.mass), -1)


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
    """Weights of every point for the given transforms: a small least squares each."""
    handles = weights.shape[1]
    made = np.einsum("na,has->nsh", affine, maps, optimize=True)
    left = snapshots - made[:, :, handles:].sum(axis=2)
    B = made[:, :, :handles]
    normal = B.swapaxes(1, 2) @ B
    ridge = RIDGE_WEIGHTS * np.trace(normal.mean(axis=0)) / handles
    right = (B.swapaxes(1, 2) @ left[:, :, None])[..., 0] + ridge * weights
    return np.linalg.solve(normal + ridge * np.eye(handles), right[..., None])[..., 0]
