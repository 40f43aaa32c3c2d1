"""What training minimises: AutoPhyX eq. (2) for the values, cross-entropy for the binding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from ....predictors.film.unet import Output
from ..trainer import Losses
from .batch import CLAUSES, TrainingBatch

BINDING_WEIGHT = 0.3  # of the cross-entropy beside the squared error


@dataclass(frozen=True)
class FilmLoss:
    """Means over the voxels of each object, then over the objects.

    In the total, voxels that touch another part count ``edge`` times more than the others; the
    binding is supervised if ``supervise``. Reported are that loss, the mean normalised squared
    error, and the share of voxels that are bound right; clauses without an object are in the total
    alone.
    """

    supervise: bool = True
    edge: float = 0.0

    def __call__(self, output: FilmOutput, batch: TrainingBatch) -> Losses:
        """Compare what the network gives for a batch with its truth."""
        values, logits = output.objects
        error = (values - batch.target).square().mean(1)
        mse = _object_mean(error, batch.valued)
        weight = 1 + self.edge * _boundary(batch.scene.part).float() if self.edge else None
        loss = _object_mean(error, batch.valued, weight)
        if self.supervise:
            entropy = _object_mean(_cross_entropy(logits, batch), batch.bound, weight)
            loss = loss + BINDING_WEIGHT * entropy
        right = _object_mean((logits.argmax(1) == batch.clause).float(), batch.bound)
        total = loss
        if batch.alone is not None and output.alone is not None:
            total = loss + F.mse_loss(output.alone, batch.alone.value)
        return Losses(total, {"loss": loss.detach(), "mse": mse.detach(), "right": right})


class FilmOutput(NamedTuple):
    """What the network gives for a batch: of the objects, and values (n, 3) of clauses alone."""

    objects: Output
    alone: Tensor | None


def _cross_entropy(logits: Tensor, batch: TrainingBatch) -> Tensor:
    """Cross-entropy of the binding (batch, x, y, z).

    A real slot of unknown matter may be of the kind that a clause speaks of: as far as that is
    open (``doubt``), all clauses are wanted alike.
    """
    crossed = F.cross_entropy(logits, batch.clause.clamp(max=CLAUSES), reduction="none")
    doubt = batch.doubt[:, None, None, None]
    return crossed * (1 - doubt) + doubt * _indifferent(logits, batch)


def _indifferent(logits: Tensor, batch: TrainingBatch) -> Tensor:
    """Cross-entropy against all clauses that are there, and none, alike (batch, x, y, z)."""
    present = batch.scene.clause_mask
    present = torch.cat([present, torch.ones_like(present[:, :1])], 1)[..., None, None, None]
    shares = logits.log_softmax(1).masked_fill(~present, 0.0).sum(1)
    return -shares / present.sum(1)


def _boundary(part: Tensor) -> Tensor:
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
