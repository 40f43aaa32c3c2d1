"""What `convert` returns: a tet mesh and the report that proves its guarantees."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...fem.scene.mesh import TetMesh
from ...predictors.asset import Asset
from ..io.document import mesh_document
from ..io.sidecar import Sidecar

if TYPE_CHECKING:
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
