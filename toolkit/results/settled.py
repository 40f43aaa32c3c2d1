"""A body at rest under its load, as `simulate` returns it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from ...fem.laws.law import LAWS
from ...fem.result import Modes, SagResult
from ...fem.safety import PartStresses, Safety, part_safety, part_stresses
from ...fem.uncertainty.likely import ranged_answers
from .description import vector_words
from .simulation import Animation, Simulation

if TYPE_CHECKING:
    from ...fem.verdicts import Check

# Share of the load in each frame of a static answer's motion: it comes on slowly and linearly.
RAMP = np.linspace(0, 1, 6)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Settled(Simulation):
    """A body at rest under its load."""

    solved: SagResult
    modes: Modes | None = None

    kind = "sag"

    @property
    def displacement(self) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] at rest."""
        return self.solved.displacement

    @property
    def animation(self) -> Animation:
        """The load comes on slowly; its share takes the place of the time."""
        return Animation(RAMP, RAMP[:, None, None] * self.displacement)

    @property
    def numbers(self) -> dict[str, Any]:
        """Displacement [m], ratio, stress [Pa], frequencies [Hz], residual of the solver."""
        static, factor = self.solved.static, self.solved.load_factor
        return {
            "max_displacement": self.solved.max_displacement,
            "sag_ratio": self.solved.sag_ratio,
            "height": self.solved.height,
            "max_von_mises": self.max_von_mises,
            "load_factor": factor and factor.value,
            "safety": [{**s._asdict(), "factor": s.factor} for s in self.safety],
            "intervals": self.intervals,
            "reaction": static.reaction.sum(axis=0),
            "frequencies": self.frequencies,
            "order": static.order,
            "gap": self.solved.discretisation_error,
            "residual": static.residual,
            "iterations": static.iterations,
            "solver": static.solver,
        }

    @property
    def solution(self) -> tuple[tuple[str, str], ...]:
        """Law and elements, solver, and what the supports carry."""
        static = self.solved.static
        solver = static.solver or "Newton's method"
        if static.iterations and not static.solver.count(" after "):  # which counts them itself
            solver += f", {static.iterations} iterations"
        elements = "quadratic" if static.order == 2 else "linear"
        return (
            ("Law and elements", f"{LAWS[static.law].title}, {elements} tets"),
            ("Solver", f"{solver}, residual {static.residual:.1g}"),
            ("Force of the supports", vector_words(static.reaction.sum(axis=0), "N")),
        )

    @cached_property
    def max_von_mises(self) -> float:
        """Largest von Mises stress [Pa], at the points as verdicts judge it."""
        return max(here.largest for here in self._stresses)

    @cached_property
    def safety(self) -> tuple[Safety, ...]:
        """Stress beside strength of every part whose material has one; none where it collapsed."""
        if not self.solved.trusted:
            return ()
        return part_safety(self.solved.static, self.materials, self._stresses)

    @cached_property
    def _stresses(self) -> tuple[PartStresses, ...]:
        return part_stresses(self.solved.static)

    @cached_property
    def intervals(self) -> dict[str, Any] | None:
        """Lowest and highest mass [kg], displacement [m] and frequencies [Hz]; None: not known."""
        known = {"draws": self.draws, "exact": self.exact, "modes": self.modes}
        return ranged_answers(self.scene, self.materials, result=self.solved, **known)

    @property
    def cell_data(self) -> Mapping[str, np.ndarray]:
        """Von Mises stress [Pa]."""
        return {"von_mises": self.solved.von_mises}

    @property
    def vibrations(self) -> Modes | None:
        """Natural vibrations of the body as it stands."""
        return self.modes

    @property
    def frequencies(self) -> tuple[float, ...]:
        """First natural frequencies [Hz] of the body as it stands."""
        return () if self.modes is None else tuple(self.modes.frequencies.tolist())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the solver assumed."""
        return self.solved.warnings

    def checks(self) -> Sequence[Check]:
        """Shape, buckling, mesh, explicit step, size, standing, strength, frequency, range."""
        from ...fem.verdicts import (
            first_frequency,
            span_of_answers,
            static_checks,
            stays_upright,
            strength,
            with_unmade,
        )

        checks = [
            *static_checks(self.solved, size_stated=self.size_stated),
            *stays_upright(self.solved, self.scene),
            *map(strength, self.safety),
        ]
        if self.modes is not None:
            checks.append(first_frequency(self.modes))
        if self.intervals is not None:
            checks.append(span_of_answers(*self.intervals.values()))
        return with_unmade(checks)
