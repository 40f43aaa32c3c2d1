"""The energy of a motion beside what it was given: what was made of nothing, and what is lost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..mesh import material_of
from ..scene.scene import Scene
from .result import MotionResult

# A body strained by this share has an energy that is worth no word.
UNSEEN = 1e-10


class EnergyBalance(NamedTuple):
    """Energies of a motion [J].

    ``given`` is what it had at the start and what loads and moving obstacles put in, at most at any
    time; ``excess`` what it had beyond what it was given until then, at most; ``lost`` what is
    missing at the end. Of that ``dropped`` went in one frame, the one that ends at ``time`` [s].
    """

    given: float
    excess: float
    lost: float
    dropped: float
    time: float


def energy_balance(motion: MotionResult, scene: Scene) -> EnergyBalance | None:
    """Balance of kinetic, elastic and potential energy; None where supports of particles move.

    Loads are dead, so that their work is in the potential; a moving obstacle works by its force
    over the frame, and one that stands gives nothing.
    """
    if motion.particles is not None and scene.held.values[scene.held.fixed].any():
        return None
    frames = motion.frames
    body = np.array([f.kinetic + f.elastic + f.barrier for f in frames])
    potential = np.array([f.potential for f in frames])
    given = body[0] + potential[0] - potential + _work(motion, scene)
    missing = given - body
    drops = np.diff(missing)
    worst = int(np.argmax(drops)) + 1
    floor = UNSEEN**2 * float(material_of(scene.mesh).E @ scene.mesh.volumes)
    return EnergyBalance(
        max(float(given.max()), floor),
        float(max(0.0, -missing.min())),
        float(max(0.0, missing[-1])),
        float(max(0.0, drops[worst - 1])),
        frames[worst].time,
    )


def _work(motion: MotionResult, scene: Scene) -> np.ndarray:
    """Work [J] of the moving obstacles on the body until every frame."""
    if not scene.obstacles:
        return np.zeros(len(motion.frames))
    speeds = np.array([obstacle.velocity for obstacle in scene.obstacles], dtype=float)
    power = np.einsum("foi,oi->f", motion.obstacle_forces, speeds)
    return motion.dt * np.concatenate([[0.0], np.cumsum(power[1:])])
