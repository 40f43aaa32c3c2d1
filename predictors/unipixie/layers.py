"""Building blocks of the UniPixie network: places as waves, attention, blocks steered by a vector.

Tokens are (batch, tokens, width).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

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
