"""What is measured of a piece: colours against the standard's, form against exact solids."""

import numpy as np
import pytest
from autophyx_tet.predictors.matter import FEATURES, lab, measure

OPAQUE = [1.0, 0.0, 0.04, 0.6]


def table():
    """A top of 40 x 40 x 4 cells on four legs of 4 x 4 x 36: cells, looks and pieces."""
    solid = np.full((40, 40, 40), -1)
    solid[:, :, 36:] = 0
    for x in (0, 36):
        for y in (0, 36):
            solid[x : x + 4, y : y + 4, :36] = 1
    cells = np.argwhere(solid >= 0)
    piece = solid[tuple(cells.T)]
    looks = np.where(
        piece[:, None] == 0, [0.8, 0.9, 0.9, 0.2, 0.0, 0.3, 0.1], [0.4, 0.25, 0.1, *OPAQUE]
    )
    return cells, looks, piece


@pytest.mark.parametrize(
    ("rgb", "expected"),
    [  # of sRGB's primaries under D65, to the digits that tables of CIE 15 print
        ((1, 1, 1), (100.0, 0.0, 0.0)),
        ((1, 0, 0), (53.24, 80.09, 67.20)),
        ((0, 1, 0), (87.73, -86.18, 83.18)),
        ((0, 0, 1), (32.30, 79.19, -107.86)),
        ((0, 0, 0), (0.0, 0.0, 0.0)),
    ],
)
def test_primaries_have_their_lab(rgb, expected):
    assert lab(np.array([rgb], dtype=float))[0] == pytest.approx(expected, abs=0.02)


def test_form_of_a_table():
    cells, looks, piece = table()
    found = [dict(zip(FEATURES, row, strict=True)) for row in measure(cells, looks, piece)]
    top, legs = found
    assert top["share"] == pytest.approx(6400 / (6400 + 2304))
    assert np.exp(legs["log pieces"]) == pytest.approx(4)
    # Of a box filled to the last cell; and the variance of a length n over a whole of 40.
    assert top["log fill"] == pytest.approx(0)
    assert np.exp(top["log variance 1"]) == pytest.approx((40**2 - 1) / 12 / 40**2 + 1e-5)
    assert (top["lowest"], top["highest"]) == pytest.approx((0.9, 1.0))
    assert (legs["lowest"], legs["height"]) == pytest.approx((0.0, 17.5 / 40))
    assert (top["opacity"], legs["opacity"]) == pytest.approx((0.2, 1.0))
    assert legs["reflectance"] == pytest.approx(0.04)


def test_where_a_thing_lies_is_nothing():
    cells, looks, piece = table()
    moved = measure(cells + np.array([3, 5, 7]), looks, piece)
    assert moved == pytest.approx(measure(cells, looks, piece))
