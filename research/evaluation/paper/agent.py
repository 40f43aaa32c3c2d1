"""An agent that corrects its belief of a body's matter by simulating it, a few rounds long.

Each round it simulates the body as it believes it to be, compares where the points come to rest
with where they are seen, and corrects E, nu and rho of the parts by the Gauss-Newton step of the
posterior (Tarantola 2005, eq. 3.51), whose prior is the belief that it came with. The step is taken
in 1 / E, in which the rest of a statically determinate body is linear. What makes it worse is
halved.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ....predictors.field import DEFAULT

ROUNDS = 5  # of correction, at most (UniPixie, C.4)
DIFFERENCE = 1e-3  # of normalised values, for derivatives
NOTHING = 0.1  # of minus twice the log of the posterior, whose deviations are of the order of 1
SHORTEST = 0.03  # share of 1 / E that a step leaves at least

PartValues = Float[np.ndarray, "parts 3"]
Points = Float[np.ndarray, "points 3"]
Simulation = Callable[[PartValues], Points]


class Belief(NamedTuple):
    """What is believed of each part, normalised: mean and spread, and ends that hold for sure."""

    mean: PartValues
    spread: PartValues
    low: PartValues
    high: PartValues


class Corrected(NamedTuple):
    """Values of the parts, and how many rounds of correction they took."""

    values: PartValues
    rounds: int


def correct_by_simulation(
    simulate: Simulation, seen: Points, belief: Belief, *, sight: float, rounds: int = ROUNDS
) -> Corrected:
    """Find the matter of parts whose body rests where it is ``seen``.

    Parameters
    ----------
    simulate
        Displacement [m] of all points at rest, for normalised values.
    seen
        The same of the true body, each number known to ``sight`` [m] (standard deviation).
    belief
        The prior: its mean is the first proposal, and its ends are never passed.
    rounds
        Of correction, at most; it ends where one gains nothing.
    """
    best, least, step = belief.mean, np.inf, np.zeros_like(belief.mean)
    for count in range(rounds + 1):
        tried = np.clip(best + step, belief.low, belief.high)
        rest = simulate(tried)
        lost = _lost(rest - seen, tried, belief, sight)
        gained = least - lost
        if gained > 0:
            best, least = tried, lost
        if abs(gained) < NOTHING:
            return Corrected(best, count)
        if gained < 0:
            step = step / 2
            continue
        if count < rounds:
            step = _correction(simulate, best, rest, seen, belief, sight)
    return Corrected(best, rounds)


def _lost(apart: Points, values: PartValues, belief: Belief, sight: float) -> float:
    """Minus twice the logarithm of the posterior, but for a constant."""
    prior = (values - belief.mean) / belief.spread
    return float(((apart / sight) ** 2).sum() + (prior**2).sum())


def _correction(
    simulate: Simulation,
    values: PartValues,
    rest: Points,
    seen: Points,
    belief: Belief,
    sight: float,
) -> PartValues:
    """Gauss-Newton step of the posterior in all values."""
    columns = []
    for entry in np.ndindex(values.shape):
        moved = values.copy()
        moved[entry] += DIFFERENCE
        columns.append((simulate(moved) - rest).ravel() / DIFFERENCE)
    J, weight = np.stack(columns, axis=1) / sight, belief.spread.ravel() ** -2.0
    pull = weight * (values - belief.mean).ravel()
    slope = J.T @ ((rest - seen).ravel() / sight) + pull
    step = -np.linalg.solve(J.T @ J + np.diag(weight), slope).reshape(values.shape)
    decade = 2 / DEFAULT.span[0]
    shorter = np.maximum(1 - step[:, 0] / decade * np.log(10), SHORTEST)
    step[:, 0] = -decade * np.log10(shorter)
    return step
