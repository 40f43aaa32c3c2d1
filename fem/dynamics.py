"""Implicit dynamics: every step minimises an incremental potential by Newton's method."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from jaxtyping import Float

from .blocks import discretise
from .contact import Contact
from .device import checked_device, start_warp
from .elastic import ElasticBody, Law
from .errors import ConvergenceError, InputError
from .incremental import Damping, Incremental, Rayleigh
from .mass import lumped_mass
from .mesh import TetMesh
from .newton import minimise
from .obstacles import Obstacle
from .repeated import RepeatedSolver
from .statics import material_of
from .supports import Supports

logger = logging.getLogger(__name__)

# A step ends when the unbalanced force is below this share of the external and inertial force.
TOLERANCE = 1e-4
# A step that fails is halved so often at most.
HALVINGS = 8
# Normal forces of friction are frozen during a solve: two solves settle them.
FRICTION_PASSES = 2


# Forces below this strain of the whole body, times its E, count as none [N].
NOISE = 1e-10


class Scheme(Enum):
    """Time integration: first order and damping, second order and damping little, conserving."""

    IMPLICIT_EULER = "implicit Euler"
    BDF2 = "BDF2"
    TRAPEZOIDAL = "trapezoidal"


@dataclass(frozen=True, eq=False)
class Motion:
    """State of a body at ``time`` [s].

    Parameters
    ----------
    u, v, a
        Displacement [m], velocity [m/s] and acceleration [m/s^2], shape (nodes, 3).
    contact_force
        Force of the obstacles on every node [N], shape (nodes, 3).
    gap
        Smallest distance of the surface from an obstacle [m]; infinite without obstacles.
    kinetic, elastic, potential
        Energies [J]; ``potential`` is that of gravity and dead forces.
    iterations
        Newton iterations of the step.
    """

    time: float
    u: Float[np.ndarray, "nodes 3"]
    v: Float[np.ndarray, "nodes 3"]
    a: Float[np.ndarray, "nodes 3"]
    contact_force: Float[np.ndarray, "nodes 3"]
    gap: float
    kinetic: float
    elastic: float
    potential: float
    iterations: int

    @property
    def energy(self) -> float:
        """Total energy [J] without the barrier's."""
        return self.kinetic + self.elastic + self.potential


