"""Static scenarios: loads and supports found from the geometry alone."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float

from ..discrete.boundary import face_areas, face_normals
from ..discrete.elastic import Law
from ..discrete.forces import Traction
from ..errors import ConvergenceError, InputError
from ..scene.mesh import TetMesh
from ..scene.support_finder import rest, up_axis
from ..scene.supports import Supports
from ..solve.discretisation_error import Gap, discretisation_gap
from ..solve.nonlinear import solve_nonlinear
from ..solve.statics import StaticResult, solve_static

logger = logging.getLogger(__name__)

Axis = Literal["x", "y", "z"]
# Beyond this strain the linear law is not enough.
LINEAR_LIMIT = 0.05
# Share of the height beyond which a linear displacement means collapse: large strains would have to
# be followed through folding and self-contact, minutes for what the eye has seen already.
COLLAPSE = 0.5
# Newton steps of the repeat: one that converges takes 5 to 15.
ITERATIONS = 30
AIR_DENSITY = 1.225  # [kg/m^3] at 15 C, sea level
# Radius of a finger as a share of the body's diagonal.
FINGER_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class SagResult:
    """How a body settles under its own weight, or another static load.

    Parameters
    ----------
    static
        The full static solution.
    height
        Extent along the up axis [m].
    max_displacement
        Largest displacement of a point [m].
    sag_ratio
        ``max_displacement / height``.
    gap
        Discretisation error of the largest displacement, and how it was found.
    supported
        Points that are held, shape (points,).
    warnings
        What was assumed: pieces that do not touch the ground, no common base, ...
    """

    static: StaticResult
    height: float
    max_displacement: float
    sag_ratio: float
    gap: Gap
    supported: Bool[np.ndarray, "points"]
    warnings: tuple[str, ...]

    @property
    def displacement(self) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] of the mesh points."""
        return self.static.displacement

    @property
    def von_mises(self) -> Float[np.ndarray, "tets"]:
        """Von Mises stress [Pa] of every tet."""
        return self.static.von_mises


def sag(
    mesh: TetMesh,
    *,
    up: Axis = "z",
    order: int = 1,
    supports: Literal["base", "three-point"] = "base",
    gravity: float = 9.81,
    law: Law | None = None,
    device: str = "cpu",
) -> SagResult:
    """Let ``mesh`` settle under its weight.

    Parameters
    ----------
    mesh
        Tets with a material.
    up
        The axis that points up.
    order
        1: linear tets, 2: quadratic.
    supports
        'base': the nodes near the lowest point are clamped; 'three-point': it rests on three of
        them, free to expand sideways.
    gravity
        Acceleration [m/s^2], downwards.
    law
        None: the linear law, and neo-Hookean where the linear answer strains more than 5 %.
        ``Law.LINEAR``: never repeat.
    device
        'cpu' or 'cuda'.

    Raises
    ------
    ConvergenceError
        If the linear solve does not reach its tolerance.
    """
    axis = up_axis(up)
    held, warnings = rest(mesh, axis, three_point=supports == "three-point")
    weight = -gravity * np.eye(3)[axis]
    return _settle(mesh, axis, held, warnings, order, device, law, gravity=weight)


def hang(
    mesh: TetMesh,
    *,
    up: Axis = "z",
    order: int = 1,
    gravity: float = 9.81,
    law: Law | None = None,
    device: str = "cpu",
) -> SagResult:
    """Hang ``mesh`` from its highest points under its weight; options as in ``sag``."""
    axis = up_axis(up)
    held, warnings = rest(mesh, axis, from_top=True)
    weight = -gravity * np.eye(3)[axis]
    return _settle(mesh, axis, held, warnings, order, device, law, gravity=weight)


