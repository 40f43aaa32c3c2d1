"""The time step of MPM, how stiff a material it allows, and the failure of a run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..errors import ConvergenceError
from ..material import lame_parameters
from ..note import Note

# Largest fraction of a spacing that a pressure wave crosses in a step. Shaken blocks blow up above
# 1.0 at nu 0.3 (8 and 27 particles a cell) and above 0.8 at nu 0.45.
COURANT = 0.4
# Substeps a second of motion that are spent by default.
BUDGET = 40_000.0
# CPU time [s] of a particle and substep, and of a substep without any, on one core
# (`benchmarks/mpm.py`).
COST, OVERHEAD = 2.2e-7, 6e-5
# A step turns or stretches a particle's surroundings by less than this.
MOST_STRAIN = 0.3

FailureKind = Literal["cfl", "velocity", "inverted", "left grid", "not finite"]


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A run that cannot go on, or should not begin.

    kind: What happened.
    time: When [s]; zero before the start.
    part: Name of the part that it happened in.
    E, E_max: Young's modulus there and the largest one that the steps allow [Pa].
    advice: What to do, one sentence.
    """

    kind: FailureKind
    time: float
    part: str
    E: float
    E_max: float
    advice: str

    def scaled(self, stiffer: float) -> Failure:
        """Return it for a body whose moduli acted as ``stiffer`` times themselves."""
        return replace(self, E=self.E / stiffer, E_max=self.E_max / stiffer)

    def __str__(self) -> str:
        """Return the failure in one line."""
        return Note(
            "time_step.mpm_pa",
            kind=self.kind,
            time=self.time,
            part=self.part,
            e=self.E,
            e_max=self.E_max,
            advice=self.advice,
        )


class MpmError(ConvergenceError):
    """A run of particles that failed: ``failure`` says when, where and what to do.

    ``plan`` and ``notes`` are what was known before.
    """

    def __init__(self, failure: Failure, plan: str, notes: tuple[str, ...]) -> None:
        super().__init__(str(failure))
        self.failure, self.plan, self.notes = failure, plan, notes


def stable_step(
    wave: float,
    speed: float,
    spacing: float,
    *,
    pull: float = 0.0,
    spread: float = 0.0,
    courant: float = COURANT,
) -> float:
    """Longest stable step [s] of MPM: the one rule of the time step.

    Parameters
    ----------
    wave, speed
        Speeds [m/s] of the fastest pressure wave and of the fastest particle: together they cross
        ``courant`` spacings in a step, at most.
    spacing
        Spacing [m] of the grid.
    pull
        Acceleration [m/s^2] that particles gain speed by within the step: it is all that bounds the
        steps of rigid bodies that begin to fall.
    spread
        Largest norm [1/s] of the velocity gradient: it strains by ``MOST_STRAIN`` in a step.
    courant
        Fraction of a spacing [1].

    Returns
    -------
    float
        Step [s]; infinite where nothing moves.

    Examples
    --------
    >>> round(stable_step(9.0, 1.0, 0.1), 6)
    0.004
    """
    reach, speed = courant * spacing, wave + speed
    ends = speed + np.sqrt(speed**2 + 4 * pull * reach)
    crossing = 2 * reach / ends if ends > 0 else np.inf
    return float(min(crossing, MOST_STRAIN / spread if spread > 0 else np.inf))


def largest_modulus(nu, rho, spacing: float, dt: float, *, courant: float = COURANT) -> Any:
    """E_max [Pa] that steps of ``dt`` [s] allow: rho (C dx / dt)^2 E / (lam + 2 mu).

    It is ``stable_step`` the other way round, of a body at rest. ``nu`` [1] and ``rho`` [kg/m^3]
    are numbers or arrays; the answer is as they are.
    """
    lam, mu = lame_parameters(1.0, nu)
    return np.asarray(rho) * (courant * spacing / dt) ** 2 / (lam + 2 * mu)
