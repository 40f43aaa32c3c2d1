"""A body in motion, as `simulate` returns it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from ...fem.particle_run import ParticleRun
from ...fem.result import MotionResult
from ...fem.scene.components import piece_names
from .quantities import si
from .simulation import Animation, Simulation

if TYPE_CHECKING:
    from ...fem.verdicts import Check


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Moving(Simulation):
    """A body that falls, is squeezed, blown at or torn."""

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
        """Frames, step [s], largest motion and smallest gap [m], forces [N], energies [J]."""
        frames = self.motion.frames
        pushes = np.linalg.norm(self.motion.obstacle_forces, axis=2)
        forces = pushes.max(axis=0)
        return {
            "frames": len(frames),
            "dt": self.motion.dt,
            "max_displacement": float(np.linalg.norm(self.motion.displacements, axis=2).max()),
            "smallest_gap": self.motion.smallest_gap,
            "max_contact_force": float(forces.max(initial=0.0)),
            "max_obstacle_forces": forces.tolist(),
            "obstacle_forces": pushes.tolist(),
            **self._contact(),
            "energy": [f.energy for f in frames],
            "energy_balance": self._energy(),
            "order": self.motion.order,
            "newton_iterations": sum(f.iterations for f in frames),
            "model_error": self.motion.model_error,
            "stiffening": self.motion.stiffening,
            **({} if self.motion.particles is None else {"particles": self._particles()}),
        }

    def _energy(self) -> dict[str, float] | None:
        """Energies [J]: given, the most beyond that, lost, most in one frame, its end [s]."""
        from ...fem.energy.balance import energy_balance

        found = energy_balance(self.motion, self.scene)
        return found and found._asdict()

    def _contact(self) -> dict[str, Any]:
        """Largest pressures [Pa], and forces [N] of the pieces on each other: largest and last."""
        found: dict[str, Any] = {}
        if (pressures := self.motion.largest_pressures) is not None:
            found["max_obstacle_pressures"] = pressures.obstacles.tolist()
            found["max_own_pressure"] = pressures.own
        forces, names = self.motion.piece_forces, self._piece_names
        found["piece_forces"] = [
            {
                "on": names[on],
                "by": names[by],
                "largest": float(np.linalg.norm(force, axis=1).max()),
                "last": force[-1].tolist(),
            }
            for (on, by), force in forces.items()
        ]
        return found

    @cached_property
    def _piece_names(self) -> tuple[str, ...]:
        return piece_names(self.mesh)

    def _particles(self) -> dict[str, Any]:
        """Counts of the particles, steps, and what was expected before them."""
        run = self.motion.particles
        assert run is not None
        counts = ("substeps", "outside", "stationary", "rigid", "bodies", "capped", "lagrangian")
        known = {name: getattr(run, name) for name in (*counts, "spacing", "nodes", "plan")}
        return {"count": len(run.part), **known}

    @property
    def particles(self) -> ParticleRun | None:
        """The particles that found it, where it was particles."""
        return self.motion.particles

    @property
    def solution(self) -> tuple[tuple[str, str], ...]:
        """Particles, grid and steps, where particles moved it; else what the method says."""
        run = self.motion.particles
        if run is None:
            count = len(self.motion.frames) - 1
            steps = ("Steps", f"{count:,} of {si(self.motion.dt, 's')}")
            return (*self._elements, *self.motion.solution, steps)
        grid = "x".join(map(str, run.nodes))
        words = f"{len(run.part):,} particles on {grid} nodes, {run.spacing:.3g} m apart"
        law = ("Law", "; ".join(run.laws))
        return (law, ("Material points", words), ("Steps", f"{run.substeps:,}"))

    @property
    def _elements(self) -> tuple[tuple[str, str], ...]:
        order = {1: "linear", 2: "quadratic"}.get(self.motion.order)
        return (("Elements", f"{order} tets"),) if order else ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed of the scene, of the body, and of the particles."""
        run = self.motion.particles
        return (*self.scene.warnings, *self.motion.notes, *(run.notes if run is not None else ()))

    def checks(self) -> Sequence[Check]:
        """Nothing goes through an obstacle or gains energy; who presses whom; fit elements."""
        from ...fem.energy.energy_verdicts import keeps_energy
        from ...fem.energy.motion_verdicts import (
            contact_forces,
            follows,
            in_the_grid,
            no_penetration,
        )
        from ...fem.verdicts import locking

        energy = keeps_energy(self.motion, self.scene)
        if self.motion.particles is not None:
            return [in_the_grid(self.motion.particles), *energy]
        met = (no_penetration(self.motion), contact_forces(self.motion, self._piece_names))
        suits = [locking(self.motion)] if self.motion.order else []
        return [*met, *energy, *suits, *follows(self.motion)]
