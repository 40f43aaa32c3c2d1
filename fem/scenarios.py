"""Scenarios: loads and supports found from the geometry alone."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from .elastic import Law
from .errors import ConvergenceError, InputError
from .gap import Gap, discretisation_gap
from .mesh import TetMesh
from .nonlinear import solve_nonlinear
from .pieces import face_connected_pieces, spans_plane
from .statics import StaticResult, solve_static
from .supports import Supports

logger = logging.getLogger(__name__)

Axis = Literal["x", "y", "z"]
AXES = {"x": 0, "y": 1, "z": 2}
# Nodes within this share of the height above the lowest one stand on the ground: feet are rarely
# meshed perfectly flat, and fTetWild moves a surface by 1e-3 of the diagonal.
BASE_SHARE = 0.02
# Beyond this strain the linear law is not enough.
LINEAR_LIMIT = 0.05


@dataclass(frozen=True, eq=False)
class SagResult:
    """How a body settles under its own weight.

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
    height = float(np.ptp(mesh.bounds[:, axis]))
    held, warnings = rest(mesh, axis, three_point=supports == "three-point")
    weight = np.zeros(3)
    weight[axis] = -gravity
    solve = partial(solve_static, mesh, held, gravity=weight, device=device)
    static = solve(order=order)
    gap = discretisation_gap(static, solve, warnings)
    if static.max_strain > LINEAR_LIMIT and law is not Law.LINEAR:
        static = _large(mesh, held, weight, static, device, warnings)
    for warning in warnings:
        logger.warning(warning)
    largest = float(np.linalg.norm(static.displacement, axis=1).max())
    supported = np.asarray(held.fixed.any(axis=1))
    ratio = largest / height
    return SagResult(static, height, largest, ratio, gap, supported, tuple(warnings))


def _large(mesh, held, weight, linear: StaticResult, device: str, warnings: list[str]):
    """Repeat a sag with the neo-Hookean law; the linear answer stays where that fails."""
    said = f"the linear answer strains {linear.max_strain:.0%}, more than {LINEAR_LIMIT:.0%}: "
    try:
        static = solve_nonlinear(mesh, held, gravity=weight, order=linear.order, device=device)
    except ConvergenceError as error:
        warnings.append(f"{said}it is not to be trusted, and no neo-Hookean rest exists ({error})")
        return linear
    warnings.append(said + "repeated with the neo-Hookean law")
    return static


def up_axis(up: str) -> int:
    """Index of the axis ``up``."""
    if up not in AXES:
        raise InputError(f"up axis {up!r}: wanted one of x, y, z")
    return AXES[up]


def rest(mesh: TetMesh, axis: int, *, three_point: bool = False) -> tuple[Supports, list[str]]:
    """Supports on which every piece of ``mesh`` stands, and what had to be assumed.

    A piece (tets joined through faces) that neither stands on the base nor shares three points
    that span a plane with a held piece could move freely: it is held at its own lowest points.
    """
    pieces = face_connected_pieces(mesh)
    used = np.unique(mesh.tets)
    fixed = np.zeros((len(mesh.points), 3), dtype=bool)
    warnings: list[str] = []
    place = _three_points if three_point else _clamp_lowest
    place(mesh.points, used, axis, fixed)
    members = [np.unique(mesh.tets[pieces == k]) for k in range(pieces.max() + 1)]
    held = np.any(fixed, axis=1)
    waiting = set(range(len(members)))
    while waiting:
        done = {k for k in waiting if spans_plane(mesh.points[members[k][held[members[k]]]])}
        if not done:  # the biggest loose piece gets a support of its own
            k = max(waiting, key=lambda k: len(members[k]))
            _clamp_lowest(mesh.points, members[k], axis, fixed)
            share = mesh.volumes[pieces == k].sum() / mesh.volume
            warnings.append(_loose(k, len(members), share))
            done = {k}
        for k in done:
            held[members[k]] = True
        waiting -= done
    return Supports(fixed, np.zeros(fixed.shape), np.zeros(fixed.shape)), warnings


def _loose(piece: int, pieces: int, share: float) -> str:
    return (
        f"piece {piece + 1} of {pieces} ({share:.1%} of the volume) is not attached to the base: "
        "held at its own lowest points"
    )


def _lowest(points: np.ndarray, ids: np.ndarray, axis: int) -> np.ndarray:
    """Ids near the lowest point that span a plane: the share of the height grows until they do."""
    z = points[ids, axis] - points[ids, axis].min()
    share = BASE_SHARE
    while share < 1 and not spans_plane(points[ids[z <= share * z.max()]]):
        share *= 1.5
    return ids[z <= share * z.max()]


def _clamp_lowest(points, ids, axis, fixed) -> None:
    fixed[_lowest(points, ids, axis)] = True


def _three_points(points, ids, axis, fixed) -> None:
    """Fix six components at three points far apart: no stress from the support but its reaction."""
    base = _lowest(points, ids, axis)
    side = [a for a in range(3) if a != axis]
    flat = points[base][:, side]
    a = np.argmax(np.linalg.norm(flat - flat.mean(axis=0), axis=1))
    b = np.argmax(np.linalg.norm(flat - flat[a], axis=1))
    line = flat[b] - flat[a]
    c = np.argmax(np.abs((flat - flat[a]) @ [-line[1], line[0]]))
    fixed[base[[a, b, c]], axis] = True
    fixed[base[a]] = True
    fixed[base[b], side[int(abs(line[0]) > abs(line[1]))]] = True  # the one across the line
