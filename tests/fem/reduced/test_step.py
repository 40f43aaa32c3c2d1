"""Motions of reduced bodies: what they keep, the order of their steps, the full body's motion."""

import itertools

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.reduced.basis import (
    relative_error,
    skinned_basis,
    turning_functions,
    whole_model,
)
from autophyx_tet.fem.reduced.elasticity import KeptInverse, ReducedElasticity, reduced_frequencies
from autophyx_tet.fem.reduced.model import Subspace
from autophyx_tet.fem.reduced.motion import ReducedDynamics
from autophyx_tet.fem.solve.dynamics import Dynamics
from autophyx_tet.fem.solve.schemes import Scheme

from .bodies import clamped, linear, two_part_bar, whole

MESH = two_part_bar((6, 2, 2))
GRAVITY = np.array([0.0, 0.0, -0.5])


@pytest.fixture(scope="module")
def thrown():
    """Free skinned body with a velocity field that stretches, bends and turns it."""
    model = whole(linear(MESH, free=True), Subspace.SKINNING)
    x = MESH.points - MESH.points.mean(axis=0)
    velocity = np.cross([0.3, 1.0, 2.0], x) + 0.3 * x[:, [0]] * x + [0.1, -0.2, 0.3]
    return model, model.coordinates(velocity)


def momentum(model, state):
    """Of translation [kg m/s] and about the origin [kg m^2/s]."""
    p = model.mass[:, None] * state.v
    return np.concatenate([p.sum(axis=0), np.cross(model.points + state.u, p).sum(axis=0)])


def test_a_free_body_keeps_its_momentum(thrown):
    """Of translation to round-off under every scheme: the handles hold the three translations."""
    model, velocity = thrown
    for scheme in Scheme:
        body = ReducedDynamics(model, velocity=velocity, scheme=scheme, tolerance=1e-12)
        before = momentum(model, body.state)[:3]
        for _ in range(5):
            body.step(0.01)
        after = momentum(model, body.state)[:3]
        assert np.abs(after - before).max() < 1e-12 * np.linalg.norm(before)


@pytest.mark.slow
def test_a_free_body_keeps_its_angular_momentum(thrown):
    """The span holds every turn of the deformed body: what BDF2 loses falls as the step squared."""
    model, velocity = thrown
    lost = []
    for steps in (16, 32, 64):
        body = ReducedDynamics(model, velocity=velocity, tolerance=1e-10)
        before = momentum(model, body.state)[3:]
        for _ in range(steps):
            body.advance(0.05 / steps)
        lost.append(np.linalg.norm(momentum(model, body.state)[3:] - before))
    slopes = np.log2([lost[0] / lost[1], lost[1] / lost[2]])
    assert (slopes > 1.6).all()
    assert lost[-1] < 1e-2 * np.linalg.norm(before)


def test_a_thrown_body_bends_as_the_full_one():
    """It turns by a radian and bends by a tenth of itself: functions of its modes within .2 %.

    Most of the motion is rigid. As many coordinates of modal handles are half as far off again.
    """
    x = MESH.points - MESH.points.mean(axis=0)
    velocity = np.cross([0.0, 0.0, 10.0], x) + 25 * x[:, [0]] * x[:, [0]] * [0.0, 0.0, 1.0]
    full = Dynamics(
        MESH, velocity=velocity, order=1, scheme=Scheme.BDF2, self_contact=False, tolerance=1e-8
    )
    frames = np.stack([full.step(0.005).u for _ in range(20)])
    body, off = linear(MESH, free=True), []
    functions = whole_model(body, skinned_basis(turning_functions(body, 16)), Subspace.SKINNING)
    for model in (functions, whole(body, Subspace.SKINNING)):
        moving = ReducedDynamics(model, velocity=model.coordinates(velocity))
        found = np.stack([moving.step(0.005).u for _ in range(20)])
        off.append(relative_error(model, found, frames))
    assert off[0] < 2e-3
    assert off[1] > 1.5 * off[0]


def test_bdf2_is_of_second_order():
    """The path's error falls with the square of the step: slope between 1.8 and 2.2.

    A clamped bar swings by a tenth of its length, a quarter of its slowest period.
    """
    model = whole(linear(MESH), Subspace.VECTOR)
    body = ReducedDynamics(model)
    square, modes = np.linalg.eigh(body.elasticity.tangent(np.zeros(model.dofs)))
    largest = np.linalg.norm(model.displacement(modes[:, 0]), axis=1).max()
    velocity = 0.05 / largest * np.sqrt(square[0]) * modes[:, 0]
    time, ends = np.pi / 2 / np.sqrt(square[0]), []
    for steps in (40, 80, 160, 320):
        body = ReducedDynamics(model, velocity=velocity, tolerance=1e-10)
        for _ in range(steps):
            body.advance(time / steps)
        ends.append(body.now.u)
    gaps = [np.linalg.norm(b - a) for a, b in itertools.pairwise(ends)]
    slopes = np.log2([gaps[0] / gaps[1], gaps[1] / gaps[2]])
    assert (slopes > 1.8).all()
    assert (slopes < 2.2).all()


