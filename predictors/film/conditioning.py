"""What clauses say by themselves: a value the network reads, and the exact one of the lexicon."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ..hearing.lexicon import CHANNELS, LOUDNESS
from .config import NetworkConfig
from .layers import mix

_NAMES, _VALUE = CHANNELS.index("material"), slice(CHANNELS.index("E"), CHANNELS.index("rho") + 1)


class Sayings(nn.Module):
    """For every slot: a value before tanh (3), whether it names a material (1), its value (3).

    A learned doubt of the lexicon was tried: real objects, whose binding is left open, taught it
    to doubt what was said plainly.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.direct = nn.Linear(config.slot_width, 3)

    def forward(self, slots: Tensor, embedding: Tensor) -> Tensor:
        """Sayings (batch, slots, 3 or 7) of hidden vectors and what they were made from."""
        direct = self.direct(slots)
        if not self.config.told:
            return direct
        start = self.config.sentence_dim
        hints = embedding[..., start : start + len(CHANNELS)] * (start**0.5 / LOUDNESS)
        names = hints[..., _NAMES, None].clamp(0, 1)
        return torch.cat([direct, names, names * hints[..., _VALUE]], dim=-1)


def composed(residual: Tensor, weights: Tensor, says: Tensor) -> Tensor:
    """Values (batch, 3, x, y, z): what the network finds, and what the lexicon was told.

    ``residual`` before tanh; ``weights`` (batch, x, y, z, slots) of the ``says`` of all slots.
    """
    mixed = mix(weights, says)
    found = torch.tanh((residual + mixed[:, :3]).float())
    if mixed.shape[1] == 3:
        return found
    return found * (1 - mixed[:, 3:4].float()) + mixed[:, 4:].float()
