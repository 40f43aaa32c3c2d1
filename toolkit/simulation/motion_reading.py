"""Motions out of files: displacements at equal times, to be fitted to."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...converters.mesh.pvd import read_pvd
from ...fem.errors import InputError

# Frames of a motion are at equal times to this share of their distance.
EVEN = 1e-3


class EvenMotion(NamedTuple):
    """Displacement (frames, points, 3) [m] every ``dt`` [s]."""

    displacement: np.ndarray
    dt: float


def read_motion(path: Path, points: int) -> EvenMotion:
    """Displacements of a .pvd at equal times; ``InputError`` where they are none or uneven."""
    times, frames = [], []
    for moment, data in read_pvd(path):
        u = data.point_data.get("displacement")
        if u is None or u.shape != (points, 3):
            raise InputError(
                f"{path}: frame {len(frames)} has no displacement of {points} points: wanted a "
                "motion of this mesh, as `simulate -o MOTION.pvd` writes"
            )
        times.append(moment)
        frames.append(np.asarray(u, dtype=float))
    steps = np.diff(times)
    if len(steps) < 2 or not np.ptp(steps) <= EVEN * steps.mean():
        raise InputError(f"{path}: {len(times)} frames: wanted three or more at equal times")
    return EvenMotion(np.stack(frames), float(steps.mean()))
