"""The shared encoder: a cube of voxel features becomes a few latent tokens (supplement, B.1.1)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .config import UniPixieConfig
from .layers import Attention, Waves

REACH, STRIDE = 4, 2  # of both convolutions


class LatentBlock(nn.Module):
    """Latents look at the grid, then twice at each other, then each at itself."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(4))
        self.grid_norm = nn.LayerNorm(width)
        self.look = Attention(width, heads)
        self.first, self.second = Attention(width, heads), Attention(width, heads)
        self.mlp = nn.Sequential(
            nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width)
        )

    def forward(self, latents: Tensor, grid: Tensor) -> Tensor:
        """Return the latents (batch, latents, width) after a look at ``grid`` (batch, n, width)."""
        latents = latents + self.look(self.norms[0](latents), self.grid_norm(grid))
        for norm, attention in zip(list(self.norms)[1:3], (self.first, self.second), strict=True):
            normed = norm(latents)
            latents = latents + attention(normed, normed)
        return latents + self.mlp(self.norms[3](latents))


class GridEncoder(nn.Module):
    """Two strided convolutions, then latents that read the coarse grid."""

    def __init__(self, config: UniPixieConfig) -> None:
        super().__init__()
        width = config.width
        self.stem = nn.ModuleList(
            nn.Conv3d(a, b, REACH, STRIDE, padding=1)
            for a, b in ((config.features, config.stem), (config.stem, width))
        )
        self.waves = Waves(config.frequencies, width)
        self.queries = nn.Parameter(0.02 * torch.randn(config.latents, width))
        self.blocks = nn.ModuleList(
            LatentBlock(width, config.heads) for _ in range(config.encoder_blocks)
        )

    def forward(self, features: Tensor) -> Tensor:
        """Latents (batch, latents, width) of ``features`` (batch, features, x, y, z)."""
        first, second = self.stem
        grid = second(F.silu(first(features)))
        places = cell_centres(grid.shape[-1], grid.device)
        tokens = grid.flatten(2).transpose(1, 2) + self.waves(places)
        latents = self.queries.expand(len(tokens), -1, -1)
        for block in self.blocks:
            latents = block(latents, tokens)
        return latents


def cell_centres(cells: int, device: torch.device) -> Tensor:
    """Places (cells^3, 3) in [-1, 1] of a cube's cells, x the slowest."""
    line = (torch.arange(cells, device=device) + 0.5) / cells * 2 - 1
    return torch.stack(torch.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
