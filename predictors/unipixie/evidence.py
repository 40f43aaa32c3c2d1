"""What is known of a voxel, as numbers: a feature and a colour, each with whether it is known."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .config import UniPixieConfig

FEATURE = 384  # numbers of a feature, in the space of the sentence encoder
GIVEN = FEATURE + 1 + 3 + 1
LOUDNESS = 20.0  # a unit vector's numbers are about 1/20


def known_of(feature: Tensor, seen: Tensor, colour: Tensor, shown: Tensor) -> Tensor:
    """Numbers (..., GIVEN) of unit features (..., 384) and colours (..., 3) in [0, 1].

    ``seen`` and ``shown`` (...,) say which of them are known; others are zero.
    """
    seen, shown = seen[..., None].to(feature.dtype), shown[..., None].to(feature.dtype)
    columns = (LOUDNESS * feature * seen, seen, (2 * colour - 1) * shown, shown)
    return torch.cat(columns, -1)


class Projector(nn.Module):
    """What is learned of a voxel's numbers: unit variance, and a last channel that is one."""

    def __init__(self, config: UniPixieConfig) -> None:
        super().__init__()
        self.to_features = nn.Linear(config.given, config.features - 1)

    def forward(self, known: Tensor) -> Tensor:
        """Return (..., features) of what is known (..., given)."""
        found = self.to_features(known)
        found = F.layer_norm(found, found.shape[-1:])
        return torch.cat([found, torch.ones_like(found[..., :1])], -1)
