"""A scan in one piece whose text names matter and no part: looks tell what is what."""

import numpy as np
import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.appearance.features import Appearance
from autophyx_tet.predictors.assign import predict_materials
from autophyx_tet.predictors.film.predictor import FilmPredictor
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.predictors.text.reader import read_sentence

from .test_looks import table


@pytest.mark.slow
@pytest.mark.parametrize("text", ["oak and glass", "the glass is soda-lime glass, the wood is oak"])
def test_a_clear_top_is_glass_and_brown_legs_are_oak(text):
    cells, looks, piece = table()
    part = np.full((44, 44, 44), -1)
    part[tuple((cells + 2).T)] = 0
    seen = np.zeros((*part.shape, 7), dtype=np.float32)
    seen[part == 0] = looks
    parts = PartVoxels(Grid(np.zeros(3), 0.02, part.shape), part, ("scan",))
    found = predict_materials(
        parts, read_sentence(text, parts.part_labels, load_table()), predictor=FilmPredictor(),
        appearance=lambda: Appearance(seen[..., :3], finish=seen[..., 3:]),
    )  # fmt: skip
    E = found.field.E[part == 0]
    # Of oak along its grain E is below 15 GPa, of glasses above 45: a line between, in the middle.
    right = np.where(piece == 0, E > 25e9, E < 25e9)
    assert right.mean() > 0.95  # smoothing takes cells at the joints
