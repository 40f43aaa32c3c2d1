"""Block Lanczos against dense eigensolvers."""

import numpy as np
import pytest
from autophyx_tet.fem.linalg.krylov import lanczos


def problem(n, values, rng):
    """Operator, mass and exact pairs: A x = value x, with x orthonormal in the mass."""
    half = rng.normal(size=(n, n))
    mass = half @ half.T / n + np.eye(n)
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    X = np.linalg.solve(np.linalg.cholesky(mass).T, Q)
    A = (X * values) @ X.T  # A M X = X values
    return (lambda y: A @ y), (lambda x: mass @ x), X


def test_largest_pairs_with_multiplicity():
    """A triple value comes three times; values to 1e-10, vectors of unit mass to their error."""
    rng = np.random.default_rng(0)
    values = np.concatenate([[5.0, 3.0, 3.0, 3.0], 1 / np.arange(1.0, 57.0)])
    operator, mass, exact = problem(60, values, rng)

    def enough(pairs):
        return len(pairs.values) >= 5 and (pairs.errors[:5] < 1e-6).all()

    pairs = lanczos(operator, mass, rng.normal(size=(60, 4)), enough=enough, steps=20)
    assert pairs.values[:4] == pytest.approx([5, 3, 3, 3], rel=1e-10)
    x = pairs.vectors(4)
    assert x.T @ mass(x) == pytest.approx(np.eye(4), abs=1e-6)
    inside = exact[:, :4] @ (exact[:, :4].T @ mass(x))  # the space of the first four
    assert inside == pytest.approx(x, abs=1e-5)


def test_the_whole_space_ends_the_search():
    """A space that is used up is answered exactly, whatever was asked for."""
    rng = np.random.default_rng(1)
    values = np.arange(1.0, 8.0)
    operator, mass, _ = problem(7, values, rng)
    pairs = lanczos(operator, mass, rng.normal(size=(7, 3)), enough=lambda p: False, steps=20)
    assert pairs.values == pytest.approx(values[::-1], rel=1e-9)
