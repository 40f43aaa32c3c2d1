"""Skinning weights as 650 numbers: the head of a small network whose body never changes.

The layout of Simplicits (Modi et al. 2024) as Vid2Sim and UniPixie predict it: a frozen network
turns a place in the body's box into 64 features, and 64 x 10 weights with 10 biases turn these into
ten handles. The numbers mean nothing without the network that they were fitted with, so that its
hash goes along. Ours is drawn from a seed; the papers' own is not to be had. The fit is least
squares: its residual says what the features cannot follow, and motions take weights at the points.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError

FEATURES, HANDLES, LAYERS = 64, 10, 4
NUMBERS = FEATURES * HANDLES + HANDLES
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Theta:
    """Skinning weights of a body as the head of the frozen network.

    Parameters
    ----------
    numbers
        Weights (64, 10) and then biases (10,) of the head, flat: shape (650,).
    lo, hi
        Corners of the body's box [m], shape (3,): places are taken as shares of it.
    body_hash
        Hash of the body that the numbers belong to.
    residual
        Root mean square of what the fit missed over that of the weights [1]; 0: not fitted.
    """

    numbers: Float[np.ndarray, "650"]
    lo: Float[np.ndarray, "3"]
    hi: Float[np.ndarray, "3"]
    body_hash: str = BODY_HASH
    residual: float = 0.0

    def __post_init__(self) -> None:
        if self.body_hash != BODY_HASH:
            raise InputError(
                f"theta belongs to the body {self.body_hash[:12]}, here is {BODY_HASH[:12]}: its "
                "numbers mean nothing here"
            )

    def weights(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 10"]:
        """Skinning weights [1] at ``points`` [m]."""
        head = self.numbers[: FEATURES * HANDLES].reshape(FEATURES, HANDLES)
        return body_features(points, self.lo, self.hi) @ head + self.numbers[-HANDLES:]


def body_features(
    points: Float[np.ndarray, "points 3"], lo: np.ndarray, hi: np.ndarray
) -> Float[np.ndarray, "points 64"]:
    """Features of the frozen body at ``points`` [m] of the box from ``lo`` to ``hi``."""
    x = (points - lo) / np.maximum(hi - lo, 1e-300)
    for W, b in frozen_body():
        x = x @ W.astype(float) + b
        x = np.where(x > 0, x, np.expm1(np.minimum(x, 0.0)))
    return x


def fit_theta(
    points: Float[np.ndarray, "points 3"],
    weights: Float[np.ndarray, "points 10"],
    mass: Float[np.ndarray, "points"],
) -> Theta:
    """Head whose weights come nearest to ``weights`` at ``points`` [m], by ``mass`` [kg]."""
    used = mass > 0
    lo, hi = points[used].min(axis=0), points[used].max(axis=0)
    features = np.concatenate([body_features(points, lo, hi), np.ones((len(points), 1))], axis=1)
    root = np.sqrt(mass)[:, None]
    head = np.linalg.lstsq(root * features, root * weights, rcond=1e-9)[0]
    missed = np.linalg.norm(root * (features @ head - weights))
    size = float(np.linalg.norm(root * weights)) or 1.0
    return Theta(numbers=head.ravel(), lo=lo, hi=hi, residual=float(missed) / size)
