"""The vibrations of a body, as `simulate` returns them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from ...fem.result import Modes
from ...fem.uncertainty.likely import ranged_answers
from .simulation import Animation, Simulation

if TYPE_CHECKING:
    from ...fem.verdicts import Check

# Frames of one period of a natural vibration.
SWING = np.arange(24) / 24
# A vibration is drawn with this largest displacement, as a share of the diagonal: its size is free.
DRAWN = 0.05


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
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
        known = {"frequencies": self.frequencies, "residual": self.modes.residual}
        return {**known, "intervals": self.intervals}

    @cached_property
    def intervals(self) -> dict[str, Any] | None:
        """Lowest and highest mass [kg] and frequencies [Hz]; None where no range is known."""
        known = {"draws": self.draws, "exact": self.exact, "modes": self.modes}
        return ranged_answers(self.scene, self.materials, **known)

    @property
    def point_data(self) -> Mapping[str, np.ndarray]:
        """Shapes of unit modal mass [1/sqrt(kg)] beside the drawn displacement [m]."""
        count = len(self.mesh.points)
        shapes = {f"mode_{i}": shape[:count] for i, shape in enumerate(self.modes.shapes, 1)}
        return {"displacement": self.displacement, **shapes}

    @property
    def vibrations(self) -> Modes | None:
        """Natural vibrations of the body as it stands."""
        return self.modes

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Natural frequencies [Hz], the slowest first."""
        return tuple(self.modes.frequencies.tolist())

    def checks(self) -> Sequence[Check]:
        """Rings or wobbles; within which range."""
        from ...fem.verdicts import first_frequency, span_of_answers

        checks = [first_frequency(self.modes)]
        if (known := self.intervals) is not None:
            checks.append(
                span_of_answers(known["mass"], None, known["frequencies"], known["likely"])
            )
        return checks
