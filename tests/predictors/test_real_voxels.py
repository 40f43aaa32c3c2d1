"""Real objects as voxels: a closed surface leaves no hole in what it encloses."""

import numpy as np
import pytest
import trimesh
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.research.datasets.real import CELLS, cube, voxelise
from autophyx_tet.research.datasets.shapes import EMPTY


@pytest.mark.slow
def test_closed_flat_boxes_are_filled():
    """Boards of three to six cells in any pose: every cell whose centre is inside is filled.

    Two triangles a side, the largest faces that there are; nothing beyond a cell's diagonal is.
    """
    rng = np.random.default_rng(0)
    for _ in range(8):
        size = np.array([1.0, rng.uniform(0.4, 1.0), rng.uniform(0.05, 0.1)])
        board = trimesh.creation.box(size)
        turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
        asset = Asset("board", (Part("board", board.copy().apply_transform(turn)),))
        filled = voxelise(asset, "board", "test").label != EMPTY
        lo, h = cube(asset)
        centres = lo + h * (np.argwhere(np.ones((CELLS,) * 3, dtype=bool)) + 0.5)
        depth = (size / 2 - np.abs(centres @ turn[:3, :3])).min(axis=1).reshape(filled.shape)
        assert filled[depth > 0].all()
        assert not filled[depth < -(3**0.5) * h].any()
