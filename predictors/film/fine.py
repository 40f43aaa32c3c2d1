"""The fine stage: binding and values at twice the resolution of the U-Net."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .conditioning import composed
from .config import INPUTS, NO_CLAUSE, NetworkConfig, Output, VoxelScene
from .grounding import slot_weights
from .layers import FilmBlock, Listening, Modulation, mix


class CoarseOutput(NamedTuple):
    """What the U-Net finds: finest features of both decoders, values before tanh, logits."""

    queries: Tensor
    features: Tensor
    residual: Tensor
    logits: Tensor
    weights: Tensor


class FineStage(nn.Module):
    """Refines binding and values at twice the resolution; at the start it changes nothing."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        coarse, key = config.widths[0], config.key_width
        width = config.fine_width or coarse
        self.stem = nn.Conv3d(INPUTS, width, 3, padding=1)
        self.up_query, self.up = nn.Conv3d(coarse, width, 1), nn.Conv3d(coarse, width, 1)
        self.bind = FilmBlock(width, config.slot_width, modulated=False)
        self.decode = FilmBlock(width, config.slot_width)
        self.query = nn.Conv3d(width, key, 1)
        self.listen = Listening(config.sentence_dim)
        self.keys = nn.Linear(config.text_dim, key)
        self.null = nn.Parameter(torch.zeros(1, 1, key))
        self.head = nn.Conv3d(width, 3, 1)
        for layer in (self.keys, self.head):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]

    def forward(
        self, scene: VoxelScene, coarse: CoarseOutput, slots: Tensor, says: Tensor
    ) -> Output:
        """Return values and binding on the fine grid."""
        mask = scene.inputs[:, :1]
        own = self.stem(scene.inputs) * mask.to(coarse.queries.dtype)
        x = self.bind(_double(self.up_query(coarse.queries)) + own, mask)
        keys = self.keys(self.listen(scene.clauses))
        keys = torch.cat([keys, self.null.expand(len(keys), -1, -1).to(keys.dtype)], dim=1)
        change = mix(self.query(x).permute(0, 2, 3, 4, 1), keys.transpose(1, 2)).float()
        present = torch.cat([scene.clause_mask, torch.ones_like(scene.clause_mask[:, :1])], 1)
        closed = (~present.bool())[..., None, None, None]
        logits = (_double(coarse.logits) + change).masked_fill(closed, NO_CLAUSE)
        weights = slot_weights(scene, logits).permute(0, 2, 3, 4, 1)
        x = _double(self.up(coarse.features)) + own
        x = self.decode(x, mask, Modulation(weights, slots))
        return Output(composed(_double(coarse.residual) + self.head(x), weights, says), logits)


def _double(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2, mode="nearest")
