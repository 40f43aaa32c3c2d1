"""The network of ``predictors.regions.network`` in torch, to be trained; its tensors by name."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from ....predictors.regions.network import EPSILON, HEADS, MEASURES, ORDER, PAIRS, WORDS
from ....predictors.text.parts import KINDS

WIDTH, LAYERS = 96, 3
_FAR = -1e4  # of a logit that is to be none


class RegionBatch(NamedTuple):
    """``predictors.regions.network.Inputs`` of B things, padded; the null clause stands first.

    ``there`` (B, R), ``spoken`` (B, K) say which regions and clauses are none of padding;
    ``wanted`` (B, R, K) are the cells of each region that each clause speaks of.
    """

    region: Tensor
    pairs: Tensor
    part: Tensor
    material: Tensor
    matter: Tensor
    order: Tensor
    evidence: Tensor
    told: Tensor
    there: Tensor
    spoken: Tensor
    wanted: Tensor


class RegionTransformer(nn.Module):
    """A set transformer over regions and clauses; gives logits (B, R, K)."""

    def __init__(
        self, categories: int, *, width: int = WIDTH, layers: int = LAYERS, drop: float = 0.15
    ) -> None:
        super().__init__()

        def head(inputs: int, outputs: int) -> nn.Sequential:
            inner = nn.Sequential(nn.GELU(), nn.Dropout(drop))
            return nn.Sequential(nn.Linear(inputs, width), inner, nn.Linear(width, outputs))

        said = len(KINDS) + 1 + categories + ORDER
        self.region = head(len(MEASURES) + 1, width)
        self.part, self.material = nn.Linear(WORDS, width), nn.Linear(WORDS, width)
        self.said, self.touch = nn.Linear(said, width), nn.Linear(len(PAIRS), HEADS)
        self.told = nn.Linear(width, width)
        self.kind = nn.Parameter(torch.randn(2, width) * 0.02)
        self.layers = nn.ModuleList(
            nn.ModuleDict(
                {
                    "before": nn.LayerNorm(width, EPSILON),
                    "attend": nn.Linear(width, 3 * width),
                    "out": nn.Linear(width, width),
                    "between": nn.LayerNorm(width, EPSILON),
                    "inner": nn.Linear(width, 3 * width),
                    "outer": nn.Linear(3 * width, width),
                }
            )
            for _ in range(layers)
        )
        self.regions_out = nn.LayerNorm(width, EPSILON)
        self.clauses_out = nn.LayerNorm(width, EPSILON)
        self.pair = head(3 * width + 3, 1)
        self.looks = nn.Linear(3, 1, bias=False)
        self.looks.weight.data = torch.tensor([[0.3, 0.3, 2.0]])  # what a user told weighs more
        self.drop, self.drop_words = nn.Dropout(drop), nn.Dropout(0.1)

    def forward(self, batch: RegionBatch) -> Tensor:
        """Logits of the clauses in every region."""
        words = (self.part, batch.part), (self.material, batch.material)
        c = self.said(torch.cat([batch.matter, batch.order], dim=-1))
        for layer, vectors in words:
            c = c + layer(self.drop_words(vectors))
        of = batch.told.clamp(min=0)[..., None].expand(-1, -1, c.shape[2])
        r = self.region(batch.region)
        r = r + self.told(c.gather(1, of)) * (batch.told >= 0)[..., None]
        x = torch.cat([r + self.kind[0], c + self.kind[1]], dim=1)
        present = torch.cat([batch.there, batch.spoken], dim=1)
        count, n, regions = *x.shape[:2], r.shape[1]
        bias = x.new_zeros(count, HEADS, n, n)
        bias[:, :, :regions, :regions] = self.touch(batch.pairs).movedim(-1, 1)
        bias = bias.masked_fill(~present[:, None, None], _FAR)
        for layer in self.layers:
            assert isinstance(layer, nn.ModuleDict)
            split = layer["attend"](layer["before"](x)).reshape(count, n, 3, HEADS, -1)
            q, k, v = split.permute(2, 0, 3, 1, 4)
            mixed = functional.scaled_dot_product_attention(q, k, v, attn_mask=bias)
            x = x + self.drop(layer["out"](mixed.transpose(1, 2).reshape(count, n, -1)))
            inner = functional.gelu(layer["inner"](layer["between"](x)))
            x = x + self.drop(layer["outer"](self.drop(inner)))
        r = self.regions_out(x[:, :regions])[:, :, None]
        c = self.clauses_out(x[:, regions:])[:, None]
        wide = (-1, -1, c.shape[2], -1), (-1, regions, -1, -1)
        pairs = [r.expand(*wide[0]), c.expand(*wide[1]), r * c, batch.evidence]
        logits = self.pair(torch.cat(pairs, dim=-1)) + self.looks(batch.evidence)
        return logits[..., 0].masked_fill(~batch.spoken[:, None], _FAR)
