"""Kinds by looks: laws of the fit, and what the shipped ones say of plain cases."""

import json

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.matter import FEATURES, PLAIN, SHIPPED, CategoriesByAppearance, measure
from autophyx_tet.predictors.text.parts import KINDS
from autophyx_tet.research.training.kinds_by_looks import fit_kinds, fit_regression, save_kinds

from .test_looks import table


def drawn(n=600, seed=0):
    rng = np.random.default_rng(seed)
    kind = rng.integers(0, len(KINDS), n)
    return rng.standard_normal((n, 5)) + np.eye(len(KINDS), 5)[kind], kind


def test_at_the_optimum_every_kind_is_met_as_often_as_it_was():
    """The slope along the biases, which no penalty holds, is zero: mean answers are frequencies."""
    features, kind = drawn()
    fit = fit_regression(features, kind, penalty=1.0)
    x = (features - fit.mean) / fit.deviation @ fit.weight + fit.bias
    share = np.exp(x) / np.exp(x).sum(axis=1, keepdims=True)
    # 1e-4: L-BFGS stops at a slope of 1e-5 in each of 66 numbers, over 600 samples
    assert share.mean(axis=0) == pytest.approx(fit.frequency, abs=1e-4)


def test_what_tells_nothing_makes_nothing_likelier():
    _, kind = drawn()
    fit = fit_regression(np.zeros((len(kind), 3)), kind, penalty=1.0)
    assert fit.log_ratio(np.zeros((1, 3)))[0] == pytest.approx(0, abs=1e-3)


def test_files_hold_five_digits(tmp_path):
    rng = np.random.default_rng(2)
    features = rng.standard_normal((300, len(FEATURES)))
    kinds = fit_kinds(features, rng.integers(0, len(KINDS), 300), penalty=10.0)
    save_kinds(tmp_path / "kinds.json", kinds)
    again = CategoriesByAppearance.load(tmp_path / "kinds.json")
    # 1e-3: 29 products of numbers of five digits
    assert again.log_ratio(features) == pytest.approx(kinds.log_ratio(features), abs=1e-3)


def test_a_file_of_other_measures_is_refused(tmp_path):
    found = json.loads(SHIPPED.read_text())
    found["features"] = found["features"][1:]
    (tmp_path / "kinds.json").write_text(json.dumps(found))
    with pytest.raises(InputError, match="kinds by looks"):
        CategoriesByAppearance.load(tmp_path / "kinds.json")


def test_a_clear_top_on_brown_legs_is_rather_glass_than_wood():
    top, legs = CategoriesByAppearance.load().log_ratio(measure(*table()))
    glass, wood = KINDS.index("glass"), KINDS.index("wood")
    assert top[glass] - top[wood] > 1 + legs[glass] - legs[wood]


def test_without_finish_only_colours_and_form_are_read():
    kinds = CategoriesByAppearance.load()
    cells, looks, piece = table()
    looks[:, 3:] = [1.0, 0.0, 0.04, 0.6]
    measured = measure(cells, looks, piece)
    assert kinds.log_ratio(measured) == pytest.approx(kinds.plain.log_ratio(measured[:, :PLAIN]))
