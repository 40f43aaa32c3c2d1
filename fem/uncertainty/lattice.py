"""Points that fill a cube evenly: a lattice of rank one, shifted at random."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int


def shifted_lattice(
    count: int, dimensions: int, rng: np.random.Generator
) -> Float[np.ndarray, "count dimensions"]:
    """``count`` points in [0, 1), each evenly distributed over the cube (Cranley & Patterson 1976).

    Their statistics scatter as little as those of a scrambled Sobol sequence of as many.
    """
    steps = np.arange(count)[:, None] * lattice_generator(count, dimensions) % count
    return (steps / count + rng.random(dimensions)) % 1.0


def lattice_generator(count: int, dimensions: int) -> Int[np.ndarray, "dimensions"]:
    """Steps of a lattice of ``count`` points, each the best beside those before it.

    Component by component (Sloan & Reztsov 2002), by the worst error of periodic functions with
    square-integrable derivatives whose j-th direction weighs 1 / j^2.
    """
    whole = np.arange(1, max(count // 2, 1) + 1)
    whole = whole[np.gcd(whole, count) == 1]
    place = np.arange(count)[:, None] * whole % count / count
    kernel = 2 * np.pi**2 * (place * (place - 1) + 1 / 6)  # Bernoulli's second polynomial
    so_far, found = np.ones(count), []
    for weight in 1 / np.arange(1, dimensions + 1) ** 2:
        best = int(np.argmin(so_far @ kernel))
        so_far = so_far * (1 + weight * kernel[:, best])
        found.append(whole[best])
    return np.array(found, dtype=np.int64)
