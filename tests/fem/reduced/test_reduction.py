"""Few cells stand for all tets: weights that are not negative, and the same frequency and sag."""

import numpy as np
import pytest
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.reduced.basis import (
    accuracy_warnings,
    linear_body,
    measured,
    reduce_body,
    vector_basis,
    whole_model,
)
from autophyx_tet.fem.reduced.cubature import nonnegative_weights, with_cells
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.scene.supports import Supports
from scipy.optimize import nnls

from ..bodies import with_uniform
from .bodies import clamped, two_part_bar

GRAVITY = (0.0, 0.0, -1.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", Subspace, ids=str)
def test_cells_agree_with_all_tets(kind):
    """Weights >= 0 and f1 within 1 % by what the model says and by its own measure against FEM."""
    mesh = two_part_bar((12, 3, 3))
    held = clamped(mesh)
    model = measured(
        reduce_body(mesh, held, gravity_vector=GRAVITY, kind=kind), mesh, held, GRAVITY
    )
    assert len(model.cells) < len(mesh.tets)
    assert (model.weights >= 0).all()
    assert model.accuracy.cell_frequency == pytest.approx(1.0, abs=0.01)
    assert model.accuracy.frequency == pytest.approx(1.0, abs=0.01)
    assert model.accuracy.sag < 0.01
    assert all("too coarse" in warning for warning in accuracy_warnings(model))


def test_too_few_cells_are_told():
    """Six cells cannot carry a bar of two parts: the model says so."""
    mesh = two_part_bar()
    model = reduce_body(mesh, clamped(mesh), gravity_vector=GRAVITY, most_cells=6)
    assert len(model.cells) <= 6
    assert model.accuracy.cell_error > 0.01
    assert accuracy_warnings(model)


def test_cells_whose_sag_was_not_compared_are_told():
    """Without a load there is no sag: what the cells were chosen by is said, not left out."""
    mesh = two_part_bar()
    model = reduce_body(mesh, clamped(mesh), gravity_vector=(0, 0, 0), most_cells=60)
    assert np.isnan(model.accuracy.cell_sag)
    assert any("by the frequency alone" in warning for warning in accuracy_warnings(model))


@pytest.mark.slow
def test_a_body_that_swings_far_rests_as_the_full_one():
    """A soft plate under twice the load it was made for, bent by half its length.

    Derivatives at rest are of the second order: of these alone it was 1.6 % off, now .12 %.
    """
    mesh = with_uniform(box_mesh((0.4, 0.3, 0.06), (6, 4, 1)), E=5e4, nu=0.45, rho=500.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    gravity = np.array([0, 0, -9.81 * 0.15])
    model = reduce_body(mesh, held, gravity_vector=gravity, order=2)
    assert model.dofs == 34
    assert measured(model, mesh, held, 2 * gravity).accuracy.sag < 0.003


def test_nonnegative_weights_are_lawson_and_hanson_s():
    """The minimiser over x >= 0 is unique: another code finds the same, from any start."""
    rng = np.random.default_rng(0)
    A, y = rng.normal(size=(60, 25)), rng.normal(size=60)
    wanted, _ = nnls(A, y)
    for start in (np.zeros(25), np.maximum(rng.normal(size=25), 0)):
        found = nonnegative_weights(A.T @ A, A.T @ y, start)
        assert found == pytest.approx(wanted, abs=1e-9)


@pytest.mark.slow
def test_clamped_bar_rings_as_euler_and_bernoulli_say():
    """L/h = 20, nu = 0: f1 = 1.8751^2 / (2 pi L^2) sqrt(E I / rho A), within 2 %.

    Linear tets are too stiff by a share that falls with the square of their size: extrapolated from
    two meshes (Richardson).
    """
    length, h, E, rho = 1.0, 0.05, 1e6, 1000.0
    found = []
    for across in (2, 4):
        mesh = box_mesh((length, h, h), (20 * across, across, across))
        mesh = with_uniform(mesh, E=E, nu=0.0, rho=rho)
        held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
        body = linear_body(mesh, held)
        whole = whole_model(body, vector_basis(body), Subspace.VECTOR)
        model = with_cells(whole, whole.weight(GRAVITY), 250)
        found.append(model.accuracy.frequency * body.modes.frequencies[0])
    exact = 1.8751040687**2 / (2 * np.pi * length**2) * np.sqrt(E * h**2 / 12 / rho)
    assert (4 * found[1] - found[0]) / 3 == pytest.approx(exact, rel=0.02)
