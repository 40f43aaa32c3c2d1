"""What the verbs return: data, the files written, and one JSON document each."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...fem.errors import BandError, InputError
from ...fem.scene.materials import FIELDS, outside_band
from ...fem.scene.mesh import TetMesh
from ...predictors.asset import Asset
from ...predictors.field import MaterialField
from ..io.document import mesh_document
from ..io.sidecar import Sidecar
from ..report.content import ADVICE, Verdict
from .simulation import Settled, Simulation

if TYPE_CHECKING:
    from ...converters.material_sampling import SampledMesh
    from ...predictors.images.features import VoxelFeatures
    from ...predictors.prediction import PartChoice
    from ..meshing.conversion_report import ConversionReport


@dataclass(frozen=True, eq=False)
class Conversion:
    """A tet mesh [m] of an asset and the report that proves its guarantees."""

    asset: Asset
    mesh: TetMesh
    report: ConversionReport
    files: tuple[Path, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """What was assumed, left out or found odd."""
        pieces = self.report.quality.components
        apart = f"the mesh is in {pieces} pieces that do not touch: each stands or hangs by itself"
        return [*self.asset.warnings, *self.report.warnings, *([apart] if pieces > 1 else [])]

    def described(self) -> Sidecar:
        """Return the sidecar of the mesh."""
        return Sidecar.of_asset(self.asset).with_record(convert=self.document())

    def document(self) -> dict[str, Any]:
        """Return what ``convert --json`` prints."""
        return {
            "files": self.files,
            **mesh_document(self.mesh),
            "quality": self.report.quality,
            "report": self.report.as_dict(),
            "warnings": self.warnings,
        }


@dataclass(frozen=True, eq=False)
class Assignment:
    """A mesh with E, nu, rho on every tet, their field, and the choice made for every part."""

    mesh: TetMesh
    text: str
    field: MaterialField
    choices: tuple[PartChoice, ...]
    sampling: SampledMesh
    sidecar: Sidecar
    warnings: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    def part_rows(self) -> list[dict[str, Any]]:
        """One row a part: material, values, ranges, source, why, volume [m^3], mass [kg]."""
        volumes = self.mesh.region_volumes()
        masses = np.bincount(
            self.mesh.region,
            weights=_material(self.mesh).rho * self.mesh.volumes,
            minlength=len(volumes),
        )
        return [
            {
                "name": choice.part,
                "material": choice.material,
                **choice.value._asdict(),
                "ranges": {name: getattr(choice.row, name) for name in FIELDS},
                "source": choice.source,
                "estimated": choice.row.estimated,
                "why": choice.why,
                "weight": choice.weight,
                "binding": choice.binding,
                "volume": volume,
                "mass": mass,
            }
            for choice, volume, mass in zip(self.choices, volumes, masses, strict=True)
        ]

    def check_bands(self) -> None:
        """Raise ``BandError`` where a part's E, nu or rho leave the band of its category."""
        for choice in self.choices:
            complaints = outside_band(choice.row.category, *choice.value)
            if complaints:
                raise BandError(f"part {choice.part!r}, {choice.material}: {'; '.join(complaints)}")

    def verdicts(self) -> list[Verdict]:
        """Whether the E, nu and rho of every part are usual for its category."""
        return [
            Verdict("note", f"{choice.part}: {complaint}", "inside band", ADVICE["inside band"])
            for choice in self.choices
            for complaint in outside_band(choice.row.category, *choice.value)
        ] or [Verdict("good", "E, nu and rho of every part are usual for its kind.", "inside band")]

    def described(self) -> Sidecar:
        """Return the sidecar of the mesh, with the choices on record."""
        return self.sidecar.with_record(assign=self.document())

    def document(self) -> dict[str, Any]:
        """Return what ``assign --json`` prints."""
        return {
            "files": self.files,
            "text": self.text,
            **mesh_document(self.mesh),
            "parts": self.part_rows(),
            "verdicts": self.verdicts(),
            "warnings": self.warnings,
        }


@dataclass(frozen=True, eq=False)
class RunCase:
    """One sentence and what became of the mesh under it."""

    assignment: Assignment
    simulation: Simulation


@dataclass(frozen=True, eq=False)
class RunResult:
    """One conversion, and one case for every sentence, under identical loads.

    ``features`` are what an image encoder sees of the asset, where that was asked for.
    """

    conversion: Conversion
    cases: tuple[RunCase, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    files: tuple[Path, ...] = ()
    features: VoxelFeatures | None = None

    def verdicts(self) -> list[list[Verdict]]:
        """Of every case: are its values usual, and can the eye tell it from the first one."""
        from ...fem.verdicts import distinguishable

        found = [case.assignment.verdicts() for case in self.cases]
        first, *others = (case.simulation for case in self.cases)
        for verdicts, other in zip(found[1:], others, strict=True):
            if isinstance(first, Settled) and isinstance(other, Settled):
                verdicts.append(Verdict.of(distinguishable(first.solved, other.solved)))
        return found

    def document(self) -> dict[str, Any]:
        """Return what ``run --json`` prints: the first sentence on top, all in ``cases``."""
        kind = self.cases[0].simulation.kind
        cases = [
            {
                **case.assignment.document(),
                "verdicts": verdicts,
                kind: case.simulation.document()[kind],
            }
            for case, verdicts in zip(self.cases, self.verdicts(), strict=True)
        ]
        keys = ("text", "tets", "volume", "mass", "bounds", "parts", "verdicts", kind)
        warnings = [
            *self.conversion.warnings,
            *(w for c in self.cases for w in (*c.assignment.warnings, *c.simulation.warnings)),
        ]
        return {
            "files": self.files,
            **{key: cases[0][key] for key in keys},
            "quality": self.conversion.report.quality,
            "report": self.conversion.report.as_dict(),
            "cases": cases,
            "seconds": self.seconds,
            "warnings": list(dict.fromkeys(warnings)),
        }


def _material(mesh: TetMesh):
    if mesh.material is None:
        raise InputError("the mesh has no E, nu and rho: run `autophyx-tet assign` on it first")
    return mesh.material
