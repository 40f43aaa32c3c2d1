"""The sparse Cholesky factor: exact on any pattern, shared, and honest about singular matrices."""

import numpy as np
import pytest
from autophyx_tet.fem.device import start_warp
from autophyx_tet.fem.elements import elastic
from autophyx_tet.fem.elements.assembly import BlockMatrix, discretise, stiffness
from autophyx_tet.fem.linalg import cholesky as elimination
from autophyx_tet.fem.linalg import cholesky as factor
from autophyx_tet.fem.linalg import solver
from autophyx_tet.fem.linalg.cholesky import (
    CholeskyFactor,
    NotPositive,
    cached_factor,
    dissect,
    join_supernodes,
    plan_elimination,
)
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.statics import solve_static
from scipy.sparse import block_diag, bsr_array, eye_array, random_array

from .bodies import with_uniform

EPS = np.finfo(float).eps


def block_matrix(A) -> BlockMatrix:
    """The same matrix in blocks of 3 x 3."""
    wp = start_warp()
    A = bsr_array(A, blocksize=(3, 3))
    A.sort_indices()
    return BlockMatrix(
        wp.array(A.indptr, dtype=wp.int32, device="cpu"),
        wp.array(A.indices, dtype=wp.int32, device="cpu"),
        wp.array(A.data, dtype=wp.mat33d, device="cpu"),
    )


def random_positive(nodes: int, density: float, rng: np.random.Generator):
    """Symmetric positive matrix of a random graph."""
    half = random_array((3 * nodes, 3 * nodes), density=density, rng=rng)
    return half @ half.T + eye_array(3 * nodes)


def stiff_cube(order: int, cells: int = 3):
    """Stiffness of a cube on springs, and the edges of its space."""
    grid = discretise(box_mesh((1, 1, 1), (cells,) * 3), order)
    count = len(grid.space.elements)
    matrix = stiffness(grid, np.full(count, 2.0), np.full(count, 1.0))
    return matrix, grid.space.edges


def test_it_solves_any_symmetric_positive_matrix():
    """A x = b to round-off: random graphs, several pieces, a diagonal, one node."""
    rng = np.random.default_rng(0)
    cases = [random_positive(n, d, rng) for n, d in ((1, 0.5), (7, 0.2), (60, 0.01), (90, 0.05))]
    cases += [block_diag(cases), eye_array(30) * 4.0]
    for A in cases:
        matrix = block_matrix(A)
        b = rng.normal(size=(matrix.nodes, 3))
        x = CholeskyFactor(matrix, plan_elimination(matrix)).solve(b)
        exact = np.linalg.solve(A.toarray(), b.ravel())
        bound = 100 * EPS * np.linalg.cond(A.toarray())  # backward stable, times the condition
        assert np.linalg.norm(x.ravel() - exact) <= bound * np.linalg.norm(exact)


def test_many_right_hand_sides_are_each_alone():
    """Solving for a block gives what each of its vectors gives, to round-off."""
    rng = np.random.default_rng(1)
    matrix = block_matrix(random_positive(50, 0.02, rng))
    lower = CholeskyFactor(matrix, plan_elimination(matrix))
    b = rng.normal(size=(50, 3, 4))
    together = lower.solve(b)
    for k in range(4):
        alone = lower.solve(b[:, :, k])
        assert together[:, :, k] == pytest.approx(alone, rel=1e-9, abs=1e-12)


def test_edges_follow_the_corners_for_little_fill():
    """P2 ordered by the graph of its corners fills at most 1.3 times what METIS makes of it."""
    matrix, edges = stiff_cube(2, 6)
    own = plan_elimination(matrix)
    short = plan_elimination(matrix, edges)
    assert sorted(short.order.numpy()) == list(range(matrix.nodes))
    assert short.operations < 1.3 * own.operations


def test_nested_dissection_beats_the_order_of_the_mesh():
    """Far less arithmetic than eliminating the nodes of a cube layer by layer."""
    matrix, _ = stiff_cube(1, 12)
    band = 3 * 13**2  # a layer of nodes
    assert plan_elimination(matrix).operations < 0.5 * 3 * matrix.nodes * band**2
    assert sorted(dissect(matrix.rows.numpy(), matrix.columns.numpy())) == list(range(13**3))


def test_joined_supernodes_cover_all_columns_in_order():
    """A chain, whose columns all have one entry below, joins into few; leaves of a star stay."""
    chain = join_supernodes(np.array([1, 2, 3, -1]), np.array([2, 2, 2, 1]))
    assert chain.tolist() == [0, 4]
    star = join_supernodes(np.array([3, 3, 3, -1]), np.array([2, 2, 2, 1]))
    assert star[0] == 0
    assert star[-1] == 4
    assert (np.diff(star) > 0).all()


def test_a_dense_front_is_cut_into_equal_pieces():
    """A full matrix is one supernode, cut so that little of its upper half is kept; solved."""
    nodes = 2 * elimination.WIDEST + 50
    rng = np.random.default_rng(2)
    half = rng.normal(size=(3 * nodes, 3 * nodes))
    A = half @ half.T + 3 * nodes * np.eye(3 * nodes)
    matrix = block_matrix(A)
    plan = plan_elimination(matrix)
    widths = np.diff(plan.fronts.first.numpy())
    assert widths.max() <= elimination.WIDEST
    assert np.ptp(widths) <= 1
    assert plan.entries < 0.7 * A.size  # a half, and a third of the upper triangle's squares
    b = rng.normal(size=(nodes, 3))
    x = CholeskyFactor(matrix, plan).solve(b)
    assert x.ravel() == pytest.approx(np.linalg.solve(A, b.ravel()), rel=1e-9, abs=1e-15)


