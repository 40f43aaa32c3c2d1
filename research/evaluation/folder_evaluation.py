"""Scores of predictors on a folder of objects: the whole way from a text to a field."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...fem.errors import UsageError
from ...predictors.appearance.features import Appearance
from ...predictors.field import DEFAULT, MaterialField
from ...predictors.film.predictor import FilmPredictor
from ...predictors.grid import PartVoxels
from ...predictors.resolve.resolve import RetrievalPredictor
from ...predictors.text.reader import parse
from .examples import Example, load_examples
from .mass_errors import MassErrors, mass_errors
from .metrics import Row, Score, boundary_voxels, summary
from .parser import listen

FOLDER_ROWS = ("film", "film-names", "retrieval", "retrieval-names")

# An object and a text in, a field out.
FieldPredictor = Callable[[Example, str], MaterialField]


class FolderScores(NamedTuple):
    """Rows of the table, and errors of the masses where objects were weighed."""

    rows: list[Row]
    masses: dict[str, MassErrors]


def evaluate_folder(
    folder: Path, predictors: Sequence[str] = FOLDER_ROWS, *, weights: Path | None = None
) -> FolderScores:
    """Score predictors on the objects of a folder (``examples``), each under all of its texts.

    ``film`` and ``retrieval`` do not see the names of the parts, their ``-names`` rows do. Values
    come from the network alone: nothing is looked up in the table after it.
    """
    examples = load_examples(folder)
    chosen = {name: _predictor(name, weights) for name in predictors}
    rows, masses = [], {}
    for name, predict in chosen.items():
        scores, truth, found = [], [], []
        for example in examples:
            scores.append([])
            for index, text in enumerate(example.texts):
                began = time.perf_counter()
                field = predict(example, text)
                scores[-1].append(_score(example, index, field, time.perf_counter() - began))
                if example.mass is not None:
                    truth.append(example.mass)
                    cells = field.rho[example.parts.occupied]
                    found.append(float(cells.sum()) * example.parts.grid.h**3)
        rows.append(summary(name, str(folder), scores))
        if truth:
            masses[name] = mass_errors(np.array(truth), np.array(found))
    return FolderScores(rows, masses)


def _predictor(name: str, weights: Path | None) -> FieldPredictor:
    """Return the predictor of a row: the one place here that knows predictors by name."""
    if name not in FOLDER_ROWS:
        raise UsageError(f"unknown row {name!r}: wanted one of {', '.join(FOLDER_ROWS)}")
    named = name.endswith("-names")
    film = FilmPredictor(weights=weights) if name.startswith("film") else None
    retrieval = RetrievalPredictor()

    def predict(example: Example, text: str) -> MaterialField:
        parts = example.parts
        if not named:
            parts = with_names(parts, [f"part {i + 1}" for i in range(len(parts.part_names))])
        if film is None:
            return retrieval.predict(
                parts, parse(text, retrieval.lookup.table, parts.part_names)
            ).field
        colours = None if example.colours is None else example.colours[parts.part.clip(min=0)]
        seen = Appearance(colours=colours)
        sentence = listen(text, film.table)
        return film.field(parts, sentence, up=example.up, names=named, appearance=seen)

    return predict


def _score(example: Example, index: int, field: MaterialField, seconds: float) -> Score:
    """Compare a field with the truth under one text."""
    part = example.parts.part
    truth = np.full((*part.shape, 3), np.nan)
    truth[part >= 0] = example.values[index][part[part >= 0]]
    known = np.isfinite(truth).all(axis=-1)
    if not known.any():
        raise UsageError(f"{example.name}: no part has a known value under text {index}")
    found = np.stack([field.E[known], field.nu[known], field.rho[known]], axis=-1)
    wrong = np.square(
        DEFAULT.normalise(*np.moveaxis(found, -1, 0))
        - DEFAULT.normalise(*np.moveaxis(truth[known], -1, 0))
    )
    edge = boundary_voxels(part)[known]
    sides = [float(wrong[m].mean()) if m.any() else np.nan for m in (edge, ~edge)]
    return Score(wrong.mean(axis=0), sides[0], sides[1], np.nan, 0, seconds)


def with_names(parts: PartVoxels, names: Sequence[str]) -> PartVoxels:
    """Return the parts under other names: to hide what they are called, or to tell it."""
    return replace(parts, part_names=tuple(names), labels=())
