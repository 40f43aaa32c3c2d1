"""Scores of one object, and the row of the table that they add up to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from ..fem.errors import UsageError

_BOOTSTRAP = 1000  # resamples of the objects, for 95 % intervals


@dataclass(frozen=True)
class Row:
    """One line of the table; errors are mean squared errors of values normalised to [-1, 1].

    ``interval`` is the 95 % bootstrap interval of ``mse_mean`` over the objects; ``boundary_ratio``
    the error of voxels that touch another part over that of the others.
    """

    predictor: str
    split: str
    mse_E: float
    mse_nu: float
    mse_rho: float
    mse_mean: float
    clause_accuracy: float | None
    boundary_ratio: float
    objects: int
    seconds_per_object: float
    interval: tuple[float, float]
    by_clauses: dict[int, float]

    def to_dict(self) -> dict:
        """Plain data for JSON."""
        return asdict(self)


class Score(NamedTuple):
    """Of one object: errors (3,), those at boundaries and inside, accuracy, clauses, seconds."""

    errors: np.ndarray
    edge: float
    inner: float
    right: float
    clauses: int
    seconds: float


def summary(name: str, split: str, scores: Sequence[Score]) -> Row:
    """Summarise the objects of one predictor."""
    if not scores:
        raise UsageError(f"no object of the {split} split has a known value: give more objects")
    errors = np.array([score.errors for score in scores])
    means, clauses = errors.mean(axis=1), np.array([score.clauses for score in scores])
    rng = np.random.default_rng(0)
    draws = rng.integers(len(means), size=(_BOOTSTRAP, len(means)))
    low, high = np.percentile(means[draws].mean(axis=1), [2.5, 97.5])
    sides = np.array([(score.edge, score.inner) for score in scores])
    sides = sides[~np.isnan(sides).any(axis=1)]
    edge, inner = sides.mean(axis=0) if len(sides) else (np.nan, np.nan)
    right = [score.right for score in scores if not np.isnan(score.right)]
    mse_E, mse_nu, mse_rho = errors.mean(axis=0).tolist()
    return Row(
        predictor=name,
        split=split,
        mse_E=mse_E,
        mse_nu=mse_nu,
        mse_rho=mse_rho,
        mse_mean=float(means.mean()),
        clause_accuracy=float(np.mean(right)) if right else None,
        boundary_ratio=float(edge / max(inner, 1e-9)),
        objects=len(means),
        seconds_per_object=float(np.mean([score.seconds for score in scores])),
        interval=(float(low), float(high)),
        by_clauses={int(k): float(means[clauses == k].mean()) for k in np.unique(clauses)},
    )


def touches_another(part: np.ndarray) -> np.ndarray:
    """Voxels with a neighbour of another part among the six."""
    out = np.zeros(part.shape, dtype=bool)
    for axis in range(3):
        a, b = np.moveaxis(part, axis, 0)[:-1], np.moveaxis(part, axis, 0)[1:]
        differ = (a != b) & (a >= 0) & (b >= 0)
        moved = np.moveaxis(out, axis, 0)
        moved[:-1] |= differ
        moved[1:] |= differ
    return out
