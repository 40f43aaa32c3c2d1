"""Energy, force and tangent of an elastic law on a discretised body."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..errors import InputError
from ..laws.law import LAWS
from ..scene.material import ElementMaterial
from .assembly import Discretisation, linear_stiffness
from .block_matrix import BlockMatrix


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
        Name of the elastic law, one of ``LAWS``.
    """

    def __init__(self, grid: Discretisation, material: ElementMaterial, law: str) -> None:
        start_warp()
        from .kernels_elastic import elastic_kernels

        self.grid, self.law = grid, law
        self._law, self._kernels = LAWS[law], elastic_kernels(LAWS[law])
        self._grained: BlockMatrix | None = None
        if material.tensor is not None:
            if self._law.finite:
                raise InputError(f"the {self._law.title} law knows no grain: wanted the linear one")
            self._grained = linear_stiffness(grid, material)
        moduli = [grid.array(m) for m in material.lame]
        self._p1_arrays = [grid.points, grid.elements, *moduli]
        self._arrays = [grid.points, grid.elements, grid.quadrature, *moduli]

    def _launch(self, kernel: Any, inputs: list) -> None:
        tets = len(self.grid.space.elements)
        start_warp().launch(kernel, tets, inputs=inputs, device=self.grid.device)

    def response(self, u: Float[np.ndarray, "nodes 3"]) -> Response:
        """Energy and force at the displacement ``u`` [m]."""
        if self._grained is not None:
            pull = self._grained.times(u)
            return Response(0.5 * float((u * pull).sum()), pull)
        wp = start_warp()
        field = self.grid.array(u)
        tets = len(self.grid.space.elements)
        energy = wp.empty(tets, dtype=wp.float64, device=self.grid.device)
        force = wp.zeros_like(field)
        self._launch(self._kernels.energy_and_force, [*self._arrays, field, energy, force])
        # On a GPU the sum is made there: one number comes back.
        total = wp.utils.array_sum(energy) if energy.device.is_cuda else energy.numpy().sum()
        return Response(float(total), force.numpy())

    def tangent(self, u: Float[np.ndarray, "nodes 3"], *, projected: bool = False) -> BlockMatrix:
        """Second derivative of W [N/m] at ``u`` [m].

        ``projected``: no tet has a negative part. Where the law offers one of the two only, that is
        what it gives.
        """
        wp = start_warp()
        if self._grained is not None:
            rows, columns, values = self._grained.rows, self._grained.columns, self._grained.values
            return BlockMatrix(rows, columns, wp.clone(values))
        pattern = self.grid.pattern
        values = wp.zeros(pattern.columns.shape[0], dtype=wp.mat33d, device=self.grid.device)
        kernel, inputs = self._second_derivative(u, projected)
        self._launch(kernel, [*inputs, pattern.slots, values])
        return BlockMatrix(pattern.rows, pattern.columns, values)

    def _second_derivative(self, u: np.ndarray, projected: bool) -> tuple[Any, list]:
        """Kernel of the second derivative and its inputs but the matrix."""
        kernels, p1 = self._kernels, self.grid.space.order == 1
        if kernels.stiffness_p1:
            kernel = kernels.stiffness_p1 if p1 else kernels.stiffness_p2
            return kernel, self._p1_arrays if p1 else self._arrays
        field = self.grid.array(u)
        if kernels.projected and (projected or not kernels.exact):
            return kernels.projected, [*self._arrays, field]
        if self._law.tangent_p1 and p1:
            return self._law.tangent_p1, [*self._p1_arrays, field]
        return kernels.exact, [*self._arrays, field]
