"""A motion is followed again, in coordinates of what the first one missed."""

import numpy as np
import pytest
from autophyx_tet.fem.reduced.basis import orthonormal_fields, relative_error, whole_model
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.reduced.motion import Following, ReducedMethod, enriched, with_motion_error
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.schemes import Scheme

from .bodies import clamped, linear, two_part_bar

MESH = two_part_bar((6, 2, 2))
GRAVITY = np.array([0.0, 2.0, -5.0])  # it swings by half its length
SCENE = Scene(mesh=MESH, supports=clamped(MESH), gravity_vector=GRAVITY, duration=0.2, frames=12)
DT = SCENE.duration / SCENE.frames


def modes(count):
    """So many linear modes of the clamped bar: they lock, and miss most of the higher ones."""
    body = linear(MESH)
    fields = np.moveaxis(body.modes.shapes[:count], 0, 2)
    return whole_model(body, orthonormal_fields(fields, body.mass), Subspace.VECTOR)


def full_path(law):
    full = Dynamics(
        MESH, supports=SCENE.supports, gravity_vector=GRAVITY, law=law, scheme=Scheme.BDF2,
        order=1, self_contact=False, tolerance=1e-9,
    )  # fmt: skip
    return np.stack([full.step(DT).u for _ in range(SCENE.frames)])


def path_of(found):
    return np.stack([state.u for state in found.states[1:]])


def test_of_the_linear_law_all_that_was_missed_is_the_full_body():
    """The full path lies in the span then, and a Galerkin step finds it, to its tolerance."""
    how = Following(dt=DT, frames=SCENE.frames, law="linear", most_cells=0, rounds=0)
    model = modes(4)
    once, missed = how._once(SCENE, model)
    full = full_path("linear")
    assert relative_error(model, path_of(once), full) > 0.005
    wider = enriched(model, SCENE, missed, joining=SCENE.frames, most_cells=0)
    again = how.of(SCENE, wider)
    assert relative_error(model, path_of(again), full) < 1e-4


def test_a_motion_that_is_off_is_followed_again():
    """Nearer to the full body by far, within the limit, and what was before is told."""
    model, heard, full = modes(4), [], full_path("neohookean")
    one, more = (
        Following(
            dt=DT, frames=SCENE.frames, most_cells=0, rounds=rounds, announce=heard.append
        ).of(SCENE, model)
        for rounds in (0, 2)
    )
    off = [relative_error(model, path_of(found), full) for found in (one, more)]
    assert off[0] > 0.05 > 0.01 > off[1]
    assert more.before[0] == pytest.approx(one.error.share)
    assert more.error.share < 0.05
    assert more.model.dofs > model.dofs
    assert len(heard) == len(more.before)
    assert "with 12 coordinates more" in heard[0]


def test_what_is_near_is_followed_once():
    found = ReducedMethod().solve(SCENE, order=1)
    assert found.model_error.share < 0.05
    assert [name for name, _ in found.solution] == ["reduced model"]


def test_a_reduced_body_of_a_file_has_what_its_swing_needs():
    """Let go under its load; a model of modes alone is off by more than the limit."""
    model = with_motion_error(modes(4), SCENE)
    assert model.dofs > 4
    assert model.accuracy.motion < 0.05
