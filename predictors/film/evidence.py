"""Evidence for the network: how well what is seen and what a part is called fit a clause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ..voxels import PartVoxels

VISION = 0.2  # as of simulated evidence of strength .8: chosen beforehand, not fitted


def standard(evidence: Float[np.ndarray, "x y z k"], inside: np.ndarray) -> np.ndarray:
    """Evidence (k, x, y, z) with zero mean and unit deviation inside, 0 outside."""
    within = evidence[inside]
    scaled = (evidence - within.mean()) / np.sqrt(within.var() + 1e-4)  # 1e-4: as in training
    return np.moveaxis(np.where(inside[..., None], scaled, 0), -1, 0).astype(np.float32)


def with_names(parts: PartVoxels, names: Sequence[str]) -> PartVoxels:
    """Return the parts under other names: to hide what they are called, or to tell it."""
    return replace(parts, part_names=tuple(names), labels=())
