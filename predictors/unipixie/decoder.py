"""The flow matching transformer: noisy tokens, steered by time, alpha and the object's latents.

UniPixie supplement, B.1.2. Each token sees the latents and no other token, so a body may be decoded
in portions.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from .config import UniPixieConfig
from .layers import SteeredBlock

TIMES = 16  # frequencies of the time, from 2^0 pi to 2^8 pi
TIME_OCTAVES = 8


class TimeWaves(nn.Module):
    """Sines and cosines (batch, 2 * TIMES) of times (batch,) in [0, 1]."""

    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        powers = torch.linspace(0, TIME_OCTAVES, TIMES, device="cpu")
        self.register_buffer("scale", 2**powers * math.pi, persistent=False)

    def forward(self, time: Tensor) -> Tensor:
        """Return (batch, 2 * TIMES)."""
        phase = time[:, None] * self.scale
        return torch.cat([phase.sin(), phase.cos()], -1)


class Condition(nn.Module):
    """One vector of the flow's time, of alpha and of the mean latent."""

    def __init__(self, width: int, thin: int) -> None:
        super().__init__()
        self.waves = TimeWaves()
        self.time = nn.Sequential(nn.Linear(2 * TIMES, thin), nn.SiLU(), nn.Linear(thin, width))
        self.alpha = nn.Sequential(nn.Linear(1, thin), nn.SiLU(), nn.Linear(thin, width))
        self.fuse = nn.Sequential(nn.Linear(3 * width, thin), nn.SiLU(), nn.Linear(thin, width))

    def forward(self, time: Tensor, alpha: Tensor, latents: Tensor) -> Tensor:
        """Return (batch, width) of ``time`` and ``alpha`` (batch,)."""
        known = [self.time(self.waves(time)), self.alpha(alpha[:, None]), latents.mean(1)]
        return self.fuse(torch.cat(known, -1))


class FlowDecoder(nn.Module):
    """Tokens of ``channels`` numbers in and out; ``known`` more of each are given and constant.

    Its output begins at zero.
    """

    def __init__(self, config: UniPixieConfig, channels: int, *, known: int, blocks: int) -> None:
        super().__init__()
        width = config.width
        self.condition = Condition(width, config.fusion)
        self.enter = nn.Linear(channels + known, width)
        self.blocks = nn.ModuleList(SteeredBlock(width, config.heads) for _ in range(blocks))
        self.leave = nn.Linear(width, channels)
        nn.init.zeros_(self.leave.weight)
        nn.init.zeros_(self.leave.bias)

    def forward(
        self, x: Tensor, time: Tensor, alpha: Tensor, latents: Tensor, known: Tensor, place: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return the output (batch, n, channels) and the last tokens (batch, n, width).

        ``known`` (batch, n, known) and ``place`` (batch, n, width), where each token is as waves.
        """
        condition = self.condition(time, alpha, latents)
        tokens = self.enter(torch.cat([x, known], -1)) + place
        for block in self.blocks:
            tokens = block(tokens, latents, condition)
        return self.leave(tokens), tokens
