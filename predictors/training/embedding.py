"""The sentence encoder on a torch device: corpora of a million clauses in seconds on a GPU.

The same network and weights as ``encoders.minilm``; a test compares the two.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

_BATCH_TOKENS = 1 << 16  # tokens in one forward pass


class TorchMiniLM:
    """The text encoder of ``folder`` (weights in any float type) on ``device``."""

    def __init__(self, folder: Path, *, device: str) -> None:
        from safetensors.torch import load_file
        from tokenizers import Tokenizer

        config = json.loads((folder / "config.json").read_text())
        self.heads, self.layers = config["num_attention_heads"], config["num_hidden_layers"]
        self.epsilon, self.device = config["layer_norm_eps"], device
        weights = load_file(folder / "model.safetensors", device=device)
        self.weights = {k: w.float() for k, w in weights.items() if w.is_floating_point()}
        self.tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
        self.tokenizer.no_padding()

    @torch.no_grad()
    def text(self, sentences: Sequence[str]) -> np.ndarray:
        """Unit embedding of each sentence, (n, dim), float32."""
        rows = [encoding.ids for encoding in self.tokenizer.encode_batch(list(sentences))]
        lengths = np.array([len(row) for row in rows])
        out = None
        for length in np.unique(lengths):
            same = np.flatnonzero(lengths == length)
            for batch in np.array_split(same, -(-same.size * length // _BATCH_TOKENS)):
                tokens = torch.tensor([rows[i] for i in batch], device=self.device)
                mean = F.normalize(self._forward(tokens).mean(dim=1), dim=1).cpu().numpy()
                out = np.zeros((len(rows), mean.shape[1]), np.float32) if out is None else out
                out[batch] = mean
        return np.zeros((0, 0), np.float32) if out is None else out

    def _forward(self, tokens: Tensor) -> Tensor:
        w = self.weights
        x = w["embeddings.word_embeddings.weight"][tokens]
        x = x + w["embeddings.position_embeddings.weight"][: tokens.shape[1]]
        x = self._norm("embeddings.LayerNorm", x + w["embeddings.token_type_embeddings.weight"][0])
        for layer in range(self.layers):
            at = f"encoder.layer.{layer}"
            q, k, v = (
                self._dense(f"{at}.attention.self.{role}", x).unflatten(-1, (self.heads, -1))
                for role in ("query", "key", "value")
            )
            seen = F.scaled_dot_product_attention(
                q.transpose(1, 2), k.transpose(1, 2), v.transpose(1, 2)
            )
            attended = self._dense(f"{at}.attention.output.dense", seen.transpose(1, 2).flatten(2))
            x = self._norm(f"{at}.attention.output.LayerNorm", x + attended)
            inner = F.gelu(self._dense(f"{at}.intermediate.dense", x))
            x = self._norm(f"{at}.output.LayerNorm", x + self._dense(f"{at}.output.dense", inner))
        return x

    def _dense(self, name: str, x: Tensor) -> Tensor:
        return F.linear(x, self.weights[f"{name}.weight"], self.weights[f"{name}.bias"])

    def _norm(self, name: str, x: Tensor) -> Tensor:
        weight, bias = self.weights[f"{name}.weight"], self.weights[f"{name}.bias"]
        return F.layer_norm(x, weight.shape, weight, bias, self.epsilon)
