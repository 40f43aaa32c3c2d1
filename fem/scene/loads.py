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
    parts
        The part of every face that it acts on, where it is not all of it: means over the face of
        its quadratic functions, of the corners and of the edges behind each, there, shape (faces,
        6) [1]. They add up to the share; ``value`` is so much smaller, its force that on the part.
    follows
        'pressure' or 'torque' where it turns with its faces: it stays across them, or its moment
        stays; '': a dead load.
    """

    faces: np.ndarray
    value: np.ndarray
    name: str = ""
    parts: np.ndarray | None = None
    follows: Literal["", "pressure", "torque"] = ""

    @property
    def shares(self) -> Float[np.ndarray, "faces"] | None:
        """How much of every face it acts on [1]; None: all."""
        return None if self.parts is None else self.parts.sum(axis=1)

    def fractions(self, order: int) -> Float[np.ndarray, "faces k"]:
        """What every node of a face carries of its force [1], of elements of this order."""
        parts = WHOLE if self.parts is None else self.parts / self.parts.sum(axis=1, keepdims=True)
        parts = np.broadcast_to(parts, (len(self.faces), 6))
        return parts if order == 2 else parts @ CORNERS


# Arms of faces below this share of their size are round-off, squared.
ROUND_OFF = 1e-20
# Of the whole of a face the middles of its edges have a third each; a linear function of a corner
# is its quadratic one and half of those of the edges that meet there.
WHOLE = np.array([0.0, 0.0, 0.0, 1 / 3, 1 / 3, 1 / 3])
CORNERS = np.vstack([np.eye(3), [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]]])


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
    parts: Float[np.ndarray, "faces 6"] | None = None,
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
    parts
        What of every face is under it, as ``Traction`` has it; by default all.

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
    load = _shared(faces, -value * face_normals(mesh.points, faces), parts)
    return load._replace(follows="pressure")


def spread_force(
    mesh: TetMesh,
    faces: Int[np.ndarray, "faces 3"],
    force: Sequence[float] | np.ndarray,
    *,
    parts: Float[np.ndarray, "faces 6"] | None = None,
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
    parts
        What of every face takes part, as ``Traction`` has it; by default all.

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
    areas = areas if parts is None else areas * parts.sum(axis=1)
    value = np.asarray(force, dtype=float) / areas.sum()
    return _shared(faces, np.tile(value, (len(faces), 1)), parts)


def spread_torque(
    mesh: TetMesh,
    faces: Int[np.ndarray, "faces 3"],
    torque: Sequence[float] | np.ndarray,
    *,
    parts: Float[np.ndarray, "faces 6"] | None = None,
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
    parts
        What of every face takes part, as ``Traction`` has it; by default all.

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
    turning = turning_traction(mesh.points, Traction(faces, np.zeros(3), parts=parts), torque)
    return Traction(faces, turning, parts=parts, follows="torque")


def turning_traction(
    points: Float[np.ndarray, "points 3"], load: Traction, torque: Sequence[float] | np.ndarray
) -> Float[np.ndarray, "faces 3"]:
    """Traction [Pa] of ``spread_torque`` on the faces of ``load``, whose ``points`` are there."""
    areas, arms = _arms(points, load)
    square = (areas * (arms**2).sum(axis=1)).sum()
    moments = square * np.eye(3) - np.einsum("f,fi,fj->ij", areas, arms, arms)
    total = np.asarray(torque, dtype=float)
    spin = np.linalg.pinv(moments, rcond=1e-9, hermitian=True) @ total
    # A moment of the line about itself is round-off, 1e-16 of the others: 1e-9 lies far from both.
    turns = square > ROUND_OFF * areas.sum() ** 2  # the middle of one face is that of all
    if not (turns and np.allclose(moments @ spin, total, atol=1e-9 * abs(total).max())):
        raise InputError("loads.torque_about", count=len(load.faces))
    turning = np.cross(spin, arms)
    return turning if load.shares is None else turning * load.shares[:, None]


def resultant(mesh: TetMesh, load: Traction, held: Supports | None = None) -> Resultant:
    """Total force, torque about the centroid of its surface, centroid and area of a load.

    ``held`` tells how much of it lands on fixed points, of quadratic elements: the middle of an
    edge is fixed in the directions in which both ends are.
    """
    areas, arms = _arms(mesh.points, load)
    whole = face_areas(mesh.points, load.faces)
    each = np.broadcast_to(load.value, (len(load.faces), 3)) * whole[:, None]
    middle = load.fractions(1)[0] @ mesh.points[load.faces[0]] - arms[0]
    total, sizes = each.sum(axis=0), np.abs(each)
    on_fixed = 0.0
    if held is not None and sizes.any():
        ends, parts = held.fixed[load.faces], np.abs(load.fractions(2))
        fixed = np.concatenate([ends, ends & np.roll(ends, -1, axis=1)], axis=1)
        caught = np.einsum("fk,fkd->fd", parts / parts.sum(axis=1, keepdims=True), fixed)
        on_fixed = float((sizes * caught).sum() / sizes.sum())
    torque = np.cross(arms, each).sum(axis=0)
    return Resultant(total, torque, middle, float(areas.sum()), on_fixed)


def _shared(faces: np.ndarray, value: np.ndarray, parts: np.ndarray | None) -> Traction:
    """Traction of parts of faces, as what it is on the whole of each."""
    load = Traction(faces, value, parts=parts)
    return load if parts is None else load._replace(value=value * parts.sum(axis=1)[:, None])


def _arms(
    points: Float[np.ndarray, "points 3"], load: Traction
) -> tuple[Float[np.ndarray, "faces"], Float[np.ndarray, "faces 3"]]:
    """Loaded area [m^2] of every face, and the way [m] to its middle from the centroid of all."""
    areas = face_areas(points, load.faces)
    areas = areas if load.shares is None else areas * load.shares
    middles = np.einsum("fk,fkd->fd", load.fractions(1), points[load.faces])
    return areas, middles - areas @ middles / areas.sum()
