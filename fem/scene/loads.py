"""Loads on the surface of a body, in SI: force per area, pressure, a total force or torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import InputError
from ..mesh import TetMesh, face_areas, face_normals


class Traction(NamedTuple):
    """Force per area on the surface of a body.

    Parameters
    ----------
    faces
        Ids of points of boundary faces, outward, shape (faces, 3).
    value
        Force per area [Pa], shape (faces, 3), or (3,) for all.
    name
        What it is, in words.
    follows
        'pressure' or 'torque' where it turns with its faces: it stays across them, or its moment
        stays; '': a dead load.
    """

    faces: np.ndarray
    value: np.ndarray
    name: str = ""
    follows: Literal["", "pressure", "torque"] = ""


class Resultant(NamedTuple):
    """Total ``force`` (3,) [N] of a load, and its ``torque`` (3,) [N m] about ``centre`` (3,) [m].

    ``area`` [m^2] is the loaded surface, ``centre`` its centroid.
    """

    force: np.ndarray
    torque: np.ndarray
    centre: np.ndarray
    area: float


def pressure(mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], value: float) -> Traction:
    """Pressure on outward faces: the traction -p n.

    Parameters
    ----------
    mesh
        The mesh [m].
    faces
        Ids of points of boundary faces, shape (faces, 3).
    value
        Pressure p [Pa]; a negative one pulls.

    Returns
    -------
    Traction
        Force per area [Pa] on these faces, shape (faces, 3).

    Examples
    --------
    >>> from autophyx_tet.fem import box_mesh, pressure
    >>> cube = box_mesh((1, 1, 1), (1, 1, 1))
    >>> load = pressure(cube, cube.boundary.faces, 1e5)
    >>> bool(abs(load.value.sum(axis=0)).max() < 1e-9)  # on a closed surface it has no force
    True
    """
    normals = face_normals(mesh.points, faces)
    return Traction(faces, -value * normals, follows="pressure")


def spread_force(
    mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], force: Sequence[float] | np.ndarray
) -> Traction:
    """A force in total, the same on every square metre of faces.

    Parameters
    ----------
    mesh
        The mesh [m].
    faces
        Ids of points of boundary faces, shape (faces, 3).
    force
        Force [N], shape (3,).

    Returns
    -------
    Traction
        Force per area [Pa] on these faces, shape (faces, 3).

    Examples
    --------
    >>> from autophyx_tet.fem import box_mesh, spread_force
    >>> cube = box_mesh((0.1, 0.1, 0.1), (1, 1, 1))
    >>> load = spread_force(cube, cube.boundary.faces, (0, 0, -6))
    >>> round(float(load.value[0, 2]), 9)  # Pa: 6 N on 0.06 m^2
    -100.0
    """
    value = np.asarray(force, dtype=float) / face_areas(mesh.points, faces).sum()
    return Traction(faces, np.tile(value, (len(faces), 1)))


def spread_torque(
    mesh: TetMesh, faces: Int[np.ndarray, "faces 3"], torque: Sequence[float] | np.ndarray
) -> Traction:
    """A torque in total, without a net force: the traction w x r about the centroid of faces.

    w follows from the moments of the faces, J w = torque.

    Parameters
    ----------
    mesh
        The mesh [m].
    faces
        Ids of points of boundary faces, shape (faces, 3).
    torque
        Torque [N m], shape (3,).

    Returns
    -------
    Traction
        Force per area [Pa] on these faces, shape (faces, 3).

    Raises
    ------
    InputError
        Where the middles of the faces lie on one line and the torque turns about it: no traction
        does that.

    Examples
    --------
    >>> from autophyx_tet.fem import box_mesh, spread_torque
    >>> cube = box_mesh((1, 1, 1), (1, 1, 1))
    >>> load = spread_torque(cube, cube.boundary.faces, (0, 0, 1))
    >>> bool(abs(load.value.sum(axis=0)).max() < 1e-12)  # faces of one size: no force
    True
    """
    return Traction(faces, turning_traction(mesh.points, faces, torque), follows="torque")


def turning_traction(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    torque: Sequence[float] | np.ndarray,
) -> Float[np.ndarray, "faces 3"]:
    """Traction [Pa] of ``spread_torque`` on faces whose ``points`` are there [m]."""
    areas, arms = _arms(points, faces)
    square = (areas * (arms**2).sum(axis=1)).sum()
    moments = square * np.eye(3) - np.einsum("f,fi,fj->ij", areas, arms, arms)
    total = np.asarray(torque, dtype=float)
    spin = np.linalg.pinv(moments, rcond=1e-9, hermitian=True) @ total
    # A moment of the line about itself is round-off, 1e-16 of the others: 1e-9 lies far from both.
    if not (square > 0 and np.allclose(moments @ spin, total, atol=1e-9 * abs(total).max())):
        raise InputError("loads.torque_about", count=len(faces))
    return np.cross(spin, arms)


def resultant(mesh: TetMesh, load: Traction) -> Resultant:
    """Total force, torque about the centroid of its faces, centroid and area of a load."""
    areas, arms = _arms(mesh.points, load.faces)
    each = np.broadcast_to(load.value, (len(load.faces), 3)) * areas[:, None]
    middle = mesh.points[load.faces].mean(axis=1)[0] - arms[0]
    return Resultant(each.sum(axis=0), np.cross(arms, each).sum(axis=0), middle, float(areas.sum()))


def _arms(
    points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]
) -> tuple[Float[np.ndarray, "faces"], Float[np.ndarray, "faces 3"]]:
    """Area [m^2] of every face, and the way [m] to its middle from the centroid of them all."""
    areas, middles = face_areas(points, faces), points[faces].mean(axis=1)
    return areas, middles - areas @ middles / areas.sum()
