"""Loads on the surface of a body, in SI: force per area, pressure, a total force or torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..errors import InputError
from ..mesh import TetMesh, face_areas, face_normals
from .supports import Supports


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
    shares
        How much of every face it was meant for, shape (faces,) [1], where it is not all of it:
        ``value`` is so much smaller, and its force that on the share.
    follows
        'pressure' or 'torque' where it turns with its faces: it stays across them, or its moment
        stays; '': a dead load.
    """

    faces: np.ndarray
    value: np.ndarray
    name: str = ""
    shares: np.ndarray | None = None
    follows: Literal["", "pressure", "torque"] = ""


class Resultant(NamedTuple):
    """Total ``force`` (3,) [N] of a load, and its ``torque`` (3,) [N m] about ``centre`` (3,) [m].

    ``area`` [m^2] is the loaded surface, ``centre`` its centroid, ``on_fixed`` [1] how much of what
    acts there lands on fixed points, whose supports take it up.
    """

    force: np.ndarray
    torque: np.ndarray
    centre: np.ndarray
    area: float
    on_fixed: float = 0.0


def pressure(
    mesh: TetMesh,
    faces: Int[np.ndarray, "faces 3"],
    value: float,
    *,
    shares: Float[np.ndarray, "faces"] | None = None,
) -> Traction:
    """Pressure on outward faces: the traction -p n.

    Parameters
    ----------
    mesh
        The mesh [m].
    faces
        Ids of points of boundary faces, shape (faces, 3).
    value
        Pressure p [Pa]; a negative one pulls.
    shares
        How much of every face is under it [1]; by default all.

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
    load = _shared(faces, -value * face_normals(mesh.points, faces), shares)
    return load._replace(follows="pressure")


def spread_force(
    mesh: TetMesh,
    faces: Int[np.ndarray, "faces 3"],
    force: Sequence[float] | np.ndarray,
    *,
    shares: Float[np.ndarray, "faces"] | None = None,
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
    shares
        How much of every face takes part [1]; by default all.

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
    areas = face_areas(mesh.points, faces)
    value = np.asarray(force, dtype=float) / (areas if shares is None else areas * shares).sum()
    return _shared(faces, np.tile(value, (len(faces), 1)), shares)


def spread_torque(
    mesh: TetMesh,
    faces: Int[np.ndarray, "faces 3"],
    torque: Sequence[float] | np.ndarray,
    *,
    shares: Float[np.ndarray, "faces"] | None = None,
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
    shares
        How much of every face takes part [1]; by default all.

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
    turning = turning_traction(mesh.points, faces, torque, shares)
    return Traction(faces, turning, shares=shares, follows="torque")


def turning_traction(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    torque: Sequence[float] | np.ndarray,
    shares: np.ndarray | None,
) -> Float[np.ndarray, "faces 3"]:
    """Traction [Pa] of ``spread_torque`` on faces whose ``points`` are there [m]."""
    areas, arms = _arms(points, faces, shares)
    square = (areas * (arms**2).sum(axis=1)).sum()
    moments = square * np.eye(3) - np.einsum("f,fi,fj->ij", areas, arms, arms)
    total = np.asarray(torque, dtype=float)
    spin = np.linalg.pinv(moments, rcond=1e-9, hermitian=True) @ total
    # A moment of the line about itself is round-off, 1e-16 of the others: 1e-9 lies far from both.
    if not (square > 0 and np.allclose(moments @ spin, total, atol=1e-9 * abs(total).max())):
        raise InputError("loads.torque_about", count=len(faces))
    turning = np.cross(spin, arms)
    return turning if shares is None else turning * shares[:, None]


def resultant(mesh: TetMesh, load: Traction, held: Supports | None = None) -> Resultant:
    """Total force, torque about the centroid of its surface, centroid and area of a load.

    ``held`` tells how much of it lands on fixed points: of every face a third acts at the middle of
    each edge, as on quadratic elements, and that is fixed in the directions in which both ends are.
    """
    areas, arms = _arms(mesh.points, load.faces, load.shares)
    whole = face_areas(mesh.points, load.faces)
    each = np.broadcast_to(load.value, (len(load.faces), 3)) * whole[:, None]
    middle = mesh.points[load.faces].mean(axis=1)[0] - arms[0]
    total, sizes = each.sum(axis=0), np.abs(each)
    on_fixed = 0.0
    if held is not None and sizes.any():
        ends = held.fixed[load.faces]
        free = 1 - (ends & np.roll(ends, 1, axis=1)).mean(axis=1)
        on_fixed = 1 - float((sizes * free).sum() / sizes.sum())
    torque = np.cross(arms, each).sum(axis=0)
    return Resultant(total, torque, middle, float(areas.sum()), on_fixed)


def _shared(faces: np.ndarray, value: np.ndarray, shares: np.ndarray | None) -> Traction:
    """Traction of so much of every face, as what it is on the whole of it."""
    return Traction(faces, value if shares is None else value * shares[:, None], shares=shares)


def _arms(
    points: Float[np.ndarray, "points 3"],
    faces: Int[np.ndarray, "faces 3"],
    shares: np.ndarray | None,
) -> tuple[Float[np.ndarray, "faces"], Float[np.ndarray, "faces 3"]]:
    """Loaded area [m^2] of every face, and the way [m] to its middle from the centroid of all."""
    areas, middles = face_areas(points, faces), points[faces].mean(axis=1)
    areas = areas if shares is None else areas * shares
    return areas, middles - areas @ middles / areas.sum()
