"""The estimated error of a reduced motion: exact for the linear law, near for the other one."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.forces import lumped_mass
from autophyx_tet.fem.elements.space import make_space
from autophyx_tet.fem.reduced.basis import orthonormal_fields, relative_error, whole_model
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.reduced.motion import ROUGHLY, ReducedDynamics, error_of, missed_motion
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.schemes import Scheme

from .bodies import clamped, linear, two_part_bar, whole

MESH = two_part_bar((6, 2, 2))
MASS = lumped_mass(MESH, make_space(MESH, 1))
GRAVITY = np.array([0.0, 0.2, -0.5])


def coarse():
    """Four linear modes of the clamped bar: they lock, and miss most of the higher ones."""
    body = linear(MESH)
    fields = np.moveaxis(body.modes.shapes[:4], 0, 2)
    return whole_model(body, orthonormal_fields(fields, body.mass), Subspace.VECTOR)


def both(model, law, *, gravity=GRAVITY, velocity=(0, 0, 0), scheme=Scheme.BDF2, held=True):
    """Estimated error, and the paths (reduced, full) of 12 frames."""
    supports = clamped(MESH) if held else None
    v = np.broadcast_to(np.asarray(velocity, float), MESH.points.shape)
    v = np.where(supports.fixed, 0.0, v) if held else v
    body = ReducedDynamics(
        model,
        load=model.weight(gravity),
        velocity=model.coordinates(v),
        law=law,
        scheme=scheme,
        tolerance=1e-10,
    )
    full = Dynamics(
        MESH, supports=supports, gravity_vector=gravity, velocity=v, law=law, scheme=scheme,
        order=1, self_contact=False, tolerance=1e-9,
    )  # fmt: skip
    states = [body.state, *(body.step(1 / 60) for _ in range(12))]
    known = {"load": MASS[:, None] * gravity, "velocity": v, "law": law, "scheme": scheme}
    found = error_of(missed_motion(MESH, supports, states, **known), states, MASS)
    frames = np.stack([full.step(1 / 60).u for _ in range(12)])
    return found, np.stack([s.u for s in states[1:]]), frames


@pytest.mark.slow
@pytest.mark.parametrize("scheme", Scheme)
def test_of_the_linear_law_it_is_exact(scheme):
    """Full path minus reduced path, to the solver's tolerance; a push outside the span counts."""
    found, path, full = both(coarse(), "linear", velocity=[0.1, 0.3, 0.2], scheme=scheme)
    assert found is not None
    apart = np.sqrt((MASS[:, None] * (full - path) ** 2).sum() / (MASS[:, None] * path**2).sum())
    assert apart > 0.01
    assert found.share == pytest.approx(apart, rel=1e-5)
    assert found.largest == pytest.approx(np.linalg.norm(full - path, axis=2).max(), rel=1e-5)


@pytest.mark.slow
def test_a_bent_body_s_is_near():
    """Modes that lock, of a bar that bends by a tenth of its length: within a fifth of the truth.

    The error is followed to its first order.
    """
    model = coarse()
    found, path, full = both(model, "neohookean", gravity=4 * GRAVITY)
    assert found is not None
    apart = relative_error(model, path, full)
    assert apart > 0.02
    assert found.share == pytest.approx(apart, rel=0.2)


@pytest.mark.slow
def test_a_rough_one_is_bounded():
    """A bar that folds far under ten times the load: of every second frame, by few tangents.

    With a negative part and kept for long they drove it to 1e8 times the motion of a plant. It is
    less than the near one, by no more than it is taken larger for.
    """
    model, load = coarse(), 10 * GRAVITY * MASS[:, None]
    body = ReducedDynamics(model, load=model.weight(10 * GRAVITY), law="neohookean")
    states = [body.state, *(body.step(1 / 60) for _ in range(60))]
    known = {"load": load, "velocity": np.zeros_like(load), "law": "neohookean"}
    near, rough = (
        error_of(missed_motion(MESH, clamped(MESH), some, **known, rough=rough), some, MASS)
        for some, rough in ((states, False), (states[::2], True))
    )
    assert near.share / ROUGHLY < rough.share < 2 * near.share


def test_a_full_space_has_none():
    """All fields of the mesh: nothing is left unbalanced."""
    body = linear(MESH)
    free = ~body.held.fixed.ravel()
    fields = np.eye(len(free))[:, free].reshape(*MESH.points.shape, -1)
    model = whole_model(body, orthonormal_fields(fields, body.mass), Subspace.VECTOR)
    found, *_ = both(model, "neohookean")
    assert found is not None
    assert found.share < 1e-7


@pytest.mark.slow
def test_it_turns_with_a_free_body():
    """A body that spins by a third of a turn and stretches: within a tenth of the truth."""
    model = whole(linear(MESH, free=True), Subspace.SKINNING)
    x = MESH.points - MESH.points.mean(axis=0)
    v = np.cross([0.0, 0.0, 12.0], x) + 8 * x[:, [0]] * x
    found, path, full = both(model, "neohookean", gravity=np.zeros(3), velocity=v, held=False)
    assert found is not None
    apart = relative_error(model, path, full)
    assert apart > 1e-4
    assert found.share == pytest.approx(apart, rel=0.1)
