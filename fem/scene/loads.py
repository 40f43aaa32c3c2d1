"""Loads on the surface of a body, in SI: force per area, pressure."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int

from .boundary import face_normals
from .mesh import TetMesh


class Traction(NamedTuple):
    """Force per area ``value`` (faces, 3) [Pa] on boundary ``faces`` (faces, 3)."""

    faces: np.ndarray
    value: np.ndarray


def pressure(mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], value: float) -> Traction:
    """Pressure ``value`` [Pa] on outward ``faces``: the traction -p n."""
    return Traction(faces, -value * face_normals(mesh.points, faces))
