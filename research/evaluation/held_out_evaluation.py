"""Evaluation on what training never saw: rows of the paper's metrics, object by object."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from ...fem.errors import ConvergenceError, UsageError
from ...predictors.encoders import TextEncoder
from .held_out import HeldOutObject, HeldOutSet
from .metrics import Row, Score, against_best, boundary_voxels, summary
from .rows import BASELINES, DEFAULT_ROWS, ROWS, Setting, VoxelPredictor
from .sag_render import SagRender
from .ssim import ImageSimilarity

log = logging.getLogger(__name__)


def evaluate_held_out(
    held_out: HeldOutSet,
    predictors: Sequence[str] = DEFAULT_ROWS,
    *,
    weights: Path | None = None,
    words: TextEncoder | None = None,
    renders: int = 0,
    swing: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> list[Row]:
    """Return one row for each predictor; an object's score is the mean over its texts.

    Parameters
    ----------
    held_out
        The objects, and what is said of them.
    predictors
        Names of ``ROWS``. Names of parts that are given are read as at run time.
    weights
        Checkpoint of the network; the shipped one by default.
    words
        Those of the image encoder that sees the objects, the embedded one's by default.
    renders
        How many of the objects are put under load too, to compare pictures (``sag_render``).
    swing
        Whether these are of a motion, 8 frames of the true body's first period, not of the rest.
    progress
        Called with what is scored and the seconds so far.
    """
    if swing and not renders:
        raise UsageError("--swing says how --renders N objects are compared: give that too")
    contenders = {name: ROWS[name] for name in predictors}
    text = held_out.text_table()
    setting = Setting(text, weights, words)
    built = {name: contender.build(setting) for name, contender in contenders.items()}
    scores: dict[str, dict[int, list[Score]]] = {name: {} for name in predictors}
    began = time.monotonic()
    for draw, names in product(range(held_out.texts), (False, True)):
        asked = [name for name, contender in contenders.items() if contender.names == names]
        for index, example in held_out.drawn(text, draw=draw, names=names) if asked else ():
            sag = _sag(example, swing) if index < renders and not draw else None
            for name in asked:
                if progress:
                    progress(f"{name}, object {index + 1}", time.monotonic() - began)
                scores[name].setdefault(index, []).append(_score(built[name], example, sag))
    rows = [summary(name, held_out.split, list(scores[name].values())) for name in predictors]
    return against_best(rows, scores, BASELINES)


def _score(predict: VoxelPredictor, example: HeldOutObject, sag: SagRender | None) -> Score:
    """Compare a predictor with the truth of one object."""
    batch = example.batch
    began = time.perf_counter()
    values, logits = predict(example)
    seconds = time.perf_counter() - began
    wrong = ((values - batch.target) ** 2)[0].numpy()
    valued = batch.valued[0].numpy()
    edge = boundary_voxels(batch.scene.part[0].numpy()) & valued
    mean = wrong.mean(axis=0)
    sides = [float(mean[m].mean()) if m.any() else np.nan for m in (edge, valued & ~edge)]
    right, largest = np.nan, np.nan
    if logits is not None and batch.bound.any():
        bound = batch.clause[batch.bound]
        right = float((logits.argmax(1)[batch.bound] == bound).float().mean())
        largest = float(bound.bincount().max()) / len(bound)
    return Score(
        wrong[:, valued].mean(axis=1), sides[0], sides[1], right, int(batch.mentioned[0]), seconds,
        None if sag is None else _similarity(sag, example, values[0].numpy()), largest,
    )  # fmt: skip


def _sag(example: HeldOutObject, swing: bool) -> SagRender | None:
    """The true object under its load, None where the solver finds no answer."""
    part, truth = example.batch.scene.part[0].numpy(), example.batch.target[0].numpy()
    try:
        return SagRender(part, _whole(example, truth), swing=swing)
    except ConvergenceError as error:
        log.warning("an object is not rendered: %s", error)
        return None


def _similarity(
    sag: SagRender, example: HeldOutObject, values: np.ndarray
) -> ImageSimilarity | None:
    try:
        return sag.similarity(_whole(example, values))
    except ConvergenceError as error:
        log.warning("a prediction is not rendered: %s", error)
        return None


def _whole(example: HeldOutObject, values: np.ndarray) -> np.ndarray:
    """Values (x, y, z, 3) where the truth is known; elsewhere, for all, the mean of the truth."""
    truth, known = example.batch.target[0].numpy(), example.batch.valued[0].numpy()
    mean = truth[:, known].mean(axis=1)
    return np.where(known[..., None], np.moveaxis(values, 0, -1), mean)
