"""Simulated evidence that a clause speaks of a voxel, from useless to nearly perfect."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from ...datasets.shapes import MAX_PARTS
from .batch import WHOLE, by_part


def simulate_evidence(
    part: Tensor,
    clause: Tensor,
    present: Tensor,
    strength: Tensor,
    generator: torch.Generator,
    *,
    noise: tuple[float, float, float],
) -> Tensor:
    """Evidence of one source (n, 7, x, y, z): truth times ``strength`` plus noise, standardised.

    The noise has three shares: one number for each part and clause (a misjudged part), one that
    varies smoothly over the object, one for each voxel. A whole-object clause gets noise alone.
    """
    n, cells = len(part), part.shape[-1]

    def normal(*shape: int) -> Tensor:
        return torch.randn(shape, generator=generator, device=part.device)

    k = present.shape[1]
    order = torch.arange(k, device=part.device)
    truth = (clause[:, None] == order[None, :, None, None, None]) & (order != WHOLE)[
        None, :, None, None, None
    ]
    coarse = max(2, cells // 8)
    smooth = F.interpolate(normal(n, k, coarse, coarse, coarse), size=cells, mode="trilinear")
    misjudged = by_part(normal(n, MAX_PARTS, k), part, 0.0).movedim(-1, 1)
    field = truth * strength[:, None, None, None, None]
    field = field + noise[0] * misjudged + noise[1] * smooth + noise[2] * normal(*field.shape)
    return standardise(field, (part >= 0)[:, None] & present[:, :, None, None, None])


def standardise(evidence: Tensor, where: Tensor) -> Tensor:
    """Zero mean and unit deviation over the voxels and clauses that count; 0 elsewhere."""
    count = where.sum(dim=(1, 2, 3, 4), keepdim=True).clamp(min=1)
    centred = (evidence - (evidence * where).sum((1, 2, 3, 4), keepdim=True) / count) * where
    variance = (centred * centred).sum((1, 2, 3, 4), keepdim=True) / count
    scaled = centred / (variance + 1e-4).sqrt()  # 1e-4: evidence that is constant stays silent
    return scaled.bfloat16() if scaled.is_cuda else scaled
