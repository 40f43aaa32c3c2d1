"""The two-level solver: right, and not slowed down by contrasts of E or finer meshes."""

import numpy as np
import pytest
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.errors import ConvergenceError
from autophyx_tet.fem.linalg import kernels_krylov as kernels_solver
from autophyx_tet.fem.linalg import kernels_multigrid as kernels_gpu
from autophyx_tet.fem.linalg import solver
from autophyx_tet.fem.linalg.multigrid import (
    _members,
    _motions,
    _raised_factor,
    boxes,
    inversion,
    make_groups,
)
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh, rigid_motions
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static


@pytest.fixture
def iterative(monkeypatch):
    """No direct factor, neither for small systems nor as a rescue."""
    monkeypatch.setattr(solver, "DIRECT", 0)
    monkeypatch.setattr(solver, "MOST_ENTRIES", 0)


def _iterations(n, contrast, layout):
    mesh = box_mesh((1, 1, 1), (n, n, n))
    x = mesh.centroids
    hard = {
        "layer": x[:, 2] > 0.5,
        "legs": (x[:, 2] < 0.5) & (np.abs(x[:, :2] - 0.5) < 0.3).any(axis=1),
        "random": np.random.default_rng(0).random(len(x)) < 0.5,
    }[layout]
    E = np.where(hard, 1e3 * contrast, 1e3)
    nu, rho = np.full_like(E, 0.4), np.full_like(E, 1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    body = mesh.with_material(ElementMaterial(E, nu, rho))
    return solve_static(body, held, gravity_vector=(0, 0, -9.81), order=1).iterations


@pytest.mark.slow
def test_contrast_hardly_adds_iterations(iterative):
    """From contrast 1 to 1e8 the iterations grow less than 2.5-fold."""
    for layout in ("layer", "legs", "random"):
        counts = [_iterations(8, c, layout) for c in (1, 1e2, 1e4, 1e6, 1e8)]
        assert max(counts) < 2.5 * counts[0], layout


def test_iterations_hardly_grow_with_the_mesh(iterative):
    """Twice as fine, eight times the tets: less than twice the iterations."""
    assert _iterations(12, 10, "layer") < 2 * _iterations(6, 10, "layer")


def test_both_solvers_agree(monkeypatch):
    """CG and the direct factor answer alike."""
    mesh = box_mesh((1, 0.2, 0.2), (10, 3, 3))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.4, rho=1e3))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    direct = solve_static(mesh, held, gravity_vector=(0, 0, -1))
    monkeypatch.setattr(solver, "DIRECT", 0)
    monkeypatch.setattr(solver, "MOST_ENTRIES", 0)
    iterated = solve_static(mesh, held, gravity_vector=(0, 0, -1))
    assert direct.iterations == 0 < iterated.iterations
    scale = np.abs(direct.displacement).max()
    assert iterated.displacement == pytest.approx(direct.displacement, abs=1e-6 * scale)


def test_nearly_incompressible_is_named(iterative, monkeypatch):
    """Too large for a factor, nu = .4999, out of iterations: an error that says what to do."""
    monkeypatch.setattr(solver, "MAX_ITERATIONS", 20)
    mesh = box_mesh((1, 0.5, 0.5), (4, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.4999, rho=1e3))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    with pytest.raises(ConvergenceError, match=r"nearly incompressible: take nu <= 0\.499"):
        solve_static(mesh, held, gravity_vector=(0, 0, -1), order=2)


def test_boxes_are_equal():
    """Bisection halves: box sizes differ by one node a level at most."""
    points = np.random.default_rng(0).random((1000, 3))
    sizes = np.bincount(boxes(points, 16))
    assert len(sizes) == 16
    assert sizes.max() - sizes.min() <= 4


def test_coarse_motions_span_rigid_motions():
    """Every rigid motion of the whole is a combination of those of the groups."""
    wp = start_warp()
    rng = np.random.default_rng(0)
    points = rng.random((60, 3))
    label = boxes(points, 4)
    lower = wp.array(np.broadcast_to(np.eye(3), (60, 3, 3)).copy(), dtype=wp.mat33d, device="cpu")
    free = wp.array(np.ones((60, 3)), dtype=wp.vec3d, device="cpu")
    basis = _motions(make_groups(points, label, "cpu"), lower, free).numpy()
    motion = rigid_motions(points) @ rng.normal(size=6)
    left = motion.copy()
    for k in range(4):
        Q = basis[label == k].reshape(-1, 6)
        assert Q.T @ Q == pytest.approx(np.eye(6), abs=1e-10)
        part = motion[label == k].reshape(-1)
        left[label == k] = (part - Q @ (Q.T @ part)).reshape(-1, 3)
    assert np.abs(left).max() < 1e-12


