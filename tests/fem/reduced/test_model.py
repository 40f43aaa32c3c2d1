"""A reduced model is the full body on a subspace: its energy, force and stiffness there."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.converters.archives import load_reduced, save_reduced
from autophyx_tet.fem.elements.assembly import discretise
from autophyx_tet.fem.elements.elastic import ElasticBody, first_piola
from autophyx_tet.fem.elements.forces import traction_force
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.laws.law import LAWS
from autophyx_tet.fem.mesh import face_normals
from autophyx_tet.fem.reduced.basis import (
    affine_coordinates,
    derivatives,
    laplacian_weights,
    orthonormal_fields,
    principal_fields,
    skinned_basis,
    skinned_functions,
    turning_functions,
    vector_basis,
    whole_model,
)
from autophyx_tet.fem.reduced.elasticity import ReducedElasticity, reduced_frequencies
from autophyx_tet.fem.reduced.model import Accuracy, Subspace
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.supports import Supports

from ..bodies import random_rotation
from .bodies import linear, two_part_bar, whole

MESH = two_part_bar()


@pytest.fixture(scope="module", params=[(1, False), (2, False), (1, True), (2, True)])
def free(request):
    """Body that nothing holds, of either elements: of handles, and of functions of its modes."""
    order, functions = request.param
    body = linear(MESH, free=True, order=order)
    if functions:
        return whole_model(body, skinned_basis(turning_functions(body, 12)), Subspace.SKINNING)
    return whole(body, Subspace.SKINNING)


@pytest.fixture(scope="module", params=[(kind, order) for kind in Subspace for order in (1, 2)])
def held(request):
    """Clamped body of either elements, moved by fields of vectors, and by handles."""
    kind, order = request.param
    return whole(linear(MESH, order=order), kind)


def state(model, size=0.02, seed=0):
    """Coordinates of a random motion of the slow vibrations whose points move up to ``size``."""
    elasticity = ReducedElasticity(model)
    square, modes = np.linalg.eigh(elasticity.tangent(np.zeros(model.dofs)))
    slow = modes[:, np.argsort(np.abs(square))[:12]]
    q = slow @ np.random.default_rng(seed).normal(size=slow.shape[1])
    return q * size / np.linalg.norm(model.displacement(q), axis=1).max()


def test_affine_maps_are_in_the_span_and_turns_cost_nothing(free):
    turn = random_rotation()
    for A in (turn - np.eye(3), np.random.default_rng(1).normal(size=(3, 3))):
        u = free.points @ A.T + [0.3, -0.1, 0.2]
        assert free.displacement(free.coordinates(u)) == pytest.approx(u, abs=1e-12)
    q = free.coordinates(free.points @ (turn - np.eye(3)).T)
    energy = ReducedElasticity(free).response(q).energy
    assert abs(energy) < 1e-12 * (MESH.material.E * MESH.volumes).sum()


def test_what_a_free_body_can_do_it_can_do_turned(free):
    """Rest and displacement turned by any R lie in the span, to round-off, at the same energy."""
    turn, q = random_rotation(), state(free)
    u = (free.points + free.displacement(q)) @ turn.T - free.points
    turned = free.coordinates(u)
    assert free.displacement(turned) == pytest.approx(u, abs=1e-12)
    energies = [ReducedElasticity(free).response(p).energy for p in (q, turned)]
    assert energies[1] == pytest.approx(energies[0], rel=1e-9)


@pytest.mark.parametrize("law", LAWS.names)
@pytest.mark.slow
def test_energy_and_force_are_the_full_body_s(held, law):
    """W(U q), and its gradient pulled back: the sums over tets are the same but for round-off."""
    q = state(held)
    u = held.displacement(q)
    full = ElasticBody(discretise(MESH, held.order), MESH.material, law).response(u)
    found = ReducedElasticity(held, law).response(q)
    assert found.energy == pytest.approx(full.energy, rel=1e-12)
    force = held.pull_back(full.force)
    assert np.linalg.norm(found.force - force) < 1e-12 * np.linalg.norm(force)


@pytest.mark.parametrize("law", LAWS.names)
def test_the_tangent_is_the_derivative_of_the_force(held, law):
    """Against central differences; symmetric to round-off."""
    elasticity, q, d = ReducedElasticity(held, law), state(held), state(held, 1e-6, seed=1)
    K = elasticity.tangent(q)
    ahead, behind = (elasticity.response(q + s * d).force for s in (1, -1))
    wanted = (ahead - behind) / 2
    assert np.linalg.norm(K @ d - wanted) < 1e-7 * np.linalg.norm(wanted)
    assert np.abs(K - K.T).max() < 1e-14 * np.abs(K).max()


def test_the_tangent_of_a_polynomial_is_exact(held):
    """The neo-Hookean stress is of degree 5 in H: differences of seven points miss none of it."""
    elasticity, q, d = ReducedElasticity(held), state(held), state(held, seed=1)
    force = {s: elasticity.response(q + s * d).force for s in (1, 2, 3, -1, -2, -3)}
    shares = {1: 45 / 60, 2: -9 / 60, 3: 1 / 60}
    wanted = sum(share * (force[s] - force[-s]) for s, share in shares.items())
    found = elasticity.tangent(q) @ d
    assert np.linalg.norm(found - wanted) < 1e-12 * np.linalg.norm(wanted)  # round-off: 1e-14


@pytest.mark.parametrize("law", LAWS.names)
def test_a_tiny_motion_keeps_its_energy(held, law):
    """q . K q / 2 to the size of the strain, 1e-8: nothing of W is lost in differences of J."""
    elasticity, q = ReducedElasticity(held, law), state(held, 1e-9)
    wanted = 0.5 * q @ elasticity.tangent(np.zeros(held.dofs)) @ q
    assert elasticity.response(q).energy == pytest.approx(wanted, rel=1e-7)


def test_patch(free):
    """An affine map is in equilibrium with the tractions P n of its one stress P."""
    H = 0.1 * np.random.default_rng(2).normal(size=(3, 3))
    mesh = MESH.with_material(replace(MESH.material, E=np.full(len(MESH.tets), 1e5)))
    model = free.with_moduli(np.full(len(free.cells), 1e5))
    elasticity = ReducedElasticity(model)
    q = model.coordinates(model.points @ H.T)
    P = first_piola("neohookean", H[None], type(model.lame)(*(m[:1] for m in model.lame)))[0]
    stress = elasticity.stress(q) / model.weights[:, None, None]
    assert np.abs(stress - P).max() < 1e-10 * np.abs(P).max()
    faces = mesh.boundary.faces
    load = Traction(faces, face_normals(mesh.points, faces) @ P.T)
    pulled = model.pull_back(traction_force(mesh, discretise(mesh, model.order).space, load))
    force = elasticity.response(q).force
    assert np.linalg.norm(force - pulled) < 1e-10 * np.linalg.norm(force)


def test_more_handles_are_softer_and_none_softer_than_the_body():
    """Linear compliance f . K^-1 f rises with the space, frequencies fall; the full space is FEM.

    The handles are nested: the first ones of one set of eigenmodes. The mass is that of the full
    body, lumped, and so no space rings below it.
    """
    body = linear(MESH)
    fixed = body.held.fixed.any(axis=1)
    weights = laplacian_weights(MESH, 6, fixed)
    forces = body.mass[:, None] * np.array([0.3, -1.0, 2.0])
    full = float((forces * body.compliance(forces[None])[0]).sum())
    compliance, lowest = [], []
    spaces = [skinned_functions(body, weights[:, :n], free=False) for n in (1, 2, 4, 6)]
    spaces.append(orthonormal_fields(np.eye(len(fixed))[:, ~fixed], body.mass))
    for functions in spaces:
        model = model_of_functions(body, functions)
        elasticity = ReducedElasticity(model)
        pulled = model.pull_back(forces)
        compliance.append(
            pulled @ np.linalg.solve(elasticity.tangent(np.zeros(model.dofs)), pulled)
        )
        lowest.append(reduced_frequencies(elasticity)[0])
    assert (np.diff(compliance) > 0).all()
    assert (np.diff(lowest) < 0).all()
    assert max(compliance) <= full * (1 + 1e-10)
    assert min(lowest) >= body.modes.frequencies[0] * (1 - 1e-10)
    assert compliance[-1] == pytest.approx(full, rel=1e-10)
    assert lowest[-1] == pytest.approx(body.modes.frequencies[0], rel=1e-10)


def model_of_functions(body, functions):
    return whole_model(body, skinned_basis(functions), Subspace.SKINNING)


def test_springs_hold_it_too():
    """Springs of the supports add their quadratic form of the displacement."""
    supports = Supports.none(len(MESH.points)).with_springs(MESH.points[:, 0] < 0.1, 50.0)
    from autophyx_tet.fem.reduced.basis import linear_body

    model = whole(linear_body(MESH, supports), Subspace.VECTOR)
    q = state(model)
    stiff = 0.5 * float((supports.springs * model.displacement(q) ** 2).sum())
    loose = ReducedElasticity(replace(model, springs=np.zeros_like(model.springs)))
    difference = ReducedElasticity(model).response(q).energy - loose.response(q).energy
    assert difference == pytest.approx(stiff, rel=1e-10)


def test_what_handles_cannot_do_is_refused():
    """A support that moves, a point held in one direction only, a free body of fixed fields."""
    from autophyx_tet.fem.reduced.basis import reduce_body

    points = len(MESH.points)
    moved = Supports.clamp(points, MESH.points[:, 0] < 1e-9, 0.01)
    with pytest.raises(InputError, match="moved by its supports"):
        reduce_body(MESH, moved)
    half = Supports.clamp(points, MESH.points[:, 0] < 1e-9).with_fixed([points - 1], 1)
    with pytest.raises(InputError, match="some directions only"):
        reduce_body(MESH, half, kind=Subspace.SKINNING)
    with pytest.raises(InputError, match="take functions"):
        vector_basis(linear(MESH, free=True))


def test_coordinates_about_the_middle_are_in_shares_of_the_longest_side():
    affine = affine_coordinates(MESH, MESH.points)
    assert np.ptp(affine[:, 0]) == pytest.approx(1.0, rel=1e-12)
    assert affine[:, 3] == pytest.approx(1.0, rel=0)


def test_round_trip(held, tmp_path):
    """What is saved comes back bit by bit; another file is refused."""
    given = replace(held, accuracy=Accuracy(1.01, 0.02, 0.99, float("nan")))
    save_reduced(tmp_path / "a.npz", given)
    back = load_reduced(tmp_path / "a.npz")
    for name in ("points", "faces", "mass", "basis", "cells", "weights", "gradients"):
        assert np.array_equal(getattr(back, name), getattr(given, name))
    assert (back.kind, back.region_names) == (given.kind, given.region_names)
    assert back.accuracy[:3] == given.accuracy[:3]
    np.savez(tmp_path / "b.npz", x=np.zeros(3))
    with pytest.raises(InputError, match="wanted a ReducedModel"):
        load_reduced(tmp_path / "b.npz")


def test_principal_fields_are_what_is_largest_outside_the_known_ones():
    """Of two fields hidden in many, beside known ones: both come back, nothing else of size."""
    rng = np.random.default_rng(0)
    mass = rng.uniform(1, 2, 20)
    mass[3] = 0  # a point that no tet has
    every = orthonormal_fields(rng.normal(size=(20, 3, 6)), mass)
    known, hidden = every[..., :4], every[..., 4:]
    fields = hidden @ rng.normal(size=(2, 9)) + known @ rng.normal(size=(4, 9))
    found = principal_fields(fields, known, mass, 2)
    both = np.einsum("n,nia,nib->ab", mass, found, np.concatenate([known, hidden], axis=2))
    assert both[:, :4] == pytest.approx(np.zeros((2, 4)), abs=1e-12)
    assert both[:, 4:] @ both[:, 4:].T == pytest.approx(np.eye(2), abs=1e-12)


def test_derivatives_are_bilinear():
    """Twice and three times the fields bend on six times as far together."""
    body = linear(two_part_bar((4, 2, 2)))
    a, b = body.modes.shapes[:2]
    found = derivatives(body, np.stack([a, b]))
    larger = derivatives(body, np.stack([2 * a, 3 * b]))
    for factor, one, other in zip((4, 6, 9), found, larger, strict=True):
        assert np.linalg.norm(other - factor * one) < 1e-9 * np.linalg.norm(other)
