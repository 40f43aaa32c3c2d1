"""Pieces of one look: what eyes would call one colour is one, a speck is none."""

import numpy as np
from autophyx_tet.predictors.matter import MOST, by_look

PLAIN = [1.0, 0.0, 0.04, 0.6]


def painted(colours, counts, noise=0.0, seed=0):
    """Looks of so many cells of each colour, and the colour of each."""
    which = np.repeat(np.arange(len(colours)), counts)
    rng = np.random.default_rng(seed)
    rgb = np.array(colours)[which] + noise * rng.standard_normal((len(which), 3))
    return np.c_[rgb.clip(0, 1), np.tile(PLAIN, (len(which), 1))], which


def test_two_colours_with_grain_are_two_pieces():
    # .02: the grain of a photograph of paint, some five levels of 255
    looks, which = painted([(0.45, 0.28, 0.15), (0.75, 0.75, 0.78)], [3000, 1000], noise=0.02)
    assert np.array_equal(by_look(looks), which)


def test_panes_of_one_colour_differ_by_their_opacity():
    looks, which = painted([(0.8, 0.8, 0.8)] * 2, [600, 500])
    looks[which == 1, 3] = 0.25
    assert np.array_equal(by_look(looks), which)


def test_a_speck_joins_what_it_is_nearest_to():
    looks, _ = painted([(0.9, 0.1, 0.1), (0.1, 0.1, 0.9), (0.75, 0.2, 0.3)], [5000, 4000, 20])
    found = by_look(looks)
    assert found.max() == 1
    assert set(found[-20:]) == {0}


def test_a_rainbow_is_not_a_hundred_pieces():
    rng = np.random.default_rng(1)
    looks = np.c_[rng.random((4000, 3)), np.tile(PLAIN, (4000, 1))]
    found = by_look(looks)
    assert 1 < found.max() + 1 <= MOST
    assert set(found) == set(range(found.max() + 1))


def test_one_look_is_one_piece():
    looks, _ = painted([(0.6, 0.6, 0.6)], [100])
    assert not by_look(looks).any()
