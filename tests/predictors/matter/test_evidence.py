"""Clauses about matter are dealt out by looks; what speaks of parts, or of nothing, stays."""

import numpy as np
import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.predictors.film.predictor import Frame
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.matter import by_appearance, matters, moved, typed_values
from autophyx_tet.predictors.text.parts import KINDS
from autophyx_tet.research.evaluation.parser import listen

from .test_looks import table


def heard(text):
    return listen(text, load_table()).clauses


@pytest.mark.parametrize(
    ("text", "kinds"),
    [
        ("the metal is zinc", ["metal"]),
        ("walnut and brass", ["wood", "metal"]),
        ("the legs are oak", [None]),
        ("the glass is soda-lime glass, the seat is soft", ["glass", None]),
    ],
)
def test_clauses_about_matter(text, kinds):
    found = [None if k < 0 else KINDS[k] for k in matters(heard(text))]
    assert found == kinds


def given(columns, seed=0):
    cells, looks, piece = table()
    shares = np.random.default_rng(seed).dirichlet(np.ones(columns), len(cells))
    return shares, cells, looks, piece


def test_glass_goes_to_the_clear_top_and_wood_to_the_legs():
    shares, cells, looks, piece = given(3)
    kinds = np.array([KINDS.index("wood"), KINDS.index("glass")])
    dealt = by_appearance(shares, kinds, cells, looks, piece, parts=False)
    right = np.where(piece == 0, dealt[:, 1] > dealt[:, 0], dealt[:, 0] > dealt[:, 1])
    assert right.mean() > 0.9  # of cells whose shares say nothing; half without looks
    assert dealt.sum(axis=1) == pytest.approx(1)
    assert dealt[:, 2] == pytest.approx(shares[:, 2])


def test_parts_keep_what_they_have_and_one_kind_its_own_ratio():
    """Columns: wood, glass, another wood, a part, none."""
    shares, cells, looks, piece = given(5)
    wood, glass = KINDS.index("wood"), KINDS.index("glass")
    dealt = by_appearance(
        shares, np.array([wood, glass, wood, -1]), cells, looks, piece, parts=False
    )
    assert dealt[:, 3:] == pytest.approx(shares[:, 3:])
    assert dealt[:, 0] / dealt[:, 2] == pytest.approx(shares[:, 0] / shares[:, 2])


def test_of_parts_each_kind_that_is_spoken_of_is_likely_to_have_one():
    """Neither fits; the part where stone loses least by it gains e^1 in its odds, and no other."""
    shares, cells, looks, piece = given(3)
    kinds = np.array([KINDS.index("paper"), KINDS.index("stone")])
    made, found = (
        by_appearance(shares, kinds, cells, looks, piece, parts=parts) for parts in (True, False)
    )
    gained = np.log(made[:, 1] / made[:, 0]) - np.log(found[:, 1] / found[:, 0])
    each = [gained[piece == i] for i in (0, 1)]
    assert all(np.ptp(one) < 1e-9 for one in each)  # round-off
    assert sorted(one[0] for one in each) == pytest.approx([-1, 1])


@pytest.mark.parametrize("kinds", [["wood", "wood"], ["wood", None]])
def test_one_kind_alone_is_left_to_the_network(kinds):
    shares, cells, looks, piece = given(3)
    numbers = np.array([-1 if k is None else KINDS.index(k) for k in kinds])
    assert np.array_equal(by_appearance(shares, numbers, cells, looks, piece, parts=True), shares)


def test_a_thing_without_colours_is_left_to_the_network():
    shares, cells, _, piece = given(3)
    numbers = np.array([KINDS.index("wood"), KINDS.index("glass")])
    grey = np.tile([0.6, 0.6, 0.6, 1, 0, 0.04, 0.6], (len(cells), 1))
    assert np.array_equal(by_appearance(shares, numbers, cells, grey, piece, parts=True), shares)


def test_a_cell_that_a_clause_gets_whole_has_its_values():
    told = typed_values(heard("walnut, brass"), load_table(), DEFAULT)
    gained = np.array([[0.3, -0.3, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    found = moved(told[[0, 0, 1]], gained, told)
    assert found[0] == pytest.approx(told[0] + 0.3 * (told[0] - told[1]))
    assert found[1:] == pytest.approx(told[[1, 1]])


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_upright_cells_are_those_of_the_frame(up):
    part = np.full((5, 6, 7), -1)
    part[1:4, 2:5, 1:6] = 0
    part[1, 2, 1] = -1  # no symmetry
    grid = Grid(np.zeros(3), 0.1, part.shape)
    frame = Frame.of(PartVoxels(grid, part, ("whole",)), up)
    cells = frame.upright(np.argwhere(part >= 0), part.shape)
    turned = np.flip(part.transpose(frame.axes), frame.flip)
    assert (turned[tuple(cells.T)] == 0).all()
    assert len(np.unique(cells, axis=0)) == (part == 0).sum()
