"""Laws of the probe that the benchmarks read image encoders with."""

import sys

import numpy as np
import pytest


@pytest.mark.slow
def test_probe_scores(root, monkeypatch):
    """Separable classes score 1 whatever their sizes, noise scores chance within its interval."""
    monkeypatch.syspath_prepend(str(root / "benchmarks"))
    from probe import Regions, fit_probe, score

    rng = np.random.default_rng(0)
    label = np.repeat([0, 1, 2], [90, 20, 10])
    features = rng.normal(size=(120, 60)) + 8 * np.eye(60)[label]
    regions = Regions(features, label, np.arange(120) // 4)
    assert score(fit_probe(regions).predict(features), regions, rng=rng).accuracy == 1
    blank = Regions(rng.normal(size=(120, 60)), label, regions.thing)
    fresh = rng.normal(size=(120, 60))
    result = score(fit_probe(blank).predict(fresh), blank, rng=rng)
    assert result.low < 1 / 3 < result.high
    sys.modules.pop("probe", None)
