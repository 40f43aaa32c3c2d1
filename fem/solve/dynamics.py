"""Implicit dynamics: every step minimises an incremental potential by Newton's method."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..contact.barrier import Contact
from ..device import checked_device, one_thread
from ..discrete.assembly import discretise
from ..discrete.elastic import ElasticBody, Law, Response
from ..discrete.mass import lumped_mass
from ..discrete.space import Space
from ..errors import ConvergenceError, InputError
from ..linalg.reused import RepeatedSolver
from ..scene.mesh import TetMesh
from ..scene.obstacles import Obstacle
from ..scene.supports import Supports
from .newton import minimise
from .potential import Damping, Incremental, Rayleigh
from .schemes import Forecast, Kinematics, Scheme, Step
from .statics import material_of

logger = logging.getLogger(__name__)

# A step ends when the unbalanced force is below this share of the external and inertial force.
TOLERANCE = 1e-4
# A step that fails is halved so often at most.
HALVINGS = 8
# Normal forces of friction are frozen during a solve: two solves settle them.
FRICTION_PASSES = 2
# Forces below this strain of the whole body, times its E, count as none [N].
NOISE = 1e-10


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
    kinetic, elastic, potential, barrier
        Energies [J]: of gravity and dead forces, and of the obstacles, the last two.
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
    barrier: float
    iterations: int

    @property
    def energy(self) -> float:
        """Total energy [J]."""
        return self.kinetic + self.elastic + self.potential + self.barrier


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
    obstacles, friction, thickness
        Rigid obstacles, the coefficient of Coulomb friction on all of them, and the distance [m]
        at which they begin to push, by default a thousandth of the body's diagonal.
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
        thickness: float | None = None,
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
        self.contact = Contact(mesh, grid.space, obstacles, friction, thickness)
        self.damping = Rayleigh(self, damping) if damping else None
        area = float((np.ptp(mesh.bounds, axis=0) ** 2).sum())
        self.noise = NOISE * float(np.median(material_of(mesh).E)) * area
        self.rigidity = _rigidity(mesh, grid.space)
        self._solver = RepeatedSolver(grid.space.nodes, self.held.fixed)
        u = np.where(self.held.fixed, self.held.values, 0.0)
        v = np.where(self.held.fixed, 0.0, np.broadcast_to(velocity, (nodes, 3)))
        if not self.contact.gap(u) > 0:
            raise InputError(
                f"the body starts {-self.contact.gap(u):g} m inside an obstacle: wanted a gap"
            )
        self._known: tuple[np.ndarray, Response] = (u, self.body.response(u))
        start = Kinematics(u, v, self._acceleration(u, v))
        self.state = self._measured(0.0, start, 0)
        self._forget()

    def _forget(self) -> None:
        """Start anew from the state: its past has other steps, or none."""
        self._before: Kinematics | None = None  # for BDF2
        self._forecast, self._dt = Forecast(), 0.0

    def _acceleration(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        force = self.load - self.response(u).force - self.held.springs * u
        force += self.contact.forces(u, len(u))
        if self.damping:
            force -= self.damping.force(v, 1.0)
        mass = np.where(self.mass > 0, self.mass, 1.0)[:, None]
        return np.where(self.held.fixed, 0.0, force / mass)

    def response(self, u: np.ndarray) -> Response:
        """Elastic energy and force at ``u`` [m]; the last one is remembered."""
        if self._known[0] is not u:
            self._known = (u, self.body.response(u))
        return self._known[1]

    def _measured(self, time: float, motion: Kinematics, iterations: int) -> Motion:
        u, v, _ = motion
        springs = 0.5 * float((self.held.springs * u**2).sum())
        return Motion(
            time,
            *motion,
            contact_force=self.contact.forces(u, len(u)),
            gap=self.contact.gap(u),
            kinetic=0.5 * float((self.mass[:, None] * v**2).sum()),
            elastic=self.response(u).energy + springs,
            potential=-float((self.load * u).sum()),
            barrier=self.contact.barrier(u),
            iterations=iterations,
        )

    def step(self, dt: float) -> Motion:
        """Advance by ``dt`` [s]; a step that does not converge is made of smaller ones.

        Raises
        ------
        ConvergenceError
            If steps of dt / 256 still fail.
        """
        with one_thread():
            return self._step(dt, HALVINGS)

    def _step(self, dt: float, halvings: int) -> Motion:
        try:
            self._advance(dt)
        except ConvergenceError as error:
            if halvings == 0:
                raise
            logger.info("step of %g s failed (%s): halved", dt, error)
            for _ in range(2):
                self._step(dt / 2, halvings - 1)
        return self.state

    def run(self, dt: float, steps: int) -> list[Motion]:
        """Return the states after each of ``steps`` steps of ``dt`` [s], the start first."""
        return [self.state, *(self.step(dt) for _ in range(steps))]

    def _advance(self, dt: float) -> None:
        if dt != self._dt:
            self._forget()
        state = self.state
        now = Kinematics(state.u, state.v, state.a)
        step = Step.of(self.scheme, dt, now, self._before)
        self.contact.begin(state.u, state.time + dt, dt)
        u, iterations = self._solve(step)
        u, v, a = step.ended(u)
        v, a = (np.where(self.held.fixed, 0.0, w) for w in (v, a))
        self.state = self._measured(state.time + dt, Kinematics(u, v, a), iterations)
        self._before, self._dt = now, dt
        self._forecast.add(a)

    def _solve(self, step: Step) -> tuple[np.ndarray, int]:
        old, fixed = self.state.u, self.held.fixed
        start = self.contact.allowed(old)
        if not self.contact.gap(start) > 0:
            raise ConvergenceError("an obstacle moves through the body: use a smaller step")
        ahead = np.where(fixed, old, step.target + self._forecast.next() / step.factor) - start
        u = start + min(1.0, self.contact.longest_step(start, ahead)) * ahead
        target = np.where(fixed, old, step.target)
        potential = Incremental(self, step.factor, target, step.dt)
        count = 0
        for _ in range(FRICTION_PASSES if self.contact.friction else 1):
            self.contact.lag_friction(u)
            found = minimise(potential, u, solve=self._solver, tolerance=self.tolerance)
            u, count = found.u, count + found.iterations
        return u, count

    def solve_adjoint(self, factor: float, u: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Solve H x = b with the Hessian [N/m] of the last step at ``u``, for its gradients."""
        potential = Incremental(self, factor, u, 1.0)
        return self._solver(potential.hessian(u, projected=False), b, 0.0)


def _rigidity(mesh: TetMesh, space: Space) -> Float[np.ndarray, "nodes 1"]:
    """Stiffness [N/m] of the tets around every node, in the mean: E times their size."""
    k = material_of(mesh).E * np.cbrt(mesh.volumes)
    nodes, size = space.elements.ravel(), space.elements.shape[1]
    total = np.bincount(nodes, np.repeat(k, size), len(space.nodes))
    return (total / np.maximum(np.bincount(nodes, minlength=len(space.nodes)), 1))[:, None]
