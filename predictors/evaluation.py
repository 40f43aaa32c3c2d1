"""Evaluation: rows of the paper's metrics on objects, wordings and pairs never trained on."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .dataset.real import RealObject
from .guesses import BASELINES, Guess, Sample, Seen, guess_of
from .held_out import Split, held_out_batches, held_out_text, spoken
from .score import Row, Score, summary, touches_another

__all__ = ["BASELINES", "Row", "Sample", "Seen", "Split", "evaluate"]


def evaluate(
    split: Split,
    predictors: Sequence[str] = ("film", *BASELINES),
    *,
    objects: int = 64,
    cells: int = 64,
    seed: int = 0,
    weights: Path | None = None,
    real: Sequence[RealObject] = (),
    seen: Sequence[Seen | None] = (),
) -> list[Row]:
    """Return one row for each predictor.

    Parameters
    ----------
    split
        "procedural": new shapes, held-out frames, wordings and part/material pairs, no names.
        "validation": ``real`` objects of a source that training never saw, texts about kinds of
        matter and the default template.
    predictors
        Names of rows: film, film-names, those of ``DEPRIVED`` and the ``BASELINES``. Names that
        are given are read as at run time.
    objects, cells, seed
        How many objects, on how fine a grid, drawn how.
    weights
        Checkpoint of the network; the shipped one by default.
    real, seen
        Objects of the validation split, and what an image encoder sees of each, if it was asked.
    """
    text = held_out_text(seed, real=real)
    scores: dict[str, list[Score]] = {name: [] for name in predictors}
    guesses = {name: guess_of(name, text, weights) for name in predictors}
    for names in (False, True):
        asked = [name for name in predictors if (name == "film-names") == names]
        batches = held_out_batches(
            split, text, objects=objects, cells=cells, seed=seed, names=names, real=real
        )
        for index, batch in enumerate(batches if asked else ()):
            if not batch.valued.any():
                continue
            slots = real[index].slots if split == "validation" else ()
            looks = seen[index] if seen else None
            example = Sample(batch, spoken(batch, text), slots if names else (), looks)
            for name in asked:
                scores[name].append(_score(guesses[name], example))
    return [summary(name, split, scores[name]) for name in predictors]


def _score(guess: Guess, example: Sample) -> Score:
    """Compare a predictor with the truth of one object."""
    batch = example.batch
    began = time.perf_counter()
    values, logits = guess(example)
    seconds = time.perf_counter() - began
    wrong = ((values - batch.target) ** 2)[0].numpy()
    valued = batch.valued[0].numpy()
    edge = touches_another(batch.scene.part[0].numpy()) & valued
    mean = wrong.mean(axis=0)
    sides = [float(mean[m].mean()) if m.any() else np.nan for m in (edge, valued & ~edge)]
    right = np.nan
    if logits is not None and batch.bound.any():
        right = float((logits.argmax(1) == batch.clause)[batch.bound].float().mean())
    return Score(
        wrong[:, valued].mean(axis=1), sides[0], sides[1], right, int(batch.mentioned[0]), seconds
    )
