"""The UniPixie network and its sizes: an encoder, and a head for MPM (supplement, B.1.3)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

CLASSES = 8  # logits; seven are those of ``fem.mpm.materials``
MATTER = 3  # log E, nu, log rho


@dataclass(frozen=True)
class UniPixieConfig:
    """Sizes of encoder and decoders (UniPixie supplement, Table S2 and S4).

    ``features`` numbers describe a voxel of a cube of ``cells``: those that are given, or, where
    ``given`` is not zero, what is learned of so many given ones. ``stem`` channels lie between the
    two convolutions, ``fusion`` numbers in the middle of what fuses time, alpha and mean latent;
    ``latents`` tokens of ``width`` numbers describe the object. With ``own`` the decoder sees each
    voxel's features beside its place. ``predicts`` is what the decoder's output means: the velocity
    of the flow (the paper) or where it ends, x1.
    """

    features: int = 768
    cells: int = 64
    width: int = 512
    stem: int = 512
    heads: int = 8
    latents: int = 64
    encoder_blocks: int = 6
    decoder_blocks: int = 6
    spring_blocks: int = 4
    frequencies: int = 16
    fusion: int = 64
    given: int = 0
    own: bool = False
    predicts: Literal["velocity", "x1"] = "velocity"
    steps: int = 15
    method: Literal["euler", "heun"] = "heun"


SHIPPED = UniPixieConfig(
    features=32, given=389, cells=32, width=128, stem=64, heads=4, encoder_blocks=6,
    decoder_blocks=3, spring_blocks=2, fusion=16, own=True, predicts="x1", steps=2, method="euler",
)  # fmt: skip


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


class UniPixie(nn.Module):
    """The encoder, and the head of the material point method."""

    def __init__(self, config: UniPixieConfig) -> None:
        super().__init__()
        self.config = config
        if config.given:
            self.project = Projector(config)
        self.encoder = GridEncoder(config)
        self.matter = VoxelHead(config, MATTER)
        self.classes = nn.Linear(config.width, CLASSES)

    def encode(self, voxels: Voxels) -> Tensor:
        """Latents (batch, latents, width): the same for every alpha and every head."""
        return self.encoder(voxels.grid)

    @torch.no_grad()
    def sample_matter(
        self, latents: Tensor, voxels: Voxels, alpha: Tensor, noise: Tensor, *, steps: int = 0
    ) -> tuple[Tensor, Tensor]:
        """Normalised log E, nu, log rho (batch, n, 3) and logits of the class (batch, n, 8)."""
        values, tokens = self.matter.sample(noise, alpha, latents, voxels, steps=steps)
        return values, self.classes(tokens)


# The shared encoder: a cube of voxel features becomes a few latent tokens (supplement, B.1.1).

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
        # Places (cells^3, 3) in [-1, 1] of the coarse cells, x the slowest
        line = (torch.arange(grid.shape[-1], device=grid.device) + 0.5) / grid.shape[-1] * 2 - 1
        places = torch.stack(torch.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
        tokens = grid.flatten(2).transpose(1, 2) + self.waves(places)
        latents = self.queries.expand(len(tokens), -1, -1)
        for block in self.blocks:
            latents = block(latents, tokens)
        return latents


# The flow matching transformer: noisy tokens, steered by time, alpha and the object's latents.
#
# UniPixie supplement, B.1.2. Each token sees the latents and no other token, so a body may be
# decoded in portions.

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


# Building blocks of the UniPixie network: places as waves, attention, blocks steered by a vector.
#
# Tokens are (batch, tokens, width).

# Highest frequency of a place in [-1, 1]: 2^6 pi resolves the cells of a cube of 64.
OCTAVES = 6


class Waves(nn.Module):
    """Sines and cosines of places (..., 3) in [-1, 1], ``frequencies`` an axis, to ``width``."""

    scale: Tensor

    def __init__(self, frequencies: int, width: int) -> None:
        super().__init__()
        powers = torch.linspace(0, OCTAVES, frequencies, device="cpu")
        self.register_buffer("scale", 2**powers * math.pi, persistent=False)
        self.to_width = nn.Linear(6 * frequencies, width)

    def forward(self, place: Tensor) -> Tensor:
        """Return (..., width)."""
        phase = place[..., None] * self.scale
        return self.to_width(torch.cat([phase.sin(), phase.cos()], -1).flatten(-2))


class Attention(nn.Module):
    """Attention of queries to tokens, both of ``width``; queries and keys are normed per head."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.query = nn.Linear(width, width)
        self.key_value = nn.Linear(width, 2 * width)
        self.out = nn.Linear(width, width)
        each = width // heads
        # Without weights of their own: in half precision an affine norm leaves it.
        self.query_norm = nn.RMSNorm(each, elementwise_affine=False)
        self.key_norm = nn.RMSNorm(each, elementwise_affine=False)

    def forward(self, queries: Tensor, tokens: Tensor) -> Tensor:
        """Return (batch, queries, width)."""
        query, key, value = self.query(queries), *self.key_value(tokens).chunk(2, -1)
        query, key, value = (
            t.unflatten(-1, (self.heads, -1)).transpose(1, 2) for t in (query, key, value)
        )
        mixed = F.scaled_dot_product_attention(self.query_norm(query), self.key_norm(key), value)
        return self.out(mixed.transpose(1, 2).flatten(-2))


