"""Building blocks of the FiLM network: masked norm, modulated residual block, masked pooling.

Tensors are (batch, channels, x, y, z); a mask is (batch, 1, x, y, z) with 1 on occupied voxels.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

GROUPS = 8
# Floors under a variance or a count: an empty or constant object must not divide by zero.
EPSILON = 1e-5
ONE_VOXEL = 1.0


# Of embeddings in training, against their unit variance: at most, of a sentence and of a subject.
SENTENCE_NOISE, SUBJECT_NOISE = 0.7, 0.3
UNHEARD = 0.1  # of the sentences, of which only hints and subject are heard


class Listening(nn.Module):
    """Embeddings of clauses at unit variance; in training blurred, but for the lexicon's hints.

    A clause said a little differently means the same.
    """

    def __init__(self, sentence_dim: int) -> None:
        super().__init__()
        self.sentence_dim = sentence_dim

    def forward(self, embedding: Tensor) -> Tensor:
        """Return embeddings (..., D): sentence, hints and subject, or the first of them."""
        dim = self.sentence_dim
        scaled = embedding * dim**0.5
        if not self.training:
            return scaled
        much = torch.zeros_like(scaled)
        much[..., :dim] = SENTENCE_NOISE
        heard = torch.ones_like(scaled)
        if scaled.shape[-1] > 2 * dim:
            much[..., -dim:] = SUBJECT_NOISE
            heard[..., :dim] = (torch.rand_like(scaled[..., :1]) > UNHEARD).to(scaled.dtype)
        blur = much * torch.rand_like(scaled[..., :1]) * torch.randn_like(scaled)
        return scaled * heard + blur


class Modulation(NamedTuple):
    """What FiLM gets: weight of every slot at every voxel of the block's level, and the slots.

    ``weights`` (batch, x, y, z, slots) sum to one; ``slots`` (batch, slots, width) are hidden
    vectors of clauses, from which each block reads its own scale and shift.
    """

    weights: Tensor
    slots: Tensor


def mix(weights: Tensor, values: Tensor) -> Tensor:
    """Sum slot values (batch, slots, c) with voxel weights: (batch, c, x, y, z), channels last."""
    shape = weights.shape
    flat = torch.bmm(weights.reshape(shape[0], -1, shape[-1]), values.to(weights.dtype))
    return flat.reshape(*shape[:-1], -1).permute(0, 4, 1, 2, 3)


def pool(x: Tensor, mask: Tensor, factor: int = 2) -> Tensor:
    """Mean over the occupied voxels of each cell of ``factor``^3 voxels; 0 where there is none."""
    share = F.avg_pool3d(mask, factor)
    return F.avg_pool3d(x * mask, factor) / share.clamp(min=EPSILON)


def masked_mean(x: Tensor, mask: Tensor) -> Tensor:
    """Mean over the occupied voxels, (batch, channels), in float32."""
    total = (x * mask).sum(dim=(2, 3, 4), dtype=torch.float32)
    return total / mask.sum(dim=(2, 3, 4), dtype=torch.float32).clamp(min=ONE_VOXEL)


class MaskedGroupNorm(nn.Module):
    """Group norm whose mean and variance are those of the occupied voxels: any grid will do."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.groups = GROUPS
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """Normalise; empty voxels come out as 0."""
        b, c = x.shape[:2]
        per_group = c // self.groups
        mean_c, square_c = masked_mean(x, mask), masked_mean(x * x, mask)
        mean = mean_c.reshape(b, self.groups, per_group).mean(2)
        square = square_c.reshape(b, self.groups, per_group).mean(2)
        rstd = ((square - mean * mean).clamp(min=0) + EPSILON).rsqrt()
        scale = rstd.repeat_interleave(per_group, 1) * self.weight
        shift = self.bias - mean.repeat_interleave(per_group, 1) * scale
        view = (b, c, 1, 1, 1)
        return (x * scale.view(view).to(x.dtype) + shift.view(view).to(x.dtype)) * mask.to(x.dtype)


class FilmBlock(nn.Module):
    """Residual block; FiLM (AutoPhyX eq. 1) after the second norm, the identity at the start."""

    def __init__(self, channels: int, width: int, *, modulated: bool = True) -> None:
        super().__init__()
        self.norm1, self.norm2 = MaskedGroupNorm(channels), MaskedGroupNorm(channels)
        self.conv1 = nn.Conv3d(channels, channels, 3, padding=1)
        self.conv2 = nn.Conv3d(channels, channels, 3, padding=1)
        self.film = nn.Linear(width, 2 * channels) if modulated else None
        if self.film is not None:
            nn.init.zeros_(self.film.weight)
            nn.init.zeros_(self.film.bias)

    def forward(self, x: Tensor, mask: Tensor, modulation: Modulation | None = None) -> Tensor:
        """Return x plus its modulated residual, 0 on empty voxels."""
        h = self.conv1(F.silu(self.norm1(x, mask)))
        h = self.norm2(h, mask)
        if modulation is not None and self.film is not None:
            table = self.film(modulation.slots)
            delta, beta = mix(modulation.weights, table).chunk(2, dim=1)
            h = h * (1 + delta) + beta
        return (x + self.conv2(F.silu(h))) * mask.to(x.dtype)
