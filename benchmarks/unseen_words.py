"""What words alone tell of kinds of part that were never trained on: no network, its input only.

``python benchmarks/unseen_words.py`` guesses the ranges of the held-out kinds (of boat and
umbrella) from the embeddings of their words: by the mean of all seen kinds, the nearest seen word,
and kernel ridge regression whose width and damping do best on seen kinds left out in turn: the last
two rows are of those. What none of these finds a network that hears the same words has to guess.
"""

from __future__ import annotations

import argparse
import json
from itertools import product

import numpy as np
from autophyx_tet.predictors.encoders.minilm import MiniLM
from autophyx_tet.research.datasets.parts import part_kinds
from autophyx_tet.research.datasets.ranges import RangeTable, build_range_table
from autophyx_tet.research.training.unipixie.names_on_device import Names

ALPHAS = (0.0, 0.5, 1.0)
WIDTHS = (0.2, 0.3, 0.45, 0.7, 1.0)  # of the kernel, in distances of unit vectors
DAMPINGS = (1e-3, 1e-2, 0.1, 1.0, 10.0)
FOLDS = 10


def main() -> None:
    """Print mean squared errors of normalised log E, nu, log rho at each alpha."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    table = build_range_table(MiniLM().text)
    held_out = np.array([kind.held_out for kind in part_kinds().values()])
    words = np.flatnonzero((table.kind >= 0) & ((table.rows >= 0).sum(axis=1) > 1))
    unseen = held_out[table.kind[words]]
    x, y = table.embedding[words].astype(np.float64), _ranges(table, words)
    seen, asked = x[~unseen], x[unseen]
    folds = _folds(table.kind[words][~unseen])

    def left_out(choice: tuple[float, float]) -> np.ndarray:
        """Guesses for seen words whose kind is left out."""
        out = np.empty_like(y[~unseen])
        for fold in folds:
            out[fold] = _ridge(seen[~fold], y[~unseen][~fold], seen[fold], *choice)
        return out

    choices = list(product(WIDTHS, DAMPINGS))
    width, damping = min(choices, key=lambda one: _error(left_out(one), y[~unseen]).mean())
    guesses = {
        "mean of the seen kinds": np.repeat(y[~unseen].mean(axis=0)[None], len(asked), axis=0),
        "nearest seen word": y[~unseen][(asked @ seen.T).argmax(axis=1)],
        f"kernel ridge ({width}, {damping})": _ridge(seen, y[~unseen], asked, width, damping),
    }
    rows = {name: _error(guess, y[unseen]).tolist() for name, guess in guesses.items()}
    mean = np.repeat(y[~unseen].mean(axis=0)[None], len(seen), axis=0)
    rows["seen, left out: mean of all"] = _error(mean, y[~unseen]).tolist()
    rows["seen, left out: kernel ridge"] = _error(left_out((width, damping)), y[~unseen]).tolist()
    if given.json:
        print(json.dumps({"seen": len(seen), "unseen": len(asked), "rows": rows}))
        return
    print(f"{len(seen)} seen words, {len(asked)} unseen; mean squared error at alpha {ALPHAS}")
    for name, errors in rows.items():
        print(f"{name:28}", *(f"{error:.4f}" for error in errors))


def _ranges(table: RangeTable, words: np.ndarray) -> np.ndarray:
    """Normalised log E, nu, log rho (words, alphas, 3) of what each word leaves plausible."""
    import torch

    low, high = (end.numpy() for end in Names(table, "cpu").span(torch.tensor(words)))
    return np.stack([low + alpha * (high - low) for alpha in ALPHAS], axis=1).astype(np.float64)


def _ridge(
    x: np.ndarray, y: np.ndarray, asked: np.ndarray, width: float, damping: float
) -> np.ndarray:
    """Kernel ridge regression (Gaussian kernel) of what differs from the mean."""
    mean = y.mean(axis=0)
    weights = np.linalg.solve(
        _kernel(x, x, width) + damping * np.eye(len(x)), (y - mean).reshape(len(x), -1)
    )
    return mean + (_kernel(asked, x, width) @ weights).reshape(len(asked), *mean.shape)


def _kernel(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    return np.exp((a @ b.T - 1) / width**2)  # |a - b|^2 = 2 - 2 a.b of unit vectors


def _error(guess: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Mean squared error at each alpha."""
    return ((guess - truth) ** 2).mean(axis=(0, 2)).round(4)


def _folds(kind: np.ndarray) -> list[np.ndarray]:
    """Which words belong to each of ten groups of kinds."""
    kinds = np.random.default_rng(0).permutation(np.unique(kind))
    return [np.isin(kind, fold) for fold in np.array_split(kinds, FOLDS)]


if __name__ == "__main__":
    main()
