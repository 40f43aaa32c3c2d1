"""The probe of an image encoder: how well a linear classifier reads materials off its features.

Features of regions are standardised, reduced by principal components and classified by a balanced
logistic regression; the score is the balanced accuracy on objects of another source.
"""

from typing import NamedTuple

import numpy as np
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import recall_score
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

COMPONENTS = 48
RESAMPLES = 1000  # bootstrap samples of objects


class Score(NamedTuple):
    """Balanced accuracy, its 95 % interval over resampled objects, and the number of regions."""

    accuracy: float
    low: float
    high: float
    regions: int


class Regions(NamedTuple):
    """Features (n, d), class (n,) and object (n,) of regions."""

    features: np.ndarray
    label: np.ndarray
    thing: np.ndarray


def fit_probe(regions: Regions, *, components: int = COMPONENTS) -> Pipeline:
    """Fit the classifier; every class weighs the same. Its ``predict`` gives classes."""
    probe = make_pipeline(
        StandardScaler(),
        PCA(min(components, *regions.features.shape)),
        LogisticRegression(class_weight="balanced", max_iter=1000),
    )
    return probe.fit(regions.features.astype(np.float64), regions.label)


def score(guess: np.ndarray, regions: Regions, *, rng: np.random.Generator) -> Score:
    """Balanced accuracy of guessed classes (n,), with an interval over the objects."""
    things = np.unique(regions.thing)
    rows = [np.flatnonzero(regions.thing == thing) for thing in things]
    samples = []
    for _ in range(RESAMPLES):
        picked = np.concatenate([rows[i] for i in rng.integers(len(rows), size=len(rows))])
        samples.append(balanced(guess[picked], regions.label[picked]))
    low, high = np.percentile(samples, [2.5, 97.5])
    return Score(balanced(guess, regions.label), float(low), float(high), len(guess))


def balanced(guess: np.ndarray, label: np.ndarray) -> float:
    """Mean over the classes that are there of the share that is right."""
    return float(recall_score(label, guess, labels=np.unique(label), average="macro"))
