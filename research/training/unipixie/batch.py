"""What a batch holds: objects as labelled cubes, what is known of each part, and its matter."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ....predictors.unipixie.network import Projector, Voxels
from ...datasets.shapes import EMPTY, MAX_PARTS

JITTER = 0.1  # of what is learned of a voxel: no two voxels of a part look alike


class MatterBatch(NamedTuple):
    """Objects with their truth; P parts, K voxels of each that count.

    ``label`` (n, x, y, z) is the part of every voxel, ``EMPTY`` outside; ``known`` (n, P, given)
    what is given of each part; ``alpha`` and ``time`` (n,); ``start`` and ``end`` (n, K, 3) of the
    flow; ``matter`` (n, K) the class; ``voxel`` (n, K) the flat places of the voxels, ``part``
    (n, K) their part and ``counts`` (n, K) whether its matter is known; ``shake``
    (n, x, y, z, features) what makes voxels differ.
    """

    label: Tensor
    known: Tensor
    alpha: Tensor
    time: Tensor
    start: Tensor
    end: Tensor
    matter: Tensor
    voxel: Tensor
    part: Tensor
    counts: Tensor
    shake: Tensor


def spread_parts(parts: Tensor, label: Tensor) -> Tensor:
    """Values of parts (n, P, C) on the voxels of ``label`` (n, ...), zero outside: (n, ..., C)."""
    # A product, not a gather: of that the gradient is millions of sums into a few numbers.
    flat = label.reshape(len(label), -1, 1)
    mine = flat == torch.arange(parts.shape[1], dtype=label.dtype, device=label.device)
    return (mine.to(parts.dtype) @ parts).reshape(*label.shape, parts.shape[-1])


def voxels_of(project: Projector, batch: MatterBatch) -> Voxels:
    """Bring what is known of the parts onto the cube, as a network reads it."""
    learned = project(batch.known)
    inside = (batch.label != EMPTY)[..., None].to(learned.dtype)
    cube = spread_parts(learned, batch.label) + JITTER * batch.shake.to(learned.dtype) * inside
    index = batch.voxel[..., None]
    own = cube.flatten(1, 3).gather(1, index.expand(-1, -1, cube.shape[-1]))
    return Voxels(cube.movedim(-1, 1), voxel_places(batch.voxel, batch.label.shape[-1]), own)


def voxel_places(voxel: Tensor, cells: int) -> Tensor:
    """Places (..., 3) in [-1, 1] of flat voxel numbers (...) of a cube, x the slowest."""
    axes = (voxel // cells**2, voxel // cells % cells, voxel % cells)
    return (torch.stack(axes, -1) + 0.5) / cells * 2 - 1


def part_means(values: Tensor, batch: MatterBatch) -> Tensor:
    """Means (n, 6) of values (n, K) over the voxels of each part, NaN where it has none."""
    weight = batch.counts.float()
    zero = values.new_zeros(len(values), MAX_PARTS)
    total = zero.scatter_add(1, batch.part, values * weight)
    return total / zero.scatter_add(1, batch.part, weight)
