"""Two grips pull the ends of a body apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.supports import Supports
from ..scene.up import UpAxis, up_vector
from ..validation import checked_number, checked_positive

# Points within this share of the length from an end are gripped.
GRIPPED = 0.15


@dataclass(frozen=True)
class Tear:
    """Its ends, along its longest axis, go apart by ``share`` [1] of its length in ``time`` [s]."""

    title: ClassVar[str] = "Pulled apart"
    method: ClassVar[str] = "mpm"
    with_modes: ClassVar[bool] = False

    share: float = 0.3
    time: float = 2.0
    gravity: float = 0.0

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` between two grips; ``InputError`` where a number is out of range."""
        checked_positive("share", self.share, "")
        checked_positive("time", self.time, "s")
        checked_number("gravity", self.gravity, "m/s^2", least=0.0)
        low, high = mesh.bounds
        along = int(np.argmax(high - low))
        place = (mesh.points[:, along] - low[along]) / (high[along] - low[along])
        pull = 0.5 * self.share * (high - low)[along] * np.eye(3)[along]
        held = Supports.clamp(len(place), place < GRIPPED, -pull)
        held = held.with_fixed(place > 1 - GRIPPED, (0, 1, 2), pull)
        weight = -self.gravity * up_vector(up)
        return Scene(
            mesh=mesh, up=up, supports=held, gravity_vector=weight, duration=self.time, frames=50
        )
