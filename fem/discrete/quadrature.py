"""Quadrature rules of a tet, in barycentric coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Quadrature(NamedTuple):
    """Barycentric ``points`` (n, 4) and ``weights`` (n,), which sum to 1."""

    points: np.ndarray
    weights: np.ndarray


CENTROID = np.full((1, 4), 0.25)
# Four-point rule of equal weights, exact for degree 2: barycentric coordinates of point q are b
# everywhere but a at corner q.
_A, _B = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
TET_POINTS = np.full((4, 4), _B) + (_A - _B) * np.eye(4)


def element_points(order: int) -> np.ndarray:
    """Points (n, 4) of equal weights that integrate the stiffness of P1 or P2 tets exactly."""
    return TET_POINTS if order == 2 else CENTROID


def duffy_rule() -> Quadrature:
    """Rule that is exact to degree 5: Duffy's map of Gauss points."""
    t, w = np.polynomial.legendre.leggauss(4)
    t, w = (t + 1) / 2, w / 2
    a, b, c = (v.ravel() for v in np.meshgrid(t, t, t, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel() * (1 - a) ** 2 * (1 - b) * 6
    x, y, z = a, (1 - a) * b, (1 - a) * (1 - b) * c
    return Quadrature(np.stack([1 - x - y - z, x, y, z], axis=1), weight)
