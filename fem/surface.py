"""The surface of a body: areas of its nodes, outward normals."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from .loads import Traction, traction_force
from .mesh import TetMesh
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
    a, b, c = (mesh.points[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    for k in range(3):
        np.add.at(corners, faces[:, k], area / 12)
    return 0.75 * spread + corners
