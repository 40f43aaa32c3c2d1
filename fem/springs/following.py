"""Points that follow anchors: linear moving least squares at rest, fixed weights in motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from .anchors import Anchors
from .sight import Sight

# Anchors that a point follows, and those that they are chosen from.
NEAREST, CHOICE = 12, 32
# Directions in which the anchors around a point reach less than this share are not followed: there
# a point stays as far from them as it is.
FLAT = 0.1


def following(
    points: Float[np.ndarray, "points 3"],
    body: Int[np.ndarray, "points"],
    anchors: Anchors,
    surface: Sight,
) -> Any:
    """Weights of the anchors for ``points`` [m] of the given ``body``: u = W u_anchors.

    Every row adds up to one, and affine displacements are reproduced where the anchors around a
    point span its neighbourhood. Returns (points, anchors) ``scipy.sparse.csr_array``.
    """
    from scipy.sparse import csr_array
    from scipy.spatial import KDTree

    count = min(CHOICE, len(anchors.x))
    near = KDTree(anchors.x).query(points, count)[1].reshape(len(points), count)
    start = np.repeat(np.arange(len(points)), count)
    seen = ~surface.crossed(points[start], anchors.x[near.ravel()])
    seen &= anchors.body[near.ravel()] == body[start]
    order = np.argsort(~seen.reshape(near.shape), axis=1, kind="stable")[:, :NEAREST]
    near = np.take_along_axis(near, order, axis=1)
    good = np.take_along_axis(seen.reshape(-1, count), order, axis=1)
    good |= ~good.any(axis=1, keepdims=True)  # where none is seen: the nearest ones
    weights = _moving_least_squares(points, anchors.x[near], good)
    row = np.repeat(np.arange(len(points)), near.shape[1])
    return csr_array((weights.ravel(), (row, near.ravel())), shape=(len(points), len(anchors.x)))


def _moving_least_squares(
    points: Float[np.ndarray, "n 3"],
    around: Float[np.ndarray, "n k 3"],
    good: np.ndarray,
) -> Float[np.ndarray, "n k"]:
    """Weights of sum one and of first moment zero about ``points``, over the ``good`` ones."""
    away = np.linalg.norm(around - points[:, None], axis=2)
    reach = 1.1 * np.where(good, away, 0.0).max(axis=1, keepdims=True) + 1e-300
    theta = np.where(good, (1 - np.minimum(away / reach, 1) ** 2) ** 2 + 1e-6, 0.0)
    theta /= theta.sum(axis=1, keepdims=True)
    centre = np.einsum("nk,nki->ni", theta, around)
    arm = around - centre[:, None]
    spread = np.einsum("nk,nki,nkj->nij", theta, arm, arm)
    inverse = np.linalg.pinv(spread, rcond=FLAT**2, hermitian=True)
    slope = np.einsum("nki,nij,nj->nk", arm, inverse, points - centre)
    return theta * (1 + slope)
