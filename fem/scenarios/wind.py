"""The wind blows on a standing body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..result import SagResult
from ..scene.boundary import face_normals
from ..scene.loads import Traction
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.support_finder import find_supports, ground_under
from ..scene.up import UpAxis, up_vector
from ..solve.equilibrium import StaticMethod
from ..validation import checked_direction, checked_positive

AIR_DENSITY = 1.225  # [kg/m^3] at 15 C, sea level

# What a method of motion follows: 125 frames of 0.04 s.
GUST = {"duration": 5.0, "frames": 125}


@dataclass(frozen=True)
class Wind:
    """Drag on every face that looks into a wind of ``speed`` [m/s] along ``direction``.

    By default along the first horizontal axis; ``drag`` is the coefficient [1] of a face across the
    wind. The weight is left out: the answer is what the wind adds. Faces do not shelter each other.
    """

    title: ClassVar[str] = "In the wind"
    method: ClassVar[str] = "statics"
    with_modes: ClassVar[bool] = False

    direction: Sequence[float] | None = None
    speed: float = 10.0
    drag: float = 1.2

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of the standing ``mesh``; ``InputError`` where the wind has no direction."""
        given = np.roll(up_vector(up), 1) if self.direction is None else self.direction
        blows = checked_direction("wind direction", given)
        speed = checked_positive("wind speed", self.speed, "m/s")
        drag = checked_positive("drag coefficient", self.drag, "")
        faces = mesh.boundary.faces
        facing = -face_normals(mesh.points, faces) @ blows
        windward = facing > 0
        push = 0.5 * AIR_DENSITY * speed**2 * drag * facing[windward, None] * blows
        held, warnings = find_supports(mesh, up)
        loads = (Traction(faces[windward], push, "the windward side"),)
        stands = {"supports": held, "ground": ground_under(mesh, up)}
        return Scene(mesh=mesh, up=up, **stands, tractions=loads, warnings=warnings, **GUST)


def wind(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    direction: Sequence[float] | None = None,
    speed: float = 10.0,
    drag: float = 1.2,
    order: int | None = None,
    law: str | None = None,
    device: str = "cpu",
) -> SagResult:
    """Blow on a standing ``mesh``: drag on every face that looks into the wind.

    Parameters
    ----------
    direction
        Where the wind blows to; by default along the first horizontal axis.
    speed
        Speed of the wind [m/s].
    drag
        Drag coefficient [1] of a face across the wind.

    The weight is left out: the answer is what the wind adds. Faces do not shelter each other.
    """
    scene = Wind(direction, speed, drag).scene(mesh, up=up)
    return StaticMethod().solve(scene, law=law, order=order, device=device)
