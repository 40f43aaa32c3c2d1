"""A body falls and may come to pieces, flow or stay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.up import UpAxis
from .drop import Drop

# PhysGaussian's and AutoPhyX's falls: 50 frames of 0.04 s.
FRAMES, FRAME_TIME = 50, 0.04


@dataclass(frozen=True)
class Fall:
    """It falls from ``height`` [m], its largest size by default, under ``gravity`` [m/s^2].

    ``friction`` is the coefficient of Coulomb friction [1] of the ground.
    """

    title: ClassVar[str] = "Falling"
    method: ClassVar[str] = "mpm"
    with_modes: ClassVar[bool] = False

    height: float | None = None
    friction: float = 0.3
    gravity: float = 9.81

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` above the ground; ``InputError`` where the height is not positive."""
        size = float(np.ptp(mesh.bounds, axis=0).max())
        height = size if self.height is None else self.height
        scene = Drop(height, self.friction, self.gravity).scene(mesh, up=up)
        return replace(scene, duration=FRAMES * FRAME_TIME, frames=FRAMES)
