"""Cells of an asset on the network's cube: nothing is lost, nothing depends on how it stands."""

import numpy as np
import pytest
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.unipixie.predictor import Cube


def some_parts(shape=(40, 20, 64), h=0.01, lo=(1.0, -2.0, 3.0)):
    part = np.full(shape, -1)
    part[2:38, 2:18, 2:20] = 0
    part[14:26, 6:14, 20:62] = 1
    return PartVoxels(Grid(np.array(lo), h, shape), part, ("seat", "leg"))


def test_every_cell_has_a_token_of_its_part():
    """A token is of one part, and the shares of what lies in a cell of the cube add to one."""
    parts = some_parts()
    cube = Cube.of(parts, "z", cells=32)
    assert (cube.part[cube.token[:, 0]] == parts.part[parts.occupied]).all()
    assert np.bincount(cube.at, cube.share)[np.unique(cube.at)] == pytest.approx(1)


def test_what_is_the_same_in_a_token_comes_back():
    """Means over tokens, brought back: a value of parts is unchanged, to round-off."""
    parts = some_parts()
    cube = Cube.of(parts, "z", cells=32)
    values = np.array([[1.0, 2.0], [-3.0, 5.0]])[parts.part[parts.occupied]]
    np.testing.assert_allclose(cube.back(cube.tokens(values)), values, rtol=1e-14)


def test_size_and_place_of_the_asset_do_not_count():
    """The same shape, ten times larger and elsewhere, has the same tokens."""
    one = Cube.of(some_parts(), "z", cells=32)
    other = Cube.of(some_parts(h=0.1, lo=(0.0, 0.0, 0.0)), "z", cells=32)
    np.testing.assert_array_equal(one.at, other.at)
    np.testing.assert_allclose(one.place, other.place, atol=1e-12)


def test_the_way_up_is_z():
    """An asset with y up, turned by hand to z up, has the same places."""
    parts = some_parts()
    turned = np.flip(parts.part.transpose(0, 2, 1), 2)  # (x, y, z) -> (x, z, -y)
    lying = PartVoxels(Grid(np.zeros(3), 0.01, turned.shape), turned, parts.part_names)
    standing, lying = Cube.of(parts, "z", cells=32), Cube.of(lying, "y", cells=32)

    def sorted_places(cube):
        return np.array(sorted(map(tuple, cube.place.round(6))))

    np.testing.assert_allclose(sorted_places(standing), sorted_places(lying), atol=1e-6)


def test_the_longest_side_spans_the_cube_but_for_its_rim():
    """30 of 32 cells, as in training."""
    cube = Cube.of(some_parts(), "z", cells=32)
    z = cube.at % 32
    assert (z.min(), z.max()) == (1, 30)


def test_a_coarse_asset_leaves_no_hole():
    """A solid box of 5 x 5 x 5 cells fills a box of the cube's cells."""
    part = np.zeros((5, 5, 5), dtype=int)
    parts = PartVoxels(Grid(np.zeros(3), 0.2, part.shape), part, ("block",))
    cube = Cube.of(parts, "z", cells=16)
    assert len(cube.at) == 14**3
