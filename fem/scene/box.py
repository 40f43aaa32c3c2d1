"""A box of tets: the analytic body of tests, benchmarks and examples."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from .mesh import TetMesh


def box_mesh(size: Sequence[float], cells: Sequence[int], *, lo=(0.0, 0.0, 0.0)) -> TetMesh:
    """Box of ``size`` [m] at ``lo`` [m]; Kuhn's 6 tets in each of ``cells`` = (nx, ny, nz)."""
    nx, ny, nz = cells
    axes = [o + np.linspace(0, s, n + 1) for o, s, n in zip(lo, size, cells, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    ids = np.arange(len(points)).reshape(nx + 1, ny + 1, nz + 1)
    corner = ids[:-1, :-1, :-1].reshape(-1)
    step = np.array([(ny + 1) * (nz + 1), nz + 1, 1])
    tets = []
    for order in itertools.permutations(range(3)):
        path = np.concatenate([[0], np.cumsum(step[list(order)])])
        tets.append(corner[:, None] + path)
    return TetMesh.oriented(points, np.stack(tets, axis=1).reshape(-1, 4))
