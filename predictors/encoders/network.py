"""The image network: a frozen EfficientNet-Lite, and linear maps of all its levels into one space.

Written as functions of a flat dictionary of weights, which is what a safetensors file holds. The
backbone is EfficientNet-Lite0 (Tan and Le 2019) with the weights that it learned on ImageNet, batch
norms folded into the convolutions; ours is the head: a matrix for each level to a few numbers, some
of which are turned towards words, while the others lie in directions that words leave free.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import torch

Weights = dict[str, "torch.Tensor"]
STRIDE = 4  # pixels an output cell is wide
MULTIPLE = 32  # sides of a picture must be multiples of this: the coarsest stage's stride
STRIDES = (1, 2, 2, 2, 1, 2, 1)  # of the first block of every stage
LEVELS = (1, 2, 3, 4, 5, 6)  # stages that the head reads: 1/4, 1/8, 1/16, 1/16, 1/32, 1/32
COLOURS = 16  # channels of the level below all stages: ``colours``
COVERED = 0.02  # opacity from which a pixel shows something: less is the edge of a blurred picture
FULL = 0.98  # opacity from which a pixel counts as fully covered
LENGTH = 1.5  # of word (1), plain (.5 on average) and missing parts together, before it becomes 1
DARK = 0.05  # brightness below which a saturation is noise
BATCH_NORM_EPSILON = 1e-3


class Widths(NamedTuple):
    """Channels of the stem and the stages; blocks and kernels of the stages."""

    stem: int = 32
    channels: tuple[int, ...] = (16, 24, 40, 80, 112, 192, 320)
    blocks: tuple[int, ...] = (1, 2, 2, 3, 3, 4, 1)
    kernels: tuple[int, ...] = (3, 3, 5, 3, 5, 5, 3)
    expand: int = 6

    @property
    def groups(self) -> tuple[int, ...]:
        """Channels of every level that the head reads."""
        return (COLOURS, *(self.channels[stage] for stage in LEVELS))


def folded_backbone(state: Weights, widths: Widths | None = None) -> Weights:
    """Stem and stages of a public EfficientNet-Lite checkpoint (PyTorch names), norms folded."""

    def fold(kernel: str, norm: str) -> tuple[torch.Tensor, torch.Tensor]:
        spread = (state[f"{norm}.running_var"] + BATCH_NORM_EPSILON).sqrt()
        gain = state[f"{norm}.weight"] / spread
        bias = state[f"{norm}.bias"] - state[f"{norm}.running_mean"] * gain
        return state[f"{kernel}.weight"] * gain[:, None, None, None], bias

    pairs = {"stem": ("_conv_stem", "_bn0")}
    number = 0
    for stage, blocks in enumerate((widths or Widths()).blocks):
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


def levels(weights: Weights, pictures: torch.Tensor) -> list[torch.Tensor]:
    """What the head reads of pictures (n, 4, h, w): colour on grey and opacity, in [0, 1].

    Maps (n, channels, h / stride, w / stride) of the pictures at the nearest multiple of 32:
    ``colours`` at 1/4, then ``LEVELS``. Colours are read before pictures are resized, which would
    blur the opacity of every edge.
    """
    import torch.nn.functional as F

    side = [max(round(n / MULTIPLE), 1) * MULTIPLE for n in pictures.shape[-2:]]
    found = [colours(pictures, (side[0] // STRIDE, side[1] // STRIDE))]
    if list(pictures.shape[-2:]) != side:
        pictures = F.interpolate(pictures, size=side, mode="bilinear", antialias=True)
    x = F.relu6(_conv(weights, "stem", 2 * pictures[:, :3] - 1, 2))
    for stage, stride in enumerate(STRIDES):
        block = 0
        while f"stage.{stage}.{block}.spatial.weight" in weights:
            name = f"stage.{stage}.{block}"
            y = F.relu6(_conv(weights, f"{name}.expand", x)) if stage else x
            y = F.relu6(_conv(weights, f"{name}.spatial", y, 1 if block else stride))
            y = _conv(weights, f"{name}.project", y)
            x = x + y if block else y
            block += 1
        if stage in LEVELS:
            found.append(x)
    return found


def colours(pictures: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    """Colour and opacity (n, 16, rows, columns) of what covers each cell of a grid.

    Means over the covered pixels of a cell: red, green, blue, opacity, the share of full opacity,
    and saturation; the squares and products of the first four; brightness and its square, the
    least channel. A thin opaque rod thus differs from glass, which fills its cells.
    """
    import torch
    import torch.nn.functional as F

    rgb, opacity = pictures[:, :3], pictures[:, 3:]
    bright, least = rgb.amax(dim=1, keepdim=True), rgb.amin(dim=1, keepdim=True)
    saturation = (bright - least) / bright.clamp(min=DARK)
    full = (opacity >= FULL).to(pictures.dtype)
    products = [pictures**2, rgb * rgb.roll(1, dims=1)]
    read = torch.cat([pictures, full, saturation, *products, bright, bright**2, least], dim=1)
    covered = (opacity > COVERED).to(pictures.dtype)
    total = F.adaptive_avg_pool2d(torch.cat([read * covered, covered], dim=1), size)
    return total[:, :-1] / total[:, -1:].clamp(min=COVERED)


def head(weights: Weights, found: list[torch.Tensor]) -> torch.Tensor:
    """Unit vectors (n, h/4, w/4, dim) of ``levels``: words and, across them, what is plainly seen.

    Each level is mapped to a few numbers, which are summed; mapping comes before upsampling, which
    is the same and cheaper. The first are coordinates among words, turned into a vector of length
    1; the others are kept as they are. One more direction takes up what is missing to ``LENGTH``,
    so that no number is divided by what another one is.
    """
    import torch
    import torch.nn.functional as F

    size = (found[0].shape[2], found[0].shape[3])
    read = weights["head.bias"][None, :, None, None]
    for number, level in enumerate(found):
        mapped = F.conv2d(level, weights[f"head.{number}.weight"][..., None, None])
        read = read + (mapped if number < 2 else F.interpolate(mapped, size, mode="bilinear"))
    read = read.permute(0, 2, 3, 1)
    count = weights["words.axes"].shape[1]
    said = read[..., :count] @ weights["words.axes"].T + weights["words.centre"]
    plain = read[..., count:]
    missing = LENGTH**2 - 1 - (plain**2).sum(dim=-1, keepdim=True)
    across = torch.cat([plain, missing.clamp(min=0).sqrt()], dim=-1)
    total = F.normalize(said, dim=-1, eps=1e-6) + across @ weights["plain.axes"].T
    return F.normalize(total, dim=-1, eps=1e-6)


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
