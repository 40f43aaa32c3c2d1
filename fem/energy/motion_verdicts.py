"""Verdicts on a motion: whom it meets, whether few coordinates or particles do for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model_error import MOTION_LIMIT, too_coarse
from ..particle_run import ParticleRun
from ..result import MotionResult
from ..verdicts import Check, percent


def no_penetration(motion: MotionResult) -> Check:
    """Whether the body kept its distance from every obstacle, and from itself where that was so."""
    gap = motion.smallest_gap
    passed = gap > 0
    what = "an obstacle or itself" if motion.kept_apart else "an obstacle"
    nearest = f"the smallest distance is {gap:.2g} m" if np.isfinite(gap) else "it meets nothing"
    return Check(
        "no penetration", passed, gap, 0.0,
        f"It {'never goes into' if passed else 'goes into'} {what}: {nearest}.",
    )  # fmt: skip


def follows(motion: MotionResult) -> tuple[Check, ...]:
    """Whether few coordinates move as the full body would; nothing where that is not known."""
    if (error := motion.model_error) is None:
        return ()
    near, coarse = error.share <= MOTION_LIMIT, too_coarse(motion.stiffening)
    do = "follow" if near else "do not follow"
    limit = percent(MOTION_LIMIT)
    said = (
        f"Its few coordinates {do} the full body of the same elements: off by {error.words} "
        f"(limit {limit})" + (f"; but {coarse}." if coarse else ".")
    )
    return (Check("reduced model", near and not coarse, error.share, MOTION_LIMIT, said),)


def contact_forces(motion: MotionResult, names: Sequence[str]) -> Check:
    """Who presses whom, at most; ``names`` are those of the pieces."""
    forces = np.linalg.norm(motion.obstacle_forces, axis=2).max(axis=0, initial=0.0)
    pressures = motion.largest_pressures
    said = [
        f"obstacle {k + 1} with {force:.3g} N"
        + (f" ({pressures.obstacles[k]:.3g} Pa)" if pressures else "")
        for k, force in enumerate(forces)
        if force > 0
    ]
    between = {
        pair: float(np.linalg.norm(force, axis=1).max())
        for pair, force in motion.piece_forces.items()
        if pair[0] < pair[1]
    }
    said += [f"{names[b]} on {names[a]} with {size:.3g} N" for (a, b), size in between.items()]
    if pressures and pressures.own > 0:
        said.append(f"the body itself with up to {pressures.own:.3g} Pa")
    largest = max([*forces.tolist(), *between.values()], default=0.0)
    return Check(
        "contact", True, largest, np.inf,
        f"At most it is pressed by {'; '.join(said)}." if said else "Nothing presses on it.",
    )  # fmt: skip


def in_the_grid(run: ParticleRun) -> Check:
    """Whether all particles stayed in the grid."""
    total, lost = len(run.part), run.outside
    return Check(
        "particles", not lost, lost, 0,
        f"{'All' if not lost else f'{total - lost:,} of'} {total:,} particles stay in the grid.",
    )  # fmt: skip
