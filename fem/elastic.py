"""Energy and force of an elastic law on a discretised body."""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np
from jaxtyping import Float

from .blocks import BlockMatrix, Discretisation
from .device import start_warp
from .material import ElementMaterial


class Law(Enum):
    """Elastic laws; all answer with exactly (E, nu) at small strain."""

    LINEAR = 0
    NEO_HOOKEAN = 1
    COROTATED = 2


class ElasticBody:
    """Elastic energy W(u) of a body, its gradient and its second derivative.

    Parameters
    ----------
    grid
        The discretised mesh.
    material
        E, nu, rho of every tet.
    law
        LINEAR: Hooke's law; NEO_HOOKEAN: mu/2 (|F|^2 - 3) - mu (J - 1) + lam'/2 (J - 1)^2 with
        lam' = lam + mu (Smith, de Goes & Kim 2018, without the log term); COROTATED:
        mu |F - R|^2 + lam/2 (tr(R^T F) - 3)^2.
    """

    def __init__(self, grid: Discretisation, material: ElementMaterial, law: Law) -> None:
        wp = start_warp()
        self.grid, self.law = grid, law
        moduli = [wp.array(m, dtype=wp.float64, device=grid.device) for m in material.lame]
        self._arrays = [grid.points, grid.elements, grid.quadrature, *moduli, law.value]
        self._tets = len(grid.space.elements)

    def _launch(self, kernel: Any, inputs: list) -> None:
        arrays = [*self._arrays, *inputs]
        start_warp().launch(kernel, self._tets, inputs=arrays, device=self.grid.device)

    def energy(self, u: Any) -> float:
        """Elastic energy [J] of the displacement ``u``, a warp array of vec3d (nodes,)."""
        return float(self.element_energy(u).sum())

    def element_energy(self, u: Any) -> Float[np.ndarray, "tets"]:
        """Elastic energy [J] of every tet."""
        from . import kernels_law as k

        wp = start_warp()
        out = wp.empty(self._tets, dtype=wp.float64, device=self.grid.device)
        self._launch(k.element_energy, [u, out])
        return out.numpy()

    def add_force(self, u: Any, out: Any) -> None:
        """Add the gradient dW/du [N] to ``out``, a warp array of vec3d (nodes,)."""
        from . import kernels_law as k

        self._launch(k.internal_force, [u, out])

    def tangent(self, u: Any, *, projected: bool = False) -> BlockMatrix:
        """Second derivative of W [N/m]; ``projected``: every tet made positive semi-definite."""
        from . import kernels_law as k

        wp = start_warp()
        pattern = self.grid.pattern
        values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=self.grid.device)
        exact = self.law is Law.LINEAR or (self.law is Law.NEO_HOOKEAN and not projected)
        kernel = k.tangent if exact else k.projected_tangent
        self._launch(kernel, [u, pattern.slots, values])
        return BlockMatrix(pattern.rows, pattern.columns, values)
