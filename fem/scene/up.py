"""Which way is up: an axis with its sign, as a vector and as a turn."""

from __future__ import annotations

from typing import get_args

import numpy as np
from jaxtyping import Float

from ..errors import InputError
from . import UpAxis


def up_index(up: str) -> int:
    """Index of the axis that points up or down."""
    if up not in get_args(UpAxis):
        raise InputError("up.up_axis", up=up, get_args=", ".join(get_args(UpAxis)))
    return "xyz".index(up[-1])


def up_vector(up: UpAxis) -> Float[np.ndarray, "3"]:
    """Unit vector that points up."""
    vector = np.zeros(3)
    vector[up_index(up)] = -1.0 if up[0] == "-" else 1.0
    return vector


def half_turn(up: UpAxis) -> Float[np.ndarray, "3"]:
    """Factors of the coordinates that bring ``-y`` up to ``y`` up, and so on; ones without a minus.

    The half turn is about the second level axis: for y about x, so that what faced -z faces +z.
    """
    factors = np.ones(3)
    if up[0] == "-":
        factors[[up_index(up), (up_index(up) + 1) % 3]] = -1.0
    return factors
