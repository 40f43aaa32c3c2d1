"""The natural vibrations of a standing body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.support_finder import find_supports
from ..scene.up import UpAxis


@dataclass(frozen=True)
class Vibration:
    """The first ``modes`` natural vibrations of the body clamped at its base."""

    title: ClassVar[str] = "First natural vibration"
    method: ClassVar[str] = "modal"
    with_modes: ClassVar[bool] = False

    modes: int = 6

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the standing ``mesh``."""
        held, warnings = find_supports(mesh, up)
        return Scene(mesh=mesh, up=up, supports=held, modes=self.modes, warnings=warnings)
