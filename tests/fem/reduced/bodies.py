"""Bodies and models that the tests of reduced models share."""

import numpy as np
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.reduced.basis import (
    LinearBody,
    linear_body,
    modal_weights,
    skinned_basis,
    skinned_functions,
    vector_basis,
    whole_model,
)
from autophyx_tet.fem.reduced.model import ReducedModel, Subspace
from autophyx_tet.fem.scene.supports import Supports

SIZE = (0.5, 0.1, 0.08)


def two_part_bar(cells=(8, 2, 2), *, nu=0.3) -> TetMesh:
    """Bar along x, its inner points shaken; the half far from x = 0 is ten times softer."""
    mesh = box_mesh(SIZE, cells)
    inside = ((mesh.points > 1e-9) & (mesh.points < np.array(SIZE) - 1e-9)).all(axis=1)
    shift = np.random.default_rng(0).uniform(-0.1, 0.1, mesh.points.shape) * inside[:, None]
    far = mesh.centroids[:, 0] > SIZE[0] / 2
    material = ElementMaterial(
        np.where(far, 1e5, 1e6), np.full(len(far), nu), np.where(far, 900.0, 1100.0)
    )
    points = mesh.points + shift * np.array(SIZE) / cells
    return TetMesh(points, mesh.tets, far.astype(int), ("root", "tip"), material)


def clamped(mesh: TetMesh) -> Supports:
    return Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)


def linear(mesh: TetMesh, *, free: bool = False, order: int = 1) -> LinearBody:
    return linear_body(mesh, None if free else clamped(mesh), order=order)


def whole(body: LinearBody, kind: Subspace, handles: int = 4) -> ReducedModel:
    """Model with all tets; a skinned one of that many modal handles."""
    if kind is Subspace.VECTOR:
        return whole_model(body, vector_basis(body), kind)
    weights = modal_weights(body, handles, 3)
    functions = skinned_functions(body, weights, free=body.is_free)
    return whole_model(body, skinned_basis(functions), kind)
