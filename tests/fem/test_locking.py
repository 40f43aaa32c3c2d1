"""Poisson's ratio near one half: quadratic elements against linear ones, which lock."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.reduced.basis import accuracy_warnings, reduce_body
from autophyx_tet.fem.reduced.elasticity import ReducedElasticity, reduced_frequencies, reduced_rest
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.reduced.motion import ReducedMethod, model_in_words
from autophyx_tet.fem.scenarios import drop, squeeze
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import METHOD
from autophyx_tet.fem.solve.error import linear_stiffening
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.result import ModelError, MotionResult
from autophyx_tet.fem.solve.schemes import Scheme
from autophyx_tet.fem.solve.statics import solve_static
from autophyx_tet.toolkit.verdict.checks import follows, locking

from .bodies import faces_at, shaken_box, with_uniform


def _against_p2(nu):
    """Tip of a sheared beam of plain P1 over that of P2."""
    mesh = with_uniform(box_mesh((1, 0.4, 0.4), (10, 4, 4)), E=1e6, nu=nu)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    load = Traction(faces_at(mesh, 0, 1), np.array([0, 0, -1e2]))
    tip = np.isclose(mesh.points[:, 0], 1)
    results = (solve_static(mesh, held, traction=load, order=order) for order in (1, 2))
    plain, fine = (r.displacement[tip, 2].mean() for r in results)
    return plain / fine


@pytest.mark.slow
def test_sweep_of_nu():
    """From nu = .3 to .4999 plain P1 locks beside P2 more and more."""
    plain = np.array([_against_p2(nu) for nu in (0.3, 0.4, 0.49, 0.499, 0.4999)])
    assert plain[-1] < 0.7 * plain[0]
    assert (np.diff(plain) < 0).all()


def test_locking_share():
    """The result says how much of the volume has nu > 0.45 under P1."""
    mesh = shaken_box()
    nu = np.where(mesh.centroids[:, 2] > 0.5, 0.48, 0.3)
    body = mesh.with_material(type(mesh.material)(mesh.material.E, nu, mesh.material.rho))
    held = Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0)
    share = mesh.volumes[nu > 0.45].sum() / mesh.volume
    assert solve_static(body, held, order=1).locking_fraction == pytest.approx(share)
    assert solve_static(body, held, order=2).locking_fraction == 0
    plain = solve_static(shaken_box(), held, order=1)
    assert locking(plain).outcome == "doubtful"  # they bend too stiffly at any nu


def _pad(cells):
    return with_uniform(box_mesh((0.1, 0.1, 0.03), cells), E=1e6, nu=0.495, rho=1100.0)


@pytest.mark.slow
def test_a_squeezed_rubber_pad_does_not_lock():
    """Plates on a pad of nu = .495: within 15 % of a refined quadratic answer; P1 locks."""
    press = lambda cells, order: squeeze(  # noqa: E731
        _pad(cells), axis="z", share=0.02, friction=0.5, frames=3, order=order
    )
    chosen, linear, fine = press((3, 3, 1), None), press((3, 3, 1), 1), press((4, 4, 2), 2)
    force = [-r.obstacle_forces[-1, 1, 2] for r in (chosen, linear, fine)]
    assert chosen.order == 2
    # One cell across the thickness cannot bulge as the pad does: 12 % above two, 14 % above three.
    assert force[0] == pytest.approx(force[2], rel=0.15)
    assert force[1] > 2 * force[2]  # far outside of what is asked of the chosen elements
    assert locking(chosen).outcome == "passed"
    assert "quadratic" in locking(chosen).sentence
    assert locking(linear).outcome == "failed"
    assert "100% of the volume" in locking(linear).sentence


@pytest.mark.slow
def test_a_dropped_rubber_pad_does_not_lock():
    """The largest force of a drop of nu = .495 is within 5 % of a refined quadratic answer."""
    peaks = [
        drop(_pad(cells), height=0.05, frames=60, order=order).obstacle_forces[:, 0, 2].max()
        for cells, order in (((3, 3, 1), None), ((6, 6, 2), 2))
    ]
    assert peaks[0] == pytest.approx(peaks[1], rel=0.05)


# A beam 1 x .05 x .05 m one element thick, its first frequency and its sag by Euler & Bernoulli.
L, SIDE, E, RHO = 1.0, 0.05, 2e11, 7850.0
EXACT_F1 = 1.875104**2 / (2 * np.pi) * np.sqrt(E * SIDE**2 / (12 * RHO)) / L**2
EXACT_SAG = 9.81 * RHO * SIDE**2 * L**4 / (8 * E * SIDE**4 / 12)


def _beam(cells=(9, 1, 1), nu=0.3):
    mesh = with_uniform(box_mesh((L, SIDE, SIDE), cells), E=E, nu=nu, rho=RHO)
    return mesh, Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)


def test_linear_elements_are_too_stiff_by_what_theory_says():
    """One element thick: (f1 / f1 of Euler & Bernoulli)^2, with shear and P2's own error in 6 %."""
    mesh, held = _beam()
    f1 = float(natural_modes(mesh, 1, supports=held, order=1).frequencies[0])
    assert linear_stiffening(mesh, held) == pytest.approx((f1 / EXACT_F1) ** 2, rel=0.06)
    assert linear_stiffening(mesh, held) > 4


