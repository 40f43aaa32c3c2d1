"""Kinds of matter by looks, learned from the slots of real objects whose names tell their kind."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError
from ...predictors.matter import FEATURES, PLAIN, CategoriesByAppearance, Regression
from ...predictors.text.parts import KINDS
from ..datasets.real import RealObject, kind_index

# Of .3 to 100, on objects of each source of training by the other: 3 to 30 are as good.
PENALTY = 10.0


def train_kinds(objects: Iterable[RealObject]) -> tuple[CategoriesByAppearance, int]:
    """Fit kinds to looks; return how many slots taught it, too."""
    rows, kinds = [], []
    for item in objects:
        for slot, measures in zip(
            item.slots, () if item.looks is None else item.looks, strict=False
        ):
            if kind_index(slot) >= 0 and np.isfinite(measures).all():
                rows.append(measures)
                kinds.append(kind_index(slot))
    if not rows:
        raise InputError("no object has measured looks: build the data anew with `dataset build`")
    return fit_kinds(np.array(rows), np.array(kinds), penalty=PENALTY), len(rows)


def fit_kinds(features: np.ndarray, kind: np.ndarray, *, penalty: float) -> CategoriesByAppearance:
    """Fit both to ``FEATURES`` (n, F) of pieces of known ``kind`` (n,)."""
    plain = fit_regression(features[:, :PLAIN], kind, penalty=penalty)
    return CategoriesByAppearance(fit_regression(features, kind, penalty=penalty), plain)


def fit_regression(
    features: Float[np.ndarray, "n features"], kind: Int[np.ndarray, "n"], *, penalty: float
) -> Regression:
    """Return the likeliest one, ``penalty`` / 2 of the weights' square taken off."""
    from scipy.optimize import minimize
    from scipy.special import log_softmax

    mean, deviation = features.mean(axis=0), features.std(axis=0) + 1e-9
    x = np.c_[(features - mean) / deviation, np.ones(len(features))]
    wanted = np.eye(len(KINDS))[kind]

    def cost(flat: np.ndarray) -> tuple[float, np.ndarray]:
        w = flat.reshape(x.shape[1], -1)
        log = log_softmax(x @ w, axis=1)
        slope = x.T @ (np.exp(log) - wanted)
        slope[:-1] += penalty * w[:-1]
        return penalty / 2 * float(np.square(w[:-1]).sum()) - float(
            (wanted * log).sum()
        ), slope.ravel()

    found = minimize(cost, np.zeros(x.shape[1] * len(KINDS)), jac=True, method="L-BFGS-B").x
    w = found.reshape(x.shape[1], -1)
    return Regression(mean, deviation, w[:-1], w[-1], wanted.mean(axis=0))


def save_kinds(path: Path, kinds: CategoriesByAppearance) -> None:
    """Write both as JSON, five digits each."""
    found: dict[str, object] = {"features": FEATURES, "kinds": KINDS}
    for name in ("finished", "plain"):
        found[name] = {
            k: np.array([float(f"{x:.5g}") for x in v.ravel()]).reshape(v.shape).tolist()
            for k, v in vars(getattr(kinds, name)).items()
        }
    path.write_text(json.dumps(found) + "\n", encoding="utf-8")
