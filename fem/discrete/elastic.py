"""Energy and force of an elastic law on a discretised body."""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..scene.material import ElementMaterial
from .assembly import BlockMatrix, Discretisation


class Law(Enum):
    """Elastic laws; all answer with exactly (E, nu) at small strain."""

    LINEAR = 0
    NEO_HOOKEAN = 1
    COROTATED = 2


class Response(NamedTuple):
    """Elastic ``energy`` W [J] and its gradient, the ``force`` [N] (nodes, 3) of resistance."""

    energy: float
    force: np.ndarray


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
        self._moduli = [wp.array(m, dtype=wp.float64, device=grid.device) for m in material.lame]
        self._arrays = [grid.points, grid.elements, grid.quadrature, *self._moduli, law.value]
        self._tets = len(grid.space.elements)

    def _launch(self, kernel: Any, inputs: list) -> None:
        start_warp().launch(kernel, self._tets, inputs=inputs, device=self.grid.device)

    def _field(self, u: np.ndarray) -> Any:
        wp = start_warp()
        return wp.array(u, dtype=wp.vec3d, device=self.grid.device)

    def response(self, u: Float[np.ndarray, "nodes 3"]) -> Response:
        """Energy and force at the displacement ``u`` [m]."""
        from ..laws import kernels_law as k

        wp = start_warp()
        field = self._field(u)
        energy = wp.empty(self._tets, dtype=wp.float64, device=self.grid.device)
        force = wp.zeros_like(field)
        self._launch(k.energy_and_force, [*self._arrays, field, energy, force])
        return Response(float(energy.numpy().sum()), force.numpy())

    def tangent(self, u: Float[np.ndarray, "nodes 3"], *, projected: bool = False) -> BlockMatrix:
        """Second derivative of W [N/m] at ``u`` [m]; ``projected``: no tet has a negative part."""
        from ..laws import kernels_law, kernels_projected

        wp = start_warp()
        pattern = self.grid.pattern
        values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=self.grid.device)
        inputs = [self._field(u), pattern.slots, values]
        if self.law is Law.COROTATED or (self.law is Law.NEO_HOOKEAN and projected):
            self._launch(kernels_projected.projected_tangent, [*self._arrays, *inputs])
        elif self.law is Law.NEO_HOOKEAN and self.grid.space.order == 1:
            arrays = [self.grid.points, self.grid.elements, *self._moduli]
            self._launch(kernels_law.neo_hookean_tangent_p1, [*arrays, *inputs])
        else:
            self._launch(kernels_law.tangent, [*self._arrays, *inputs])
        return BlockMatrix(pattern.rows, pattern.columns, values)