class Dynamics:
    """A body in motion.

    Parameters
    ----------
    mesh
        Tets with a material.
    supports
        Prescribed components (values are held from the start on) and springs.
    gravity
        Acceleration of gravity [m/s^2].
    forces
        Constant nodal forces [N], shape (points, 3) or (nodes, 3).
    obstacles, friction
        Rigid obstacles, and the coefficient of Coulomb friction on all of them.
    velocity
        Initial velocity [m/s], (3,) or (nodes, 3).
    law, order, scheme, damping
        Elastic law, order of the elements, time integration, Rayleigh damping.
    tolerance
        Residual of a step over the external and inertial force.
    """

    def __init__(
        self,
        mesh: TetMesh,
        *,
        supports: Supports | None = None,
        gravity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        forces: np.ndarray | None = None,
        obstacles: Sequence[Obstacle] = (),
        friction: float = 0.0,
        velocity: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        law: Law = Law.NEO_HOOKEAN,
        order: int = 1,
        scheme: Scheme = Scheme.IMPLICIT_EULER,
        damping: Damping | None = None,
        tolerance: float = TOLERANCE,
        device: str = "cpu",
    ) -> None:
        self.mesh, self.scheme, self.tolerance = mesh, scheme, tolerance
        grid = discretise(mesh, order, checked_device(device))
        self.space = grid.space
        self.body = ElasticBody(grid, material_of(mesh), law)
        self.mass = lumped_mass(mesh, grid.space)
        nodes = len(grid.space.nodes)
        self.held = (supports or Supports.none(len(mesh.points))).on(grid.space)
        self.load = self.mass[:, None] * np.asarray(gravity, dtype=float)
        if forces is not None:
            self.load[: len(forces)] += forces
        self.contact = Contact(mesh, grid.space, obstacles, friction)
        self.damping = Rayleigh(self, damping) if damping else None
        area = float((np.ptp(mesh.bounds, axis=0) ** 2).sum())
        self.noise = NOISE * float(np.median(material_of(mesh).E)) * area
        self._solver = RepeatedSolver(grid.space.nodes, self.held.fixed)
        u = np.where(self.held.fixed, self.held.values, 0.0)
        v = np.where(self.held.fixed, 0.0, np.broadcast_to(velocity, (nodes, 3)))
        if not self.contact.gap(u) > 0:
            raise InputError(
                f"the body starts {-self.contact.gap(u):g} m inside an obstacle: wanted a gap"
            )
        self.state = self._measured(0.0, u, v, self._acceleration(u, v), 0)
        self._previous: Motion | None = None  # for BDF2

    def _acceleration(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        force = self.load - self._internal(u) - self.held.springs * u
        force += self.contact.forces(u, len(u))
        mass = np.where(self.mass > 0, self.mass, 1.0)[:, None]
        return np.where(self.held.fixed, 0.0, force / mass)

    def _array(self, u: np.ndarray):
        wp = start_warp()
        return wp.array(u, dtype=wp.vec3d, device=self.body.grid.device)

    def _internal(self, u: np.ndarray) -> np.ndarray:
        field = self._array(u)
        force = start_warp().zeros_like(field)
        self.body.add_force(field, force)
        return force.numpy()

    def _measured(self, time, u, v, a, iterations) -> Motion:
        return Motion(
            time,
            u,
            v,
            a,
            self.contact.forces(u, len(u)),
            self.contact.gap(u),
            0.5 * float((self.mass[:, None] * v**2).sum()),
            self.body.energy(self._array(u)) + 0.5 * float((self.held.springs * u**2).sum()),
            -float((self.load * u).sum()),
            iterations,
        )

    def step(self, dt: float) -> Motion:
        """Advance by ``dt`` [s]; a step that does not converge is made of smaller ones.

        Raises
        ------
        ConvergenceError
            If steps of dt / 256 still fail.
        """
        return self._step(dt, HALVINGS)

    def _step(self, dt: float, halvings: int) -> Motion:
        try:
            self._advance(dt)
        except ConvergenceError as error:
            if halvings == 0:
                raise
            logger.info("step of %g s failed (%s): halved", dt, error)
            self._previous = None  # BDF2 needs equal steps
            for _ in range(2):
                self._step(dt / 2, halvings - 1)
            self._previous = None
        return self.state

    def run(self, dt: float, steps: int) -> list[Motion]:
        """Return the states after each of ``steps`` steps of ``dt`` [s], the start first."""
        return [self.state, *(self.step(dt) for _ in range(steps))]

    def _advance(self, dt: float) -> None:
        old, state = self._previous, self.state
        self.contact.begin(state.u, state.time + dt, dt)
        scheme = self.scheme
        if old is None and scheme is Scheme.BDF2:
            scheme = Scheme.IMPLICIT_EULER  # the first step has no history
        if scheme is Scheme.IMPLICIT_EULER:
            factor, target = 1 / dt**2, state.u + dt * state.v
        elif scheme is Scheme.TRAPEZOIDAL:
            factor = 4 / dt**2
            target = state.u + dt * state.v + dt**2 / 4 * state.a
        else:
            assert old is not None
            factor = 9 / (4 * dt**2)
            target = (4 * state.u - old.u) / 3 + 2 * dt / 9 * (4 * state.v - old.v)
        u, iterations = self._solve(factor, np.where(self.held.fixed, state.u, target), dt)
        if scheme is Scheme.IMPLICIT_EULER:
            v = (u - state.u) / dt
            a = (v - state.v) / dt
        elif scheme is Scheme.TRAPEZOIDAL:
            a = factor * (u - target)
            v = state.v + dt / 2 * (state.a + a)
        else:
            assert old is not None
            v = (3 * u - 4 * state.u + old.u) / (2 * dt)
            a = factor * (u - target)
        v, a = (np.where(self.held.fixed, 0.0, w) for w in (v, a))
        self._previous = state
        self.state = self._measured(state.time + dt, u, v, a, iterations)

    def _solve(self, factor: float, target: np.ndarray, dt: float) -> tuple[np.ndarray, int]:
        start = self.contact.allowed(self.state.u)
        if not self.contact.gap(start) > 0:
            raise ConvergenceError("an obstacle moves through the body: use a smaller step")
        ahead = target + self._foreseen(factor) - start
        u = start + min(1.0, self.contact.longest_step(start, ahead)) * ahead
        potential = Incremental(self, factor, target, dt)
        count = 0
        for _ in range(FRICTION_PASSES if self.contact.friction else 1):
            self.contact.lag_friction(u)
            goal = self.tolerance * potential.scale()
            found = minimise(potential, u, solve=self._solver, target=goal)
            u, count = found.u, count + found.iterations
        return u, count

    def solve_adjoint(self, factor: float, u: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Solve H x = b with the Hessian [N/m] of the last step at ``u``, for its gradients."""
        potential = Incremental(self, factor, u, 1.0)
        return self._solver(potential.hessian(u, projected=False), b, 0.0)

    def _foreseen(self, factor: float) -> np.ndarray:
        """Way that the last acceleration adds to inertia: the first guess of a smooth step."""
        if self.contact.gap(self.state.u) < self.contact.thickness:
            return np.zeros_like(self.state.u)
        return np.where(self.held.fixed, 0.0, self.state.a / factor)
