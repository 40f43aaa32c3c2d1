"""What `convert` returns: a tet mesh and the report that proves its guarantees."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...fem.scene.mesh import TetMesh
from ...predictors.asset import Asset
from ..io.document import mesh_document
from ..io.sidecar import Sidecar
from ..walls.wall_options import WallOptions
from .summary import as_table, in_a_line

if TYPE_CHECKING:
    from ..meshing.conversion_report import ConversionReport


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

    def _repr_html_(self) -> str:
        return as_table(self)

    @property
    def warnings(self) -> list[str]:
        """What was assumed, left out or found odd."""
        pieces = self.report.quality.components
        apart = f"the mesh is in {pieces} pieces that do not touch: each stands or hangs by itself"
        return [*self.asset.warnings, *self.report.warnings, *([apart] if pieces > 1 else [])]

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
