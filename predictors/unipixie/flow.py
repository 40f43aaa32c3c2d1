"""Flow matching: from noise x0 at time 0 along straight lines to data x1 at time 1.

Lipman et al. 2023; UniPixie supplement, B.2 and B.3.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Literal

import torch
from torch import Tensor

# The velocity of an x1-prediction, (x1 - x) / (1 - t), is not asked for nearer to the end.
LAST = 0.02
# Deviation of the noise x0: that of normalised matter. With noise three times as wide the flow
# decides so late that a few steps give the mean alone (80 % intervals held 17 % of the truth).
NOISE = 0.3
SHARED = 0.8  # of the variance of the noise that the voxels of a part have in common

Velocity = Callable[[Tensor, Tensor], Tensor]


def on_the_way(x0: Tensor, x1: Tensor, time: Tensor) -> Tensor:
    """Return x at ``time`` (batch,) of ``x0`` and ``x1`` (batch, ...)."""
    t = time.reshape(-1, *(1,) * (x0.ndim - 1))
    return (1 - t) * x0 + t * x1


def coherent_noise(shared: Tensor, own: Tensor) -> Tensor:
    """Where flows begin: normal numbers that the voxels of a part share, and each voxel's own."""
    return NOISE * (SHARED**0.5 * shared + (1 - SHARED) ** 0.5 * own)


def velocity_towards(x1: Tensor, x: Tensor, time: Tensor) -> Tensor:
    """Velocity (batch, ...) that leads from ``x`` at ``time`` (batch,) to ``x1`` at 1."""
    left = (1 - time).clamp(min=LAST).reshape(-1, *(1,) * (x.ndim - 1))
    return (x1 - x) / left


def integrate(
    velocity: Velocity, x: Tensor, *, steps: int, method: Literal["euler", "heun"] = "heun"
) -> Tensor:
    """Follow ``velocity``(x, time) from noise ``x`` (batch, ...) at 0 to 1 (eqs. S3 and S4).

    Heun's corrector asks for the velocity at the end of a step, two evaluations each.
    """
    line = torch.linspace(0, 1, steps + 1, dtype=x.dtype, device=x.device)
    for now, then in pairwise(line.expand(len(x), -1).unbind(1)):
        dt = (then - now)[0]
        first = velocity(x, now)
        if method == "heun":
            first = (first + velocity(x + dt * first, then)) / 2
        x = x + dt * first
    return x
