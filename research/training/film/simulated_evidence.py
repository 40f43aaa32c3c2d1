"""Simulated evidence that a clause speaks of a voxel, and features, from useless to perfect."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from ...datasets.shapes import MAX_PARTS
from .batch import WHOLE, by_part

FUZZ = 0.5  # length of what differs between the unit features of two voxels of a part


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


def simulate_features(words: Tensor, generator: torch.Generator) -> Tensor:
    """Unit features (n, P, F) of parts that are called ``words`` (n, P, F): exact to lost in noise.

    One quality for an object; what is no word is noise, or words of another part of the batch.
    """
    n, p, dim = words.shape

    def draw(*shape: int, normal: bool = False) -> Tensor:
        make = torch.randn if normal else torch.rand
        return make(shape, generator=generator, device=words.device)

    other = words.reshape(n * p, dim)[(draw(n, p) * n * p).long()]
    mixed = draw(n, p, 1)
    noise = draw(n, p, dim, normal=True)
    return blurred(words, draw(n, 1, 1), mixed * other, (1 - mixed) * noise)


def blurred(words: Tensor, quality: Tensor, other: Tensor, noise: Tensor) -> Tensor:
    """Unit features (n, P, F): ``words`` as far as ``quality`` goes, else what is not them.

    That is a share of ``other`` words and one of ``noise`` of unit deviation.
    """
    wrong = other + noise / words.shape[-1] ** 0.5
    return F.normalize(quality * words + (1 - quality) * wrong, dim=-1, eps=1e-6)


def spread_features(features: Tensor, part: Tensor, generator: torch.Generator) -> Tensor:
    """Features of parts (n, P, F) on their voxels (n, F, x, y, z), no two voxels quite alike."""
    kind = torch.bfloat16 if features.is_cuda else features.dtype
    cube = by_part(features.to(kind), part, 0.0)
    fuzz = torch.randn(cube.shape, generator=generator, device=cube.device, dtype=kind)
    cube = F.normalize(cube + fuzz * (FUZZ / cube.shape[-1] ** 0.5), dim=-1)
    seen = by_part(features.abs().amax(-1) > 0, part, False)
    return torch.where(seen[..., None], cube, torch.zeros_like(cube)).movedim(-1, 1)
