"""What meets a network from outside: loads of its anchors, planes against its surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ..scene.obstacles import Plane


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceContact:
    """Points of the surface that planes push, and the anchors that they follow.

    Parameters
    ----------
    points
        Positions at rest [m], shape (points, 3).
    weights
        Weights of the anchors for them, sparse (points, anchors).
    stiffness
        Force of a point for a depth [N/m], shape (points,).
    planes, friction, reach
        What pushes them, its coefficient of Coulomb friction [1], and from how far [m].
    """

    points: Float[np.ndarray, "points 3"]
    weights: Any
    stiffness: Float[np.ndarray, "points"]
    planes: tuple[Plane, ...]
    friction: float = 0.0
    reach: float = 0.0

    @property
    def matrix(self) -> Any:
        """Stiffness [N/m] of one component when all points are pushed, (anchors, anchors)."""
        from scipy.sparse import diags_array

        return self.weights.T @ diags_array(self.stiffness) @ self.weights

    def grip(self, inverse_mass: Float[np.ndarray, "anchors"], dt: float) -> np.ndarray:
        """Rubbing [N s/m] that stops no point beyond rest in a step, all of them together."""
        size = abs(self.weights)
        crowd = size.T @ np.ones(len(self.points))
        return 1 / np.maximum(dt * (size @ (crowd * inverse_mass)), 1e-300)


@dataclass(frozen=True, eq=False, kw_only=True)
class AnchorLoads:
    """What acts on anchors beside springs, each of shape (n, 3).

    ``force`` [N] is constant, ``ground`` [N/m] are springs to where they rest.
    """

    force: Float[np.ndarray, "n 3"]
    ground: Float[np.ndarray, "n 3"]
