"""MiniLM on a torch device, which reads a million clauses in seconds."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..predictors.encoders.minilm import Arrays, MiniLM


class DeviceArrays(Arrays):
    """The arrays of torch on a device."""

    module: Any = torch
    tokens = 1 << 16  # widest activation near 400 MB, slow where a device is given little

    def __init__(self, device: str) -> None:
        self.device = device

    def load(self, path: Path) -> dict[str, Any]:
        """Read the weights of a safetensors file, single precision."""
        from safetensors.torch import load_file

        loaded = load_file(path, device=self.device)
        return {key: w.float() for key, w in loaded.items() if w.is_floating_point()}

    def given(self, tokens: np.ndarray) -> Any:
        """Bring an array to the device."""
        return torch.asarray(tokens, device=self.device)

    def taken(self, x: Any) -> np.ndarray:
        """Bring an array back."""
        return x.cpu().numpy()

    def sparing(self) -> AbstractContextManager:
        """Without gradients."""
        return torch.inference_mode()


def minilm(device: str | None) -> MiniLM:
    """The text encoder on a device; None computes with numpy."""
    return MiniLM(arrays=DeviceArrays(device) if device else None)
