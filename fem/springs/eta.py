"""Eta, which takes neighbours in: a network that stiffens while its constants k stay."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from .network import SpringNetwork

# Where neighbours beyond the nearest sixteen count nothing, and where all do: the ends of eta.
SOFTEST, STIFFEST = 20.0, -20.0


def eta_for_ratio(network: SpringNetwork, ratio: float) -> float:
    """Eta whose network is ``ratio`` [1] times as stiff as its softest, all k the same.

    By bisection on the sum of k w l; ratios out of reach give the nearer end.
    """
    k = network.calibrated(SOFTEST)

    def log_stiffness(eta: float) -> float:
        return float(np.log(network.stiffness(eta, k=k) @ network.length**2))

    wanted = np.log(ratio) + log_stiffness(SOFTEST)
    low, high = STIFFEST, SOFTEST
    if wanted >= log_stiffness(low):
        return low
    if wanted <= log_stiffness(high):
        return high
    while high - low > 1e-12 * SOFTEST:
        middle = (low + high) / 2
        low, high = (middle, high) if log_stiffness(middle) > wanted else (low, middle)
    return (low + high) / 2


def eta_reach(network: SpringNetwork) -> float:
    """How many times stiffer than its softest a network gets by eta alone [1]."""
    k, square = network.calibrated(SOFTEST), network.length**2
    ends = [network.stiffness(eta, k=k) @ square for eta in (STIFFEST, SOFTEST)]
    return float(ends[0] / ends[1])


def stiffened(
    network: SpringNetwork, k: Float[np.ndarray, "n"], ratio: float
) -> Float[np.ndarray, "springs"]:
    """Stiffness [N/m] of springs ``ratio`` [1] times as stiff as at the softest eta.

    ``k`` [N] stays while eta takes more neighbours in, and is multiplied for what eta cannot.
    """
    square = network.length**2
    soft = network.stiffness(SOFTEST, k=k) @ square
    stiff = network.stiffness(eta_for_ratio(network, ratio), k=k)
    return ratio * soft / (stiff @ square) * stiff
