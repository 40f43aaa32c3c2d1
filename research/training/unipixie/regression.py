"""What the flow is compared with: a U-Net that regresses the field at once, steered by alpha.

It reads the same cube of learned features; its layers and alpha's scale and shift of every block
are those of the comparison in UniPixie's supplement, C.2, without its diffusion.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ....predictors.unipixie.network import CLASSES, MATTER, Projector, UniPixieConfig
from .batch import MatterBatch, voxels_of
from .loss import MatterOutput

WIDTHS = (32, 64, 128, 192)
STEER = 128  # numbers that alpha becomes
GROUPS = 8


class SteeredConvolutions(nn.Module):
    """Two convolutions with a residual path, scaled and shifted between them."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first, self.second = (nn.Conv3d(width, width, 3, padding=1) for _ in range(2))
        self.norms = nn.ModuleList(nn.GroupNorm(GROUPS, width) for _ in range(2))
        self.steer = nn.Linear(STEER, 2 * width)
        nn.init.zeros_(self.steer.weight)
        nn.init.zeros_(self.steer.bias)

    def forward(self, x: Tensor, steer: Tensor) -> Tensor:
        """Return the shape given."""
        scale, shift = self.steer(steer)[..., None, None, None].chunk(2, 1)
        inner = self.norms[1](self.first(F.silu(self.norms[0](x))))
        return x + self.second(F.silu(inner * (1 + scale) + shift))


class RegressionUNet(nn.Module):
    """Values and logits of every voxel of a cube of features, for alpha (batch,)."""

    def __init__(self, config: UniPixieConfig, widths: tuple[int, ...] = WIDTHS) -> None:
        super().__init__()
        self.config = config
        self.project = Projector(config)
        self.enter = nn.Conv3d(config.features, widths[0], 3, padding=1)
        self.alpha = nn.Sequential(
            nn.Linear(1, STEER), nn.SiLU(), nn.Linear(STEER, STEER), nn.SiLU()
        )
        self.down = nn.ModuleList(nn.Conv3d(a, b, 2, 2) for a, b in pairwise(widths))
        self.up = nn.ModuleList(nn.Conv3d(b, a, 1) for a, b in pairwise(widths))
        self.falling = nn.ModuleList(SteeredConvolutions(width) for width in widths)
        self.rising = nn.ModuleList(SteeredConvolutions(width) for width in widths[:-1])
        self.leave = nn.Conv3d(widths[0], MATTER + CLASSES, 1)

    def forward(self, grid: Tensor, alpha: Tensor) -> Tensor:
        """Return (batch, 3 + 8, x, y, z) of features (batch, features, x, y, z)."""
        return self.unet(grid, self.alpha(alpha[:, None]))

    def unet(self, given: Tensor, steer: Tensor) -> Tensor:
        """Return (batch, 3 + 8, x, y, z) of what enters, scaled and shifted as ``steer`` says."""
        x, passed = self.enter(given), []
        for level, block in enumerate(self.falling):
            x = block(self.down[level - 1](x) if level else x, steer)
            passed.append(x)
        for level in reversed(range(len(self.rising))):
            above = F.interpolate(self.up[level](x), scale_factor=2)
            x = self.rising[level](above + passed[level], steer)
        return self.leave(x)


def regress(network: RegressionUNet, batch: MatterBatch) -> MatterOutput:
    """Return what the U-Net makes of a batch: nothing in it depends on the flow's time."""
    voxels = voxels_of(network.project, batch)
    found = network(voxels.grid, batch.alpha).flatten(2).movedim(1, -1)
    index = batch.voxel[..., None].expand(-1, -1, found.shape[-1])
    said, logits = found.gather(1, index).split([MATTER, CLASSES], -1)
    return MatterOutput(said, logits, torch.zeros_like(said[0, 0, 0]))
