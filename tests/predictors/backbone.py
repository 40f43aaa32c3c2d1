"""An image network of random weights, for tests."""

import numpy as np
import torch
from autophyx_tet.predictors.encoders.plain import Weights, Widths

SMALLEST = Widths(8, (8, 8, 12, 12, 16, 16, 16), (1,) * 7, (3,) * 7, 2)


def new_backbone(widths: Widths, *, seed: int) -> Weights:
    """Return random weights: normal, of variance 2 / fan-in before a rectifier, else 1 / fan-in."""
    generator = torch.Generator().manual_seed(seed)
    weights: Weights = {}

    def add(name: str, *shape: int, gain: float = np.sqrt(2)) -> None:
        deviation = gain / np.sqrt(np.prod(shape[1:]))
        weights[f"{name}.weight"] = torch.randn(shape, generator=generator) * deviation
        weights[f"{name}.bias"] = torch.zeros(shape[0])

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
    return weights
