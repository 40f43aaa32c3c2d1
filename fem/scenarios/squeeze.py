"""A body is squeezed between two plates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from ..contact.barrier import barrier_thickness
from ..deprecation import renamed_options
from ..errors import InputError
from ..laws.law import Law
from ..result import MotionResult
from ..scene.mesh import TetMesh, material_of
from ..scene.obstacles import gripper
from ..scene.scene import Scene
from ..scene.up import UpAxis, up_index
from ..solve.dynamics import DynamicMethod
from ..solve.method import FrameProgress
from ..validation import checked_number

FRAMES = 20
# A squeeze is slow: the plates take this many times the crossing of the slowest shear wave.
SLOWNESS = 50.0
# And at least this long [s] for each width of travel: friction sticks below a speed that is a share
# of the size per second, so the corners of a squeeze in milliseconds (stiff bodies) would be too
# sharp for Newton; and it is the same friction for every share.
LEAST = 100.0
# The plates begin to push at this share of their travel from the body, where they start. They go on
# by half of it: wherever in it they end, the body is squeezed as asked to half a per cent.
REACH = 0.01


@dataclass(frozen=True)
class Squeeze:
    """Two plates close by ``share`` of the width along ``axis``, slowly, without gravity.

    By default along the first horizontal axis; ``friction`` is that of the plates [1].
    """

    title: ClassVar[str] = "Squeezed"
    method: ClassVar[str] = "dynamics"
    with_modes: ClassVar[bool] = False

    axis: Literal["x", "y", "z"] | None = None
    share: float = 0.1
    friction: float = 0.5
    frames: int = FRAMES

    def scene(self, mesh: TetMesh, *, up: UpAxis = "z") -> Scene:
        """Scene of ``mesh`` between the plates; ``InputError`` where the share is not one."""
        if not 0 < self.share < 1:
            raise InputError(f"share {self.share:g}: wanted between 0 and 1")
        checked_number("friction", self.friction, "", least=0.0)
        k = up_index(self.axis or ("x" if up[-1] != "x" else "y"))
        low, high = mesh.bounds
        diagonal = float(np.linalg.norm(high - low))
        travel = self.share * float(high[k] - low[k]) / 2
        reach = min(REACH * travel, barrier_thickness(mesh))
        material = material_of(mesh)
        slowest = float(np.sqrt((material.lame.mu / material.rho).min()))
        duration = max(LEAST * self.share, SLOWNESS * diagonal / slowest)
        speed = (travel + reach / 2) / duration
        away = reach * np.eye(3)[k]
        return Scene(
            mesh=mesh,
            up=up,
            obstacles=gripper(tuple(low - away), tuple(high + away), k, speed),
            friction=self.friction,
            thickness=reach,
            duration=duration,
            frames=self.frames,
        )


@renamed_options(tell="progress")
def squeeze(
    mesh: TetMesh,
    *,
    axis: Literal["x", "y", "z"] = "x",
    share: float = 0.1,
    friction: float = 0.5,
    frames: int = FRAMES,
    law: str = Law.NEO_HOOKEAN,
    order: int | None = None,
    device: str = "cpu",
    progress: FrameProgress | None = None,
) -> MotionResult:
    """Squeeze ``mesh`` between two plates that close by ``share`` of its width along ``axis``.

    The plates close slowly against the waves in the body; gravity is left out; ``progress`` is
    called after every frame.
    """
    scene = Squeeze(axis, share, friction, frames).scene(mesh)
    return DynamicMethod().solve(scene, law=law, order=order, device=device, progress=progress)