def test_a_small_vibration_has_the_model_s_own_period():
    """Along its first shape, u = a cos(w t): BDF2's phase error is (w dt)^2 / 3 of a radian."""
    model = whole(linear(MESH), Subspace.VECTOR)
    body = ReducedDynamics(model, tolerance=1e-10)
    square, modes = np.linalg.eigh(body.elasticity.tangent(np.zeros(model.dofs)))
    frequency = reduced_frequencies(body.elasticity)[0]
    assert frequency == pytest.approx(np.sqrt(square[0]) / 2 / np.pi, rel=1e-9)
    speed = 1e-6 * np.sqrt(square[0])
    body = ReducedDynamics(model, velocity=speed * modes[:, 0], tolerance=1e-7)
    steps = 400
    for _ in range(steps // 4):
        body.advance(1 / frequency / steps)
    phase = 2 * np.pi / steps
    amplitude = modes[:, 0] @ body.now.u
    assert amplitude == pytest.approx(1e-6, rel=10 * phase**2)


@pytest.mark.slow
@pytest.mark.parametrize("kind", Subspace, ids=str)
def test_it_moves_as_the_full_body(kind):
    """Released under its weight: 30 frames of the same scheme, within 5 % in the norm of mass."""
    model = whole(linear(MESH), kind, handles=8)
    options = {"scheme": Scheme.BDF2}
    full = Dynamics(MESH, supports=clamped(MESH), gravity_vector=GRAVITY, order=1, **options)
    body = ReducedDynamics(model, load=model.weight(GRAVITY), **options)
    frames = [[mover.step(1 / 60).u for _ in range(30)] for mover in (body, full)]
    assert relative_error(model, *(np.stack(f) for f in frames)) < 0.05


def test_state_is_told_as_the_full_body_s():
    """Energies add up: released from rest, the weight's work is kinetic and elastic energy."""
    model = whole(linear(MESH), Subspace.VECTOR)
    options = {"scheme": Scheme.TRAPEZOIDAL, "tolerance": 1e-8}
    body = ReducedDynamics(model, load=model.weight(GRAVITY), **options)
    states = [body.step(1 / 240) for _ in range(20)]
    for state in states:
        work = -state.potential
        assert state.kinetic + state.elastic == pytest.approx(work, rel=1e-2)
    assert states[-1].gap == np.inf
    assert states[-1].obstacle_force.shape == (0, 3)


def test_wrong_start_is_refused():
    from autophyx_tet.fem.elements.space import make_space
    from autophyx_tet.fem.scene.obstacles import Plane
    from autophyx_tet.fem.solve.contact import Contact

    model = whole(linear(MESH), Subspace.VECTOR)
    inside = Contact(MESH, make_space(MESH, 1), [Plane((0, 0, 0.02))], friction=0.0)
    with pytest.raises(InputError, match="inside an obstacle"):
        ReducedDynamics(model, contact=inside)


@pytest.mark.parametrize("kind", Subspace, ids=str)
def test_a_kept_inverse_changes_no_motion(kind, monkeypatch):
    """Steps of the same residual, by few Hessians or by one every iteration, are the same."""
    model = whole(linear(two_part_bar((6, 2, 2))), kind)
    made = []
    tangent = ReducedElasticity.tangent

    def counted(self, q, **options):
        made.append(q)
        return tangent(self, q, **options)

    monkeypatch.setattr(ReducedElasticity, "tangent", counted)

    def path():
        made.clear()
        load = model.weight([0.0, 0.3, -2.0])
        body = ReducedDynamics(model, load=load, tolerance=1e-10)
        return np.stack([body.advance(1 / 60).u for _ in range(12)]), len(made)

    few, few_made = path()
    monkeypatch.setattr("autophyx_tet.fem.reduced.elasticity.CONTRACTION", 0.0)
    every, every_made = path()
    assert np.linalg.norm(few - every) < 1e-8 * np.linalg.norm(every)
    assert few_made < 0.6 * every_made


def test_a_kept_inverse_takes_in_what_it_is_told():
    """The secant it was told of last holds, and it stays symmetric; what bends down is no news."""
    rng = np.random.default_rng(0)
    A, B = (a @ a.T + np.eye(6) for a in rng.normal(size=(2, 6, 6)))
    kept = KeptInverse()
    kept.renew(A)
    every = lambda matrix: np.stack([kept.solve(column) for column in matrix.T], 1)  # noqa: E731
    assert every(A) == pytest.approx(np.eye(6), abs=1e-12)
    for move in rng.normal(size=(4, 6)):
        kept.learn(move, B @ move)
        assert kept.solve(B @ move) == pytest.approx(move, abs=1e-12)
        kept.learn(move, -B @ move)
        assert kept.solve(B @ move) == pytest.approx(move, abs=1e-12)
    assert every(np.eye(6)) == pytest.approx(every(np.eye(6)).T, abs=1e-12)
    kept.renew(-A)
    assert np.isnan(kept.solve(move)).all()


def test_an_inverse_learns_across_steps_too():
    """Two quadratics of one Hessian A, other loads: after begin, inverse (A move) = move."""
    rng = np.random.default_rng(3)
    half = rng.normal(size=(5, 5))
    A = half @ half.T + np.eye(5)
    first, second = rng.normal(size=(2, 5)), rng.normal(size=(2, 5))
    kept = KeptInverse()
    for q, load in zip(first, second, strict=True):
        kept.begin(load)
        kept.at(q, A @ q - load, lambda: 2 * A)
    move = first[1] - first[0]
    assert kept.solve(A @ move) == pytest.approx(move, rel=1e-12)
