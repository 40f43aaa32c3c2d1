"""How well a piece's looks fit each kind of matter: logistic regression on what is measured."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ...fem.errors import InputError
from ..hearing.kinds import KINDS
from .looks import FEATURES, PLAIN

SHIPPED = Path(__file__).parents[1] / "weights" / "matter.json"
# Of an answer, one in so many is wrong whatever the regression says: names of slots mislead too.
_MISLED = 0.01
_ALIKE = 1e-6  # means that differ by less do so by round-off


@dataclass(frozen=True, eq=False)
class Regression:
    """Multinomial logistic regression of standardised features (n, F) on ``KINDS``.

    ``frequency`` is how often each kind was met.
    """

    mean: Float[np.ndarray, "features"]
    deviation: Float[np.ndarray, "features"]
    weight: Float[np.ndarray, "features kinds"]
    bias: Float[np.ndarray, "kinds"]
    frequency: Float[np.ndarray, "kinds"]

    @classmethod
    def fit(
        cls,
        features: Float[np.ndarray, "n features"],
        kind: Int[np.ndarray, "n"],
        *,
        penalty: float,
    ) -> Regression:
        """Return the likeliest one, ``penalty`` / 2 of the weights' square taken off."""
        from scipy.optimize import minimize

        mean, deviation = features.mean(axis=0), features.std(axis=0) + 1e-9
        x = np.c_[(features - mean) / deviation, np.ones(len(features))]
        wanted = np.eye(len(KINDS))[kind]

        def cost(flat: np.ndarray) -> tuple[float, np.ndarray]:
            w = flat.reshape(x.shape[1], -1)
            log = _log_softmax(x @ w)
            slope = x.T @ (np.exp(log) - wanted)
            slope[:-1] += penalty * w[:-1]
            return penalty / 2 * float(np.square(w[:-1]).sum()) - float(
                (wanted * log).sum()
            ), slope.ravel()

        found = minimize(cost, np.zeros(x.shape[1] * len(KINDS)), jac=True, method="L-BFGS-B").x
        w = found.reshape(x.shape[1], -1)
        return cls(mean, deviation, w[:-1], w[-1], wanted.mean(axis=0))

    def log_ratio(self, features: Float[np.ndarray, "n features"]) -> Float[np.ndarray, "n kinds"]:
        """Log of how much likelier each kind is by these looks than it was without them."""
        log = _log_softmax((features - self.mean) / self.deviation @ self.weight + self.bias)
        return np.log(np.exp(log) + _MISLED) - np.log(self.frequency + _MISLED)


@dataclass(frozen=True)
class KindsByLooks:
    """Regressions for things with a finish and opacities, and for those of plain colours."""

    finished: Regression
    plain: Regression

    @classmethod
    def fit(cls, features: np.ndarray, kind: np.ndarray, *, penalty: float) -> KindsByLooks:
        """Fit both to ``FEATURES`` (n, F) of pieces of known ``kind`` (n,)."""
        plain = Regression.fit(features[:, :PLAIN], kind, penalty=penalty)
        return cls(Regression.fit(features, kind, penalty=penalty), plain)

    @classmethod
    @lru_cache(maxsize=2)
    def load(cls, path: Path = SHIPPED) -> KindsByLooks:
        """Return the shipped ones, or those of a file that ``save`` wrote."""
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            if found["features"] != list(FEATURES) or found["kinds"] != list(KINDS):
                raise ValueError("of other features or kinds")
            parts = (
                {k: np.array(v) for k, v in found[name].items()} for name in ("finished", "plain")
            )
            return cls(*(Regression(**part) for part in parts))
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path} does not hold kinds by looks: {error}") from error

    def save(self, path: Path) -> None:
        """Write both as JSON, five digits each."""
        found = {"features": FEATURES, "kinds": KINDS}
        for name in ("finished", "plain"):
            found[name] = {k: _plain(v) for k, v in vars(getattr(self, name)).items()}
        path.write_text(json.dumps(found) + "\n", encoding="utf-8")

    def log_ratio(self, features: Float[np.ndarray, "n features"]) -> Float[np.ndarray, "n kinds"]:
        """As ``Regression.log_ratio``; all of one opacity and finish say nothing by them."""
        if np.ptp(features[:, PLAIN:], axis=0).max() > _ALIKE or features[0, PLAIN] < 1 - _ALIKE:
            return self.finished.log_ratio(features)
        return self.plain.log_ratio(features[:, :PLAIN])


def _log_softmax(x: np.ndarray) -> np.ndarray:
    from scipy.special import logsumexp

    return x - logsumexp(x, axis=1, keepdims=True)


def _plain(array: np.ndarray) -> list:
    """Nested lists of five digits."""
    return np.array([float(f"{x:.5g}") for x in array.ravel()]).reshape(array.shape).tolist()
