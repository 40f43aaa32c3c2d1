"""The smoother of the V-cycle: a polynomial of the matrix, in double and in single precision."""

import numpy as np
import pytest
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.elements.assembly import add_diagonal, discretise, stiffness
from autophyx_tet.fem.linalg.multigrid import SPREAD, Smoother, scale
from autophyx_tet.fem.mesh import box_mesh
from numpy.polynomial.chebyshev import chebval


@pytest.fixture
def scaled():
    """Scaled stiffness of a cube that stands on springs."""
    grid = discretise(box_mesh((1, 1, 1), (3, 3, 3)), 1)
    count = len(grid.space.elements)
    matrix = stiffness(grid, np.full(count, 2.0), np.full(count, 1.0))
    add_diagonal(matrix, np.broadcast_to(0.1 * np.eye(3), (matrix.nodes, 3, 3)).copy())
    return scale(matrix)


def error_left(scaled, degree):
    """What a smoother of a degree leaves of an error: T((theta - A) / delta) / T(theta / delta)."""
    low = scaled.largest / SPREAD
    theta, delta = (scaled.largest + low) / 2, (scaled.largest - low) / 2
    values, vectors = np.linalg.eigh(scaled.matrix.to_scipy().toarray())
    pick = [0] * degree + [1]
    shares = chebval((theta - values) / delta, pick) / chebval(theta / delta, pick)
    return vectors @ (shares[:, None] * vectors.T)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize(
    ("single", "round_off"),
    [(False, 1e-12), (True, 1e-5)],  # of double, and of single precision
)
def test_what_is_left_is_a_chebyshev_polynomial(scaled, single, round_off, degree):
    """From x = 0, and once more from there: the error is what the polynomial leaves of it."""
    A = scaled.matrix.to_scipy().toarray()
    smoother = Smoother(scaled.matrix, scaled.largest, degree, single=single)
    x = np.random.default_rng(0).normal(size=len(A))
    smoother.r.assign((A @ x).reshape(-1, 3))
    left = error_left(scaled, degree)

    def launch(commands):
        for command in commands:
            command.launch()
        return smoother.z.numpy().reshape(-1)

    once = launch(smoother.before)
    np.testing.assert_allclose(x - once, left @ x, atol=round_off * np.abs(x).max())
    residual = smoother.residual.numpy().reshape(-1)
    np.testing.assert_allclose(residual, A @ (x - once), atol=10 * round_off)
    np.testing.assert_allclose(
        x - launch(smoother.after), left @ left @ x, atol=round_off * np.abs(x).max()
    )


def test_products_by_scalars_are_those_by_rows(scaled):
    """y = A x with a thread a scalar: the way of a GPU, here on a CPU."""
    from autophyx_tet.fem.elements import kernels_field as k

    wp, matrix = start_warp(), scaled.matrix
    x = np.random.default_rng(0).normal(size=(matrix.nodes, 3))
    y = wp.zeros(3 * matrix.nodes, dtype=wp.float64, device="cpu")
    flat = matrix.values.view(wp.float64).flatten()
    given = wp.array(x.reshape(-1), dtype=wp.float64, device="cpu")
    pattern = [matrix.rows, matrix.columns]
    wp.launch(k.multiply_scalars, len(y), inputs=[*pattern, flat, given, y], device="cpu")
    exact = matrix.to_scipy() @ x.reshape(-1)
    np.testing.assert_allclose(y.numpy(), exact, atol=1e-13)  # round-off
