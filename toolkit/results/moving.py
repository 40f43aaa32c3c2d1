"""A body in motion, as `simulate` returns it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ...fem.result import MotionResult
from .simulation import Animation, Simulation
from .verdict import Verdict


@dataclass(frozen=True, eq=False, kw_only=True)
class Moving(Simulation):
    """A body that falls or is squeezed."""

    motion: MotionResult

    kind = "motion"

    @property
    def displacement(self) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] in the last frame."""
        return self.motion.displacements[-1]

    @property
    def animation(self) -> Animation:
        """The motion as it is."""
        return Animation(np.array([f.time for f in self.motion.frames]), self.motion.displacements)

    @property
    def numbers(self) -> dict[str, Any]:
        """Frames, step [s], smallest gap [m], largest force of an obstacle [N], energies [J]."""
        frames = self.motion.frames
        forces = np.linalg.norm(self.motion.obstacle_forces, axis=2).max(axis=0)
        return {
            "frames": len(frames),
            "dt": self.motion.dt,
            "smallest_gap": self.motion.smallest_gap,
            "max_contact_force": float(forces.max(initial=0.0)),
            "max_obstacle_forces": forces.tolist(),
            "energy": [f.energy for f in frames],
            "order": self.motion.order,
            "newton_iterations": sum(f.iterations for f in frames),
        }

    def verdicts(self) -> list[Verdict]:
        """Nothing went through an obstacle; the elements suit the material."""
        from ...fem.verdicts import locking, no_penetration

        return [Verdict.of(no_penetration(self.motion)), Verdict.of(locking(self.motion))]
