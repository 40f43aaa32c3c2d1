"""The linear elements below quadratic ones as a coarse level of CG."""

import numpy as np
import pytest
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.elements.assembly import apply_supports, discretise, node_supports, stiffness
from autophyx_tet.fem.elements.space import extend_linear
from autophyx_tet.fem.linalg import kernels_multigrid, solver
from autophyx_tet.fem.linalg.multigrid import CornerLevel, scale
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static

from .bodies import shaken_box, with_uniform


def test_linear_functions_are_corrected_exactly():
    """r = A u for a piecewise linear u that the supports allow: one correction finds u."""
    wp = start_warp()
    mesh = shaken_box(cells=(3, 2, 2), E=1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == mesh.points[:, 0].min())
    grid = discretise(mesh, 2)
    fixed = node_supports(held, grid.space).fixed
    matrix = stiffness(grid, *mesh.material.lame)
    apply_supports(matrix, fixed)
    corners = np.random.default_rng(0).normal(size=mesh.points.shape)
    corners[held.fixed] = 0.0
    u = np.where(fixed, 0.0, extend_linear(grid.space, corners))
    force = matrix.times(u)
    system = scale(matrix)
    inverse, lower = system.inverse.numpy(), system.lower.numpy()
    r = wp.array(np.einsum("nij,nj->ni", inverse, force), dtype=wp.vec3d, device="cpu")
    z = wp.zeros_like(r)
    CornerLevel(system.matrix, system.lower, grid.space.edges, fixed, r, z).apply()
    scaled = np.einsum("nji,nj->ni", lower, u)
    assert z.numpy() == pytest.approx(scaled, abs=1e-9 * np.abs(scaled).max())


@pytest.mark.slow
def test_transfers_by_corners_are_those_by_nodes():
    """P^T r and P u as a GPU makes them, here on a CPU: of numbers in single precision."""
    wp, rng = start_warp(), np.random.default_rng(0)
    corners, nodes = 20, 80
    own = np.arange(corners)
    ends = np.concatenate([np.stack([own, own], axis=1), rng.integers(0, corners, (60, 2))])
    T, inverse = rng.normal(size=(nodes, 3, 3)), rng.normal(size=(corners, 3, 3))
    r, x, u = (rng.normal(size=(n, 3)) for n in (nodes, nodes, corners))
    first = np.concatenate([[0], np.cumsum(np.bincount(ends.ravel()))])
    lists = [wp.array(v, dtype=int) for v in (first, np.argsort(ends, axis=None) // 2)]
    blocks = [wp.array(v, dtype=wp.mat33d) for v in (T, inverse)]
    flat = [wp.array(v.ravel().astype(np.float32)) for v in (r, x)]
    load, found = (wp.array(u, dtype=wp.vec3d) for _ in range(2))
    kernel = kernels_multigrid.single_restrict_to_corners
    inputs = [*lists, *blocks, flat[0], load]
    wp.launch_tiled(kernel, dim=[corners], inputs=inputs, block_dim=32, device="cpu")
    kernel = kernels_multigrid.single_prolong_from_corners
    inputs = [wp.array(ends, dtype=wp.vec2i), *blocks, found, flat[1]]
    wp.launch(kernel, nodes, inputs=inputs, device="cpu")
    total = np.zeros((corners, 3))
    for end in ends.T:
        np.add.at(total, end, np.einsum("nji,nj->ni", T, r))
        x += np.einsum("nij,nj->ni", T, np.einsum("nji,nj->ni", inverse, u)[end])
    scaled = np.einsum("nij,nj->ni", inverse, total)
    assert load.numpy() == pytest.approx(scaled, abs=1e-6 * np.abs(scaled).max())
    assert flat[1].numpy() == pytest.approx(x.ravel(), abs=1e-6 * np.abs(x).max())


@pytest.fixture
def iterative(monkeypatch):
    """A factor of the whole is said to be slow, one of the corners to be quick."""
    monkeypatch.setattr(solver, "DIRECT", 0)
    slow = solver.MAX_ITERATIONS
    monkeypatch.setattr(
        solver, "iterations_worth", lambda p, m: slow if len(p.order) == m.nodes else 0
    )


def shaken(ratio: float):
    """Cube of badly shaped tets of two materials, held at one side."""
    mesh = shaken_box(cells=(6, 6, 6), amount=0.28)
    E = np.where(mesh.centroids[:, 1] > 0.5, 1e9 * ratio, 1e9)
    mesh = mesh.with_material(ElementMaterial(E, np.full_like(E, 0.3), np.full_like(E, 1e3)))
    return mesh, Supports.clamp(len(mesh.points), mesh.points[:, 0] <= mesh.points[:, 0].min())


@pytest.mark.slow
def test_bad_tets_and_contrasts_take_few_iterations(iterative, monkeypatch):
    """Contrast 1 and 1e4: at most 60 iterations, fewer than over aggregates; the right answer."""
    options = {"gravity_vector": (0, 0, -9.81), "order": 2}
    for ratio in (1.0, 1e4):
        mesh, held = shaken(ratio)
        found = solve_static(mesh, held, **options)
        with monkeypatch.context() as patch:
            patch.setattr(solver, "_level_below", lambda matrix, edges: {"edges": None})
            over_aggregates = solve_static(mesh, held, **options)
            patch.setattr(solver, "_level_below", over_both)
            both = solve_static(mesh, held, **options)
            patch.setattr(solver, "iterations_worth", lambda plan, matrix: 0)
            exact = solve_static(mesh, held, **options)
        solvers = [r.solver for r in (found, over_aggregates, both, exact)]
        assert solvers == [
            solver.CG_LINEAR, solver.CG_AGGREGATES, solver.CG_BOTH, solver.CHOLESKY
        ]  # fmt: skip
        assert found.iterations <= 60
        assert found.iterations <= both.iterations < over_aggregates.iterations
        scale = np.abs(exact.displacement).max()
        for answer in (found, both):
            assert answer.displacement == pytest.approx(exact.displacement, abs=1e-5 * scale)


def over_both(matrix, edges):
    """The way of a GPU, and of bodies whose corners are too many for a factor."""
    return {"edges": edges, "factored": False}


@pytest.mark.slow
def test_iterations_over_both_levels_do_not_grow_with_the_mesh(iterative, monkeypatch):
    """From 6,591 unknowns to 46,875: a quarter more iterations at most."""
    monkeypatch.setattr(solver, "_level_below", over_both)
    counts = []
    for n in (6, 12):
        mesh = with_uniform(box_mesh((1, 1, 1), (n, n, n)), E=1e6, nu=0.4, rho=1e3)
        held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
        found = solve_static(mesh, held, gravity_vector=(0, 0, -9.81), order=2)
        assert found.solver == solver.CG_BOTH
        counts.append(found.iterations)
    assert counts[1] <= 1.25 * counts[0]  # 18 and 20; by the smoother alone twice as many


def test_a_body_that_nothing_holds_is_suspect(iterative):
    """A singular coarse matrix ends in the solver's own word, not in an answer."""
    mesh = with_uniform(box_mesh((1, 1, 1), (2, 2, 2)), E=1e3, nu=0.3, rho=1.0)
    grid = discretise(mesh, 2)
    matrix = stiffness(grid, *mesh.material.lame)
    b = np.random.default_rng(0).normal(size=grid.space.nodes.shape)
    fixed = np.zeros(b.shape, dtype=bool)
    known = {"points": grid.space.nodes, "fixed": fixed, "edges": grid.space.edges}
    assert solver.solve_system(matrix, b, **known, tolerance=1e-8).suspect
