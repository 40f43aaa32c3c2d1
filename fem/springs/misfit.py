"""How far springs are from a motion, which every step of a fit asks."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ..errors import InputError, UsageError
from ..scene.mesh import TetMesh, material_of
from ..solve.method import FrameProgress
from .body import SpringBody
from .method import COST, PATIENCE

logger = logging.getLogger(__name__)

# Motions that a fit takes, about: 9 to 14 were counted.
USUAL = 12
# Steps are made shorter only where they are too long by more than this share, so that differences
# are not those of another step.
LEEWAY = 0.05


class SpringMisfit:
    """A motion that a body's springs are compared with; steps grow shorter as springs need it.

    Parameters
    ----------
    body
        Whose springs are fitted.
    wanted
        Displacement [m] of the mesh points, shape (frames, points, 3), the start first.
    dt
        Between two frames [s].
    dashpot, steps
        Damping of the springs, and how many steps a frame has at least.
    announce, progress
        Called before the first motion with what a fit takes, and every frame with how many of all
        its frames are done.
    """

    def __init__(
        self,
        body: SpringBody,
        wanted: Float[np.ndarray, "frames points 3"],
        dt: float,
        *,
        dashpot: float = 0.0,
        steps: int = 1,
        announce: Callable[[str], None] | None = None,
        progress: FrameProgress | None = None,
    ) -> None:
        self.body, self.dt, self.dashpot, self.steps = body, dt, dashpot, steps
        self.target = np.asarray(wanted, dtype=float)[1:]
        self.weight = _weights(body.scene.mesh, self.target)
        self.motions, self.announce, self.progress = 0, announce, progress

    def of(self, stiffness: Float[np.ndarray, "springs"]) -> np.ndarray:
        """Weighted difference (n,) of the springs' displacement, over the motion's size.

        Raises
        ------
        UsageError
            Where a fit would take hours.
        """
        motion = self.body.motion(stiffness, dashpot=self.dashpot)
        needed = motion.steps_for(self.dt)
        self.steps = needed if needed > (1 + LEEWAY) * self.steps else self.steps
        plan = self._plan(len(stiffness))
        if self.announce is not None and not self.motions:
            self.announce(plan)
        out = np.empty_like(self.target)
        for frame in range(len(out)):
            motion.advance(self.dt, steps=self.steps)
            out[frame] = self.body.displacement(motion.x)
            if self.progress is not None:
                most = max(USUAL, self.motions + 2)
                self.progress(self.motions * len(out) + frame + 1, most * len(out))
        self.motions += 1
        return (self.weight * (out - self.target)).ravel()

    def _plan(self, springs: int) -> str:
        """What a fit takes, in words."""
        steps = self.steps * len(self.target)
        seconds = USUAL * 2 * COST * springs * steps
        if seconds > PATIENCE:
            raise UsageError(
                f"a fit takes some {USUAL} motions of {steps:,} steps, so stiff the springs are: "
                f"some {seconds / 3600:.1f} hours; fewer --anchors, a shorter or softer motion, or "
                "--solver lbs"
            )
        logger.info("a motion of %s steps takes some %.0f s", f"{steps:,}", seconds / USUAL)
        plan = f"{springs:,} springs, about {USUAL} motions of {steps:,} steps"
        return f"{plan}: some {seconds:,.0f} s"


def _weights(
    mesh: TetMesh, target: Float[np.ndarray, "frames points 3"]
) -> Float[np.ndarray, "points 1"]:
    """Roots of the points' mass, so that the motion to fit to is of length one."""
    if target.ndim != 3 or not len(target) or target.shape[1:] != mesh.points.shape:
        raise InputError(
            f"a motion of shape {target.shape}: wanted (frames, {len(mesh.points)}, 3)"
        )
    share = (material_of(mesh).rho * mesh.volumes / 4).repeat(4)
    weight = np.sqrt(np.bincount(mesh.tets.ravel(), share, len(mesh.points)))[:, None]
    size = float(np.linalg.norm(weight * target))
    if not size > 0:
        raise InputError("nothing moves in the motion: there is nothing to fit to")
    return weight / size
