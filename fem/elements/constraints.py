"""Supports as constraints of the discrete system: on every node, out of matrix and load."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool

from ..device import start_warp
from ..errors import InputError
from ..material import ElementMaterial
from ..scene.supports import Supports
from .assembly import BlockMatrix, Discretisation, add_diagonal, linear_stiffness
from .space import Space, extend_linear


def node_supports(supports: Supports, space: Space) -> Supports:
    """Continue ``supports`` to all nodes of ``space``: an edge is held where both its ends are."""
    if len(supports.fixed) == len(space.nodes):
        return supports
    if len(supports.fixed) != space.points:
        raise InputError(
            f"supports of {len(supports.fixed)} points: wanted {space.points} (mesh points) "
            f"or {len(space.nodes)} (nodes of the order-{space.order} space)"
        )
    edges = space.edges
    return Supports(
        np.concatenate([supports.fixed, supports.fixed[edges].all(axis=1)]),
        extend_linear(space, supports.values),
        np.concatenate([supports.springs, np.zeros((len(edges), 3))]),
    )


def free_components(fixed: Bool[np.ndarray, "nodes 3"], device: Any) -> Any:
    """Array of vec3d on a device: 1 where a component is free, 0 where it is ``fixed``."""
    from . import kernels_field as k

    wp = start_warp()
    if not wp.get_device(device).is_cuda:
        return wp.array(~fixed, dtype=wp.vec3d, device=device)
    given = wp.array(fixed.ravel().view(np.uint8), dtype=wp.uint8, device=device)  # an eighth
    free = wp.empty(len(fixed), dtype=wp.vec3d, device=device)
    numbers = free.view(wp.float64).flatten()
    wp.launch(k.lift_fixed, len(given), inputs=[given, numbers], device=device)
    return free


def apply_supports(
    matrix: BlockMatrix, fixed: np.ndarray, springs: np.ndarray | None = None
) -> None:
    """Add ``springs`` [N/m] (nodes, 3) and drop the ``fixed`` (nodes, 3) rows, in place."""
    device = matrix.values.device
    if springs is not None and springs.any():
        add_diagonal(matrix, springs)
    drop_rows(matrix, free_components(fixed, device))


def drop_rows(matrix: BlockMatrix, free: Any) -> None:
    """Drop the rows and columns that are not ``free``, in place: ``free_components`` says which."""
    from . import kernels_field as k

    wp, device = start_warp(), matrix.values.device
    inputs = [matrix.rows, matrix.columns, free, matrix.values]
    wp.launch(k.fix_rows, matrix.nodes, inputs=inputs, device=device)


class _Known(NamedTuple):
    grid: Discretisation
    material: ElementMaterial
    held: Supports
    matrix: BlockMatrix


# Stiffnesses of the last bodies: a rest, its buckling and its vibrations have the same one, and
# linear elements come between.
_RECENT: list[_Known] = []
_KEPT = 2


def held_stiffness(grid: Discretisation, material: ElementMaterial, held: Supports) -> BlockMatrix:
    """Stiffness [N/m] of linear elasticity with supports: one that was kept, or a new one."""
    for known in _RECENT:
        same = known.grid is grid and _as_stiff(known.material, material)
        if same and _alike(known.held, held):
            return known.matrix
    matrix = linear_stiffness(grid, material)
    apply_supports(matrix, held.fixed, held.springs)
    return matrix


def keep_stiffness(
    grid: Discretisation, material: ElementMaterial, held: Supports, matrix: BlockMatrix
) -> None:
    """Keep a ``held_stiffness`` for the next call of it: from now on nobody may change it."""
    if not any(known.matrix is matrix for known in _RECENT):
        _RECENT.insert(0, _Known(grid, material, held, matrix))
        del _RECENT[_KEPT:]


def _as_stiff(one: ElementMaterial, two: ElementMaterial) -> bool:
    """Whether every tet has the very same stiffness in both, whatever they weigh."""
    pairs = ((getattr(one, name), getattr(two, name)) for name in ("E", "nu", "tensor"))
    return one is two or all(a is b or np.array_equal(a, b) for a, b in pairs)


def _alike(one: Supports, two: Supports) -> bool:
    """Whether supports hold the same, wherever they hold it."""
    same = np.array_equal(one.fixed, two.fixed) and np.array_equal(one.springs, two.springs)
    return bool(same)


def reduced_load(
    matrix: BlockMatrix, load: np.ndarray, held: Supports, prescribed: np.ndarray
) -> np.ndarray:
    """Right-hand side (nodes, 3) once prescribed components are dropped from ``matrix``, in place.

    Prescribed unknowns of the reduced system are zero: they are known, and put back afterwards.
    """
    rhs = load - (matrix.times(prescribed) if prescribed.any() else 0.0)
    rhs[held.fixed] = 0.0
    apply_supports(matrix, held.fixed, held.springs)
    return rhs
