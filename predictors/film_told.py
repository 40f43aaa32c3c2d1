"""What clauses say by themselves: a value the network reads, and the exact one of the lexicon."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from .film_parts import mix
from .film_scene import NetworkConfig
from .lexicon import CHANNELS, LOUDNESS

_NAMES, _VALUE = CHANNELS.index("material"), slice(CHANNELS.index("E"), CHANNELS.index("rho") + 1)
_TRUSTED = 3.0  # logit at the start: a material that the lexicon names is nearly always meant


class Sayings(nn.Module):
    """For every slot: a value before tanh (3), how far the lexicon's is meant (1), that value (3).

    The lexicon's value is weighed with how far it is meant, so that slots can be mixed.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.direct = nn.Linear(config.slot_width, 3)
        self.meant = nn.Linear(config.slot_width, 1) if config.told else None
        if self.meant is not None:
            nn.init.zeros_(self.meant.weight)
            nn.init.constant_(self.meant.bias, _TRUSTED)

    def forward(self, slots: Tensor, embedding: Tensor) -> Tensor:
        """Sayings (batch, slots, 3 or 7) of hidden vectors and what they were made from."""
        direct = self.direct(slots)
        if self.meant is None:
            return direct
        start = self.config.sentence_dim
        hints = embedding[..., start : start + len(CHANNELS)] * (start**0.5 / LOUDNESS)
        names = hints[..., _NAMES, None].clamp(0, 1)
        share = torch.sigmoid(self.meant(slots)) * names.to(direct.dtype)
        return torch.cat([direct, share, share * hints[..., _VALUE].to(direct.dtype)], dim=-1)


def composed(residual: Tensor, weights: Tensor, says: Tensor) -> Tensor:
    """Values (batch, 3, x, y, z): what the network finds, and what the lexicon was told.

    ``residual`` before tanh; ``weights`` (batch, x, y, z, slots) of the ``says`` of all slots.
    """
    mixed = mix(weights, says)
    found = torch.tanh((residual + mixed[:, :3]).float())
    if mixed.shape[1] == 3:
        return found
    return found * (1 - mixed[:, 3:4].float()) + mixed[:, 4:].float()
