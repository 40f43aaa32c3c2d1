"""Where a load meets the ground, and how far within the feet of what stands there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..scene.up import UpAxis, up_index, up_vector


class Foothold(NamedTuple):
    """What a body that only stands on level ground needs of it.

    The load meets the ground ``inside`` [m] its feet, outside where negative: then it tips over.
    ``friction`` is the least coefficient [1] at which it does not slide; infinite where it lifts.
    """

    inside: float
    friction: float


def foothold(
    feet: Float[np.ndarray, "n 3"],
    force: Float[np.ndarray, "3"],
    moment: Float[np.ndarray, "3"],
    up: UpAxis,
) -> Foothold:
    """Foothold of a rigid body on level ground along the axis ``up`` below its ``feet`` [m].

    ``force`` [N] is that of all loads, ``moment`` [N m] theirs about the origin. A rigid body on
    such ground is at rest if and only if its load meets the ground within the convex hull of its
    feet, as there pressures alone balance it.
    """
    z, upwards = up_index(up), up_vector(up)
    x, y = (z + 1) % 3, (z + 2) % 3
    if force @ upwards >= 0:
        return Foothold(-np.inf, np.inf)
    base = (feet @ upwards).min() * upwards
    about = moment - np.cross(base, force)
    place = np.array([-about[y], about[x]]) / force[z]
    slides = float(np.hypot(force[x], force[y]) / abs(force[z]))
    return Foothold(_depth(place, feet[:, [x, y]]), slides)


def _depth(place: Float[np.ndarray, "2"], feet: Float[np.ndarray, "n 2"]) -> float:
    """How deep a place lies in the convex hull of others: negative outside, where it is a bound."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        sides = ConvexHull(feet).equations
    except QhullError:  # feet on a line hold nothing upright
        return -float(np.linalg.norm(feet - place, axis=1).min())
    return float(-(sides[:, :2] @ place + sides[:, 2]).max())
