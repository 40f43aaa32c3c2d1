"""A mesh on a device: its space and matrix pattern; the stiffness assembled on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..laws.law import LAWS, Law
from ..scene.material import ElementMaterial
from ..scene.mesh import TetMesh
from .block_matrix import BlockMatrix
from .space import Space, element_points, make_space


class Pattern(NamedTuple):
    """Which node couples with which, in block rows; device arrays of warp.

    ``rows`` (nodes + 1) and ``columns`` (blocks) as in CSR with sorted columns, ``slots``
    (tets, k * k) the position of every pair of an element's nodes in ``columns``.
    """

    rows: Any
    columns: Any
    slots: Any


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The space of a mesh and its arrays on one device."""

    space: Space
    device: str
    points: Any
    elements: Any
    quadrature: Any
    pattern: Pattern
    _constants: list[tuple[np.ndarray, Any]] = field(default_factory=list, repr=False)

    def constant(self, values: Float[np.ndarray, "tets"]) -> Any:
        """Array on the device of numbers that are only read; of a material's it is kept.

        What may be written to is copied anew, for nobody would tell.
        """
        for known, there in self._constants:
            if known is values:
                return there
        made = self.array(values)
        if not values.flags.writeable:
            self._constants.insert(0, (values, made))
            del self._constants[_CONSTANTS:]
        return made

    def array(self, values: Any) -> Any:
        """Array on the device of numbers (n,) or vectors (n, 3); one that is there as it is."""
        if not isinstance(values, np.ndarray):
            return values.array
        wp = start_warp()
        dtype = wp.vec3d if values.ndim == 2 else wp.float64
        return wp.array(values, dtype=dtype, device=self.device)


# Discretisations of the last meshes, by the identity of their arrays: materials come and go on the
# same tets, while a solve of each order on two meshes is all that alternates in practice.
_RECENT: list[tuple[np.ndarray, np.ndarray, Discretisation]] = []
_KEPT = 4
_CONSTANTS = 4  # lam, mu and rho of one material, and one more


def discretise(mesh: TetMesh, order: int, device: str = "cpu") -> Discretisation:
    """Space, pattern and device arrays of ``mesh``, kept for the next call with the same tets."""
    for points, tets, grid in _RECENT:
        same = points is mesh.points and tets is mesh.tets
        if same and grid.space.order == order and grid.device == device:
            return grid
    grid = _discretise(mesh, order, device)
    _RECENT.insert(0, (mesh.points, mesh.tets, grid))
    del _RECENT[_KEPT:]
    return grid


def _discretise(mesh: TetMesh, order: int, device: str) -> Discretisation:
    wp = start_warp()
    space = make_space(mesh, order)
    pattern = make_pattern(space, device)
    return Discretisation(
        space,
        device,
        wp.array(space.nodes, dtype=wp.vec3d, device=device),
        wp.array(space.elements, dtype=wp.int32, device=device),
        wp.array(element_points(order), dtype=wp.vec4d, device=device),
        pattern,
    )


def make_pattern(space: Space, device: str = "cpu") -> Pattern:
    """Pattern of the stiffness of ``space``; made on the CPU, then moved to ``device``."""
    from scipy.sparse import csr_array

    from . import kernels_matrix as k

    wp = start_warp()
    elements, count = space.elements, len(space.nodes)
    tets, size = elements.shape
    ones = np.ones(elements.size, dtype=np.int8)
    owner = csr_array((ones, elements.ravel(), np.arange(tets + 1) * size), shape=(tets, count))
    owner = owner.tocsc()  # counting sort: the elements around every node
    start = wp.array(owner.indptr, dtype=wp.int32, device="cpu")
    incident = wp.array(owner.indices, dtype=wp.int32, device="cpu")
    nodes = wp.array(elements, dtype=wp.int32, device="cpu")
    scratch = wp.empty(size * elements.size + count, dtype=wp.int32, device="cpu")
    lengths = wp.empty(count, dtype=wp.int32, device="cpu")
    wp.launch(k.sorted_rows, count, inputs=[start, incident, nodes, scratch, lengths], device="cpu")
    rows = wp.array(np.concatenate([[0], np.cumsum(lengths.numpy())]), dtype=wp.int32, device="cpu")
    columns = wp.empty(int(rows.numpy()[-1]), dtype=wp.int32, device="cpu")
    wp.launch(k.copy_rows, count, inputs=[start, size, scratch, rows, columns], device="cpu")
    slots = wp.empty((tets, size * size), dtype=wp.int32, device="cpu")
    wp.launch(k.element_slots, tets, inputs=[nodes, rows, columns, slots], device="cpu")
    return Pattern(rows.to(device), columns.to(device), slots.to(device))


def linear_stiffness(grid: Discretisation, material: ElementMaterial) -> BlockMatrix:
    """Stiffness matrix [N/m] of linear elasticity, along the grain where there is one."""
    if material.tensor is None:
        return stiffness(grid, *material.lame)
    from . import kernels_grain as k

    wp = start_warp()
    device, pattern = grid.device, grid.pattern
    values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=device)
    tensor = wp.array(material.tensor, dtype=k.mat66d, device=device)
    inputs = [grid.points, grid.elements, grid.quadrature, tensor, pattern.slots, values]
    wp.launch(k.anisotropic_stiffness, len(material.tensor), inputs=inputs, device=device)
    return BlockMatrix(pattern.rows, pattern.columns, values)


def stiffness(grid: Discretisation, lam: np.ndarray, mu: np.ndarray) -> BlockMatrix:
    """Stiffness matrix [N/m] of linear elasticity with Lame parameters (tets,) [Pa]."""
    wp = start_warp()
    from .kernels_elastic import elastic_kernels

    device, pattern = grid.device, grid.pattern
    kernels = elastic_kernels(LAWS[Law.LINEAR])
    values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=device)
    moduli = [grid.constant(m) for m in (lam, mu)]
    kernel, arrays = kernels.stiffness_p1, [grid.points, grid.elements, *moduli]
    if grid.space.order == 2:
        kernel, arrays = kernels.stiffness_p2, [*arrays[:2], grid.quadrature, *moduli]
    wp.launch(kernel, len(lam), inputs=[*arrays, pattern.slots], outputs=[values], device=device)
    return BlockMatrix(pattern.rows, pattern.columns, values)
