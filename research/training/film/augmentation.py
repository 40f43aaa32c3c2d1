"""Objects in other places and sizes: labels of voxels turned, mirrored and shrunk."""

from __future__ import annotations

import torch
from torch import Tensor

from ...datasets.shapes import EMPTY


def turned(label: Tensor, generator: torch.Generator) -> Tensor:
    """Rotate labels (n, x, y, z) about z by quarter turns and mirror, by quarters of the batch."""
    device = label.device
    order = torch.randperm(len(label), generator=generator, device=device)
    out = label.clone()
    for quarter in order.chunk(4):
        turns, mirror = torch.randint(4, (2,), generator=generator, device=device).tolist()
        rotated = torch.rot90(label[quarter], turns, (1, 2))
        out[quarter] = rotated.flip(1) if mirror % 2 else rotated
    return out


def shrunk(label: Tensor, generator: torch.Generator) -> Tensor:
    """Shrink each object of (n, x, y, z) along each axis by up to a third."""
    n, cells = label.shape[:2]
    device = label.device
    scale = 1 - torch.rand(n, 3, generator=generator, device=device) / 3
    line = torch.arange(cells, device=device) + 0.5 - cells / 2
    at = (line[None, None] / scale[..., None] + cells / 2).floor().long()
    outside = (at < 0) | (at >= cells)
    x, y, z = at.clamp(0, cells - 1).unbind(1)
    which = torch.arange(n, device=device)[:, None, None, None]
    out = label[which, x[:, :, None, None], y[:, None, :, None], z[:, None, None, :]]
    a, b, c = outside.unbind(1)
    empty = a[:, :, None, None] | b[:, None, :, None] | c[:, None, None, :]
    return torch.where(empty, EMPTY, out)
