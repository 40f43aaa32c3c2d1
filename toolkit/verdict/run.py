"""What `run` returns: one conversion, and a case for every sentence."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...fem.errors import UsageError
from ...fem.grain import grained_parts
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ...predictors.asset import Asset
from ..asset.document import Sidecar, mesh_document, versions
from ..meshing.guarantees import ConversionReport
from ..options import AssignOptions, WallOptions
from .assignment import Assignment
from .check import Check, as_table, in_a_line
from .simulation import Simulation, StaticSimulation

if TYPE_CHECKING:
    from ...predictors.appearance.features import VoxelFeatures


# Places of the dial: the soft end of what is not said, its middle, the stiff end.
DIAL = (0.0, 0.5, 1.0)


def dialled(options: AssignOptions, *, dial: bool) -> tuple[AssignOptions, ...]:
    """The options, or those of every place of the dial."""
    if not dial:
        return (options,)
    if options.alpha is not None:
        raise UsageError("--dial shows alpha 0, .5 and 1: leave --alpha out")
    return tuple(replace(options, alpha=alpha) for alpha in DIAL)


@dataclass(frozen=True, eq=False)
class RunCase:
    """One sentence and what became of the mesh under it."""

    assignment: Assignment
    simulation: Simulation

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful about its words, its answer and what its files hold."""
        said = (*self.assignment.warnings, *self.simulation.warnings)
        if parts := grained_parts(self.simulation.mesh):
            files = "mesh.msh and field.npz hold E, nu and rho, not"
            said += (f"{files} the grain of {', '.join(parts)}: `simulate` and `export` find it",)
        return said


@dataclass(frozen=True, eq=False)
class RunResult:
    """One conversion, and one case for every sentence, under identical loads.

    ``features`` are what an image encoder sees of the asset, where that was asked for; ``command``
    makes it again, ``date`` is when it was made; ``seconds`` and ``cpu_seconds`` are by stage.
    Turned by the dial, each sentence has three cases.
    """

    conversion: Conversion
    cases: tuple[RunCase, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    cpu_seconds: dict[str, float] = field(default_factory=dict)
    files: tuple[Path, ...] = ()
    features: VoxelFeatures | None = None
    command: str = ""
    date: str = ""

    def __repr__(self) -> str:
        return in_a_line(self)

    _repr_html_ = as_table

    @property
    def turned(self) -> bool:
        """Whether the cases of a sentence lie at several places between soft and stiff."""
        return len({case.assignment.field.alpha for case in self.cases}) > 1

    def verdicts(self) -> list[list[Check]]:
        """Of every case: are its values usual, and can the eye tell it from the first one."""
        from .checks import distinguishable

        found = [case.assignment.verdicts() for case in self.cases]
        if self.turned:
            for k in range(0, len(self.cases), len(DIAL)):
                found[k].append(_order([c.simulation for c in self.cases[k : k + len(DIAL)]]))
            return found
        first, *others = (case.simulation for case in self.cases)
        for verdicts, other in zip(found[1:], others, strict=True):
            if isinstance(first, StaticSimulation) and isinstance(other, StaticSimulation):
                verdicts.append(distinguishable(first.solved, other.solved))
        return found

    def document(self) -> dict[str, Any]:
        """Return what ``run --json`` prints: the first sentence on top, all in ``cases``."""
        kind = self.cases[0].simulation.kind
        answers = [case.simulation.document() for case in self.cases]
        cases = [
            {
                **case.assignment.document(),
                "alpha": case.assignment.field.alpha,
                "verdicts": [found.document() for found in verdicts],
                **{key: answer[key] for key in ("scenario", "scene", kind)},
            }
            for case, verdicts, answer in zip(self.cases, self.verdicts(), answers, strict=True)
        ]
        keys = ("text", "tets", "volume", "mass", "mass_interval", "bounds", "parts", "verdicts")
        keys = (*keys, "scenario", "scene", kind)
        warnings = [
            *self.conversion.warnings,
            *(warning for case in self.cases for warning in case.warnings),
        ]
        return {
            "files": self.files,
            **{key: cases[0][key] for key in keys},
            "quality": self.conversion.report.quality,
            "report": self.conversion.report.as_dict(),
            "cases": cases,
            "command": self.command,
            "date": self.date,
            "versions": versions(),
            "seconds": self.seconds,
            "cpu_seconds": self.cpu_seconds,
            "warnings": list(dict.fromkeys(warnings)),
        }


def _order(cases: Sequence[Simulation]) -> Check:
    """Whether one sentence's cases, from soft to stiff, give way less and less.

    A linear body under one dead load stores less energy wherever it is made stiffer (Clapeyron: it
    is half the work of the load); its largest displacement need not fall.
    """
    if all(isinstance(case, StaticSimulation) for case in cases):
        given = [case.solved.static.energy for case in cases if isinstance(case, StaticSimulation)]
        does, unit = Note("checks.strains_by"), "J"
    else:
        given = [float(np.linalg.norm(c.animation.displacement, axis=-1).max()) for c in cases]
        does, unit = Note("checks.moves_by"), "m"
    told = {"does": does, "values": ", ".join(f"{x:.3g}" for x in given), "unit": unit}
    falls = all(stiff < soft for soft, stiff in pairwise(given))
    said = Note("checks.less_and_less" if falls else "checks.not_less", **told)
    return Check("dial", "passed" if falls else "failed", said, given[-1], given[0], unit)


class Stopwatch:
    """Seconds of every stage, by name, on the wall and of processors; laps of one name add up."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.cpu_seconds: dict[str, float] = {}
        self._last = self._now()

    def lap(self, name: str) -> None:
        """Add the time since the last lap to ``name``."""
        now = self._now()
        for kept, began, ended in zip(
            (self.seconds, self.cpu_seconds), self._last, now, strict=True
        ):
            kept[name] = kept.get(name, 0.0) + ended - began
        self._last = now

    @staticmethod
    def _now() -> tuple[float, float]:
        """Time on the wall, and that of this process and of its children that have ended [s]."""
        return time.perf_counter(), sum(os.times()[:4])


@dataclass(frozen=True, eq=False)
class Conversion:
    """A tet mesh [m] of an asset and the report that proves its guarantees."""

    asset: Asset
    mesh: TetMesh
    report: ConversionReport
    files: tuple[Path, ...] = ()
    walls: WallOptions = field(default_factory=WallOptions)

    def __repr__(self) -> str:
        return in_a_line(self)

    _repr_html_ = as_table

    @property
    def warnings(self) -> list[str]:
        """What was assumed, left out or found odd."""
        pieces = self.report.quality.components
        apart = [Note("messages.apart", pieces=pieces)] if pieces > 1 else []
        return [*self.asset.warnings, *self.report.warnings, *apart]

    @property
    def known_walls(self) -> WallOptions:
        """What was said of walls, with those that the mesh holds by themselves."""
        return replace(self.walls, held=(*self.report.walls, *self.walls.held))

    def described(self) -> Sidecar:
        """Return the sidecar of the mesh."""
        return Sidecar.of_asset(self.asset).with_record(
            convert=self.document(), walls=asdict(self.known_walls)
        )

    def document(self) -> dict[str, Any]:
        """Return what ``convert --json`` prints."""
        return {
            "files": self.files,
            **mesh_document(self.mesh),
            "quality": self.report.quality,
            "report": self.report.as_dict(),
            "warnings": self.warnings,
        }
