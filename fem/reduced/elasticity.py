"""Elastic energy of a reduced model, by the same functions of the law as the full body's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..device import Recorder, start_warp
from ..laws.law import LAWS, Law
from .gradients import cell_gradients
from .model import ReducedModel


class ReducedResponse(NamedTuple):
    """Elastic ``energy`` [J] and its gradient ``force`` (dofs,) [N/sqrt(kg)]."""

    energy: float
    force: np.ndarray


class ReducedElasticity:
    """Elastic energy W(q) of a reduced model, its gradient and second derivative.

    Parameters
    ----------
    model
        The reduced model.
    law
        Name of the elastic law, one of ``LAWS``.
    """

    def __init__(self, model: ReducedModel, law: str = Law.NEO_HOOKEAN) -> None:
        from ..discrete.kernels_elastic import elastic_kernels

        wp = start_warp()
        kernels = elastic_kernels(LAWS[law])
        self.model, self.law = model, law
        self.gradients = cell_gradients(model)
        self._H, self._P = (wp.empty(len(model.cells), dtype=wp.mat33d, device="cpu") for _ in "HP")
        self._W, self._lam, self._mu = (
            wp.empty(len(model.cells), dtype=wp.float64, device="cpu") for _ in range(3)
        )
        self._A = wp.empty((len(model.cells), 81), dtype=wp.float64, device="cpu")
        # What the kernels read and write, as numpy sees it: asking each time takes as long as they.
        self._h, self._p, self._w, self._a = (
            array.numpy() for array in (self._H, self._P, self._W, self._A)
        )
        record = Recorder(len(model.cells), "cpu")
        given = [self._H, self._lam, self._mu]
        self._stress = record(kernels.stress, [*given, self._W, self._P])
        exact, projected = kernels.exact_at, kernels.projected_at
        self._exact = record(exact or projected, [*given, self._A])
        self._projected = record(projected or exact, [*given, self._A])
        self.set_moduli(model.E, model.nu)

    def set_moduli(self, E: np.ndarray, nu: np.ndarray) -> None:
        """Take other moduli ``E`` [Pa] and ``nu`` [1] of the cells, shape (cells,)."""
        self.model = self.model.with_moduli(E, nu)
        self._weigh(*self.model.lame)

    def _weigh(self, lam: np.ndarray, mu: np.ndarray) -> None:
        """Laws are linear in the Lame parameters: the weight of a cell goes in with them."""
        self._lam.assign(self.model.weights * lam)
        self._mu.assign(self.model.weights * mu)

    def stress(self, q: np.ndarray) -> np.ndarray:
        """First Piola stress times the weight of every cell [Pa m^3], shape (cells, 3, 3)."""
        self._h[:] = self.gradients.of(q)
        self._stress.launch()
        return self._p

    def force_with(self, q: np.ndarray, lam: np.ndarray, mu: np.ndarray) -> np.ndarray:
        """Elastic force (dofs,) [N/sqrt(kg)] at ``q`` with other Lame parameters (cells,) [Pa]."""
        self._weigh(lam, mu)
        force = self.gradients.pull(self.stress(q))
        self._weigh(*self.model.lame)
        return force

    def response(self, q: np.ndarray) -> ReducedResponse:
        """Energy and force at the coordinates ``q`` (dofs,) [m sqrt(kg)], springs and all."""
        force = self.gradients.pull(self.stress(q))
        springs = self.model.springs @ q
        return ReducedResponse(float(self._w.sum() + 0.5 * springs @ q), force + springs)

    def tangent(self, q: np.ndarray, *, projected: bool = False) -> np.ndarray:
        """Second derivative (dofs, dofs) [1/s^2]; ``projected``: no cell has a negative part."""
        self._h[:] = self.gradients.of(q)
        (self._projected if projected else self._exact).launch()
        return self.gradients.pull_tangent(self._a.reshape(-1, 9, 9)) + self.model.springs
