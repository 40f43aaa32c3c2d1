"""Cells of a grid as tets, and in blocks: what pictures of sag and audits are computed on."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from ..fem.mesh import TetMesh, box_mesh

TETS_PER_CELL = 6


def voxel_mesh(occupied: Bool[np.ndarray, "x y z"]) -> TetMesh:
    """Six tets in every occupied cell, in C order; the grid's longest side is 1 m."""
    shape = np.array(occupied.shape)
    box = box_mesh((shape / shape.max()).tolist(), occupied.shape)
    tets = box.tets[np.repeat(occupied.ravel(), TETS_PER_CELL)]
    used, corner = np.unique(tets, return_inverse=True)
    return TetMesh.oriented(box.points[used], corner.reshape(-1, 4))


def blocks(values: np.ndarray, cells: int) -> np.ndarray:
    """Voxels (x, y, z, ...) by block (a, b, d, voxels, ...), at most ``cells`` blocks a side.

    Zeros, which are outside, fill what is missing to whole blocks.
    """
    size = -(-max(values.shape[:3]) // cells)
    rest_of = values.shape[3:]
    pad = [(0, -n % size) for n in values.shape[:3]] + [(0, 0)] * len(rest_of)
    values = np.pad(values, pad)
    a, b, d = (n // size for n in values.shape[:3])
    split = values.reshape(a, size, b, size, d, size, *rest_of)
    return np.moveaxis(split, (1, 3, 5), (3, 4, 5)).reshape(a, b, d, size**3, *rest_of)
