"""Skinning weights as 650 numbers: what the features span comes back; a foreign body is refused."""

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.predictors.unipixie.simplicits import (
    BODY_HASH,
    HANDLES,
    NUMBERS,
    Theta,
    fit_theta,
    frozen_body,
    hash_of,
)

LO, HI = np.array([-1.0, 0.0, 2.0]), np.array([1.0, 0.5, 5.0])


def somewhere(count=400):
    points = np.random.default_rng(1).uniform(LO, HI, (count, 3))
    points[:2] = LO, HI  # so that the box is theirs
    return points


def test_weights_of_the_span_come_back():
    """Weights that a head makes are fitted to 1e-6, whatever the mass of the points."""
    numbers = np.random.default_rng(0).normal(size=NUMBERS)
    theta, points = Theta(numbers=numbers, lo=LO, hi=HI), somewhere()
    weights = theta.weights(points)
    assert weights.shape == (len(points), HANDLES)
    mass = np.random.default_rng(2).uniform(0.1, 2, len(points))
    found = fit_theta(points, weights, mass)
    assert found.residual < 1e-6
    assert found.weights(points) == pytest.approx(weights, abs=1e-6 * np.abs(weights).max())
    assert (found.lo, found.hi) == (pytest.approx(LO), pytest.approx(HI))


def test_what_the_features_cannot_follow_is_told():
    """Weights that jump from point to point leave most of themselves."""
    points = somewhere()
    noise = np.random.default_rng(3).normal(size=(len(points), HANDLES))
    assert fit_theta(points, noise, np.ones(len(points))).residual > 0.5


def test_the_body_is_the_one_of_the_hash():
    """Its numbers are drawn anew here, and any other number has another hash."""
    body = frozen_body()
    assert hash_of(body) == BODY_HASH
    changed = body[0]._replace(b=body[0].b + np.float32(1e-6))
    assert hash_of((changed, *body[1:])) != BODY_HASH


def test_a_foreign_body_is_refused():
    with pytest.raises(InputError, match="mean nothing here"):
        Theta(numbers=np.zeros(NUMBERS), lo=LO, hi=HI, body_hash="0" * 64)
