"""A body falls on the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..deprecation import renamed_options
from ..laws.law import Law
from ..result import MotionResult
from ..scene.mesh import TetMesh
from ..scene.scene import Scene
from ..scene.support_finder import ground_under
from ..scene.up import UpAxis, up_vector
from ..solve.dynamics import DynamicMethod
from ..solve.method import FrameProgress
from ..solve.schemes import Scheme
from ..validation import checked_number, checked_positive

# A drop is followed for this many fall times, so that the bounce is seen.
FALLS = 3.0
FRAMES = 90


@dataclass(frozen=True)
class Drop:
    """It falls from ``height`` [m], half its size by default, under ``gravity`` [m/s^2].

    ``friction`` is the coefficient of Coulomb friction [1] of the ground.
    """

    title: ClassVar[str] = "Dropped"
    method: ClassVar[str] = "dynamics"
    with_modes: ClassVar[bool] = False

    height: float | None = None
    friction: float = 0.3
    gravity: float = 9.81
    frames: int = FRAMES

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` above the ground; ``InputError`` where the height is not positive."""
        size = float(np.ptp(mesh.bounds, axis=0).max())
        height = 0.5 * size if self.height is None else self.height
        checked_positive("height", height, "m")
        checked_positive("gravity", self.gravity, "m/s^2")
        checked_number("friction", self.friction, "", least=0.0)
        return Scene(
            mesh=mesh,
            up=up,
            gravity_vector=-self.gravity * up_vector(up),
            obstacles=(ground_under(mesh, up, gap=height),),
            friction=self.friction,
            duration=FALLS * float(np.sqrt(2 * height / self.gravity)),
            frames=self.frames,
        )


@renamed_options(tell="progress")
def drop(
    mesh: TetMesh,
    *,
    up: UpAxis = "z",
    height: float | None = None,
    friction: float = 0.3,
    gravity: float = 9.81,
    frames: int = FRAMES,
    law: str = Law.NEO_HOOKEAN,
    scheme: Scheme = Scheme.IMPLICIT_EULER,
    order: int | None = None,
    device: str = "cpu",
    progress: FrameProgress | None = None,
) -> MotionResult:
    """Let ``mesh`` fall on the ground from ``height`` [m], half its size by default.

    ``friction`` is the coefficient of Coulomb friction of the ground, ``gravity`` in [m/s^2];
    ``progress`` is called after every frame.
    """
    scene = Drop(height, friction, gravity, frames).scene(mesh, up=up)
    return DynamicMethod().solve(
        scene, law=law, order=order, device=device, progress=progress, scheme=scheme
    )