@pytest.mark.slow
def test_linear_elements_are_less_too_stiff_where_they_are_finer():
    """Excess falls with the square of the element: in half the size to a third at most."""
    excess = [linear_stiffening(*_beam(cells)) - 1 for cells in ((10, 1, 1), (20, 2, 2))]
    assert 0 < excess[1] < excess[0] / 3


def test_a_motion_of_a_coarse_bar_takes_elements_that_bend():
    """Let go at once a beam swings to twice its sag: BDF2 damps it by less than 10 %."""
    mesh, held = _beam()
    swing = {"duration": 0.5 / EXACT_F1, "frames": 20, "gravity_vector": (0, 0, -9.81)}
    scene = Scene(mesh=mesh, supports=held, self_contact=False, **swing)
    motion = METHOD.solve(scene, scheme=Scheme.BDF2)
    assert np.abs(motion.displacements[..., 2]).max() == pytest.approx(2 * EXACT_SAG, rel=0.1)
    assert locking(motion).outcome == "passed"
    few = METHOD.solve(replace(scene, frames=1), order=1)
    assert locking(few).outcome == "failed"
    assert "too coarse for linear elements" in locking(few).sentence


@pytest.mark.slow
@pytest.mark.parametrize("kind", Subspace)
def test_a_reduced_body_of_a_coarse_beam_bends(kind):
    """Its tip sags by q L^4 / 8 E I and rings as Euler & Bernoulli say, within 1 %.

    Of nu = 0, so that the wall holds back no anticlastic bending; linear elements are 9 times too
    stiff. Handles: 2 %, they have no curvature of their own.
    """
    mesh, held = _beam(nu=0.0)
    model = reduce_body(mesh, held, kind=kind)
    within = 0.01 if kind is Subspace.VECTOR else 0.02
    elasticity = ReducedElasticity(model)
    rest = model.displacement(reduced_rest(elasticity, model.weight([0, 0, -9.81])).u)
    tip = rest[: len(mesh.points)][mesh.points[:, 0] > L - 1e-9, 2]
    assert -tip.mean() == pytest.approx(EXACT_SAG, rel=within)
    assert reduced_frequencies(elasticity)[0] == pytest.approx(EXACT_F1, rel=within)
    assert linear_stiffening(mesh, held) > 4
    assert accuracy_warnings(model) == ()


def test_a_reduced_motion_of_a_coarse_beam_swings_to_twice_its_sag():
    """As the full body's, with the same damping by BDF2; and no verdict is against it."""
    mesh, held = _beam(nu=0.0)
    swing = {"duration": 0.5 / EXACT_F1, "frames": 20, "gravity_vector": (0, 0, -9.81)}
    motion = ReducedMethod().solve(Scene(mesh=mesh, supports=held, **swing))
    assert np.abs(motion.displacements[..., 2]).max() == pytest.approx(2 * EXACT_SAG, rel=0.1)
    assert locking(motion).outcome == "passed"
    assert all(check.outcome == "passed" for check in follows(motion))


def test_linear_elements_of_a_reduced_body_say_that_they_are_too_stiff():
    mesh, held = _beam()
    model = reduce_body(mesh, held, order=1)
    f1 = model.accuracy.best_frequency
    assert f1**2 == pytest.approx(model.accuracy.stiffening, rel=1e-3)
    assert f"{f1:.3f} of the full body's with quadratic elements" in model_in_words(model)
    assert any("too coarse for linear elements" in said for said in accuracy_warnings(model))


def test_few_coordinates_of_elements_that_lock_are_no_good_verdict():
    """A motion within .1 % of a full body that is 4 times too stiff does not pass."""
    near = ModelError(1e-3, 1e-6)
    said = {"frames": (), "dt": 0.1, "points": 4, "model_error": near}
    (check,) = follows(MotionResult(**said, stiffening=4.2))
    assert check.outcome == "failed"
    assert "4.2 times too stiff" in check.sentence
    assert all(
        follows(MotionResult(**said, stiffening=s))[0].outcome == "passed" for s in (1.05, np.nan)
    )
