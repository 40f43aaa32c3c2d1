"""What `simulate` returns, whatever the body does: all told, written and shown alike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.particle_run import ParticleRun
from ...fem.result import Modes
from ...fem.scenarios.scenario import SCENARIOS
from ...fem.scene.mesh import TetMesh
from ...fem.scene.scene import Scene
from ...fem.uncertainty.ranges import Draws, Exact
from ..driving import DriveRecord
from ..io.document import mesh_document
from .description import describe
from .summary import as_table, in_a_line
from .verdict import Verdict, with_doubts

if TYPE_CHECKING:
    from ...fem.verdicts import Check


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
    the user gave the size or the unit of that file.
    """

    scene: Scene
    scenario: str
    stated: bool = False
    seconds: float = 0.0
    driven: DriveRecord | None = None
    materials: Mapping[str, str] = field(default_factory=dict)
    differences: tuple[str, ...] = ()
    size_stated: bool = False
    draws: Draws = field(default_factory=dict)
    exact: Exact = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    # Name of the answer's numbers in the document.
    kind: ClassVar[str]

    def __repr__(self) -> str:
        return in_a_line(self)

    def _repr_html_(self) -> str:
        return as_table(self)

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
        """First natural frequencies [Hz], where they are known."""
        return ()

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

    def verdicts(self) -> list[Verdict]:
        """Findings in plain words: whether the mesh is the file's body, then every check."""
        return with_doubts(list(self._judged), self.differences)

    @cached_property
    def _judged(self) -> tuple[Verdict, ...]:
        """Every check in words; what is printed, written and reported is judged once."""
        return tuple(map(Verdict.of, self.checks()))

    def write(self, path: Path) -> list[Path]:
        """Write the state shown as .vtu or .vtk, the motion as .pvd or .glb; return the files."""
        if path.suffix.lower() == ".glb":
            from ...converters.mesh.gltf_motion import write_motion_glb

            return [write_motion_glb(path, self.mesh, *self.animation, up=self.scene.up)]
        if path.suffix.lower() != ".pvd":
            from ...converters.mesh.mesh_file import write_mesh

            fields = {"point_data": self.point_data, "cell_data": self.cell_data}
            write_mesh(path, self.mesh, **fields)
            return [path]
        from ...converters.mesh.pvd import write_pvd

        frames = zip(self.animation.times.tolist(), self.animation.displacement, strict=True)
        return write_pvd(path, self.mesh, ((time, {"displacement": u}) for time, u in frames))

    def document(self) -> dict[str, Any]:
        """Return what ``simulate --json`` prints."""
        return {
            "files": self.files,
            **mesh_document(self.mesh),
            "scenario": self.scenario,
            "scene": [acting._asdict() for acting in describe(self.scene)],
            self.kind: {**self.numbers, "verdicts": self.verdicts()},
            "seconds": self.seconds,
            **({} if self.driven is None else {"drive": self.driven.document()}),
            "warnings": (*self.warnings, *(self.driven.warnings if self.driven else ())),
        }
