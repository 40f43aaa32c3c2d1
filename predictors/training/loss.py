"""What training minimises: AutoPhyX eq. (2) for the values, cross-entropy for the binding."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from ..film_scene import Output
from .batch import CLAUSES, Batch

BINDING_WEIGHT = 0.3  # of the cross-entropy beside the squared error


class Losses(NamedTuple):
    """The loss and what to watch: mean normalised squared error, share of voxels bound right."""

    total: Tensor
    mse: Tensor
    right: Tensor


def losses(output: Output, batch: Batch, *, supervise: bool = True) -> Losses:
    """Return means over the voxels of each object, then over the objects."""
    error = (output.values - batch.target).square().mean(1)
    mse = _object_mean(error, batch.valued)
    crossed = F.cross_entropy(output.logits, batch.clause.clamp(max=CLAUSES), reduction="none")
    # A real slot of unknown matter may be of the kind that a clause speaks of.
    entropy = _object_mean(crossed, batch.bound)
    right = _object_mean((output.logits.argmax(1) == batch.clause).float(), batch.bound)
    total = mse + BINDING_WEIGHT * entropy if supervise else mse
    return Losses(total, mse.detach(), right.detach())


def _object_mean(values: Tensor, where: Tensor) -> Tensor:
    """Mean over objects of the mean over voxels that count; objects without any are left out."""
    weight = where.float()
    count = weight.sum(dim=(1, 2, 3))
    mean = torch.where(where, values, 0.0).sum(dim=(1, 2, 3)) / count.clamp(min=1)
    return mean.sum() / (count > 0).sum().clamp(min=1)