class GatedMLP(nn.Module):
    """SwiGLU with a hidden width of four."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.inner = nn.Linear(width, 8 * width)
        self.outer = nn.Linear(4 * width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Return the shape given."""
        gate, value = self.inner(x).chunk(2, -1)
        return self.outer(F.silu(gate) * value)


class SteeredBlock(nn.Module):
    """Cross-attention and gated MLP, each scaled, shifted and gated by a vector (AdaLN-Zero).

    All gates begin at zero: at first a block gives back what it is given.
    """

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width, elementwise_affine=False)
        self.attention = Attention(width, heads)
        self.mlp = GatedMLP(width)
        self.steer = nn.Linear(width, 6 * width)
        nn.init.zeros_(self.steer.weight)
        nn.init.zeros_(self.steer.bias)

    def forward(self, x: Tensor, latents: Tensor, condition: Tensor) -> Tensor:
        """Return x (batch, n, width) changed by ``latents`` as the ``condition`` (batch, width)."""
        steer = self.steer(F.silu(condition))[:, None].chunk(6, -1)
        scale, shift, gate = steer[:3]
        x = x + gate * self.attention(self.norm(x) * (1 + scale) + shift, latents)
        scale, shift, gate = steer[3:]
        return x + gate * self.mlp(self.norm(x) * (1 + scale) + shift)


# Flow matching: from noise x0 at time 0 along straight lines to data x1 at time 1.
#
# Lipman et al. 2023; UniPixie supplement, B.2 and B.3.

# The velocity of an x1-prediction, (x1 - x) / (1 - t), is not asked for nearer to the end.
LAST = 0.02
# Deviation of the noise x0: that of normalised matter. With noise three times as wide the flow
# decides so late that a few steps give the mean alone (80 % intervals held 17 % of the truth).
NOISE = 0.3
SHARED = 0.8  # of the variance of the noise that the voxels of a part have in common

Velocity = Callable[[Tensor, Tensor], Tensor]


def coherent_noise(shared: Tensor, own: Tensor) -> Tensor:
    """Where flows begin: normal numbers that the voxels of a part share, and each voxel's own."""
    return NOISE * (SHARED**0.5 * shared + (1 - SHARED) ** 0.5 * own)


def velocity_towards(x1: Tensor, x: Tensor, time: Tensor) -> Tensor:
    """Velocity (batch, ...) that leads from ``x`` at ``time`` (batch,) to ``x1`` at 1."""
    left = (1 - time).clamp(min=LAST).reshape(-1, *(1,) * (x.ndim - 1))
    return (x1 - x) / left


def integrate(
    velocity: Velocity, x: Tensor, *, steps: int, method: Literal["euler", "heun"] = "heun"
) -> Tensor:
    """Follow ``velocity``(x, time) from noise ``x`` (batch, ...) at 0 to 1 (eqs. S3 and S4).

    Heun's corrector asks for the velocity at the end of a step, two evaluations each.
    """
    line = torch.linspace(0, 1, steps + 1, dtype=x.dtype, device=x.device)
    for now, then in pairwise(line.expand(len(x), -1).unbind(1)):
        dt = (then - now)[0]
        first = velocity(x, now)
        if method == "heun":
            first = (first + velocity(x + dt * first, then)) / 2
        x = x + dt * first
    return x


# What is known of a voxel, as numbers: a feature and a colour, each with whether it is known.

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
