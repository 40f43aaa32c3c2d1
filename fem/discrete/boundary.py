"""The surface of a body: areas of its nodes, outward normals."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from ..scene.mesh import TetMesh
from .forces import Traction, traction_force
from .space import Space


def node_areas(mesh: TetMesh, space: Space) -> Float[np.ndarray, "nodes"]:
    """Share of the surface [m^2] of every node, zero inside.

    P1: a third of the faces around it; P2: corners get a twelfth and edges a quarter of a face, so
    that none is without weight.
    """
    faces = mesh.boundary.faces
    one = np.broadcast_to([1.0, 0.0, 0.0], faces.shape)
    spread = traction_force(mesh, space, Traction(faces, one))[:, 0]
    if space.order == 1:
        return spread
    corners = np.zeros(len(space.nodes))
    area = face_areas(mesh, faces)
    for k in range(3):
        np.add.at(corners, faces[:, k], area / 12)
    return 0.75 * spread + corners


def face_areas(mesh: TetMesh, faces: Int[np.ndarray, "faces 3"]) -> Float[np.ndarray, "faces"]:
    """Area [m^2] of every face."""
    return np.linalg.norm(_cross(mesh, faces), axis=1) / 2


def face_normals(mesh: TetMesh, faces: Int[np.ndarray, "faces 3"]) -> Float[np.ndarray, "faces 3"]:
    """Unit normal of every face, outward where the faces are those of ``mesh.boundary``."""
    cross = _cross(mesh, faces)
    return cross / np.linalg.norm(cross, axis=1, keepdims=True)


def _cross(mesh: TetMesh, faces: np.ndarray) -> np.ndarray:
    a, b, c = (mesh.points[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)
