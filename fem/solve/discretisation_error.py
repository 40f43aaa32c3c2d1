"""Discretisation error of a static answer: P1 against P2, or an estimate of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import ConvergenceError
from ..result import LOCKING, DiscretisationError, StaticResult
from ..scene.mesh import TetMesh, material_of

# Unknowns of a P2 solve above which the gap is estimated instead.
LARGEST_P2 = 150_000


def p2_unknowns(mesh: TetMesh) -> int:
    """Unknowns of the P2 space of ``mesh``, by Euler's formula (exact for one ball-like piece)."""
    faces = (4 * len(mesh.tets) + len(mesh.boundary.faces)) // 2
    used = len(np.unique(mesh.tets))
    edges = used + faces - len(mesh.tets) - 1
    return 3 * (used + edges)


def affordable_order(mesh: TetMesh) -> int:
    """Quadratic elements while they are affordable: linear ones are far too stiff on thin parts."""
    return 2 if p2_unknowns(mesh) <= LARGEST_P2 else 1


def motion_order(mesh: TetMesh) -> int:
    """Linear elements for a motion, but quadratic ones where linear ones lock, if affordable."""
    locks = (material_of(mesh).nu > LOCKING).any()
    return affordable_order(mesh) if locks else 1


def find_discretisation_error(
    result: StaticResult, solve: Callable[..., StaticResult], warnings: list[str]
) -> DiscretisationError:
    """Error of ``result``: ``solve(order=...)`` answers the same problem with the other order."""
    if result.order == 1 and p2_unknowns(result.mesh) > LARGEST_P2:
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
