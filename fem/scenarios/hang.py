"""A body hangs under its own weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..result import SagResult
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.support_finder import Axis, find_supports, up_axis
from ..solve.equilibrium import StaticMethod
from ..validation import checked_number


@dataclass(frozen=True)
class Hang:
    """It hangs from its highest points under ``gravity`` [m/s^2], downwards."""

    title: ClassVar[str] = "Hanging under its own weight"
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = False

    gravity: float = 9.81

    def scene(self, mesh: TetMesh, *, up: Axis = "z") -> Scene:
        """Scene of the hanging ``mesh``."""
        axis = up_axis(up)
        held, warnings = find_supports(mesh, axis, from_top=True)
        weight = -checked_number("gravity", self.gravity, "m/s^2", least=0.0) * np.eye(3)[axis]
        return Scene(mesh=mesh, up=axis, supports=held, gravity_vector=weight, warnings=warnings)


def hang(
    mesh: TetMesh,
    *,
    up: Axis = "z",
    order: int | None = None,
    gravity: float = 9.81,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Hang ``mesh`` from its highest points under its weight; options as in ``sag``."""
    scene = Hang(gravity).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)
