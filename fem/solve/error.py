"""Discretisation error of a body at rest; what elements a motion takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..elements.assembly import node_supports
from ..elements.elastic import constrained_stiffness
from ..elements.space import LARGEST_MOVING, LARGEST_P2, affordable_order, p2_unknowns
from ..errors import ConvergenceError, InputError
from ..linalg.solver import rough_factor
from ..mesh import TetMesh, material_of
from ..note import Note
from ..scene.supports import Supports
from .mesh_error import MeshError, estimate_error
from .modal import QUICK, factor_fits, natural_modes
from .result import BENDS_ALIKE, LOCKING, DiscretisationError, StaticResult

# Unknowns of quadratic elements up to which a motion takes them where linear ones lock in bending.
FEW_UNKNOWNS = 20_000
LINEAR_TAKEN = Note("error.linear_elements", largest_p2=LARGEST_P2)


class MotionElements(NamedTuple):
    """Order of a motion's elements, and how many times too stiff they are: NaN, not known."""

    order: int
    stiffening: float = np.nan


def motion_order(mesh: TetMesh) -> int:
    """Linear elements for a motion, but quadratic ones where linear ones lock, if affordable."""
    locks = (material_of(mesh).nu > LOCKING).any()
    return affordable_order(mesh, LARGEST_MOVING) if locks else 1


def motion_elements(
    mesh: TetMesh, supports: Supports | None, order: int | None = None, *, most: int = FEW_UNKNOWNS
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
        if not factor_fits(mesh, most=QUICK):
            return np.nan
        linear, quadratic = (
            float(natural_modes(mesh, 1, supports=supports, order=order).frequencies[0]) ** 2
            for order in (1, 2)
        )
    except (InputError, ConvergenceError):
        return np.nan
    return linear / quadratic if quadratic > 0 else np.nan


def find_discretisation_error(
    result: StaticResult, supports: Supports, solve: Callable[..., StaticResult], **loads: Any
) -> MeshError:
    """Error of the linear ``result`` under ``supports`` and ``loads`` as in ``solve_static``.

    ``solve(order=2)`` answers the same problem with quadratic elements, where linear ones were
    taken.
    """
    if result.order == 1:
        return MeshError(_error_of_linear(result, supports, solve))
    if (stiffness := result.cycle) is None:
        space = result.space
        held = node_supports(supports, space)
        known = {"points": space.nodes, "fixed": held.fixed, "edges": space.edges}
        stiffness = rough_factor(constrained_stiffness(result.body, held), **known)
    known = {name: loads.get(name) for name in ("gravity_vector", "traction", "forces")}
    return estimate_error(result, supports, stiffness, **known)


def _error_of_linear(
    result: StaticResult, supports: Supports, solve: Callable[..., StaticResult]
) -> DiscretisationError:
    """Error of linear elements, by the answer of quadratic ones where these are affordable."""
    if affordable_order(result.mesh) == 1:
        return DiscretisationError(np.nan, "", LINEAR_TAKEN)
    try:
        fine = solve(order=2)
    except ConvergenceError as error:
        return DiscretisationError(np.nan, "", Note("error.quadratic_elements", error=error))
    change = fine.displacement - result.displacement
    coarse, largest, off = (
        float(np.linalg.norm(u, axis=1).max())
        for u in (result.displacement, fine.displacement, change)
    )
    if not supports.values.any():  # else the largest may be prescribed
        off = abs(coarse - largest)
    return DiscretisationError(off / largest if largest > 0 else 0.0, "P1/P2")
