"""Skinning weights as 650 numbers: the head of a small network whose body never changes.

The layout of Simplicits (Modi et al. 2024) as Vid2Sim and UniPixie predict it: a frozen network
turns a place in the body's box into 64 features, and 64 x 10 weights with 10 biases turn these into
ten handles. The numbers mean nothing without the network that they were made with, so that its
hash is checked. Ours is drawn from a seed; the papers' own is not to be had.
"""

from __future__ import annotations

import hashlib
from functools import cache
from typing import NamedTuple

import numpy as np

from ....fem.errors import InputError

FEATURES, HANDLES, LAYERS = 64, 10, 4
# Standard deviation of the first layer's weights over He's: the features then bend inside the box.
BEND = 2.0
# What is shipped: its numbers are drawn again in every process, and must be these.
BODY_HASH = "8ca2cdfd8761214cb9a0fba856d4bb3b8fda995933de00cee7a4c0db93dcb62e"


class Layer(NamedTuple):
    """One layer of the body: y = elu(x W + b)."""

    W: np.ndarray
    b: np.ndarray


@cache
def frozen_body() -> tuple[Layer, ...]:
    """Layers of the body, 3 -> 64 -> 64 -> 64 -> 64, in single precision.

    Raises
    ------
    InputError
        Where this machine draws other numbers than those that the hash is of.
    """
    rng = np.random.Generator(np.random.PCG64(0))
    layers = []
    for k in range(LAYERS):
        size = 3 if k == 0 else FEATURES
        spread = (2.0 / size) ** 0.5 * (BEND if k == 0 else 1.0)
        # Of uniform numbers, whose bits are the same everywhere.
        W = (2 * rng.random((size, FEATURES)) - 1) * 3**0.5 * spread
        b = 2 * rng.random(FEATURES) - 1
        layers.append(Layer(W.astype(np.float32), b.astype(np.float32)))
    if (found := hash_of(tuple(layers))) != BODY_HASH:
        raise InputError(f"the body of the weights has hash {found}, wanted {BODY_HASH}")
    return tuple(layers)


def hash_of(layers: tuple[Layer, ...]) -> str:
    """SHA-256 of the numbers of a body, little-endian, layer by layer."""
    digest = hashlib.sha256()
    for array in (a for layer in layers for a in layer):
        digest.update(np.ascontiguousarray(array, dtype="<f4").tobytes())
    return digest.hexdigest()
