"""What training minimises: AutoPhyX eq. (2) for the values, cross-entropy for the binding."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from ..film.config import Output
from .batch import CLAUSES, Batch

BINDING_WEIGHT = 0.3  # of the cross-entropy beside the squared error


class Losses(NamedTuple):
    """The loss and what to watch: mean normalised squared error, share of voxels bound right."""

    total: Tensor
    mse: Tensor
    right: Tensor


def losses(output: Output, batch: Batch, *, supervise: bool = True, edge: float = 0.0) -> Losses:
    """Return means over the voxels of each object, then over the objects.

    In the total, voxels that touch another part count ``edge`` times more than the others.
    """
    error = (output.values - batch.target).square().mean(1)
    mse = _object_mean(error, batch.valued)
    weight = 1 + edge * touching(batch.scene.part).float() if edge else None
    squared = _object_mean(error, batch.valued, weight)
    crossed = F.cross_entropy(output.logits, batch.clause.clamp(max=CLAUSES), reduction="none")
    doubt = batch.doubt[:, None, None, None]
    crossed = crossed * (1 - doubt) + doubt * _indifferent(output.logits, batch)
    # A real slot of unknown matter may be of the kind that a clause speaks of.
    entropy = _object_mean(crossed, batch.bound, weight)
    right = _object_mean((output.logits.argmax(1) == batch.clause).float(), batch.bound)
    total = squared + BINDING_WEIGHT * entropy if supervise else squared
    return Losses(total, mse.detach(), right.detach())


def _indifferent(logits: Tensor, batch: Batch) -> Tensor:
    """Cross-entropy against all clauses that are there, and none, alike (batch, x, y, z)."""
    present = batch.scene.clause_mask
    present = torch.cat([present, torch.ones_like(present[:, :1])], 1)[..., None, None, None]
    shares = logits.log_softmax(1).masked_fill(~present, 0.0).sum(1)
    return -shares / present.sum(1)


def touching(part: Tensor) -> Tensor:
    """Voxels with a neighbour of another part among the six, (batch, x, y, z)."""
    out = torch.zeros_like(part, dtype=torch.bool)
    for axis in (1, 2, 3):
        size = part.shape[axis] - 1
        a, b = part.narrow(axis, 0, size), part.narrow(axis, 1, size)
        differ = (a != b) & (a >= 0) & (b >= 0)
        out.narrow(axis, 0, size).logical_or_(differ)
        out.narrow(axis, 1, size).logical_or_(differ)
    return out


def _object_mean(values: Tensor, where: Tensor, importance: Tensor | None = None) -> Tensor:
    """Mean over objects of the mean over voxels that count; objects without any are left out."""
    weight = where.float() if importance is None else where * importance
    count = weight.sum(dim=(1, 2, 3))
    mean = (torch.where(where, values, 0.0) * weight).sum(dim=(1, 2, 3)) / count.clamp(min=1)
    return mean.sum() / (count > 0).sum().clamp(min=1)
