"""Discretisation error of a body at rest; what elements a motion takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..discrete.assembly import discretise
from ..discrete.constraints import held_stiffness, node_supports
from ..discrete.space import LARGEST_MOVING, LARGEST_P2, affordable_order, p2_unknowns
from ..errors import ConvergenceError, InputError
from ..model_error import BENDS_ALIKE
from ..result import CUBIC, LOCKING, DiscretisationError, StaticResult
from ..scene.mesh import TetMesh, material_of
from ..scene.supports import Supports
from .cubic_surplus import STILL_TO_COME, cubic_surplus
from .held_inverse import held_inverse
from .modal import natural_modes, quick_order

# Unknowns of quadratic elements up to which a motion takes them where linear ones lock in bending.
FEW_UNKNOWNS = 20_000
# Where no factor is affordable the estimate solves to this relative residual.
ROUGH = 1e-3
LINEAR_TAKEN = f"linear elements were taken: quadratic ones have over {LARGEST_P2:,} unknowns"


class MotionElements(NamedTuple):
    """Order of a motion's elements, and how many times too stiff they are: NaN, not known."""

    order: int
    stiffening: float = np.nan


def motion_order(mesh: TetMesh) -> int:
    """Linear elements for a motion, but quadratic ones where linear ones lock, if affordable."""
    locks = (material_of(mesh).nu > LOCKING).any()
    return affordable_order(mesh, LARGEST_MOVING) if locks else 1


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
    result: StaticResult, supports: Supports, solve: Callable[..., StaticResult], **loads: Any
) -> DiscretisationError:
    """Error of the linear ``result`` under ``supports`` and ``loads`` as in ``solve_static``.

    ``solve(order=2)`` answers the same problem with quadratic elements, where linear ones were
    taken.
    """
    if supports.values.any():
        why = "the largest displacement is a prescribed one, whatever the mesh"
        return DiscretisationError(np.nan, "", why)
    largest = float(np.linalg.norm(result.displacement, axis=1).max())
    if result.order == 1:
        if affordable_order(result.mesh) == 1:
            return DiscretisationError(np.nan, "", LINEAR_TAKEN)
        try:
            fine = float(np.linalg.norm(solve(order=2).displacement, axis=1).max())
        except ConvergenceError as error:
            return DiscretisationError(np.nan, "", f"quadratic elements gave no answer ({error})")
        return DiscretisationError(abs(largest - fine) / fine if fine > 0 else 0.0, "P1/P2")
    grid = discretise(result.mesh, 2)
    held = node_supports(supports, grid.space)
    stiffness = held_stiffness(grid, material_of(result.mesh), held)
    inverse = held_inverse(stiffness, grid.space, held, rough=ROUGH)
    assert inverse is not None  # it may be rough
    known = {name: loads[name] for name in ("gravity_vector", "traction")}
    moved = cubic_surplus(result, supports, inverse.solve, **known)
    node = int(np.linalg.norm(result.displacement, axis=1).argmax())
    change = abs(float(np.linalg.norm(result.displacement[node] + moved[node])) - largest)
    return DiscretisationError(STILL_TO_COME * change / largest if largest else 0.0, CUBIC)
