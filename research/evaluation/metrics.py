"""Scores of one object, and the row of the table that they add up to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fem.errors import UsageError
from .ssim import ImageSimilarity

Interval = tuple[float, float]  # 95 % bootstrap over the objects

_BOOTSTRAP = 1000  # resamples of the objects, for 95 % intervals


@dataclass(frozen=True)
class Row:
    """One line of the table; errors are mean squared errors of values normalised to [-1, 1].

    ``interval`` is the 95 % bootstrap interval of ``mse_mean`` over the objects; ``boundary_ratio``
    the error of voxels that touch another part over that of the others. ``largest_clause`` is what
    ``clause_accuracy`` would be if all of an object were of its largest matter. ``difference`` is
    ``mse_mean`` less that of ``best_baseline``, the best of the run, over the objects of both.
    ``psnr`` [dB] and ``ssim`` compare the pictures of the first ``rendered`` objects under load;
    their differences are the intervals of what they have more than those of the best baseline.
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
    texts: int
    seconds_per_object: float
    interval: Interval
    by_clauses: dict[int, float]
    best_baseline: str | None = None
    difference: float | None = None
    difference_interval: Interval | None = None
    difference_by_clauses: dict[int, Interval] | None = None
    rendered: int = 0
    psnr: float | None = None
    psnr_interval: Interval | None = None
    ssim: float | None = None
    ssim_interval: Interval | None = None
    psnr_difference: Interval | None = None
    ssim_difference: Interval | None = None
    largest_clause: float | None = None
    clause_margin_interval: Interval | None = None

    def to_dict(self) -> dict:
        """Plain data for JSON."""
        return asdict(self)


class Score(NamedTuple):
    """Of one object: errors (3,), those at boundaries and inside, accuracy, clauses, seconds.

    ``similarity`` compares its picture under load with the true one's, if that was asked;
    ``largest`` is the accuracy of one clause for all.
    """

    errors: np.ndarray
    edge: float
    inner: float
    right: float
    clauses: int
    seconds: float
    similarity: ImageSimilarity | None = None
    largest: float = np.nan


def summary(name: str, split: str, objects: Sequence[Sequence[Score]]) -> Row:
    """Summarise one predictor's scores: those of every object, one for each text."""
    if not objects:
        raise UsageError(f"no object of the {split} split has a known value: give more objects")
    errors = np.array([np.mean([score.errors for score in texts], axis=0) for texts in objects])
    means = errors.mean(axis=1)
    scores = [score for texts in objects for score in texts]
    each = np.array([score.errors.mean() for score in scores])
    clauses = np.array([score.clauses for score in scores])
    sides = np.array([(score.edge, score.inner) for score in scores])
    sides = sides[~np.isnan(sides).any(axis=1)]
    edge, inner = sides.mean(axis=0) if len(sides) else (np.nan, np.nan)
    bound = [texts for texts in objects if not all(np.isnan(score.right) for score in texts)]
    right = np.array([np.nanmean([score.right for score in texts]) for texts in bound])
    largest = np.array([np.nanmean([score.largest for score in texts]) for texts in bound])
    mse_E, mse_nu, mse_rho = errors.mean(axis=0).tolist()
    row = Row(
        predictor=name,
        split=split,
        mse_E=mse_E,
        mse_nu=mse_nu,
        mse_rho=mse_rho,
        mse_mean=float(means.mean()),
        clause_accuracy=float(right.mean()) if len(bound) else None,
        largest_clause=float(largest.mean()) if len(bound) else None,
        clause_margin_interval=bootstrap_interval(right - largest) if len(bound) else None,
        boundary_ratio=float(edge / max(inner, 1e-9)),
        objects=len(means),
        texts=len(scores),
        seconds_per_object=float(np.mean([score.seconds for score in scores])),
        interval=bootstrap_interval(means),
        by_clauses={int(k): float(each[clauses == k].mean()) for k in np.unique(clauses)},
    )
    return _with_pictures(
        row, [score.similarity for score in scores if score.similarity is not None]
    )


