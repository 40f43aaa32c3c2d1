"""Contact pressure: nodal forces over the surface that faces them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..discrete.space import Space
from ..scene.boundary import area_vectors
from ..scene.mesh import TetMesh


class ContactPressures(NamedTuple):
    """Largest contact pressures [Pa]: by every one of the ``obstacles``, by the body's ``own``."""

    obstacles: Float[np.ndarray, "obstacles"]
    own: float


def largest_ever(known: Sequence[ContactPressures | None]) -> ContactPressures | None:
    """Largest of all that are known; None where none are."""
    found = [pressures for pressures in known if pressures is not None]
    if not found:
        return None
    obstacles = np.max([pressures.obstacles for pressures in found], axis=0)
    return ContactPressures(obstacles, max(pressures.own for pressures in found))


def largest_pressure(
    mesh: TetMesh,
    space: Space,
    u: Float[np.ndarray, "nodes 3"],
    force: Float[np.ndarray, "nodes 3"],
) -> float:
    """Largest pressure [Pa] of nodal contact forces [N] at the displacement ``u`` [m].

    Over a third of the area of the faces around a point, as seen along its force: a side wall
    carries nothing of what presses the base. Forces in the middle of quadratic edges are halved
    between their ends, which leaves a uniform pressure uniform.
    """
    if not force.any():
        return 0.0
    points = force[: space.points].copy()
    np.add.at(points, space.edges, 0.5 * force[space.points :, None])
    size = np.linalg.norm(points, axis=1)
    faces = mesh.boundary.faces
    way = points / np.where(size > 0, size, 1.0)[:, None]
    vectors = area_vectors(mesh.points + u[: space.points], faces)
    seen = np.maximum(-np.einsum("fd,fkd->fk", vectors, way[faces]), 0.0) / 3
    area = np.bincount(faces.ravel(), seen.ravel(), minlength=len(size))
    return float((size[area > 0] / area[area > 0]).max(initial=0.0))
