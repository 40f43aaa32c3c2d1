"""Rayleigh damping: of the velocity by the mass, and of the rate of strain by the stiffness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..device import start_warp
from ..elements.assembly import BlockMatrix, Discretisation, add_diagonal
from ..elements.elastic import Response, displacement_gradients
from ..elements.space import element_points
from ..errors import InputError
from ..material import ElementMaterial, LameParameters


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping C = ``mass`` M + ``stiffness`` K [1/s, s]; none by default.

    K resists the rate of strain of the body as it lies, so that it brakes no turn; M brakes all.

    Parameters
    ----------
    mass
        Rate [1/s] at which velocities fade, all of them.
    stiffness
        Time [s] by which rates of strain are resisted.

    Examples
    --------
    >>> from autophyx_tet.fem import Damping, Dynamics, ElementMaterial, box_mesh
    >>> block = box_mesh((1, 1, 1), (1, 1, 1))
    >>> block = block.with_material(ElementMaterial.uniform(6, E=1e6, nu=0.0, rho=1e3))
    >>> body = Dynamics(block, velocity=(1.0, 0.0, 0.0), damping=Damping(mass=1.0))
    >>> body.step(1.0).v[0, 0].round(6).item()  # m/s: implicit Euler, v / (1 + dt)
    0.5
    """

    mass: float = 0.0
    stiffness: float = 0.0


class Rayleigh:
    """Damping forces of a body of nodal ``mass`` [kg] (nodes,).

    Viscosity is a stress that resists the rate of strain and leaves turns alone (Kelvin & Voigt).
    Over a step of dt the rate is (E - E_0) / dt with Green's strains at its ends. Its stress is
    then the derivative of dt |rate|^2 / 2 by the displacement, with Hooke's law as the norm: a turn
    of any size costs nothing, and small motions see exactly the stiffness at rest times their
    velocity.
    """

    def __init__(
        self,
        grid: Discretisation,
        material: ElementMaterial,
        mass: Float[np.ndarray, "nodes"],
        damping: Damping,
    ) -> None:
        if damping.stiffness and material.tensor is not None:
            raise InputError("damping.damping_proportion")
        self.alpha, self.beta = damping.mass, damping.stiffness
        self.mass, self.grid = damping.mass * mass[:, None], grid
        lame = [grid.array(self.beta * np.asarray(m)) for m in material.lame]  # [Pa s]
        self._arrays = [grid.tets, *lame, None, True]  # no tensors; finite strains

    def force(self, u: np.ndarray, v: np.ndarray) -> Float[np.ndarray, "nodes 3"]:
        """Damping force [N] at the displacement ``u`` [m] and velocity ``v`` [m/s]."""
        return self.mass * v + (self._viscous(1.0, u, v, rate=True).force if self.beta else 0.0)

    def step(self, u: np.ndarray, start: np.ndarray, dt: float) -> Response:
        """Half the energy [J] lost in a step of ``dt`` [s] from ``start`` to ``u``, its force."""
        push = self.mass * (u - start) / dt
        energy = 0.5 * float(((u - start) * push).sum())
        if not self.beta:
            return Response(energy, push)
        more, force = self._viscous(1 / dt, u, start, rate=False)
        return Response(energy + more, push + force)

    def _viscous(self, scale: float, u: np.ndarray, along: np.ndarray, *, rate: bool) -> Response:
        """Potential [J] and force [N] of the viscosity, ``rate``: for the velocity ``along``."""
        from ..elements import kernels_elastic as k

        wp = start_warp()
        fields = [self.grid.array(u), self.grid.array(along)]
        tets, device = len(self.grid.space.elements), self.grid.device
        energy = wp.zeros(tets, dtype=wp.float64, device=device)
        force = wp.zeros_like(fields[0])
        inputs = [*self._arrays, scale, *fields, rate, energy, force]
        wp.launch(k.tensor_response, tets, inputs=inputs, device=device)
        return Response(float(energy.numpy().sum()), force.numpy())

    def stresses(
        self, u: np.ndarray, start: np.ndarray, v: np.ndarray | None, dt: float
    ) -> list[Callable[[LameParameters], np.ndarray]]:
        """Viscous stresses (tets, points, 3, 3) of given moduli: of ``step``, of ``force`` at v.

        First Piola stresses at the points of ``element_points``, linear in the moduli (broadcast).
        """
        where = element_points(self.grid.space.order)

        def stress(lame: LameParameters, at: np.ndarray, along: np.ndarray, rate: bool):
            H, G = (displacement_gradients(self.grid, field, where) for field in (at, along))
            D, T = H - G, H.swapaxes(-1, -2)
            D = G + T @ G if rate else D + (T @ D + D.swapaxes(-1, -2) @ G) / 2
            trace = np.trace(D, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
            lam, mu = (np.asarray(m)[..., None, None] for m in lame)
            S = mu * (D + D.swapaxes(-1, -2)) + lam * trace
            return S + H @ S

        if not self.beta:
            return []
        of_step = lambda lame: self.beta / dt * stress(lame, u, start, False)  # noqa: E731
        if v is None:
            return [of_step]
        return [of_step, lambda lame: self.beta * stress(lame, start, v, True)]

    def add_to(
        self, matrix: BlockMatrix, u: np.ndarray, start: np.ndarray, dt: float, *, projected: bool
    ) -> None:
        """Add the derivative of the force of ``step`` to ``matrix``.

        ``projected``: no tet has a negative part.
        """
        from ..elements import kernels_elastic as k

        if self.beta:
            inputs = [*self._arrays, 1 / dt, self.grid.array(u), self.grid.array(start), projected]
            inputs += [self.grid.pattern.slots, matrix.values]
            tets, device = len(self.grid.space.elements), self.grid.device
            start_warp().launch(k.tensor_tangent, tets, inputs=inputs, device=device)
        add_diagonal(matrix, self.mass[:, :, None] / dt * np.eye(3))