def test_motions_that_a_group_cannot_make_are_dropped():
    """Three nodes on a line, clamped in x: two translations and two rotations are left."""
    wp = start_warp()
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    lower = wp.array(np.broadcast_to(np.eye(3), (3, 3, 3)).copy(), dtype=wp.mat33d, device="cpu")
    free = wp.array([[0.0, 1, 1]] * 3, dtype=wp.vec3d, device="cpu")
    groups = make_groups(points, np.zeros(3, dtype=int), "cpu")
    basis = _motions(groups, lower, free).numpy().reshape(-1, 6)
    assert np.linalg.norm(basis, axis=0) == pytest.approx([0, 1, 1, 0, 1, 1])


def test_both_restrictions_are_the_transposed_prolongation():
    """P^T r gathered by column, as a GPU does, and scattered by row; P c, as a GPU does."""
    wp = start_warp()
    rng = np.random.default_rng(0)
    start, columns = np.array([0, 2, 3, 6, 6, 8]), np.array([0, 2, 1, 0, 1, 3, 2, 3])
    blocks, r = rng.normal(size=(8, 3, 6)), rng.normal(size=(5, 3))
    dense = np.zeros((5, 3, 4, 6))
    dense[np.repeat(np.arange(5), np.diff(start)), :, columns] = blocks
    P = [wp.array(v, dtype=wp.int32, device="cpu") for v in (start, columns)]
    transfer = wp.array(blocks, dtype=kernels_solver.mat36d, device="cpu")
    fine = wp.array(r, dtype=wp.vec3d, device="cpu")
    one, two = (wp.zeros(4, dtype=kernels_solver.vec6d, device="cpu") for _ in range(2))
    wp.launch(kernels_solver.scatter, 5, inputs=[*P, transfer, fine, one], device="cpu")
    flat = two.view(wp.float64).flatten()
    single, given = (wp.array(v.ravel(), dtype=wp.float32, device="cpu") for v in (blocks, r))
    inputs = [*_members(*P, 4), single, given, flat]
    wp.launch_tiled(kernels_gpu.single_restrict, dim=[4], inputs=inputs, block_dim=64, device="cpu")
    expected = np.einsum("icaj,ic->aj", dense, r)
    assert one.numpy() == pytest.approx(expected)
    assert two.numpy() == pytest.approx(expected, rel=1e-5)  # single precision
    back = wp.zeros(15, dtype=wp.float32, device="cpu")
    wp.launch(kernels_gpu.single_prolong, 15, inputs=[*P, single, flat, back], device="cpu")
    prolonged = np.einsum("icaj,aj->ic", dense, two.numpy())
    assert back.numpy().reshape(5, 3) == pytest.approx(prolonged, rel=1e-5, abs=1e-5)


def test_gauss_jordan_inverts():
    """A A^-1 = 1 for the dense kernels that a GPU solves the coarse system with."""
    wp = start_warp()
    half = np.random.default_rng(0).normal(size=(80, 60))
    matrix = half.T @ half
    given = wp.array(matrix, dtype=wp.float64, device="cpu")
    inverse = inversion(len(matrix), "cpu")(given).numpy()
    assert inverse @ matrix == pytest.approx(np.eye(60), abs=1e-10)


def test_a_coarse_matrix_that_is_singular_to_round_off_is_factored():
    """Dependent rigid modes (a Gram matrix of rank 40 of 60): L L^T = A to 1e-4 of its diagonal."""
    rng = np.random.default_rng(0)
    basis = rng.normal(size=(60, 40))
    matrix = basis @ basis.T
    lower = np.tril(_raised_factor(matrix.copy())[0])
    assert np.abs(lower @ lower.T - matrix).max() <= 1e-4 * matrix.diagonal().max()
