"""Moduli fitted to motions: twins get their numbers back, and what cannot be told is said."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem.errors import ConvergenceError, InputError
from autophyx_tet.fem.identify import (
    NU_HIGH,
    ObservedMotion,
    fit_motion,
    fit_warnings,
    moduli_forces,
)
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import box_mesh
from autophyx_tet.fem.reduced.basis import reduce_body
from autophyx_tet.fem.reduced.elasticity import ReducedElasticity
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.reduced.motion import ReducedDynamics
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.schemes import Scheme

from .reduced.bodies import linear, two_part_bar, whole

DT = 1 / 60


@pytest.fixture(scope="module")
def model():
    return whole(linear(two_part_bar((6, 2, 2))), Subspace.VECTOR)


def twin(model, *, scale, nu, scheme=Scheme.BDF2, frames=12):
    """What the same model does with other moduli, let go under a sideways and downward weight."""
    load = model.weight([0.0, 0.3, -0.6])
    other = model.with_moduli(scale * model.E, np.full_like(model.nu, nu))
    body = ReducedDynamics(other, load=load, scheme=scheme, tolerance=1e-10)
    u = [body.state.u, *(body.step(DT).u for _ in range(frames))]
    return ObservedMotion(displacement=np.stack(u), dt=DT, load=load, velocity=np.zeros(model.dofs))


@pytest.mark.parametrize("scheme", [Scheme.BDF2, Scheme.IMPLICIT_EULER])
def test_a_twin_s_scale_comes_back(model, scheme):
    """From three times off, within 1e-4."""
    found = fit_motion(model, twin(model, scale=1 / 3, nu=0.3, scheme=scheme), scheme=scheme)
    assert found.scale == pytest.approx(1 / 3, rel=1e-4)
    assert found.nu is None
    assert found.error < 1e-4 < found.unfitted_error


@pytest.mark.slow
def test_a_twin_s_nu_comes_back_too(model):
    found = fit_motion(model, twin(model, scale=1.7, nu=0.4), with_nu=True)
    assert found.scale == pytest.approx(1.7, rel=1e-4)
    assert found.nu == pytest.approx(0.4, abs=1e-4)
    assert found.covariance.shape == (2, 2)
    assert abs(found.correlation) <= 1


@pytest.mark.slow
def test_a_full_body_s_scale_comes_back():
    """Of docs/reduced.md: 30 frames of a full bar, from a third of its E: to .2 %, with nu 1 %."""
    mesh = box_mesh((1.0, 0.12, 0.12), (24, 4, 4))
    E = np.where(mesh.centroids[:, 0] < 0.5, 1e6, 1e5)
    flat = np.full_like(E, 0.35), np.full_like(E, 1000.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    weight, push = np.array([0, 0, -1.0]), np.where(held.fixed, 0.0, [0, 0.35, 0])
    known = {"gravity_vector": weight, "supports": held, "order": 1, "self_contact": False}
    full = Dynamics(
        mesh.with_material(ElementMaterial(E, *flat)), velocity=push, scheme=Scheme.BDF2, **known
    )
    frames = [np.zeros_like(mesh.points), *(full.step(DT).u for _ in range(30))]
    soft = mesh.with_material(ElementMaterial(E / 3, *flat))
    model = reduce_body(soft, held, gravity_vector=weight, derived=36, order=1)
    observed = ObservedMotion(
        displacement=np.stack(frames),
        dt=DT,
        load=model.weight(weight),
        velocity=model.coordinates(push),
    )
    assert fit_motion(model, observed).scale == pytest.approx(3, rel=2e-3)
    # The cells that are drawn move nu by .005, and E the other way.
    found = fit_motion(model, observed, with_nu=True)
    assert found.scale == pytest.approx(3, rel=1e-2)
    assert found.nu == pytest.approx(0.35, abs=1e-2)
    assert fit_warnings(found) == ()
    assert "not to be trusted" in fit_warnings(replace(found, error=0.02))[0]


def test_forces_of_the_moduli_are_derivatives(model):
    """By log E and nu, against central differences."""
    q = 0.01 * np.random.default_rng(0).normal(size=model.dofs)
    found = moduli_forces(ReducedElasticity(model), q)

    def force(log_E, nu):
        other = model.with_moduli(np.exp(log_E) * model.E, model.nu + nu)
        return ReducedElasticity(other).response(q).force

    h = 1e-5
    for column, (a, b) in zip(found.T, ((h, 0), (0, h)), strict=True):
        wanted = (force(a, b) - force(-a, -b)) / (2 * h)
        assert np.linalg.norm(column - wanted) < 1e-6 * np.linalg.norm(wanted)


def test_what_lies_outside_the_span_is_told(model):
    """A motion that no coordinate makes leaves its whole share, whatever the moduli."""
    observed = twin(model, scale=2.0, nu=0.3)
    rng = np.random.default_rng(0)
    noise = rng.normal(size=observed.displacement.shape) * (model.basis != 0).any(axis=2)
    noise -= np.stack([model.displacement(model.coordinates(n)) for n in noise])
    size = np.sqrt((model.mass[:, None] * observed.displacement**2).sum())
    noise *= size / np.sqrt((model.mass[:, None] * noise**2).sum())
    both = observed.displacement + noise
    both[0] = 0
    found = fit_motion(model, ObservedMotion(**{**vars(observed), "displacement": both}))
    assert found.scale == pytest.approx(2.0, rel=1e-4)
    assert found.outside == pytest.approx(np.sqrt(0.5), rel=0.05)
    assert found.error == pytest.approx(found.outside, rel=1e-3)


@pytest.mark.slow
def test_nu_beyond_its_limit_is_told(model):
    """Of a nu that the fit may not reach it takes the nearest one, and says so."""
    found = fit_motion(model, twin(model, scale=1.0, nu=0.4975, frames=6), with_nu=True)
    assert found.nu == NU_HIGH
    assert "ended at its limit of 0.495" in fit_warnings(found)[0]
    assert fit_warnings(fit_motion(model, twin(model, scale=1.2, nu=0.3, frames=3))) == ()


def test_a_fit_that_does_not_settle_is_refused(model, monkeypatch):
    monkeypatch.setattr("autophyx_tet.fem.identify.MOST", 2)
    with pytest.raises(ConvergenceError, match="does not settle"):
        fit_motion(model, twin(model, scale=0.2, nu=0.3, frames=3))


def test_a_motion_of_another_mesh_is_refused(model):
    observed = twin(model, scale=1.0, nu=0.3)
    short = ObservedMotion(**{**vars(observed), "displacement": observed.displacement[:, :-1]})
    with pytest.raises(InputError, match="same mesh"):
        fit_motion(model, short)
