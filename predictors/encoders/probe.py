"""The probe of an image encoder: how well a linear classifier reads materials off its features.

Features of regions are standardised, reduced by principal components and classified by a balanced
logistic regression; the score is the balanced accuracy on objects of another source.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

COMPONENTS = 48
PENALTY = 1.0  # of the squared weights, against the summed loss: scikit-learn's C = 1
RESAMPLES = 1000  # bootstrap samples of objects
FLAT = 1e-6  # a feature that varies less than this is not scaled up


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


class Probe(NamedTuple):
    """A fitted classifier: mean and map to components, weights (classes, components + 1)."""

    mean: np.ndarray
    basis: np.ndarray
    weights: np.ndarray

    def __call__(self, features: Float[np.ndarray, "n d"]) -> Int[np.ndarray, "n"]:
        """Class of every region."""
        reduced = (features - self.mean) @ self.basis
        return (reduced @ self.weights[:, :-1].T + self.weights[:, -1]).argmax(axis=1)


def fit_probe(regions: Regions, *, components: int = COMPONENTS) -> Probe:
    """Fit the classifier; every class weighs the same."""
    import torch

    features = regions.features.astype(np.float64)
    mean, scale = features.mean(axis=0), np.maximum(features.std(axis=0), FLAT)
    scaled = (features - mean) / scale
    _, _, axes = np.linalg.svd(scaled, full_matrices=False)
    basis = axes[:components].T / scale[:, None]
    x = torch.from_numpy((features - mean) @ basis)
    y = torch.from_numpy(regions.label.astype(np.int64))
    count = torch.bincount(y).double()
    balance = (len(y) / (len(count) * count.clamp(min=1)))[y]
    weights = torch.zeros(len(count), x.shape[1] + 1, dtype=torch.float64, requires_grad=True)
    solver = torch.optim.LBFGS([weights], max_iter=300, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        solver.zero_grad()
        logits = x @ weights[:, :-1].T + weights[:, -1]
        errors = torch.nn.functional.cross_entropy(logits, y, reduction="none")
        total = (errors * balance).sum() + PENALTY / 2 * (weights[:, :-1] ** 2).sum()
        total.backward()
        return total

    solver.step(loss)
    return Probe(mean, basis, weights.detach().numpy())


def score(guess: Int[np.ndarray, "n"], regions: Regions, *, rng: np.random.Generator) -> Score:
    """Balanced accuracy of guessed classes, with an interval over the objects."""
    right = guess == regions.label
    things = np.unique(regions.thing)
    rows = [np.flatnonzero(regions.thing == thing) for thing in things]
    samples = []
    for _ in range(RESAMPLES):
        picked = np.concatenate([rows[i] for i in rng.integers(len(rows), size=len(rows))])
        samples.append(balanced(right[picked], regions.label[picked]))
    low, high = np.percentile(samples, [2.5, 97.5])
    return Score(balanced(right, regions.label), float(low), float(high), len(right))


def balanced(right: np.ndarray, label: np.ndarray) -> float:
    """Mean over the classes of the share that is right."""
    count = np.bincount(label)
    hits = np.bincount(label, weights=right, minlength=len(count))
    return float((hits[count > 0] / count[count > 0]).mean())
