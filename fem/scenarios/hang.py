"""A body hangs under its own weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..result import SagResult
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.support_finder import find_supports
from ..scene.up import UpAxis, up_vector
from ..solve.equilibrium import StaticMethod
from ..validation import checked_number


@dataclass(frozen=True)
class Hang:
    """It hangs from its highest points under ``gravity`` [m/s^2], downwards."""

    title: ClassVar[str] = "Hanging under its own weight"
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = False

    gravity: float = 9.81

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the hanging ``mesh``."""
        held, warnings = find_supports(mesh, up, from_top=True)
        weight = -checked_number("gravity", self.gravity, "m/s^2", least=0.0) * up_vector(up)
        return Scene(mesh=mesh, up=up, supports=held, gravity_vector=weight, warnings=warnings)


def hang(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    order: int | None = None,
    gravity: float = 9.81,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Hang ``mesh`` from its highest points under its weight; options as in ``sag``."""
    scene = Hang(gravity).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)
