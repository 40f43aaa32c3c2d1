"""Weights in bytes: of a matrix a byte a number, and a step for each of its rows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

LEAST = 1e-30  # of a row's largest number: below, it is one of noughts
STEP = ".step"  # ends the name of the steps of a weight


def packed(weights: Mapping[str, np.ndarray], *, axes: int = 2) -> dict[str, np.ndarray]:
    """Weights of ``axes`` axes and more as bytes (..., n) and steps (..., 1), others as halves.

    >>> stored = packed({"w": np.array([[0.5, -1.0], [0.0, 3.0]])})
    >>> sorted(stored), stored["w"].tolist(), unpacked(stored)["w"].round(2).tolist()
    (['w', 'w.step'], [[64, -127], [0, 127]], [[0.5, -1.0], [0.0, 3.0]])
    """
    out: dict[str, np.ndarray] = {}
    for name, whole in weights.items():
        if whole.ndim < axes:
            out[name] = whole.astype(np.float16)
            continue
        largest = np.abs(whole).max(axis=-1, keepdims=True)
        step = (np.where(largest > LEAST, largest, 1) / 127).astype(np.float32)
        out |= {name: np.round(whole / step).astype(np.int8), f"{name}{STEP}": step}
    return out


def unpacked(stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The numbers of stored weights, single precision: bytes times their steps, halves as such."""
    steps = {name: x.astype(np.float32) for name, x in stored.items() if name.endswith(STEP)}
    return {
        name: x.astype(np.float32) * steps.get(f"{name}{STEP}", np.float32(1))
        for name, x in stored.items()
        if name not in steps
    }
