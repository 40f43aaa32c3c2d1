"""Spring-mass networks as a method of the scene: tets become anchors, and follow them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..errors import UsageError
from ..note import Note
from ..scene.scene import Scene
from ..solve.method import FrameProgress
from ..solve.result import MotionResult
from ..validation import checked_count, checked_positive
from .body import SpringBody, spring_body
from .network import SOFTEST, stiffened

# CPU time of half a spring and step [s]: 3.3 to 5 ns were measured, on a busy machine more.
COST = 6e-9
# A run that takes longer [s] is refused.
PATIENCE = 600.0


@dataclass(frozen=True, kw_only=True)
class SpringMethod:
    """Motion of a scene by a spring-mass network.

    anchors, neighbours: Anchors of the body, and how many each is joined with.
    eta: Weights of the neighbours: 0, all of them alike; 20, the nearest sixteen alone.
    scale: What the calibrated stiffness of the springs is multiplied by [1].
    surface: Logarithm [1] of the stiffness at the surface over that in the middle, as a fit finds
        it.
    stiffer: How many times as stiff [1] as at the softest eta, k the same: eta is then found for
        that.
    dashpot: Damping of every spring over its stiffness [s].
    seed: Of the places of the anchors.
    announce: Hears springs, steps and expected time, in words, before the run.
    """

    anchors: int = 2048
    neighbours: int = 32
    eta: float = 0.0
    scale: float = 1.0
    surface: float = 0.0
    stiffer: float | None = None
    dashpot: float = 0.0
    seed: int = 0
    announce: Callable[[str], None] | None = None

    laws: tuple[str, ...] = ()

    def solve(
        self,
        scene: Scene,
        *,
        law: str | None = None,
        order: int | None = None,
        device: str = "cpu",
        progress: FrameProgress | None = None,
    ) -> MotionResult:
        """Follow the scene for its duration.

        Raises UsageError: Where an obstacle is no plane, the run would take ten minutes, a GPU is
            asked for, or a ``law`` or an ``order``: these are for elements.
        Raises ConvergenceError: Where the steps turn out unstable.
        """
        if law is not None or order is not None:
            raise UsageError("method.springs_elements")
        if device != "cpu":
            raise UsageError("method.springs_device")
        body = spring_body(scene, self.anchors, self.neighbours, seed=self.seed)
        frames = checked_count("frames", scene.frames)
        dt = checked_positive("duration", scene.duration, "s") / frames
        motion = body.motion(self.stiffness(body), dashpot=self.dashpot)
        springs, steps = len(motion.network.i), motion.steps_for(scene.duration)
        seconds = 2 * COST * springs * steps
        if seconds > PATIENCE:
            raise UsageError(
                "method.springs_stiff",
                longest_step=motion.longest_step,
                steps=steps,
                minutes=seconds / 60,
            )
        count = len(motion.network.anchors.x)
        plan = Note("method.anchors_springs", count=count, springs=springs, steps=steps)
        plan = f"{plan}: some {seconds:,.0f} s"
        if self.announce is not None:
            self.announce(plan)
        states = [body.state(motion, 0.0)]
        for frame in range(1, frames + 1):
            motion.advance(dt)
            states.append(body.state(motion, frame * dt))
            if progress is not None:
                progress(frame, frames)
        solution = (("springs", plan), ("steps", f"{motion.steps:,}"))
        points = len(scene.mesh.points)
        return MotionResult(tuple(states), dt, points, order=0, notes=body.notes, solution=solution)

    def stiffness(self, body: SpringBody) -> Float[np.ndarray, "springs"]:
        """Stiffness of the springs of ``body`` [N/m]."""
        if self.stiffer is None:
            return self.scale * body.network.stiffness(self.eta, surface=self.surface)
        k = self.scale * body.network.constants(SOFTEST, self.surface)
        return stiffened(body.network, k, self.stiffer)


METHOD = SpringMethod()
