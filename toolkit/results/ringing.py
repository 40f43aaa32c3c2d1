"""The vibrations of a body, as `simulate` returns them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ...fem.result import Modes
from .simulation import Animation, Simulation
from .verdict import Verdict

# Frames of one period of a natural vibration.
SWING = np.arange(24) / 24
# A vibration is drawn with this largest displacement, as a share of the diagonal: its size is free.
DRAWN = 0.05


@dataclass(frozen=True, eq=False, kw_only=True)
class Ringing(Simulation):
    """The natural vibrations of a body as it stands."""

    modes: Modes

    kind = "modal"

    @property
    def displacement(self) -> Float[np.ndarray, "points 3"]:
        """Shape of the first vibration, at its largest."""
        shape = self.modes.shapes[0, : len(self.mesh.points)]
        diagonal = float(np.linalg.norm(np.ptp(self.mesh.bounds, axis=0)))
        return shape * (DRAWN * diagonal / np.linalg.norm(shape, axis=1).max())

    @property
    def animation(self) -> Animation:
        """One period of the first vibration."""
        period = 1.0 / self.modes.frequencies[0]
        swing = np.sin(2 * np.pi * SWING)
        return Animation(SWING * period, swing[:, None, None] * self.displacement)

    @property
    def numbers(self) -> dict[str, Any]:
        """Frequencies [Hz] and the residual of the eigensolver."""
        return {"frequencies": self.frequencies, "residual": self.modes.residual}

    @property
    def point_data(self) -> Mapping[str, np.ndarray]:
        """Shapes of unit modal mass [1/sqrt(kg)] beside the drawn displacement [m]."""
        count = len(self.mesh.points)
        shapes = {f"mode_{i}": shape[:count] for i, shape in enumerate(self.modes.shapes, 1)}
        return {"displacement": self.displacement, **shapes}

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Natural frequencies [Hz], the slowest first."""
        return tuple(self.modes.frequencies.tolist())

    def verdicts(self) -> list[Verdict]:
        """Rings or wobbles."""
        from ...fem.verdicts import first_frequency

        return [Verdict.of(first_frequency(self.modes))]
