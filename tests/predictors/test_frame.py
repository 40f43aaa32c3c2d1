"""Laws of the network's frame: upright, of the size of training, and no cell is lost on the way."""

import numpy as np
import pytest
from autophyx_tet.predictors.film.predictor import Frame
from autophyx_tet.predictors.grid import Grid, PartVoxels


def voxels(part) -> PartVoxels:
    names = tuple(f"p{i}" for i in range(int(part.max()) + 1))
    return PartVoxels(Grid(np.zeros(3), 0.01, part.shape), part, names)


@pytest.mark.slow
@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_up_to_64_cells_are_seen_one_by_one(up):
    """Each slice along each axis a part of its own: all come into the frame and back again."""
    for cells in (48, 62, 63, 64):
        for axis in range(3):
            shape = np.full(3, 20)
            shape[axis] = cells
            part = np.full(shape + 2, -1)
            line = np.arange(cells).reshape([-1 if a == axis else 1 for a in range(3)])
            part[1:-1, 1:-1, 1:-1] = line
            frame = Frame.of(voxels(part), up)
            seen = frame.forward(part, outside=-1)
            assert seen.shape == (64, 64, 64)
            assert set(seen.ravel()) == set(part.ravel()), (cells, axis)
            assert (frame.back(seen, voxels(part))[part >= 0] == part[part >= 0]).all()


def test_of_a_finer_grid_nothing_falls_between_the_cells():
    """Sheets of one cell, free or inside a block, are there at any number of cells above 64."""
    for cells in (65, 70, 100, 130):
        part = np.full((cells, 24, 24), -1)
        part[:, :12, :12] = 0
        sheets = np.arange(0, cells, 5)
        part[sheets, 12:, 12:] = 1  # in the air
        part[sheets[:, None], 4, 4] = 1 + np.arange(1, len(sheets) + 1)[:, None]  # inside
        frame = Frame.of(voxels(part), "z")
        seen = frame.forward(part, outside=-1)
        back = frame.back(seen, voxels(part))
        assert (back[part >= 0] >= 0).all(), cells
        assert set(seen.ravel()) == set(part.ravel()), cells


def test_a_small_grid_grows_to_the_size_of_training():
    """20 cells become 62 along the longest side, each two to four times, none another's."""
    part = np.arange(20 * 10 * 5).reshape(20, 10, 5)
    frame = Frame.of(voxels(part), "z")
    assert max(frame.inside) == 62
    assert (frame.back(frame.forward(part, outside=-1), voxels(part)) == part).all()
