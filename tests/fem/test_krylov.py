"""Krylov methods: inner products, the largest eigenvalue, conjugate gradients."""

import numpy as np
import pytest
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.elements.assembly import add_diagonal, discretise, stiffness
from autophyx_tet.fem.linalg import kernels_krylov
from autophyx_tet.fem.linalg.krylov import (
    ConjugateGradients,
    DeviceVector,
    LargestEigenvalue,
    SlicedMatrix,
    inner_product,
    length,
)
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.schemes import DeviceSteps


@pytest.fixture
def matrix():
    """Stiffness of a cube that stands on springs."""
    grid = discretise(box_mesh((1, 1, 1), (3, 3, 3)), 1)
    count = len(grid.space.elements)
    matrix = stiffness(grid, np.full(count, 2.0), np.full(count, 1.0))
    add_diagonal(matrix, np.broadcast_to(0.1 * np.eye(3), (matrix.nodes, 3, 3)).copy())
    return matrix


class Nothing:
    """The preconditioner z = r."""

    def __init__(self, r):
        self.r, self.z = r, start_warp().zeros_like(r)

    def apply(self):
        """Copy."""
        start_warp().copy(self.z, self.r)


def test_lanczos_bounds_the_spectrum(matrix):
    """The largest eigenvalue, raised by its margin: above the true one, by 10 % at most."""
    exact = np.linalg.eigvalsh(matrix.to_scipy().toarray())[-1]
    assert exact <= LargestEigenvalue(matrix)() <= 1.1 * exact


def test_lanczos_of_no_number_is_no_number(matrix):
    """A matrix with NaN has no largest eigenvalue, and says so."""
    matrix.values.numpy()[0] = np.nan
    assert np.isnan(LargestEigenvalue(matrix)())


def test_conjugate_gradients_solve_again_and_again(matrix):
    """A x = b to the residual asked for; the same object serves the next right-hand side."""
    wp = start_warp()
    eye = wp.array(
        np.broadcast_to(np.eye(3), (matrix.nodes, 3, 3)).copy(), dtype=wp.mat33d, device="cpu"
    )
    plain = Nothing(wp.zeros(matrix.nodes, dtype=wp.vec3d, device="cpu"))
    cg = ConjugateGradients(matrix, eye, plain, plain.r, plain.z)
    for seed in range(2):
        b = np.random.default_rng(seed).normal(size=(matrix.nodes, 3))
        plain.r.assign(b)
        iterations = cg.run(1e-8, 200)
        assert cg.reached
        assert iterations < 200
        assert np.linalg.norm(matrix.times(cg.x.numpy()) - b) < 1.1e-8


def test_conjugate_gradients_notice_negative_curvature(matrix):
    """An indefinite matrix ends the loop, and is told apart from a slow one."""
    wp = start_warp()
    shift = np.broadcast_to(-3 * np.eye(3), (matrix.nodes, 3, 3)).copy()
    add_diagonal(matrix, shift)
    eye = wp.array(
        np.broadcast_to(np.eye(3), (matrix.nodes, 3, 3)).copy(), dtype=wp.mat33d, device="cpu"
    )
    plain = Nothing(wp.array(np.ones((matrix.nodes, 3)), dtype=wp.vec3d, device="cpu"))
    cg = ConjugateGradients(matrix, eye, plain, plain.r, plain.z)
    cg.run(1e-8, 200)
    assert cg.indefinite
    assert not cg.reached


@pytest.mark.slow
def test_a_sliced_matrix_multiplies_as_the_matrix(matrix):
    """What a GPU multiplies by: q = A p of uneven rows, and p . q, with the numbers of now."""
    wp = start_warp()
    sliced, p = SlicedMatrix(matrix, wp.float64), np.random.default_rng(0).normal(size=(64, 3))
    matrix.values.numpy()[:] *= 2.0
    sliced.refresh()
    given, out = wp.array(p.ravel(), dtype=wp.float64), wp.zeros(192, dtype=wp.float64)
    scalars = wp.zeros(6, dtype=wp.float64)
    inputs = [*sliced.arrays, given, out, scalars]
    wp.launch(kernels_krylov.multiply_and_measure, 192, inputs=inputs, device="cpu")
    assert out.numpy() == pytest.approx(matrix.to_scipy() @ p.ravel(), rel=1e-13, abs=1e-13)
    assert scalars.numpy()[kernels_krylov.PAP] == pytest.approx(p.ravel() @ out.numpy(), rel=1e-13)


def test_vectors_of_a_device_are_those_of_numpy():
    """Sums, multiples, inner products and lengths, to round-off; no operation changes one."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 700, 3))
    x, y = (DeviceVector.of(v, "cpu") for v in (a, b))
    for found, wanted in (
        (x + y, a + b),
        (-x, -a),
        (2.5 * y, 2.5 * b),
        (x - 3.0 * y, a - 3 * b),
        (np.float64(2.0) * x / 4.0, a / 2),
    ):
        np.testing.assert_allclose(found.numpy(), wanted, rtol=1e-15, atol=1e-15)
    assert inner_product(x, y) == pytest.approx(inner_product(a, b), rel=1e-12)
    assert length(x) == pytest.approx(np.linalg.norm(a), rel=1e-12)
    assert np.isnan(inner_product(x, np.nan * y))
    np.testing.assert_array_equal(x.numpy(), a)


def test_a_step_on_a_device_is_that_of_the_host():
    """The beam under its weight, its foot held and a spring at its end: alike to round-off."""
    mesh = box_mesh((1, 0.2, 0.2), (6, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.3, rho=1e3))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    held = held.with_springs(mesh.points[:, 0] == 1, (0.0, 1e2, 3e2))
    bodies = [
        Dynamics(mesh, supports=held, gravity_vector=(0, 0, -9.81), order=1, self_contact=False)
        for _ in range(2)
    ]
    bodies[1].steps = DeviceSteps(bodies[1], "cpu")
    for one, two in zip(*(body.run(0.01, 8) for body in bodies), strict=True):
        np.testing.assert_allclose(two.u, one.u, atol=1e-12 * max(np.abs(one.u).max(), 1e-300))
        assert two.elastic == pytest.approx(one.elastic, rel=1e-10)
        assert two.iterations == one.iterations
