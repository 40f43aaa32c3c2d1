"""What is kept of a motion that particles found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, eq=False, kw_only=True)
class ParticleRun:
    """The particles of a motion that was found by them.

    Parameters
    ----------
    spacing, nodes
        Spacing of the grid [m] and its nodes along every axis.
    substeps, plan
        Steps taken, and what was expected before them, in words.
    outside, stationary, rigid, bodies, capped
        Particles that left the grid, that stand still, that belong to so many rigid bodies, and
        that were softened.
    lagrangian
        Whether the weights were those at rest.
    notes, laws
        What was assumed, and the laws of its matter in words.
    part
        Region of every particle, shape (n,).
    positions, gradients
        Places [m] and deformation gradients in every frame, (frames, n, 3) and (frames, n, 3, 3).
    """

    spacing: float
    nodes: tuple[int, int, int]
    substeps: int
    plan: str
    outside: int
    stationary: int
    rigid: int
    bodies: int
    capped: int
    lagrangian: bool
    notes: tuple[str, ...]
    laws: tuple[str, ...]
    part: Int[np.ndarray, "n"]
    positions: Float[np.ndarray, "frames n 3"]
    gradients: Float[np.ndarray, "frames n 3 3"]
