"""Loads on the surface of a body, in SI: force per area, pressure, a total force or torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import InputError
from ..mesh import TetMesh, face_areas, face_normals


class Traction(NamedTuple):
    """Force per area ``value`` (faces, 3) [Pa] on boundary ``faces`` (faces, 3).

    ``name`` says in words what it is.
    """

    faces: np.ndarray
    value: np.ndarray
    name: str = ""


class Resultant(NamedTuple):
    """Total ``force`` (3,) [N] of a load, and its ``torque`` (3,) [N m] about ``centre`` (3,) [m].

    ``area`` [m^2] is the loaded surface, ``centre`` its centroid.
    """

    force: np.ndarray
    torque: np.ndarray
    centre: np.ndarray
    area: float


def pressure(mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], value: float) -> Traction:
    """Pressure ``value`` [Pa] on outward ``faces``: the traction -p n."""
    return Traction(faces, -value * face_normals(mesh.points, faces))


def spread_force(
    mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], force: Sequence[float] | np.ndarray
) -> Traction:
    """``force`` (3,) [N] in total, the same on every square metre of ``faces``."""
    value = np.asarray(force, dtype=float) / face_areas(mesh.points, faces).sum()
    return Traction(faces, np.tile(value, (len(faces), 1)))


def spread_torque(
    mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], torque: Sequence[float] | np.ndarray
) -> Traction:
    """``torque`` (3,) [N m] in total: the traction w x r about the centroid of ``faces``.

    It has no net force; w follows from the moments of the faces, J w = torque. ``InputError`` where
    the middles of the faces lie on one line and the torque turns about it: no traction does that.
    """
    areas, arms = _arms(mesh, faces)
    square = (areas * (arms**2).sum(axis=1)).sum()
    moments = square * np.eye(3) - np.einsum("f,fi,fj->ij", areas, arms, arms)
    total = np.asarray(torque, dtype=float)
    spin = np.linalg.pinv(moments, rcond=1e-9, hermitian=True) @ total
    # A moment of the line about itself is round-off, 1e-16 of the others: 1e-9 lies far from both.
    if not (square > 0 and np.allclose(moments @ spin, total, atol=1e-9 * abs(total).max())):
        raise InputError(
            f"a torque about the line of its {len(faces)} face(s): wanted a wider surface"
        )
    return Traction(faces, np.cross(spin, arms))


def resultant(mesh: TetMesh, load: Traction) -> Resultant:
    """Total force, torque about the centroid of its faces, centroid and area of a load."""
    areas, arms = _arms(mesh, load.faces)
    each = np.broadcast_to(load.value, (len(load.faces), 3)) * areas[:, None]
    middle = mesh.points[load.faces].mean(axis=1)[0] - arms[0]
    return Resultant(each.sum(axis=0), np.cross(arms, each).sum(axis=0), middle, float(areas.sum()))


def _arms(
    mesh: TetMesh, faces: Int[np.ndarray, "faces 3"]
) -> tuple[Float[np.ndarray, "faces"], Float[np.ndarray, "faces 3"]]:
    """Area [m^2] of every face, and the way [m] to its middle from the centroid of them all."""
    areas, middles = face_areas(mesh.points, faces), mesh.points[faces].mean(axis=1)
    return areas, middles - areas @ middles / areas.sum()
