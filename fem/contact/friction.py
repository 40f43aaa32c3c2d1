"""Smoothed Coulomb friction (Li et al. 2020, IPC), its normal forces frozen during a solve."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .sites import Sites


class Slip(NamedTuple):
    """Slip ``y`` (n, 3) [m] along an obstacle, and the functions of it that friction is made of.

    ``over`` is f1(|y|) / |y| [1/m], ``potential`` is f0(|y|) [m].
    """

    y: np.ndarray
    over: np.ndarray
    potential: np.ndarray


class Lagged(NamedTuple):
    """Friction of one obstacle, frozen during a solve.

    ``force`` (n,) is the coefficient times the normal force [N] at the ``sites``, ``normal``
    (n, 3) its direction, ``start`` (n, 3) [m] the displacement from which sliding is counted,
    ``limit`` [m] the slip below which it sticks, ``obstacle`` the number of that one.
    """

    obstacle: int
    sites: Sites
    force: np.ndarray
    normal: np.ndarray
    start: np.ndarray
    limit: float

    def slip(self, u: np.ndarray) -> Slip:
        """Tangential slip at the displacement ``u`` (nodes, 3) [m]."""
        y = self.sites.moved(u) - self.start
        y = y - (y * self.normal).sum(axis=1, keepdims=True) * self.normal
        size, limit = np.linalg.norm(y, axis=1), self.limit
        inside = size < limit
        over = np.where(inside, (2 - size / limit) / limit, 1 / np.maximum(size, limit))
        potential = np.where(inside, size**2 / limit - size**3 / (3 * limit**2) + limit / 3, size)
        return Slip(y, over, potential)

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Derivative of the potential by the place of every site [N], shape (n, 3)."""
        y, over, _ = self.slip(u)
        return (self.force * over)[:, None] * y

    def energy(self, u: np.ndarray) -> float:
        """Potential of friction [J]."""
        return float((self.force * self.slip(u).potential).sum())

    def hessian(self, u: np.ndarray, *, sharp: bool) -> np.ndarray:
        """Positive second derivative at every site [N/m], shape (n, 3, 3).

        A bound, with which Newton creeps but never overshoots; ``sharp``: friction's own, with
        which it arrives at once from near by.
        """
        y, over, _ = self.slip(u)
        flat = over[:, None, None] * (np.eye(3) - outer(self.normal))
        if sharp:  # a slide is pushed back across its direction only
            size = np.linalg.norm(y, axis=1)
            along = y / np.where(size > 0, size, 1.0)[:, None]
            bend = np.where(size < self.limit, 2 * (1 - size / self.limit) / self.limit, 0.0) - over
            flat += bend[:, None, None] * outer(along)
        return self.force[:, None, None] * flat


def outer(n: np.ndarray) -> np.ndarray:
    """Outer product of every row (n, 3) with itself, (n, 3, 3)."""
    return n[:, :, None] * n[:, None, :]
