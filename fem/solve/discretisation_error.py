"""Discretisation error: P1 against P2, or an estimate of it; what elements a motion takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..discrete.space import affordable_order, p2_unknowns
from ..errors import ConvergenceError, InputError
from ..model_error import BENDS_ALIKE
from ..result import LOCKING, DiscretisationError, StaticResult
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from .modal import natural_modes, quick_order

# Unknowns of quadratic elements up to which a motion takes them where linear ones lock in bending.
FEW_UNKNOWNS = 20_000


class MotionElements(NamedTuple):
    """Order of a motion's elements, and how many times too stiff they are: NaN, not known."""

    order: int
    stiffening: float = np.nan


def motion_order(mesh: TetMesh) -> int:
    """Linear elements for a motion, but quadratic ones where linear ones lock, if affordable."""
    locks = (material_of(mesh).nu > LOCKING).any()
    return affordable_order(mesh) if locks else 1


def motion_elements(
    mesh: TetMesh,
    supports: Supports | None,
    order: int | None = None,
    *,
    most: int = FEW_UNKNOWNS,
) -> MotionElements:
    """Elements of a motion: of ``order`` where it is given, else ``motion_order``'s.

    Quadratic ones too where linear ones lock in bending, while they have ``most`` unknowns.
    """
    if (used := order or motion_order(mesh)) == 2:
        return MotionElements(2)
    stiffening = linear_stiffening(mesh, supports)
    if order is None and stiffening > BENDS_ALIKE and p2_unknowns(mesh) <= most:
        return MotionElements(2)
    return MotionElements(used, stiffening)


def linear_stiffening(mesh: TetMesh, supports: Supports | None = None) -> float:
    """How many times as stiff [1] linear elements make ``mesh`` as quadratic ones do, as held.

    The ratio of the squares of the first frequencies, both with the consistent mass. Linear
    elements lock in bending where a part is few of them thick, whatever its nu. NaN where quadratic
    ones have no modes within seconds.
    """
    try:
        if quick_order(mesh) != 2:
            return np.nan
        linear, quadratic = (
            float(natural_modes(mesh, 1, supports=supports, order=order).frequencies[0]) ** 2
            for order in (1, 2)
        )
    except (InputError, ConvergenceError):
        return np.nan
    return linear / quadratic if quadratic > 0 else np.nan


def find_discretisation_error(
    result: StaticResult, solve: Callable[..., StaticResult], warnings: list[str]
) -> DiscretisationError:
    """Error of ``result``: ``solve(order=...)`` answers the same problem with the other order."""
    if result.order == 1 and affordable_order(result.mesh) == 1:
        return DiscretisationError(recovery_estimate(result), "stress recovery")
    try:
        other = solve(order=3 - result.order)
    except ConvergenceError as error:
        warnings.append(f"the P1/P2 gap could not be computed: {error}")
        return DiscretisationError(recovery_estimate(result), "stress recovery")
    one, two = (np.linalg.norm(r.displacement, axis=1).max() for r in (result, other))
    fine = two if result.order == 1 else one
    error = float(abs(one - two) / fine) if fine > 0 else 0.0
    recovery = recovery_estimate(result) if result.order == 2 else np.inf
    return DiscretisationError(error, "P1/P2", recovery)


def recovery_estimate(result: StaticResult) -> float:
    """Zienkiewicz & Zhu (1987): energy of the stress minus its nodal mean, over the energy.

    The relative error of the energy, which is that of the displacement at the loads.
    """
    mesh = result.mesh
    material, volumes = material_of(mesh), mesh.volumes
    ids = mesh.tets.ravel()
    weight = np.bincount(ids, np.repeat(volumes, 4), minlength=len(mesh.points))
    flat = result.stress.reshape(-1, 9)
    mean = (
        np.stack(
            [np.bincount(ids, np.repeat(volumes * s, 4), len(mesh.points)) for s in flat.T], axis=1
        )
        / np.where(weight > 0, weight, 1.0)[:, None]
    )
    jump = (mean[mesh.tets].mean(axis=1) - flat).reshape(-1, 3, 3)
    error = (volumes * _complementary_energy(jump, material)).sum()
    total = (volumes * _complementary_energy(result.stress, material)).sum()
    return float(error / total) if total > 0 else 0.0


def _complementary_energy(stress: np.ndarray, material) -> np.ndarray:
    trace = np.trace(stress, axis1=1, axis2=2)
    square = np.einsum("tij,tij->t", stress, stress)
    return ((1 + material.nu) * square - material.nu * trace**2) / (2 * material.E)
