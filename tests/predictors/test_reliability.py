"""Laws of certainty: a fit finds the law that made the answers; a curve counts what it is given."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from autophyx_tet.predictors.film.predictor import Calibration, Certainty, log_odds
from autophyx_tet.research.evaluation import held_out
from autophyx_tet.research.evaluation.held_out import HeldOutSet
from autophyx_tet.research.evaluation.reliability import (
    Answer,
    Bin,
    answers,
    borne_out,
    curve,
    expected_error,
    fit,
)
from autophyx_tet.research.evaluation.rows import ROWS


def drawn(law: Calibration, count: int) -> list[Answer]:
    """Answers that are right as often as a law says."""
    rng = np.random.default_rng(0)
    shares = rng.uniform(0.05, 0.999, count)
    return [Answer(float(s), bool(rng.uniform() < law(s)), i) for i, s in enumerate(shares)]


def test_a_fit_finds_the_law():
    """To .1, about three deviations of 4,000 draws; what it then says is right that often."""
    law = Calibration(0.5, -0.8)
    given = drawn(law, 4000)
    found = fit(given)
    assert found == pytest.approx(law, abs=0.1)
    said = np.array([found(answer.share) for answer in given])
    right = [answer.right for answer in given]
    assert expected_error(curve(said, right)) < 0.03
    raw = np.array([answer.share for answer in given])
    assert expected_error(curve(raw, right)) > 0.1


def test_a_curve_counts():
    bins = curve(np.array([0.05, 0.05, 0.95, 1.0]), [True, False, True, True])
    assert [(b.count, b.right) for b in bins] == [(2, 0.5), (2, 1.0)]
    assert expected_error(bins) == pytest.approx((2 * 0.45 + 2 * 0.025) / 4)


def test_certainty_grows_with_the_share_and_is_never_whole():
    law = Calibration(0.7, 0.2)
    said = [law(share) for share in (0.0, 0.2, 0.5, 0.9, 1.0)]
    assert said == sorted(said)
    assert 0 < said[0] < said[-1] < 1
    np.testing.assert_allclose(log_odds(np.array([0.5, 0.75])), [0, np.log(3)])


def test_only_what_others_bore_out_is_told():
    """Bins with few answers, or right more or less often than said, say nothing."""
    bins = [Bin(0.0, 0.2, 5, 0.1, 0.1), Bin(0.4, 0.6, 40, 0.5, 0.7), Bin(0.6, 0.8, 40, 0.7, 0.66)]
    assert borne_out(bins) == [(0.6, 0.8)]
    certainty = Certainty(Calibration(1.0, 0.0), ((0.6, 0.8),))
    assert certainty.of(0.7) == pytest.approx(0.7)
    assert certainty.of(0.5) is None
    assert Certainty(Calibration(1.0, 0.0)).of(0.7) is None


def test_the_shipped_calibration_says_more_of_larger_shares():
    certainty = Certainty.load()
    told = [certainty.of(share) for share in np.linspace(0, 1, 101)]
    said = [value for value in told if value is not None]
    assert said == sorted(said)
    assert all(any(low <= value <= high for low, high in certainty.spans) for value in said)


class Loud:
    """A row that always gives the first clause, by logits that no softmax has seen."""

    names = False

    def build(self, setting):
        def predict(example):
            logits = torch.zeros(1, example.batch.scene.clause_mask.shape[1] + 1, 1, 1, 1)
            logits[:, 0] = 2.0
            return None, logits.expand(-1, -1, *example.batch.scene.part.shape[1:])

        return predict


@pytest.mark.slow
def test_shares_are_shares_and_pieces_are_left_out(monkeypatch):
    """In [0, 1] whatever the logits are; of objects with no more clauses than parts."""
    embed = lambda texts: np.random.default_rng(0).normal(size=(len(texts), 12)) / 4  # noqa: E731
    monkeypatch.setattr(held_out, "HintedEncoder", lambda encoder: SimpleNamespace(text=embed))
    objects = HeldOutSet("procedural", objects=3, cells=16)
    pieces = {
        index
        for index, example in objects.drawn(objects.text_table())
        if example.batch.scene.clause_mask.sum() > example.batch.scene.part.max() + 1
    }
    ROWS.register("loud", Loud())
    try:
        given = list(answers(objects, "loud"))
    finally:
        ROWS.unregister("loud")
    assert given
    assert all(0 < answer.share < 1 for answer in given)
    assert not pieces & {answer.index for answer in given}
