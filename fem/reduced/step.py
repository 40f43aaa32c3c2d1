"""Motion of a reduced body: every step minimises an incremental potential of the coordinates."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from jaxtyping import Float

from ..contact.barrier import Contact
from ..device import one_thread
from ..errors import ConvergenceError, InputError
from ..laws.law import Law
from ..linalg.krylov import length
from ..result import Motion
from ..solve.newton import Point, minimise
from ..solve.potential import ROUND_OFF
from ..solve.schemes import Forecast, Kinematics, Scheme, Step
from ..validation import checked_positive
from .elasticity import ReducedElasticity
from .model import ReducedModel
from .rest import KeptInverse

logger = logging.getLogger(__name__)

# A step ends when the unbalanced force is below this share of the external and inertial force.
TOLERANCE = 1e-4
# A step that fails is halved so often at most.
HALVINGS = 8
FRICTION_PASSES = 2
# Moves that make room in front of an obstacle: each meets the sites that the last one left behind.
ROOM_PASSES = 10


class _Potential:
    """Incremental potential: c/2 |q - target|^2 + W(q) - f . q + barrier + friction."""

    def __init__(self, body: ReducedDynamics, factor: float, target: np.ndarray) -> None:
        self.of, self.factor, self.target = body, factor, target
        stiffness = factor + body.stiffest
        self.least = ROUND_OFF * stiffness * length(target) / body.tolerance
        self._gradient = np.zeros_like(target)  # of what was evaluated last
        body.kept.begin(factor * target)

    def evaluate(self, q: np.ndarray) -> Point:
        """Energy, infinite on contact; gradient; size of the external and inertial force."""
        of, away = self.of, q - self.target
        push = self.factor * away
        energy, force = of.elasticity.response(q)
        energy += 0.5 * float(push @ away) - float(of.load @ q)
        gradient, scale = force + push - of.load, max(of.load_size, length(push))
        if of.contact is not None:
            u = of.model.displacement(q)
            barrier = of.contact.value(u)
            if not np.isfinite(barrier):
                return Point(np.inf, np.full_like(q, np.inf), 0.0)
            contact = -of.model.pull_back(of.contact.forces(u, len(u)))
            energy, gradient = energy + barrier, gradient + contact
            scale = max(scale, length(contact))
        self._gradient = gradient
        return Point(energy, gradient, max(scale, self.least, 1e-300))

    def hessian(self, q: np.ndarray, *, projected: bool) -> KeptInverse:
        """Inverse of the second derivative (dofs, dofs) [s^2] at ``q``, the last one evaluated.

        Without obstacles that of an earlier state serves as long as it does well.
        """
        if self.of.contact is not None:
            self.of.kept.inverse = None
        return self.of.kept.at(
            q, self._gradient, lambda: self._matrix(q, projected=projected), projected
        )

    def _matrix(self, q: np.ndarray, *, projected: bool) -> np.ndarray:
        of = self.of
        matrix = of.elasticity.tangent(q, projected=projected)
        matrix.flat[:: len(q) + 1] += self.factor
        if of.contact is not None:
            matrix += pulled_hessian(of.model, of.contact, of.model.displacement(q))
        return matrix

    def longest_step(self, q: np.ndarray, step: np.ndarray) -> float:
        """Share of ``step`` that keeps the body out of the obstacles."""
        if self.of.contact is None:
            return np.inf
        model = self.of.model
        return self.of.contact.longest_step(model.displacement(q), model.displacement(step))


class ReducedDynamics:
    """A reduced body in motion.

    Parameters
    ----------
    model
        The reduced model.
    load
        Constant forces on the coordinates [N/sqrt(kg)], shape (dofs,): ``model.weight`` and
        ``model.pull_back`` make them.
    velocity
        Initial velocity of the coordinates [m sqrt(kg)/s], shape (dofs,).
    contact
        Obstacles against the surface of the full body, pulled back through the basis.
    law, scheme, tolerance
        Name of the elastic law, time integration, residual of a step over the external and
        inertial force.
    """

    def __init__(
        self,
        model: ReducedModel,
        *,
        load: Float[np.ndarray, "dofs"] | None = None,
        velocity: Float[np.ndarray, "dofs"] | None = None,
        contact: Contact | None = None,
        law: str = Law.NEO_HOOKEAN,
        scheme: Scheme = Scheme.BDF2,
        tolerance: float = TOLERANCE,
    ) -> None:
        self.model, self.scheme, self.tolerance = model, scheme, tolerance
        self.elasticity = ReducedElasticity(model, law)
        self.contact = contact if contact is not None and contact.obstacles else None
        zero = np.zeros(model.dofs)
        self.load = zero if load is None else load
        self.load_size = length(self.load)
        self.stiffest = float(np.linalg.eigvalsh(self.elasticity.tangent(zero))[-1])
        if self.contact is not None and not self.contact.gap(model.displacement(zero)) > 0:
            raise InputError("the body starts inside an obstacle: wanted a gap")
        v = zero if velocity is None else velocity
        self.now = Kinematics(zero, v, self.load - self.elasticity.response(zero).force)
        self.time, self.iterations, self.last_dt = 0.0, 0, 0.0
        self.kept, self._factor = KeptInverse(), 0.0
        self._forget()

    def _forget(self) -> None:
        """Start anew: the past has other steps, or none."""
        self._before: Kinematics | None = None
        self._forecast = Forecast()

    def advance(self, dt: float) -> Kinematics:
        """Coordinates, their velocity and acceleration ``dt`` [s] later.

        A step that does not converge is made of smaller ones; ``last_dt`` [s] is then that of the
        last of them.

        Raises
        ------
        ConvergenceError
            If steps of dt / 256 still fail.
        """
        checked_positive("dt", dt, "s")
        self.iterations = 0
        self._halved(dt, HALVINGS)
        return self.now

    def step(self, dt: float) -> Motion:
        """Advance by ``dt`` [s]; see ``advance``."""
        with one_thread():
            self.advance(dt)
        return self.state

    @property
    def state(self) -> Motion:
        """What the full body does now, as the full method tells it."""
        q, v, a = self.now
        u, contact, model = self.model.displacement(q), self.contact, self.model
        none = np.zeros_like(u)
        return Motion(
            self.time,
            u,
            model.displacement(v),
            model.displacement(a),
            contact_force=none if contact is None else contact.forces(u, len(u)),
            obstacle_force=np.zeros((0, 3)) if contact is None else contact.obstacle_forces(u),
            gap=np.inf if contact is None else contact.gap(u),
            kinetic=0.5 * float(v @ v),
            elastic=self.elasticity.response(q).energy,
            potential=-float(self.load @ q),
            barrier=0.0 if contact is None else contact.barrier(u),
            iterations=self.iterations,
        )

    def _halved(self, dt: float, halvings: int) -> None:
        try:
            self._advance(dt)
        except ConvergenceError as error:
            if halvings == 0:
                raise
            logger.info("step of %g s failed (%s): halved", dt, error)
            for _ in range(2):
                self._halved(dt / 2, halvings - 1)

    def _advance(self, dt: float) -> None:
        if dt != self.last_dt:
            self._forget()
        step = Step.of(self.scheme, dt, self.now, self._before)
        if self.contact is not None:
            self.contact.begin(self.model.displacement(self.now.u), self.time + dt, dt)
        q, iterations = self._solve(step)
        if leapt := self._leaps(step, q):
            self._forget()
            if step.before is not None:
                step, q, more = self._restarted(step, q)
                iterations += more
        self._before, self.last_dt, self.now = None if leapt else self.now, dt, step.ended(q)
        self.time, self.iterations = self.time + dt, self.iterations + iterations
        self._forecast.add(self.now.a)

    def _restarted(self, step: Step, q: np.ndarray) -> tuple[Step, np.ndarray, int]:
        """The ``step`` to ``q`` made anew without its past, where that converges."""
        try:
            return step.restarted, *self._solve(step.restarted)
        except ConvergenceError as error:
            logger.info("an impact is kept as its past leads it: %s", error)
            return step, q, 0

    def _leaps(self, step: Step, q: np.ndarray) -> bool:
        """Whether an obstacle stops or throws the body within the ``step`` to ``q``."""
        if self.contact is None:
            return False
        barriers = [self.contact.barrier(self.model.displacement(x)) for x in (self.now.u, q)]
        if not any(barriers):
            return False
        kinetic = 0.5 * float(self.now.v @ self.now.v)
        elastic = self.elasticity.response(self.now.u).energy
        return step.leaps(q, 1.0, kinetic + elastic + barriers[0])

    def _solve(self, step: Step) -> tuple[np.ndarray, int]:
        if step.factor != self._factor:
            self.kept, self._factor = KeptInverse(), step.factor
        potential = _Potential(self, step.factor, step.target)
        ahead = step.target + self._forecast.next() / step.factor
        options: dict[str, Any] = {"solve": KeptInverse.solve, "tolerance": self.tolerance}
        if self.contact is None:
            found = minimise(potential, ahead, **options)
            return found.u, found.iterations
        q, count = self._allowed(self.now.u), 0
        q = q + min(1.0, potential.longest_step(q, ahead - q)) * (ahead - q)
        for _ in range(FRICTION_PASSES if self.contact.friction else 1):
            self.contact.lag_friction(self.model.displacement(q))
            found = minimise(potential, q, **options)
            q, count = found.u, count + found.iterations
        return q, count

    def _allowed(self, q: np.ndarray) -> np.ndarray:
        """``q`` moved as little as possible so that no obstacle that moves has reached the body."""
        assert self.contact is not None
        for _ in range(ROOM_PASSES):
            u = self.model.displacement(q)
            push = self.contact.allowed(u) - u
            size = np.linalg.norm(push, axis=1)
            if not size.any():
                return q
            near = size > 0
            rows = np.einsum("nia,ni->na", self.model.basis[near], push[near] / size[near, None])
            q = q + np.linalg.lstsq(rows, size[near], rcond=None)[0]
        if self.contact.gap(self.model.displacement(q)) > 0:
            return q
        raise ConvergenceError("an obstacle moves through the body: use a smaller step")


def pulled_hessian(
    model: ReducedModel, contact: Contact, u: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "dofs dofs"]:
    """Hessian of barrier and friction by the coordinates [1/s^2], at the displacement ``u`` [m]."""
    diagonal, pairs = contact.hessian_blocks(u)
    near = np.flatnonzero(np.abs(diagonal).max(axis=(1, 2)) > 0)
    B = model.basis[near]
    total = B.reshape(-1, model.dofs).T @ (diagonal[near] @ B).reshape(-1, model.dofs)
    for i, j, blocks in pairs:
        left, right = model.basis[i.ravel()], model.basis[j.ravel()]
        total += np.einsum("nia,nij,njb->ab", left, blocks.reshape(-1, 3, 3), right, optimize=True)
    return total