def _with_pictures(row: Row, found: Sequence[ImageSimilarity]) -> Row:
    if not found:
        return row
    psnr, ssim = np.array(found).T
    return replace(
        row, rendered=len(found), psnr=float(psnr.mean()), psnr_interval=bootstrap_interval(psnr),
        ssim=float(ssim.mean()), ssim_interval=bootstrap_interval(ssim),
    )  # fmt: skip


def against_best(
    rows: Sequence[Row],
    scores: Mapping[str, Mapping[int, Sequence[Score]]],
    baselines: Sequence[str],
) -> list[Row]:
    """Rows with their difference to the baseline of least error, object by object.

    ``scores`` are those of every predictor by the number of the object, one for each text.
    """
    known = [row for row in rows if row.predictor in baselines]
    if not known:
        return list(rows)
    best = min(known, key=lambda row: row.mse_mean).predictor
    theirs = scores[best]
    compared = []
    for row in rows:
        paired = _differences(scores[row.predictor], theirs)
        if row.predictor != best and len(paired):
            by_clauses = {
                k: bootstrap_interval(_differences(scores[row.predictor], theirs, clauses=k))
                for k in row.by_clauses
            }
            row = replace(
                row, best_baseline=best, difference=float(paired.mean()),
                difference_interval=bootstrap_interval(paired), difference_by_clauses=by_clauses,
            )  # fmt: skip
        compared.append(_pictures_against_best(row, known, scores))
    return compared


def _pictures_against_best(
    row: Row, known: Sequence[Row], scores: Mapping[str, Mapping[int, Sequence[Score]]]
) -> Row:
    """Row with what its PSNR and SSIM are above those of the baseline that is best in each."""
    for kind in ("psnr", "ssim"):
        shown = {one.predictor: getattr(one, kind) for one in known if one.rendered}
        if not shown or row.predictor == (best := max(shown, key=lambda name: shown[name])):
            continue
        pairs = [
            (getattr(mine.similarity, kind), getattr(theirs.similarity, kind))
            for i, (mine, *_) in scores[row.predictor].items()
            for theirs in scores[best].get(i, ())[:1]
            if mine.similarity and theirs.similarity
        ]
        if pairs:
            gained = bootstrap_interval(np.subtract(*np.array(pairs).T))
            row = replace(row, **{f"{kind}_difference": gained})
    return row


def _differences(
    mine: Mapping[int, Sequence[Score]],
    theirs: Mapping[int, Sequence[Score]],
    *,
    clauses: int | None = None,
) -> np.ndarray:
    """Mean error less theirs of each object that both scored, of texts of so many ``clauses``."""
    pairs = [(mine[i], theirs[i]) for i in mine if i in theirs]
    told = [[[s for s in texts if clauses in (None, s.clauses)] for texts in two] for two in pairs]
    return np.array([_error(one) - _error(two) for one, two in told if one and two])


def _error(texts: Sequence[Score]) -> float:
    return float(np.mean([score.errors for score in texts]))


def bootstrap_interval(values: Float[np.ndarray, "objects"]) -> Interval:
    """95 % bootstrap interval of the mean."""
    draws = np.random.default_rng(0).integers(len(values), size=(_BOOTSTRAP, len(values)))
    low, high = np.percentile(values[draws].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def boundary_voxels(part: np.ndarray) -> np.ndarray:
    """Voxels with a neighbour of another part among the six."""
    out = np.zeros(part.shape, dtype=bool)
    for axis in range(3):
        a, b = np.moveaxis(part, axis, 0)[:-1], np.moveaxis(part, axis, 0)[1:]
        differ = (a != b) & (a >= 0) & (b >= 0)
        moved = np.moveaxis(out, axis, 0)
        moved[:-1] |= differ
        moved[1:] |= differ
    return out
