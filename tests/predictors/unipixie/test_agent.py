"""The agent that corrects itself finds what a body's rest tells, and no more."""

import numpy as np
import pytest
from autophyx_tet.predictors.field import DEFAULT
from autophyx_tet.research.evaluation.paper.agent import Belief, correct_by_simulation

LEVER = 100.0  # [m^2 / s^2] g L^2 of the rods


def rods(values):
    """Sag [m] of hanging rods, each by itself: u = rho g L^2 / (2 E) at its end."""
    E, _, rho = DEFAULT.physical(values)
    return np.stack([rho * LEVER / (2 * E)] * 3, axis=1)


def belief(mean, spread, width=1.0):
    mean = np.array(mean, dtype=float)
    return Belief(mean, np.broadcast_to(np.array(spread, float), mean.shape), mean - width,
                  mean + width)  # fmt: skip


def test_what_is_known_of_the_weight_gives_the_stiffness():
    """With rho known, E of every rod follows from its sag, from decades away in five rounds."""
    truth = np.array([[-0.3, 0.2, 0.1], [0.4, 0.2, -0.1]])
    guess = truth + np.array([[0.2, 0, 0], [-0.25, 0, 0]])
    seen = rods(truth)
    found = correct_by_simulation(
        rods, seen, belief(guess, [1.0, 1.0, 1e-6]), sight=1e-6 * np.abs(seen).min()
    )
    # Gauss-Newton converges by squares, with derivatives by differences of 1e-3.
    np.testing.assert_allclose(found.values, truth, atol=1e-4)


def test_a_sag_does_not_tell_weight_from_stiffness():
    """Of one rod only rho / E is seen: both move by their share of the prior's variance."""
    truth = np.array([[0.1, 0.2, 0.0]])
    guess = np.array([[0.0, 0.2, 0.0]])
    seen = rods(truth)
    found = correct_by_simulation(
        rods, seen, belief(guess, [0.2, 0.1, 0.1]), sight=1e-6 * np.abs(seen).min()
    ).values[0]
    # Least (dE/.2)^2 + (drho/.1)^2 with s_rho drho - s_E dE = -s_E .1, s the decades of a range.
    s_E, _, s_rho = DEFAULT.span / 2
    share = s_E * 0.1 / ((s_E * 0.2) ** 2 + (s_rho * 0.1) ** 2)
    wanted = (share * s_E * 0.2**2, -share * s_rho * 0.1**2)
    assert found[[0, 2]] == pytest.approx(wanted, abs=1e-4)  # as above


def test_what_cannot_be_seen_stays_as_believed():
    """A rod whose sag lies far below what is seen keeps its first value; the soft one does not."""
    truth = np.array([[-0.5, 0.2, 0.0], [0.9, 0.2, 0.0]])
    guess = np.array([[-0.4, 0.2, 0.0], [0.8, 0.2, 0.0]])
    sight = 1e3 * rods(truth)[1, 0]
    assert rods(truth)[0, 0] > 10 * sight
    found = correct_by_simulation(rods, rods(truth), belief(guess, [0.1, 0.1, 1e-6]), sight=sight)
    assert found.values[1] == pytest.approx(guess[1], abs=1e-4)  # pulled by a thousandth of sight
    assert abs(found.values[0, 0] - truth[0, 0]) < 0.02


def test_it_stops_where_it_sees_no_difference_and_never_leaves_the_range():
    truth = np.array([[0.2, 0.2, 0.0]])
    seen = rods(truth)
    again = correct_by_simulation(rods, seen, belief(truth, 0.1), sight=1e-3 * seen[0, 0])
    assert again.rounds == 1  # one, which gains nothing
    np.testing.assert_array_equal(again.values, truth)
    narrow = belief([[0.0, 0.2, 0.0]], 0.1, width=0.05)
    held = correct_by_simulation(rods, seen, narrow, sight=1e-3 * seen[0, 0])
    assert (np.abs(held.values - narrow.mean) <= 0.05).all()
    assert held.values[0, 0] == pytest.approx(0.05)
