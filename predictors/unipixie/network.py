"""The UniPixie network: one encoder, and a head for each of three solvers (supplement, B.1.3)."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from .config import ANCHORS, CLASSES, ELASTIC, MATTER, THETA, UniPixieConfig
from .decoder import FlowDecoder
from .encoder import GridEncoder
from .evidence import Projector
from .flow import integrate, velocity_towards
from .layers import Waves

HEADS = ("mpm", "lbs", "spring")
SKINNING = "skinning"  # of the second alone what has no flow


class Voxels(NamedTuple):
    """What is given: a cube of features, and the voxels whose matter is asked for.

    ``grid`` (batch, features, x, y, z), zero where nothing is; ``place`` (batch, n, 3) in [-1, 1]
    and ``own`` (batch, n, features) of the voxels.
    """

    grid: Tensor
    place: Tensor
    own: Tensor


class VoxelHead(nn.Module):
    """Flow of ``channels`` numbers of every voxel."""

    def __init__(self, config: UniPixieConfig, channels: int) -> None:
        super().__init__()
        self.config, self.channels = config, channels
        self.waves = Waves(config.frequencies, config.width)
        known = config.features if config.own else 0
        self.decoder = FlowDecoder(config, channels, known=known, blocks=config.decoder_blocks)

    def forward(
        self, x: Tensor, time: Tensor, alpha: Tensor, latents: Tensor, voxels: Voxels
    ) -> tuple[Tensor, Tensor]:
        """Return what the configuration says it predicts, and the last tokens."""
        known = voxels.own if self.config.own else voxels.own[..., :0]
        return self.decoder(x, time, alpha, latents, known, self.waves(voxels.place))

    def sample(
        self, noise: Tensor, alpha: Tensor, latents: Tensor, voxels: Voxels, *, steps: int = 0
    ) -> tuple[Tensor, Tensor]:
        """Where the flow from ``noise`` (batch, n, channels) ends, and the last tokens there."""
        tokens = noise

        def velocity(x: Tensor, time: Tensor) -> Tensor:
            nonlocal tokens
            out, tokens = self(x, time, alpha, latents, voxels)
            return out if self.config.predicts == "velocity" else velocity_towards(out, x, time)

        steps = steps or self.config.steps
        end = integrate(velocity, noise, steps=steps, method=self.config.method)
        return end, tokens


class SpringHead(nn.Module):
    """Flow of one vector: log stiffness of every anchor, and the softness eta of all."""

    def __init__(self, config: UniPixieConfig) -> None:
        super().__init__()
        self.decoder = FlowDecoder(config, ANCHORS + 1, known=0, blocks=config.spring_blocks)

    def forward(self, x: Tensor, time: Tensor, alpha: Tensor, latents: Tensor) -> Tensor:
        """Return the velocity (batch, 2049), or x1, at ``x`` (batch, 2049)."""
        nothing, nowhere = x[:, None, :0], latents.new_zeros(())
        out, _ = self.decoder(x[:, None], time, alpha, latents, nothing, nowhere)
        return out[:, 0]


class UniPixie(nn.Module):
    """Encoder and heads; ``heads`` are by default all three (the paper's joint network)."""

    def __init__(self, config: UniPixieConfig, heads: tuple[str, ...] = HEADS) -> None:
        super().__init__()
        self.config = config
        if config.given:
            self.project = Projector(config)
        self.encoder = GridEncoder(config)
        width = config.width
        if "mpm" in heads:
            self.matter = VoxelHead(config, MATTER)
            self.classes = nn.Linear(width, CLASSES)
        if {"lbs", SKINNING} & set(heads):
            self.body = nn.Sequential(
                *(layer for _ in range(3) for layer in (nn.Linear(width, width), nn.SiLU())),
                nn.Linear(width, THETA),
            )
        if "lbs" in heads:
            self.elastic = VoxelHead(config, ELASTIC)
        if "spring" in heads:
            self.springs = SpringHead(config)

    def encode(self, voxels: Voxels) -> Tensor:
        """Latents (batch, latents, width): the same for every alpha and every head."""
        return self.encoder(voxels.grid)

    def skinning(self, latents: Tensor) -> Tensor:
        """Numbers theta (batch, 650) of the skinning body; alpha does not move them."""
        return self.body(latents.mean(1))

    @torch.no_grad()
    def sample_matter(
        self, latents: Tensor, voxels: Voxels, alpha: Tensor, noise: Tensor, *, steps: int = 0
    ) -> tuple[Tensor, Tensor]:
        """Normalised log E, nu, log rho (batch, n, 3) and logits of the class (batch, n, 8)."""
        values, tokens = self.matter.sample(noise, alpha, latents, voxels, steps=steps)
        return values, self.classes(tokens)
