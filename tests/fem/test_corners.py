"""The linear elements below quadratic ones as a coarse level of CG."""

import numpy as np
import pytest
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.elements.assembly import apply_supports, discretise, node_supports, stiffness
from autophyx_tet.fem.elements.space import extend_linear
from autophyx_tet.fem.linalg import solver
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
            patch.setattr(solver, "_level_edges", lambda matrix, edges: None)
            over_aggregates = solve_static(mesh, held, **options)
            patch.setattr(solver, "iterations_worth", lambda plan, matrix: 0)
            exact = solve_static(mesh, held, **options)
        solvers = [r.solver for r in (found, over_aggregates, exact)]
        assert solvers == [solver.CG_LINEAR, solver.CG_AGGREGATES, solver.CHOLESKY]
        assert found.iterations <= 60
        assert found.iterations < over_aggregates.iterations
        scale = np.abs(exact.displacement).max()
        assert found.displacement == pytest.approx(exact.displacement, abs=1e-5 * scale)


def test_a_body_that_nothing_holds_is_suspect(iterative):
    """A singular coarse matrix ends in the solver's own word, not in an answer."""
    mesh = with_uniform(box_mesh((1, 1, 1), (2, 2, 2)), E=1e3, nu=0.3, rho=1.0)
    grid = discretise(mesh, 2)
    matrix = stiffness(grid, *mesh.material.lame)
    b = np.random.default_rng(0).normal(size=grid.space.nodes.shape)
    fixed = np.zeros(b.shape, dtype=bool)
    known = {"points": grid.space.nodes, "fixed": fixed, "edges": grid.space.edges}
    assert solver.solve_system(matrix, b, **known, tolerance=1e-8).suspect
