"""Parts of speech: the tagger of spaCy's small English model, without spaCy.

Each word is what it is (normalised), its first letter, its last three and its shape, each a sum of
four rows of a table that a hash of it points at (Svenstrup et al. 2017); four convolutions over
three words, with maxout and residuals, then give each word the likeliest tag of the Penn treebank.
spaCy's own start takes some .7 s of a processor, of which tags need none.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt64

_MASK = 2**64 - 1
_MURMUR = 0xC6A4A7935BD1E995  # Appleby's MurmurHash64A, which spaCy keeps strings by
_FIRST_SEED = 8  # of the hashes into the first table; the next has one more
# Strings that spaCy has numbers of its own for, where they may be a word, its end or its shape.
_SYMBOLS = {
    "X": 101, "_": 456, "agent": 401, "amod": 402, "attr": 404, "aux": 405, "cc": 407, "conj": 410,
    "cop": 411, "dep": 414, "det": 415, "expl": 417, "mark": 423, "meta": 424, "neg": 425,
    "nn": 427, "num": 431, "number": 432, "obj": 434, "obl": 435, "poss": 440, "possessive": 441,
    "prep": 443, "prt": 444, "root": 449, "acl": 451,
}  # fmt: skip


def unpacked(path: Path) -> dict[Any, Any]:
    """Content of one of the model's files: MessagePack, of which arrays are records with bytes."""
    import msgpack

    def array(record: dict[Any, Any]) -> Any:
        if not record.get(b"nd"):
            return record
        return np.frombuffer(record[b"data"], record[b"type"]).reshape(record[b"shape"])

    return msgpack.unpackb(path.read_bytes(), object_hook=array, strict_map_key=False)


class Tags:
    """Gives each word of a text its tag; ``folder`` holds the model."""

    def __init__(self, folder: Path) -> None:
        params = [p for p in unpacked(folder / "tok2vec/model")["params"] if p]
        self._tables = [p["E"] for p in params if "E" in p]
        self._maxouts = [(p["W"], p["b"]) for p in params if "W" in p]
        self._scales = [(p["G"], p["b"]) for p in params if "G" in p]
        (self._out,) = [p for p in unpacked(folder / "tagger/model")["params"] if p]
        self._labels = json.loads((folder / "tagger/cfg").read_text())["labels"]
        self._norms = unpacked(folder / "vocab/lookups.bin")["lexeme_norm"]

    def __call__(self, words: Sequence[str]) -> list[str]:
        """Tags of words that are not empty and no spaces."""
        if not words:
            return []
        ids = np.array([self._features(word) for word in words], np.uint64)
        x = np.concatenate(
            [
                table[_spread(of, _FIRST_SEED + k) % len(table)].sum(axis=1)
                for k, (table, of) in enumerate(zip(self._tables, ids.T, strict=True))
            ], axis=1,
        )  # fmt: skip
        x = self._layer(0, x)
        depth = len(self._maxouts) - 1
        x = np.pad(x, ((depth, depth), (0, 0)))
        for k in range(1, depth + 1):
            wide = np.pad(x, ((1, 1), (0, 0)))
            x = x + self._layer(k, np.concatenate([wide[:-2], x, wide[2:]], axis=1))
        logits = x[depth:-depth] @ self._out["W"].T + self._out["b"]
        return [self._labels[k] for k in logits.argmax(axis=1)]

    def _features(self, word: str) -> list[int]:
        """Numbers of norm, first letter, end and shape; that a space follows, and it is none."""
        norm = self._norms.get(number_of(word), word.lower())
        kinds = (
            "X" if c.isupper() else "x" if c.isalpha() else "d" if c.isdigit() else c for c in word
        )
        shape = re.sub(r"(.)\1{4,}", lambda m: m[0][:4], "".join(kinds))
        return [*map(number_of, (norm, word[0], word[-3:], shape)), 1, 0]

    def _layer(self, k: int, x: Float[np.ndarray, "words in"]) -> Float[np.ndarray, "words out"]:
        """The largest of three linear maps, of mean 0 and variance 1, scaled."""
        (weight, bias), (gain, shift) = self._maxouts[k], self._scales[k]
        x = (x @ weight.reshape(-1, weight.shape[-1]).T).reshape(len(x), *bias.shape) + bias
        x = x.max(axis=-1)
        x = x - x.mean(axis=1, keepdims=True)
        return x / np.sqrt((x * x).mean(axis=1, keepdims=True) + 1e-8) * gain + shift


@cache
def number_of(text: str) -> int:
    """The 64 bits that spaCy knows a string by."""
    if text in _SYMBOLS:
        return _SYMBOLS[text]
    data = text.encode()
    found = 1 ^ (len(data) * _MURMUR & _MASK)
    for at in range(0, len(data), 8):
        word = int.from_bytes(data[at : at + 8], "little")
        if at + 8 <= len(data):
            word = word * _MURMUR & _MASK
            word = (word ^ word >> 47) * _MURMUR & _MASK
        found = (found ^ word) * _MURMUR & _MASK
    found = (found ^ found >> 47) * _MURMUR & _MASK
    return found ^ found >> 47


def _spread(ids: UInt64[np.ndarray, "n"], seed: int) -> UInt64[np.ndarray, "n 4"]:
    """Four 32-bit hashes of each number: Appleby's MurmurHash3 for 128 bits."""

    def mixed(h: Any) -> Any:
        for factor in (0xFF51AFD7ED558CCD, 0xC4CEB9FE1A85EC53):
            h = (h ^ (h >> np.uint64(33))) * np.uint64(factor)
        return h ^ (h >> np.uint64(33))

    one = ids * np.uint64(0x87C37B91114253D5)
    one = ((one << np.uint64(31)) | (one >> np.uint64(33))) * np.uint64(0x4CF5AD432745937F)
    two = np.uint64(seed ^ 8)
    one = (one ^ two) + two
    one, two = mixed(one), mixed(one + two)
    one = one + two
    two = one + two
    halves = [
        h >> np.uint64(shift) & np.uint64(0xFFFFFFFF) for h in (one, two) for shift in (0, 32)
    ]
    return np.stack(halves, axis=1)
