"""Whether a network that says "80 % sure" is right four times in five."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...predictors.film.predictor import Calibration, log_odds
from .held_out import HeldOutObject, HeldOutSet
from .rows import ROWS, Setting

LEAST = 20  # answers of a bin, for its share of right ones to be known to a tenth
WITHIN = 0.1  # "in 7 of 10" is told in tenths


class Answer(NamedTuple):
    """The clause found for a part: its share there, whether it is the one, of what object."""

    share: float
    right: bool
    index: int


class Bin(NamedTuple):
    """Answers of like certainty: how many, their mean certainty, the share that is right."""

    low: float
    high: float
    count: int
    said: float
    right: float


def answers(held_out: HeldOutSet, row: str = "film") -> Iterator[Answer]:
    """Yield the answer of a row of the evaluation for every part whose clause is known.

    Not of objects with more clauses than parts, whose cells decide each for itself.
    """
    text = held_out.text_table()
    predict = ROWS[row].build(Setting(text))
    for draw in range(held_out.texts):
        for index, example in held_out.drawn(text, draw=draw):
            scene = example.batch.scene
            if int(scene.clause_mask.sum()) <= int(scene.part.max()) + 1:
                _, logits = predict(example)
                yield from _of_parts(example, logits.softmax(1)[0].numpy(), index)


def _of_parts(example: HeldOutObject, shares: np.ndarray, index: int) -> Iterator[Answer]:
    batch = example.batch
    part, bound = batch.scene.part[0].numpy(), batch.bound[0].numpy()
    clause = batch.clause[0].numpy()
    for p in range(part.max() + 1):
        cells = (part == p) & bound
        if cells.any():
            mean = shares[:, cells].mean(axis=1)
            wanted = np.bincount(clause[cells]).argmax()
            yield Answer(float(mean.max()), bool(mean.argmax() == wanted), index)


def fit(given: Sequence[Answer]) -> Calibration:
    """Fit p = logistic(slope log-odds(share) + offset) to the answers: Platt (1999)."""
    from scipy.optimize import minimize

    x = log_odds(np.array([answer.share for answer in given]))
    right = np.array([answer.right for answer in given], dtype=float)
    # Platt's targets: an event seen n times of n is not certain.
    hits, misses = right.sum(), len(right) - right.sum()
    target = np.where(right > 0, (hits + 1) / (hits + 2), 1 / (misses + 2))

    def loss(line: np.ndarray) -> float:
        z = line[0] * x + line[1]
        return float(np.mean(np.logaddexp(0, z) - target * z))

    slope, offset = minimize(loss, np.array([1.0, 0.0])).x
    return Calibration(float(slope), float(offset))


def curve(certainty: Float[np.ndarray, "n"], right: Sequence[bool], *, bins: int = 10) -> list[Bin]:
    """Return the answers in bins of certainty from 0 to 1, without those that are empty."""
    edges = np.linspace(0, 1, bins + 1)
    which = np.clip(np.digitize(certainty, edges) - 1, 0, bins - 1)
    correct = np.asarray(right, dtype=float)
    return [
        Bin(
            float(edges[b]), float(edges[b + 1]), int((which == b).sum()),
            float(certainty[which == b].mean()), float(correct[which == b].mean()),
        )
        for b in range(bins)
        if (which == b).any()
    ]  # fmt: skip


def expected_error(bins: Sequence[Bin]) -> float:
    """Expected calibration error: mean |said - right| over the answers."""
    return sum(b.count * abs(b.said - b.right) for b in bins) / sum(b.count for b in bins)


def borne_out(bins: Sequence[Bin]) -> list[tuple[float, float]]:
    """Spans of certainty in which ``LEAST`` answers or more are right as often as is said."""
    spans: list[tuple[float, float]] = []
    for b in bins:
        if b.count >= LEAST and abs(b.said - b.right) <= WITHIN:
            joins = bool(spans) and np.isclose(spans[-1][1], b.low)
            low = spans.pop()[0] if joins else b.low
            spans.append((round(low, 3), round(b.high, 3)))
    return spans