def wind(
    mesh: TetMesh,
    *,
    up: Axis = "z",
    direction: Sequence[float] | None = None,
    speed: float = 10.0,
    drag: float = 1.2,
    order: int = 1,
    law: Law | None = None,
    device: str = "cpu",
) -> SagResult:
    """Blow on a standing ``mesh``: drag on every face that looks into the wind.

    Parameters
    ----------
    direction
        Where the wind blows to; by default along the first horizontal axis.
    speed
        Speed of the wind [m/s].
    drag
        Drag coefficient [1] of a face across the wind.

    The weight is left out: the answer is what the wind adds. Faces do not shelter each other.
    """
    axis = up_axis(up)
    blows = np.eye(3)[(axis + 1) % 3] if direction is None else np.asarray(direction, dtype=float)
    if not np.linalg.norm(blows) > 0:
        raise InputError(f"wind direction {direction}: wanted a vector that is not zero")
    blows = blows / np.linalg.norm(blows)
    faces = mesh.boundary.faces
    facing = -face_normals(mesh, faces) @ blows
    windward = facing > 0
    push = 0.5 * AIR_DENSITY * speed**2 * drag * facing[windward, None] * blows
    held, warnings = rest(mesh, axis)
    load = Traction(faces[windward], push)
    return _settle(mesh, axis, held, warnings, order, device, law, traction=load)


def poke(
    mesh: TetMesh,
    *,
    up: Axis = "z",
    force: float = 10.0,
    at: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    order: int = 1,
    law: Law | None = None,
    device: str = "cpu",
) -> SagResult:
    """Press a finger on a standing ``mesh``; the weight is left out.

    Parameters
    ----------
    force
        Force of the finger [N], spread over a patch of a twentieth of the diagonal.
    at
        Where [m], shape (3,); by default the highest point.
    direction
        Where the finger pushes to; by default down.
    """
    axis = up_axis(up)
    used = np.unique(mesh.tets)
    highest = mesh.points[used[np.argmax(mesh.points[used, axis])]]
    place = highest if at is None else np.asarray(at, dtype=float)
    pushes = -np.eye(3)[axis] if direction is None else np.asarray(direction, dtype=float)
    faces = mesh.boundary.faces
    away = np.linalg.norm(mesh.points[faces].mean(axis=1) - place, axis=1)
    patch = FINGER_SHARE * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    touched = faces[away <= max(patch, float(away.min()))]
    pressure = force / face_areas(mesh, touched).sum() / np.linalg.norm(pushes)
    held, warnings = rest(mesh, axis)
    load = Traction(touched, np.broadcast_to(pressure * pushes, touched.shape))
    return _settle(mesh, axis, held, warnings, order, device, law, traction=load)


def _settle(
    mesh: TetMesh,
    axis: int,
    held: Supports,
    warnings: list[str],
    order: int,
    device: str,
    law: Law | None,
    **loads: Any,
) -> SagResult:
    """Solve, measure the gap, and repeat with large deformation where strains demand it."""
    solve = partial(solve_static, mesh, held, device=device, **loads)
    static = solve(order=order)
    gap = discretisation_gap(static, solve, warnings)
    height = float(np.ptp(mesh.bounds[:, axis]))
    largest = float(np.linalg.norm(static.displacement, axis=1).max())
    if law is not Law.LINEAR and largest > COLLAPSE * height:
        warnings.append(
            f"it collapses: the linear answer moves {largest / height:.1f} times its height, which "
            "says that it cannot stand, not how it lies"
        )
    elif law is not Law.LINEAR and static.max_strain > LINEAR_LIMIT:
        static = _large(mesh, held, static, device, warnings, loads)
        largest = float(np.linalg.norm(static.displacement, axis=1).max())
    for warning in warnings:
        logger.warning(warning)
    supported = np.asarray(held.fixed.any(axis=1))
    ratio = largest / height
    return SagResult(static, height, largest, ratio, gap, supported, tuple(warnings))


def _large(mesh, held, linear: StaticResult, device: str, warnings: list[str], loads: dict):
    """Repeat a solve with the neo-Hookean law; the linear answer stays where that fails."""
    said = f"the linear answer strains {linear.max_strain:.0%}, more than {LINEAR_LIMIT:.0%}: "
    try:
        static = solve_nonlinear(
            mesh, held, order=linear.order, device=device, iterations=ITERATIONS, **loads
        )
    except ConvergenceError as error:
        warnings.append(f"{said}it is not to be trusted, and no neo-Hookean rest exists ({error})")
        return linear
    warnings.append(said + "repeated with the neo-Hookean law")
    return static
