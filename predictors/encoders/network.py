"""The image network: an EfficientNet-Lite with a feature pyramid, one unit vector per 4 x 4 pixels.

Written as functions of a flat dictionary of weights, which is what a safetensors file holds. The
backbone is EfficientNet-Lite0 (Tan and Le 2019) without its last stage and with its batch norms
folded into the convolutions, so that training can start from weights learned on ImageNet; the
pyramid follows Lin et al. 2017, its last block Liu et al. 2022.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import torch

Weights = dict[str, "torch.Tensor"]
STRIDE = 4  # pixels an output cell is wide
MULTIPLE = 32  # sides of a picture must be multiples of this: the coarsest stage's stride
STRIDES = (1, 2, 2, 2, 1, 2)  # of the first block of every stage
LEVELS = (1, 2, 4, 5)  # stages whose output the pyramid takes: 1/4, 1/8, 1/16, 1/32
START_SCALE = 1e-2  # of the last residual branch at the start of training
BATCH_NORM_EPSILON = 1e-3


class Widths(NamedTuple):
    """Channels of the stem, the stages and the pyramid; blocks and kernels of the stages."""

    stem: int = 32
    channels: tuple[int, ...] = (16, 24, 40, 80, 112, 192)
    blocks: tuple[int, ...] = (1, 2, 2, 3, 3, 4)
    kernels: tuple[int, ...] = (3, 3, 5, 3, 5, 5)
    expand: int = 6
    pyramid: int = 128
    hidden: int = 256
    dim: int = 384


SMALLEST = Widths(8, (8, 8, 12, 12, 16, 16), (1,) * 6, (3,) * 6, 2, 16, 24)  # for tests


def new_weights(widths: Widths, *, seed: int) -> Weights:
    """Return random weights: normal, of variance 2 / fan-in before a rectifier, else 1 / fan-in."""
    import torch

    generator = torch.Generator().manual_seed(seed)
    weights: Weights = {}

    def add(name: str, *shape: int, gain: float = np.sqrt(2)) -> None:
        deviation = gain / np.sqrt(np.prod(shape[1:]))
        weights[f"{name}.weight"] = torch.randn(shape, generator=generator) * deviation
        weights[f"{name}.bias"] = torch.zeros(shape[0])

    def add_norm(name: str, channels: int) -> None:
        weights[f"{name}.weight"] = torch.ones(channels)
        weights[f"{name}.bias"] = torch.zeros(channels)

    add("stem", widths.stem, 3, 3, 3)
    before = widths.stem
    for stage, channels in enumerate(widths.channels):
        for block in range(widths.blocks[stage]):
            name, inner = f"stage.{stage}.{block}", before * (widths.expand if stage else 1)
            if stage:
                add(f"{name}.expand", inner, before, 1, 1)
            add(f"{name}.spatial", inner, 1, widths.kernels[stage], widths.kernels[stage])
            add(f"{name}.project", channels, inner, 1, 1, gain=1.0)
            before = channels
    for level, stage in enumerate(LEVELS):
        add(f"lateral.{level}", widths.pyramid, widths.channels[stage], 1, 1, gain=1.0)
    add("merge.spatial", widths.pyramid, 1, 7, 7, gain=1.0)
    add_norm("merge.norm", widths.pyramid)
    add("merge.widen", 4 * widths.pyramid, widths.pyramid)
    add("merge.narrow", widths.pyramid, 4 * widths.pyramid, gain=1.0)
    weights["merge.scale"] = torch.full((widths.pyramid,), START_SCALE)
    add_norm("head.norm", widths.pyramid)
    add("head.hidden", widths.hidden, widths.pyramid)
    add("head.out", widths.dim, widths.hidden, gain=1.0)
    return weights


def folded_backbone(state: Weights) -> Weights:
    """Stem and stages of a public EfficientNet-Lite0 checkpoint (PyTorch names), norms folded."""

    def fold(kernel: str, norm: str) -> tuple[torch.Tensor, torch.Tensor]:
        spread = (state[f"{norm}.running_var"] + BATCH_NORM_EPSILON).sqrt()
        gain = state[f"{norm}.weight"] / spread
        bias = state[f"{norm}.bias"] - state[f"{norm}.running_mean"] * gain
        return state[f"{kernel}.weight"] * gain[:, None, None, None], bias

    pairs = {"stem": ("_conv_stem", "_bn0")}
    widths, number = Widths(), 0
    for stage, blocks in enumerate(widths.blocks):
        for block in range(blocks):
            theirs, ours = f"_blocks.{number}", f"stage.{stage}.{block}"
            if stage:
                pairs[f"{ours}.expand"] = (f"{theirs}._expand_conv", f"{theirs}._bn0")
            pairs[f"{ours}.spatial"] = (f"{theirs}._depthwise_conv", f"{theirs}._bn1")
            pairs[f"{ours}.project"] = (f"{theirs}._project_conv", f"{theirs}._bn2")
            number += 1
    weights: Weights = {}
    for name, pair in pairs.items():
        weights[f"{name}.weight"], weights[f"{name}.bias"] = fold(*pair)
    return weights


def backbone(weights: Weights, images: torch.Tensor, *, drop: float = 0.0) -> list[torch.Tensor]:
    """Features at 1/4, 1/8, 1/16 and 1/32 of pictures (n, 3, h, w) in [0, 1].

    ``drop`` is the chance that a residual branch of a picture is left out in training.
    """
    import torch.nn.functional as F

    x = F.relu6(_conv(weights, "stem", 2 * images - 1, 2))
    levels = []
    for stage, stride in enumerate(STRIDES):
        block = 0
        while f"stage.{stage}.{block}.spatial.weight" in weights:
            name = f"stage.{stage}.{block}"
            y = F.relu6(_conv(weights, f"{name}.expand", x)) if stage else x
            y = F.relu6(_conv(weights, f"{name}.spatial", y, 1 if block else stride))
            y = _conv(weights, f"{name}.project", y)
            x = x + _dropped(y, drop) if block else y
            block += 1
        if stage in LEVELS:
            levels.append(x)
    return levels


def trunk(weights: Weights, images: torch.Tensor, *, drop: float = 0.0) -> torch.Tensor:
    """Features (n, pyramid, h/4, w/4) of pictures (n, 3, h, w) in [0, 1]."""
    import torch.nn.functional as F

    levels = backbone(weights, images, drop=drop)
    levels = [_conv(weights, f"lateral.{level}", x) for level, x in enumerate(levels)]
    x = levels.pop()
    while levels:
        finer = levels.pop()
        x = finer + F.interpolate(x, size=finer.shape[-2:], mode="bilinear", align_corners=False)
    y = _conv(weights, "merge.spatial", x).permute(0, 2, 3, 1)
    y = F.layer_norm(y, y.shape[-1:], weights["merge.norm.weight"], weights["merge.norm.bias"])
    y = F.gelu(F.linear(y, weights["merge.widen.weight"], weights["merge.widen.bias"]))
    y = F.linear(y, weights["merge.narrow.weight"], weights["merge.narrow.bias"])
    return x + (y * weights["merge.scale"]).permute(0, 3, 1, 2)


def head(weights: Weights, features: torch.Tensor) -> torch.Tensor:
    """Unit vectors (..., dim) of trunk features (..., pyramid)."""
    import torch.nn.functional as F

    norm = weights["head.norm.weight"], weights["head.norm.bias"]
    x = F.layer_norm(features, features.shape[-1:], *norm)
    x = F.gelu(F.linear(x, weights["head.hidden.weight"], weights["head.hidden.bias"]))
    x = F.linear(x, weights["head.out.weight"], weights["head.out.bias"])
    return F.normalize(x.float(), dim=-1, eps=1e-6)


def _conv(weights: Weights, name: str, x: torch.Tensor, stride: int = 1) -> torch.Tensor:
    """Convolution with TensorFlow's SAME padding, depthwise where the kernel has one channel."""
    import torch.nn.functional as F

    kernel = weights[f"{name}.weight"]
    groups = x.shape[1] // kernel.shape[1]
    free = kernel.shape[-1] - stride  # of the padding of even sides: the smaller half comes first
    if free > 0 and stride > 1:
        x = F.pad(x, (free // 2, free - free // 2) * 2)
    pad = 0 if stride > 1 else kernel.shape[-1] // 2
    return F.conv2d(x, kernel, weights[f"{name}.bias"], stride, pad, groups=groups)


def _dropped(y: torch.Tensor, drop: float) -> torch.Tensor:
    """Leave a residual branch out of some pictures, and scale the others up."""
    import torch

    if not drop:
        return y
    keep = torch.rand(len(y), 1, 1, 1, device=y.device) >= drop
    return y * keep / (1 - drop)