def test_a_matrix_that_is_not_positive_is_named():
    """Indefinite, or no number: an error, never an answer."""
    for bad in (np.diag([1.0] * 6 + [-1.0] * 3), np.diag([1.0] * 8 + [np.nan])):
        matrix = block_matrix(bad)
        with pytest.raises(NotPositive):
            CholeskyFactor(matrix, plan_elimination(matrix))


def test_one_factor_for_one_matrix(monkeypatch):
    """The very same values share a factor; one entry changed, in place or not, makes a new one."""
    monkeypatch.setattr(factor, "_RECENT", [])
    matrix, _ = stiff_cube(1)
    values = matrix.values.numpy()
    values[diagonal_slots(matrix)] += np.eye(3)
    plan = plan_elimination(matrix)
    one = cached_factor(matrix, plan)
    again = BlockMatrix(matrix.rows, matrix.columns, start_warp().clone(matrix.values))
    assert cached_factor(again, plan) is one
    values[diagonal_slots(matrix)[0]] *= 1 + EPS
    assert cached_factor(matrix, plan) is not one


def diagonal_slots(matrix: BlockMatrix) -> np.ndarray:
    """Positions of the diagonal blocks."""
    rows = np.repeat(np.arange(matrix.nodes), np.diff(matrix.rows.numpy()))
    return np.flatnonzero(rows == matrix.columns.numpy())


def test_statics_of_two_loads_factor_once(monkeypatch):
    """Two loads on one body: one elimination, one factor, and the second answer scales."""
    monkeypatch.setattr(factor, "_RECENT", [])
    monkeypatch.setattr(elimination, "_RECENT", [])
    made = []
    make = factor.CholeskyFactor
    monkeypatch.setattr(factor, "CholeskyFactor", lambda *a: made.append(make(*a)) or made[-1])
    mesh = with_uniform(box_mesh((1, 0.2, 0.2), (6, 2, 2)), E=1e6, nu=0.3, rho=1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    one, two = (solve_static(mesh, held, gravity_vector=(0, 0, -g), order=2) for g in (1.0, 2.0))
    assert len(made) == 1
    assert one.solver == two.solver == solver.CHOLESKY
    assert two.displacement == pytest.approx(2 * one.displacement, rel=1e-9, abs=1e-12)


def test_two_weights_of_one_body_make_its_stiffness_once(monkeypatch):
    """Twice the density is twice the answer by the very same matrix; another E or nu is not."""
    made, make = [], elastic.linear_stiffness
    monkeypatch.setattr(elastic, "linear_stiffness", lambda *a: made.append(a) or make(*a))
    monkeypatch.setattr(elastic, "_RECENT_STIFFNESS", [])
    base = box_mesh((1, 0.2, 0.2), (6, 2, 2))
    held = Supports.clamp(len(base.points), base.points[:, 0] == 0)
    taken = ({}, {"rho": 2e3}, {"E": 2e6}, {"nu": 0.2})
    given = {"E": 1e6, "nu": 0.3, "rho": 1e3}
    bodies = (with_uniform(base, **(given | one)) for one in taken)
    found = [solve_static(one, held, gravity_vector=(0, 0, -1), order=2) for one in bodies]
    assert len(made) == 3
    light, heavy, stiff, _ = (one.displacement for one in found)
    # Relative: the residual of a solve is below 1e-8.
    assert heavy == pytest.approx(2 * light, rel=1e-7, abs=1e-12)
    assert stiff == pytest.approx(light / 2, rel=1e-7, abs=1e-12)


def test_the_factor_is_worth_it_on_thin_bodies_only(monkeypatch):
    """A plank is factored at once; a cube goes to conjugate gradients."""
    monkeypatch.setattr(solver, "DIRECT", 0)
    named = []
    for size, cells in (((40, 1, 1), (80, 2, 2)), ((1, 1, 1), (9, 9, 9))):
        mesh = with_uniform(box_mesh(size, cells), E=1e6, nu=0.3, rho=1e3)
        held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
        named.append(solve_static(mesh, held, gravity_vector=(0, 0, -1), order=2).solver)
    assert named == [solver.CHOLESKY, solver.CG_LINEAR]


def test_cg_that_takes_too_long_is_followed_by_the_factor(monkeypatch):
    """Out of patience: the factor answers, and the result says what was tried first."""
    monkeypatch.setattr(solver, "DIRECT", 0)
    monkeypatch.setattr(solver, "USUAL", 10)
    monkeypatch.setattr(solver, "iterations_worth", lambda plan, matrix: 11)
    mesh = with_uniform(box_mesh((1, 0.1, 0.1), (20, 2, 2)), E=1e6, nu=0.49, rho=1e3)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    found = solve_static(mesh, held, gravity_vector=(0, 0, -1), order=2)
    assert found.solver == f"{solver.CHOLESKY} after 11 iterations of {solver.CG_BOTH}"
    assert found.residual < 1e-8
