"""Time integration: where inertia alone carries a body, and what its motion is after a step."""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from ..linalg.krylov import length

# Most accelerations that a forecast continues.
DEGREE = 5
# A step that changes the velocity by what carries more than this share of the energy before it has
# an impact in it that it does not follow.
LEAP = 0.25


class Scheme(Enum):
    """Time integration: first order and damping, second order and damping little, conserving."""

    IMPLICIT_EULER = "implicit Euler"
    BDF2 = "BDF2"
    TRAPEZOIDAL = "trapezoidal"


class Kinematics(NamedTuple):
    """Displacement [m], velocity [m/s] and acceleration [m/s^2], each (nodes, 3).

    Arrays, or vectors of a device.
    """

    u: Any
    v: Any
    a: Any


class Step(NamedTuple):
    """An implicit step of ``dt`` [s]: M ``factor`` (u - ``target``) balances the forces at u."""

    scheme: Scheme
    dt: float
    factor: float
    target: Any
    now: Kinematics
    before: Kinematics | None

    @staticmethod
    def of(scheme: Scheme, dt: float, now: Kinematics, before: Kinematics | None) -> Step:
        """Step from ``now``; BDF2 has its second order from the state one ``dt`` ``before``."""
        if scheme is Scheme.BDF2 and before is not None:
            target = (4 * now.u - before.u) / 3 + 2 * dt / 9 * (4 * now.v - before.v)
            return Step(scheme, dt, 9 / (4 * dt**2), target, now, before)
        if scheme is Scheme.TRAPEZOIDAL:
            target = now.u + dt * now.v + dt**2 / 4 * now.a
            return Step(scheme, dt, 4 / dt**2, target, now, before)
        return Step(Scheme.IMPLICIT_EULER, dt, 1 / dt**2, now.u + dt * now.v, now, None)

    @property
    def restarted(self) -> Step:
        """The same step without a past."""
        return Step.of(self.scheme, self.dt, self.now, None)

    def leaps(self, u: np.ndarray, mass: np.ndarray | float, energy: float) -> bool:
        """Whether the step to ``u`` changes the velocity at once, for a body of ``energy`` [J].

        ``mass`` [kg] is that of the rows of ``u``. Past states then lead away from where the body
        goes: BDF2 would read the stop of a falling body as a speed upwards.
        """
        change = self.ended(u).v - self.now.v
        return 0.5 * float((mass * change**2).sum()) > LEAP * energy

    def ended(self, u: Any) -> Kinematics:
        """Motion at the end of the step, where the displacement is ``u``."""
        now, before, dt = self.now, self.before, self.dt
        a = self.factor * (u - self.target)
        if self.scheme is Scheme.TRAPEZOIDAL:
            return Kinematics(u, now.v + dt / 2 * (now.a + a), a)
        if before is None:
            return Kinematics(u, (u - now.u) / dt, a)
        return Kinematics(u, (3 * u - 4 * now.u + before.u) / (2 * dt), a)


class Forecast:
    """Acceleration of the next step from those of the last ones, a polynomial in time.

    The sum of the first n backward differences continues n values; what it misses the next one by
    is the n-th difference. As many are summed as would have foreseen the last value best.
    """

    def __init__(self) -> None:
        self.differences: list[np.ndarray] = []
        self.terms = 0

    def add(self, a: np.ndarray) -> None:
        """Take in the acceleration of a step."""
        new = [a]
        for old in self.differences[:DEGREE]:
            new.append(new[-1] - old)
        self.differences = new
        sizes = [length(difference) for difference in new]
        self.terms = sizes.index(min(sizes))

    def next(self) -> np.ndarray | float:
        """Acceleration to expect [m/s^2]; zero without a past."""
        return sum(self.differences[: self.terms], 0.0)
