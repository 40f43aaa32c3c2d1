"""What `simulate` returns: a body that settles, moves or rings, all told and shown alike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.result import Modes, MotionResult, SagResult
from ...fem.scenarios.scenario import SCENARIOS
from ...fem.scene.mesh import TetMesh
from ..io.document import mesh_document
from .verdict import Verdict

# Share of the load in each frame of a static answer's motion: it comes on slowly and linearly.
RAMP = np.linspace(0, 1, 6)
# Frames of one period of a natural vibration.
SWING = np.arange(24) / 24
# A vibration is drawn with this largest displacement, as a share of the diagonal: its size is free.
DRAWN = 0.05


class Animation(NamedTuple):
    """A motion: times [s] and the displacement [m] of the mesh points at each."""

    times: Float[np.ndarray, "frames"]
    displacement: Float[np.ndarray, "frames points 3"]


@dataclass(frozen=True, eq=False)
class Simulation(ABC):
    """The answer of ``mesh`` under a ``scenario``, and the ``seconds`` it took."""

    mesh: TetMesh
    scenario: str
    seconds: float = 0.0
    files: tuple[Path, ...] = ()

    # Name of the answer's numbers in the document.
    kind: ClassVar[str]

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
    def cell_data(self) -> Mapping[str, np.ndarray]:
        """Fields of the answer on the tets."""
        return {}

    @property
    def point_data(self) -> Mapping[str, np.ndarray]:
        """Fields of the answer at the points: displacement [m]."""
        return {"displacement": self.displacement}

    @property
    def frequencies(self) -> tuple[float, ...]:
        """First natural frequencies [Hz], where they are known."""
        return ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed."""
        return ()

    @property
    def title(self) -> str:
        """What happens, in a few words."""
        return SCENARIOS[self.scenario].title

    def verdicts(self) -> list[Verdict]:
        """Findings in plain words, each with its number and threshold."""
        return []

    def write(self, path: Path) -> list[Path]:
        """Write the state shown as .vtu or .vtk, or the whole motion as .pvd; return the files."""
        from ...converters.mesh.mesh_file import write_mesh
        from ...converters.mesh.pvd import write_pvd

        if path.suffix.lower() != ".pvd":
            fields = {"point_data": self.point_data, "cell_data": self.cell_data}
            write_mesh(path, self.mesh, **fields)
            return [path]
        frames = zip(self.animation.times.tolist(), self.animation.displacement, strict=True)
        return write_pvd(path, self.mesh, ((time, {"displacement": u}) for time, u in frames))

    def document(self) -> dict[str, Any]:
        """Return what ``simulate --json`` prints."""
        return {
            "files": self.files,
            **mesh_document(self.mesh),
            "scenario": self.scenario,
            self.kind: {**self.numbers, "verdicts": self.verdicts()},
            "seconds": self.seconds,
            "warnings": self.warnings,
        }


@dataclass(frozen=True, eq=False, kw_only=True)
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
        static = self.solved.static
        return {
            "max_displacement": self.solved.max_displacement,
            "sag_ratio": self.solved.sag_ratio,
            "height": self.solved.height,
            "max_von_mises": float(self.solved.von_mises.max()),
            "frequencies": self.frequencies,
            "order": static.order,
            "gap": self.solved.discretisation_error,
            "residual": static.residual,
            "iterations": static.iterations,
        }

    @property
    def cell_data(self) -> Mapping[str, np.ndarray]:
        """Von Mises stress [Pa]."""
        return {"von_mises": self.solved.von_mises}

    @property
    def frequencies(self) -> tuple[float, ...]:
        """First natural frequencies [Hz] of the body as it stands."""
        return () if self.modes is None else tuple(self.modes.frequencies.tolist())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the solver assumed."""
        return self.solved.warnings

    def verdicts(self) -> list[Verdict]:
        """Shape, discretisation, explicit step, first frequency."""
        from ...fem.verdicts import first_frequency, static_checks

        checks = [*static_checks(self.solved)]
        if self.modes is not None:
            checks.append(first_frequency(self.modes))
        return [*map(Verdict.of, checks)]


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
            "newton_iterations": sum(f.iterations for f in frames),
        }

    def verdicts(self) -> list[Verdict]:
        """Nothing went through an obstacle."""
        from ...fem.verdicts import no_penetration

        return [Verdict.of(no_penetration(self.motion))]


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


def simulation_of(
    mesh: TetMesh, scenario: str, result: SagResult | MotionResult | Modes
) -> Simulation:
    """Answer of ``mesh`` under ``scenario``, by the kind of its result, whatever the method."""
    if isinstance(result, SagResult):
        return Settled(mesh, scenario, solved=result)
    if isinstance(result, MotionResult):
        return Moving(mesh, scenario, motion=result)
    return Ringing(mesh, scenario, modes=result)
