"""What a batch of training holds: a scene with its truth."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ....predictors.film.unet import VoxelScene
from ...datasets.shapes import MAX_PARTS
from ..sentences import Clauses

CLAUSES = MAX_PARTS + 1  # one for each part, one for the whole
WHOLE = MAX_PARTS


class TrainingBatch(NamedTuple):
    """A scene with its truth: see ``predictors.film.config.VoxelScene``.

    ``target`` (batch, 3, x, y, z) normalised; ``clause`` (batch, x, y, z) the clause that speaks of
    a voxel, ``CLAUSES`` for none; ``valued`` and ``bound``: where each of the two counts.
    ``mentioned`` (batch,) counts the clauses; ``doubt`` (batch,) is the share of the binding that
    training leaves open: few real objects are known, and colours do not settle their matter.
    ``alone`` are clauses that train without an object, if any.
    """

    scene: VoxelScene
    target: Tensor
    clause: Tensor
    valued: Tensor
    bound: Tensor
    mentioned: Tensor
    doubt: Tensor
    alone: Clauses | None = None


def exists_or_whole(exists: Tensor) -> Tensor:
    """Which clause slots can hold a clause, (n, 7)."""
    return torch.cat([exists, torch.ones_like(exists[:, :1])], dim=1)


def by_part(values: Tensor, part: Tensor, outside) -> Tensor:
    """Spread values of parts (n, 6, ...) to their voxels; ``outside`` elsewhere."""
    n = len(part)
    flat = part.reshape(n, -1).clamp(min=0)
    at = torch.arange(n, device=part.device)[:, None]
    spread = values[at, flat].reshape(*part.shape, *values.shape[2:])
    mask = (part >= 0).reshape(*part.shape, *(1,) * (values.ndim - 2))
    return torch.where(mask, spread, torch.full_like(spread, outside))
