"""Evaluation: rows of the paper's metrics on objects, wordings and pairs never trained on."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...fem.errors import ConvergenceError
from ..datasets.real import RealObject
from ..encoders.protocol import TextEncoder
from .baselines import BASELINES, Guess, Sample, Seen, guess_of
from .held_out import Split, held_out_batches, held_out_text, spoken
from .metrics import Row, Score, against_best, summary, touches_another
from .sag_render import Stage
from .ssim import Likeness

if TYPE_CHECKING:
    from ..training.batch import Batch

__all__ = ["BASELINES", "Row", "Sample", "Seen", "Split", "evaluate"]

log = logging.getLogger(__name__)


def evaluate(
    split: Split,
    predictors: Sequence[str] = ("film", *BASELINES),
    *,
    objects: int = 64,
    cells: int = 64,
    seed: int = 0,
    texts: int = 1,
    weights: Path | None = None,
    real: Sequence[RealObject] = (),
    seen: Sequence[Seen | None] = (),
    words: TextEncoder | None = None,
    renders: int = 0,
    progress: Callable[[str, float], None] | None = None,
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
    texts
        How often something is said of each object: its score is the mean.
    weights
        Checkpoint of the network; the shipped one by default.
    real, seen, words
        Objects of the validation split; what an image encoder sees of each, if it was asked; and
        the words of that encoder, the embedded one's by default.
    renders
        How many of the objects are put under load too, to compare pictures (``sagging``).
    progress
        Called with what is scored and the seconds so far.
    """
    text = held_out_text(seed, real=real)
    scores: dict[str, dict[int, list[Score]]] = {name: {} for name in predictors}
    guesses = {name: guess_of(name, text, weights, words) for name in predictors}
    began = time.monotonic()
    for draw, names in product(range(texts), (False, True)):
        asked = [name for name in predictors if (name == "film-names") == names]
        batches = held_out_batches(
            split, text, objects=objects, cells=cells, seed=seed, draw=draw, names=names, real=real
        )
        for index, batch in enumerate(batches if asked else ()):
            if not batch.valued.any():
                continue
            slots = real[index].slots if split == "validation" else ()
            looks = seen[index] if seen else None
            example = Sample(batch, spoken(batch, text), slots if names else (), looks)
            stage = _stage(batch) if index < renders and not draw else None
            for name in asked:
                if progress:
                    progress(f"{name}, object {index + 1}", time.monotonic() - began)
                score = _score(guesses[name], example, stage)
                scores[name].setdefault(index, []).append(score)
    rows = [summary(name, split, list(scores[name].values())) for name in predictors]
    return against_best(rows, scores, BASELINES)


def _score(guess: Guess, example: Sample, stage: Stage | None) -> Score:
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
        wrong[:, valued].mean(axis=1), sides[0], sides[1], right, int(batch.mentioned[0]), seconds,
        None if stage is None else _seen(stage, batch, values[0].numpy()),
    )  # fmt: skip


def _stage(batch: Batch) -> Stage | None:
    """The true object under its load, None where the solver finds no answer."""
    try:
        return Stage(batch.scene.part[0].numpy(), _whole(batch, batch.target[0].numpy()))
    except ConvergenceError as error:
        log.warning("an object is not rendered: %s", error)
        return None


def _seen(stage: Stage, batch: Batch, values: np.ndarray) -> Likeness | None:
    try:
        return stage.likeness(_whole(batch, values))
    except ConvergenceError as error:
        log.warning("a prediction is not rendered: %s", error)
        return None


def _whole(batch: Batch, values: np.ndarray) -> np.ndarray:
    """Values (x, y, z, 3) where the truth is known; elsewhere, for all, the mean of the truth."""
    truth, known = batch.target[0].numpy(), batch.valued[0].numpy()
    mean = truth[:, known].mean(axis=1)
    return np.where(known[..., None], np.moveaxis(values, 0, -1), mean)
