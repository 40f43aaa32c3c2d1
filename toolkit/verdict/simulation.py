"""What `simulate` returns, whatever the body does: all told, written and shown alike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.elements.assembly import discretise
from ...fem.laws.law import LAWS
from ...fem.mesh import TetMesh, piece_names
from ...fem.note import Note
from ...fem.safety import PartStresses, Safety, part_safety, part_stresses, reactions
from ...fem.scene.loads import resultant
from ...fem.scene.scene import Scene
from ...fem.solve.method import SCENARIOS
from ...fem.solve.result import Modes, MotionResult, ParticleRun, SagResult, energy_balance
from ...fem.uncertainty import Draws, Exact, ranged_answers
from ..asset.document import mesh_document
from ..driving import DriveRecord
from ..meshing.messages import listed
from .check import Check, as_table, in_a_line, si, with_doubts
from .description import describe


class Animation(NamedTuple):
    """A motion: times [s] and the displacement [m] of the mesh points at each."""

    times: Float[np.ndarray, "frames"]
    displacement: Float[np.ndarray, "frames points 3"]


@dataclass(frozen=True, eq=False)
class Simulation(ABC):
    """The answer of a ``scene`` of the kind ``scenario``, and the ``seconds`` it took.

    ``stated`` says whether a user changed what the scenario holds or loads; ``driven`` is what
    moved with the mesh, ``materials`` the row of the table that each part is of, ``draws`` what a
    predictor drew of parts that are of none, ``exact`` which numbers of a part were stated,
    ``differences`` what the mesh has otherwise than the file that it was made of; ``size_stated``:
    the user gave the size or the unit of that file; ``guesses``: parts whose material is one.
    """

    scene: Scene
    scenario: str
    stated: bool = False
    seconds: float = 0.0
    driven: DriveRecord | None = None
    materials: Mapping[str, str] = field(default_factory=dict)
    differences: tuple[str, ...] = ()
    size_stated: bool = False
    guesses: tuple[str, ...] = ()
    draws: Draws = field(default_factory=dict)
    exact: Exact = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    # Name of the answer's numbers in the document.
    kind: ClassVar[str]

    def __repr__(self) -> str:
        return in_a_line(self)

    _repr_html_ = as_table

    @property
    def mesh(self) -> TetMesh:
        """The mesh that was loaded."""
        return self.scene.mesh

    @property
    @abstractmethod
    def displacement(self) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] of the state that a picture shows."""

    @property
    @abstractmethod
    def animation(self) -> Animation:
        """The motion that a report plays."""

    @property
    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """The numbers of the answer, in SI."""

    @property
    def solution(self) -> tuple[tuple[str, str], ...]:
        """How it was solved, label and words."""
        return ()

    @property
    def particles(self) -> ParticleRun | None:
        """The particles that found it, where it was particles."""
        return None

    @property
    def cell_data(self) -> Mapping[str, np.ndarray]:
        """Fields of the answer on the tets."""
        return {}

    @property
    def point_data(self) -> Mapping[str, np.ndarray]:
        """Fields of the answer at the points: displacement [m]."""
        return {"displacement": self.displacement}

    @property
    def frequencies(self) -> tuple[float, ...]:
        """First natural frequencies [Hz], the slowest first, where they are known."""
        return () if self.vibrations is None else tuple(self.vibrations.frequencies.tolist())

    @property
    def vibrations(self) -> Modes | None:
        """Natural vibrations, where they are known."""
        return None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed."""
        return self.scene.warnings

    @property
    def title(self) -> str:
        """What happens, in a few words."""
        return "Under the stated loads" if self.stated else SCENARIOS[self.scenario].title

    def checks(self) -> Sequence[Check]:
        """What the answer is held against, each with its number and threshold."""
        return ()

    def verdicts(self) -> list[Check]:
        """Whether the body is known, then every check, those in doubt marked so."""
        return [*self._judged]

    @cached_property
    def _judged(self) -> Sequence[Check]:
        """What is printed, written and reported is judged once."""
        found: list[Check] = []
        if self.differences:
            said = Note("checks.differs", how="; ".join(self.differences))
            found.append(Check("body", "failed", said))
        if self.guesses:
            rows = dict.fromkeys(self.materials.get(part, "") for part in self.guesses)
            told = {"parts": listed(self.guesses), "materials": ", ".join(rows)}
            found.append(Check("materials", "doubtful", Note("checks.guessed", **told)))
        return with_doubts([*found, *self.checks()])

    def write(self, path: Path) -> list[Path]:
        """Write the state shown as .vtu or .vtk, the motion as .pvd or .glb; return the files."""
        if path.suffix.lower() == ".glb":
            from ...converters.mesh.gltf_motion import write_motion_glb

            return [write_motion_glb(path, self.mesh, *self.animation, up=self.scene.up)]
        if path.suffix.lower() != ".pvd":
            from ...converters.mesh.meshdata import write_mesh

            fields = {"point_data": self.point_data, "cell_data": self.cell_data}
            write_mesh(path, self.mesh, **fields)
            return [path]
        from ...converters.mesh.vtk import write_pvd

        frames = zip(self.animation.times.tolist(), self.animation.displacement, strict=True)
        return write_pvd(path, self.mesh, ((time, {"displacement": u}) for time, u in frames))

    def document(self) -> dict[str, Any]:
        """Return what ``simulate --json`` prints."""
        return {
            "files": self.files,
            **mesh_document(self.mesh),
            "scenario": self.scenario,
            "scene": [acting._asdict() for acting in describe(self.scene)],
            self.kind: {
                **self.numbers,
                "solution": dict(self.solution),
                "verdicts": [found.document() for found in self.verdicts()],
            },
            "seconds": self.seconds,
            **({} if self.driven is None else {"drive": self.driven.document()}),
            "warnings": (*self.warnings, *(self.driven.warnings if self.driven else ())),
        }


# Fraction of the load in each frame of a static answer's motion: it comes on slowly and linearly.
RAMP = np.linspace(0, 1, 6)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class StaticSimulation(Simulation):
    """A body at rest under its load."""

    solved: SagResult
    modes: Modes | None = None
    modes_unmade: str = ""

    kind = "sag"

    @property
    def displacement(self) -> Float[np.ndarray, "points 3"]:
        """Displacement [m] at rest."""
        return self.solved.displacement

    @property
    def animation(self) -> Animation:
        """The load comes on slowly; its fraction takes the place of the time."""
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
            "load_factor_error": factor and factor.error,
            "load_factor_passed": factor and factor.passed,
            "safety": [{**s._asdict(), "factor": s.factor} for s in self.safety],
            "intervals": self.intervals,
            "reaction": static.reaction.sum(axis=0),
            "reactions": [
                one._asdict() for one in reactions(self.scene, static.space, static.reaction)
            ],
            "loads": [
                {"place": load.name, **resultant(self.mesh, load, self.scene.held)._asdict()}
                for load in self.scene.tractions
            ],
            "frequencies": self.frequencies,
            "law": static.law,
            "order": static.order,
            "gap": self.solved.discretisation_error,
            "residual": static.residual,
            "iterations": static.iterations,
            "solver": static.solver,
        }

    @property
    def solution(self) -> tuple[tuple[str, str], ...]:
        """Law and elements, and solver."""
        static = self.solved.static
        solver = static.solver or "Newton's method"
        if static.iterations and not static.solver.count(" after "):  # which counts them itself
            solver += f", {static.iterations} iterations"
        elements = "quadratic" if static.order == 2 else "linear"
        return (
            ("Law and elements", f"{LAWS[static.law].title}, {elements} tets"),
            ("Solver", f"{solver}, residual {static.residual:.1g}"),
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
        known: dict[str, Any] = {"draws": self.draws, "exact": self.exact, "modes": self.modes}
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
    def warnings(self) -> tuple[str, ...]:
        """What the solver assumed."""
        return self.solved.warnings

    def checks(self) -> Sequence[Check]:
        """Shape, buckling, mesh, explicit step, size, standing, strength, frequency, range."""
        from .checks import (
            first_frequency,
            loads_reach,
            span_of_answers,
            static_checks,
            stays_upright,
            strength,
            strength_unmade,
            supports_reach,
        )

        names, used = self.mesh.region_names, np.unique(self.mesh.region)
        unknown = {names[k] for k in used} - {one.part for one in self.safety}
        known = self.intervals or {}
        softest = known.get("load_factor")
        checks = [
            *static_checks(self.solved, size_stated=self.size_stated, load_factors=softest),
            *supports_reach(self.scene),
            *loads_reach(self.scene),
            *stays_upright(self.solved, self.scene),
            *(strength(one, self.solved.discretisation_error) for one in self.safety),
            *strength_unmade(sorted(unknown), self.materials, rests=self.solved.trusted),
        ]
        if self.modes is not None or self.modes_unmade:
            checks.append(first_frequency(self.modes, self.modes_unmade))
        if known:
            names = ("mass", "max_displacement", "frequencies", "likely")
            checks.append(span_of_answers(*(known[name] for name in names)))
        return checks


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class MotionSimulation(Simulation):
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
        motion, names, run = self.motion, self._piece_names, self.motion.particles
        largest = lambda force: float(np.linalg.norm(force, axis=1).max())  # noqa: E731
        # Forces of the obstacles, frame by frame, and of the pieces on each other
        pushes = np.linalg.norm(motion.obstacle_forces, axis=2)
        forces, pressures = pushes.max(axis=0), motion.largest_pressures
        impact = motion.impact
        met = pushes.any() or bool(motion.piece_forces)
        unknown = bool(impact is not None and met and impact.unresolved)
        if impact is not None:
            forces = np.maximum(forces, impact.forces)
        found: dict[str, Any] = {
            "frames": len(motion.frames),
            "dt": motion.dt,
            "max_displacement": float(np.linalg.norm(motion.displacements, axis=2).max()),
            "smallest_gap": motion.smallest_gap,
            "max_contact_force": None if unknown else float(forces.max(initial=0.0)),
            "max_obstacle_forces": None if unknown else forces.tolist(),
            "obstacle_forces": pushes.tolist(),
        }
        if pressures is not None:
            found["max_obstacle_pressures"] = None if unknown else pressures.obstacles.tolist()
            found["max_own_pressure"] = None if unknown else pressures.own
        found["piece_forces"] = [
            {
                "on": names[on],
                "by": names[by],
                "largest": None if unknown else largest(force),
                "last": force[-1].tolist(),
            }
            for (on, by), force in motion.piece_forces.items()
        ]
        if motion.reactions is not None:
            space = discretise(self.mesh, motion.order).space
            found["reactions"] = [
                one._asdict() | {"largest": None if unknown else largest(one.force)}
                for one in reactions(self.scene, space, motion.reactions)
            ]
        # Energies [J]: given, the most beyond that, lost, most in one frame, its end [s]
        balance = energy_balance(motion, self.scene)
        found |= {
            "energy": [f.energy for f in motion.frames],
            "energy_balance": balance and balance._asdict(),
            "order": motion.order,
            "newton_iterations": sum(f.iterations for f in motion.frames),
            "model_error": motion.model_error,
            "stiffening": motion.stiffening,
            "impact": impact and {**impact._asdict(), "unresolved": impact.unresolved},
        }
        if run is not None:
            known = ("substeps", "outside", "stationary", "rigid", "bodies", "capped")
            known += ("lagrangian", "spacing", "nodes", "plan")
            particles = {name: getattr(run, name) for name in known}
            found["particles"] = {"count": len(run.part), **particles}
            found["breakage"] = run.breakage._asdict()
        return found

    @cached_property
    def _piece_names(self) -> tuple[str, ...]:
        return piece_names(self.mesh)

    @property
    def particles(self) -> ParticleRun | None:
        """The particles that found it, where it was particles."""
        return self.motion.particles

    @property
    def solution(self) -> tuple[tuple[str, str], ...]:
        """Particles, grid and steps, where particles moved it; else what the method says."""
        run = self.motion.particles
        if run is None:
            count, order = len(self.motion.frames) - 1, self.motion.order
            kind = {1: "linear", 2: "quadratic"}.get(order)
            elements = (("Elements", f"{kind} tets"),) if kind else ()
            steps = ("Steps", f"{count:,} of {si(self.motion.dt, 's')}")
            return (*elements, *self.motion.solution, steps)
        grid = "x".join(map(str, run.nodes))
        words = f"{len(run.part):,} particles on {grid} nodes, {run.spacing:.3g} m apart"
        law = ("Law", "; ".join(run.laws))
        return (law, ("Material points", words), ("Steps", f"{run.substeps:,}"))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed of the scene, of the body, and of the particles."""
        run = self.motion.particles
        return (*self.scene.warnings, *self.motion.notes, *(run.notes if run is not None else ()))

    def checks(self) -> Sequence[Check]:
        """Nothing goes through an obstacle or gains energy; who presses whom; fit elements."""
        from .checks import (
            breakage,
            contact_forces,
            follows,
            in_the_grid,
            keeps_energy,
            locking,
            no_penetration,
        )

        energy = keeps_energy(self.motion, self.scene)
        falls = bool(self.scene.obstacles) and not self.scene.held.fixed.any()
        if self.motion.particles is not None:
            run, wanted = self.motion.particles, self.scenario in ("tear", "fall")
            met = [contact_forces(self.motion, (), falls=falls)]
            met = met if falls or self.motion.obstacle_forces.any() else []
            return [in_the_grid(run), *met, *energy, *breakage(run, wanted=wanted)]
        forces = contact_forces(self.motion, self._piece_names, falls=falls)
        met = (no_penetration(self.motion), forces)
        suits = [locking(self.motion)] if self.motion.order else []
        return [*met, *energy, *suits, *follows(self.motion)]


SWING = np.arange(24) / 24  # frames of one period of a natural vibration
DRAWN = 0.05  # of the diagonal: the largest displacement that is drawn, for its size is free


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ModalSimulation(Simulation):
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
        return {**known, "free": self.modes.free, "intervals": self.intervals}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed, and what moves freely."""
        names = ", ".join(dict.fromkeys(self.modes.free))
        free = (Note("checks.free_motions", names=names),) if names else ()
        return (*self.scene.warnings, *free)

    @cached_property
    def intervals(self) -> dict[str, Any] | None:
        """Lowest and highest mass [kg] and frequencies [Hz]; None where no range is known."""
        known: dict[str, Any] = {"draws": self.draws, "exact": self.exact, "modes": self.modes}
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

    def checks(self) -> Sequence[Check]:
        """Rings or wobbles; within which range."""
        from .checks import first_frequency, span_of_answers

        checks = [first_frequency(self.modes)]
        if (known := self.intervals) is not None:
            checks.append(
                span_of_answers(known["mass"], None, known["frequencies"], known["likely"])
            )
        return checks
