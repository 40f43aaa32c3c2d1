"""The predictor with its shipped weights: words stay, the rest moves from soft to stiff."""

import numpy as np
import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.appearance.features import Appearance
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.text.reader import parse
from autophyx_tet.predictors.unipixie.predictor import UniPixiePredictor

pytestmark = pytest.mark.slow  # network, encoder and reader are loaded


@pytest.fixture(scope="module")
def predictor():
    return UniPixiePredictor()


@pytest.fixture(scope="module")
def parts():
    """A plate on a post, with names that say nothing."""
    part = np.full((24, 24, 30), -1)
    part[10:14, 10:14, 1:24] = 1
    part[2:22, 2:22, 24:28] = 0
    return PartVoxels(Grid(np.zeros(3), 0.02, part.shape), part, ("Mesh_01", "Mesh_02"))


def predicted(predictor, parts, text="", **options):
    names = tuple(name for labels in parts.part_labels for name in labels)
    return predictor.predict(parts, parse(text, load_table(), names), **options)


def test_what_nothing_names_moves_from_soft_to_stiff(predictor, parts):
    """E of every cell rises with alpha, and lies in the range that is given with it."""
    made = [predicted(predictor, parts, alpha=alpha) for alpha in (0.0, 0.5, 1.0)]
    inside = parts.occupied
    E = np.array([one.field.E[inside] for one in made])
    assert (np.diff(E, axis=0) > 0).all()
    ranges = made[1].field.ranges
    assert ranges is not None
    low, high = ranges.E[inside].T
    slack = 1 + 1e-9  # round-off
    assert ((E >= low / slack) & (E <= high * slack)).all()
    assert all(choice.network == "UniPixie" and choice.guessed for choice in made[1].choices)


def test_it_says_that_it_guesses(predictor, parts):
    doubts = list(predicted(predictor, parts).doubts())
    assert [name for name in parts.part_names if any(name in doubt for doubt in doubts)] == [
        "Mesh_01", "Mesh_02",
    ]  # fmt: skip


def test_what_a_clause_names_stays_its_row(predictor, parts):
    """The clause's row at alpha, whatever the network finds."""
    made = predicted(predictor, parts, "Mesh_01 is oak", alpha=1.0)
    oak = made.choices[0]
    assert oak.settled
    assert oak.value == oak.row.value(1.0)
    assert "oak" in oak.row.name


def test_colour_is_evidence(predictor, parts):
    """A leaf's green and a copper's red are not taken for the same matter."""
    found = []
    for colour in ((0.25, 0.45, 0.15), (0.85, 0.55, 0.45)):
        seen = Appearance(colours=np.broadcast_to(colour, (*parts.part.shape, 3)).copy())
        found.append(predicted(predictor, parts, appearance=lambda seen=seen: seen).choices[0])
    assert found[0].value.E < found[1].value.E / 1.5
