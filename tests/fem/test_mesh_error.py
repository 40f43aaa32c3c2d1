"""The error that is told of a quadratic answer, beside that of refined answers."""

from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise, linear_stiffness, node_supports
from autophyx_tet.fem.elements.space import duffy_rule, element_points
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.linalg import solver
from autophyx_tet.fem.material import ElementMaterial, OrthotropicConstants
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scenarios import hang
from autophyx_tet.fem.scene.loads import resultant, spread_force
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.scene.supports import Supports
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.fem.solve.error import bisected, largest_error, refine_scene
from autophyx_tet.fem.solve.mesh_error import CubicElements, wedge_exponents
from autophyx_tet.fem.solve.modal import ModalMethod
from autophyx_tet.fem.solve.result import SAFETY
from autophyx_tet.toolkit.simulation.simulate import simulate
from autophyx_tet.toolkit.verdict.checks import discretisation

from .bodies import faces_at, with_uniform


def beam(cells, size=(5.0, 1.0, 1.0), *, nu=0.3, E=1e9):
    """A beam under its weight, clamped where x is 0."""
    mesh = with_uniform(box_mesh(size, cells), E=E, nu=nu, rho=1000.0)
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] < 1e-9)
    return Scene(mesh=mesh, supports=held, gravity_vector=(0, 0, -9.81))


def finer(scene, times=1):
    """All tets cut until their edges are half as long, ``times`` times."""
    for _ in range(3 * times):
        scene = bisected(scene, np.arange(len(scene.mesh.tets)))
    return scene


def rest(scene):
    return StaticMethod().solve(scene, law="linear")


def top_force(result, scene, axis):
    """Force [N] of what moves on the body."""
    held = node_supports(scene.held, result.static.space)
    return float(result.static.reaction[held.values[:, axis] != 0, axis].sum())


# The surplus of cubic elements


@pytest.mark.parametrize("grain", [False, True])
def test_forces_and_energies_are_the_integrals_of_their_gradients(grain):
    """Energy, by Gauss points of a polynomial of degree 4; x . K y = y . K x; blocks; mass."""
    mesh = with_uniform(box_mesh((1.0, 0.2, 0.3), (3, 2, 2)), E=1e6, nu=0.3, rho=1e3)
    if grain:
        constants = OrthotropicConstants(1e7, 1e6, 5e5, 4e5, 3e5, 2e5, 0.3, 0.2, 0.3)
        every = np.ones(len(mesh.tets), dtype=bool)
        mesh = mesh.with_material(mesh.material.with_grain(every, constants, np.eye(3)))
    grid = discretise(mesh, 2)
    cubic = CubicElements(mesh, grid.space, np.zeros((len(grid.space.nodes), 3), dtype=bool))
    rng = np.random.default_rng(0)
    u, x = rng.normal(size=(len(grid.space.nodes), 3)), rng.normal(size=(cubic.count, 3))
    on_nodes, on_own = cubic.forces(x)
    assert (on_nodes * u).sum() == pytest.approx((cubic.nodal_forces(u) * x).sum(), rel=1e-12)
    energy = cubic.energies(u, x)
    stiff = (u * linear_stiffness(grid, mesh.material).times(u)).sum()
    whole = stiff + 2 * (on_nodes * u).sum() + (on_own * x).sum()
    assert energy.sum() == pytest.approx(whole, rel=1e-12)
    where, weights = duffy_rule()
    H = cubic.gradients(u, x, np.arange(len(mesh.tets)), where)
    from autophyx_tet.fem.elements.elastic import linear_stress

    density = (linear_stress(H, mesh.material) * H).sum(axis=(-1, -2))
    np.testing.assert_allclose(energy, mesh.volumes * (density @ weights), rtol=1e-10)
    if not grain:
        one = np.zeros_like(x)
        one[7, 1] = 1.0
        column = np.linalg.inv(cubic.inverse_blocks()[7])[:, 1]
        np.testing.assert_allclose(cubic.forces(one)[1][7], column, atol=1e-9 * abs(column).max())
    line = grid.space.nodes @ rng.normal(size=(3, 3))  # its stress is constant
    points = element_points(2)
    H = cubic.gradients(line, 0 * x, np.arange(len(mesh.tets)), points)
    flux = linear_stress(H, mesh.material)
    pushed = cubic.nodal_forces(line)
    off = 1e-10 * abs(pushed).max()
    np.testing.assert_allclose(cubic.flux_forces(flux, points), pushed, atol=off)
    shift = np.tile([1.0, 0.0, 0.0], (len(u), 1))  # a rigid shift weighs the mass
    assert cubic.weigh(shift, 0 * x)[1] == pytest.approx(mesh.mass, rel=1e-12)


def test_an_exact_answer_has_no_error():
    """A hanging bar is quadratic: cubic elements add nothing to it, and a percent is told."""
    mesh = with_uniform(box_mesh((0.2, 0.2, 1.0), (2, 2, 5)), E=1e8, nu=0.0, rho=1000.0)
    error = hang(mesh, law="linear").discretisation_error
    assert error.value < 1e-8
    assert error.bound == 0.01
    assert error.places == ()


def test_a_cycle_and_a_factor_find_the_same(monkeypatch):
    """The nodes follow by one V-cycle as they do by the factor: the steps of CG end alike."""
    errors = []
    for direct in (10**6, 0):
        monkeypatch.setattr(solver, "DIRECT", direct)
        errors.append(rest(beam((12, 3, 3))).discretisation_error)
    for name in ("value", "energy", "stress"):
        one, two = (getattr(error, name) for error in errors)
        assert two == pytest.approx(one, rel=0.03)  # a fiftieth of the energy is left either way


def test_along_the_grain():
    """A solid that is told as one with a grain, but isotropic, has the same error."""
    scene = beam((10, 1, 1), (1, 0.1, 0.1))
    plain = rest(scene).discretisation_error
    shear = 1e9 / 2.6
    alike = OrthotropicConstants(1e9, 1e9, 1e9, shear, shear, shear, 0.3, 0.3, 0.3)
    every = np.ones(len(scene.mesh.tets), dtype=bool)
    material = scene.mesh.material.with_grain(every, alike, np.eye(3))
    error = rest(replace(scene, mesh=scene.mesh.with_material(material))).discretisation_error
    assert error.value == pytest.approx(plain.value, rel=1e-6)
    assert error.stress == pytest.approx(plain.stress, rel=1e-6)


# Singular places


@pytest.mark.parametrize(
    ("angle", "held", "exponent"),
    [
        (90, False, 1.0),  # smooth
        (270, False, 0.5445),  # Williams (1952), symmetric
        (360, False, 0.5),  # a crack
        (90, True, 0.7112),  # a clamped wall, nu .3
        (180, True, 0.5),  # the end of a clamp on a flat face: complex, real part 1/2
        (45, True, 1.0),
    ],
)
def test_exponents_of_corners(angle, held, exponent):
    found = wedge_exponents(np.array([float(angle)]), np.array([0.3]), np.array([held]))
    assert found == pytest.approx(exponent, abs=5e-4)


def test_an_inner_corner_is_named_where_it_is():
    """An L held at its top end: the corner at (.5, .5) and the clamp, and the largest stress."""
    mesh = box_mesh((1.0, 1.0, 0.2), (8, 8, 1))
    cells = np.repeat(mesh.centroids.reshape(-1, 6, 3).mean(axis=1), 6, axis=0)
    used, tets = np.unique(
        mesh.tets[(cells[:, 0] < 0.5) | (cells[:, 1] < 0.5)], return_inverse=True
    )
    mesh = with_uniform(
        TetMesh.oriented(mesh.points[used], tets.reshape(-1, 4)), E=1e9, nu=0.3, rho=1000.0
    )
    held = Supports.clamp(len(mesh.points), mesh.points[:, 1] > 1 - 1e-9)
    load = spread_force(mesh, faces_at(mesh, 0, 1.0), (0, -1e3, 0))
    error = rest(Scene(mesh=mesh, supports=held, tractions=(load,))).discretisation_error
    corner = next(place for place in error.places if place.kind == "inner corner")
    np.testing.assert_allclose(corner.centre[:2], (0.5, 0.5), atol=1e-9)
    assert corner.exponent == pytest.approx(0.5445, abs=5e-4)
    assert error.peak in error.places


def test_a_force_at_a_point_is_named():
    scene = beam((3, 3, 3), (1, 1, 1))
    forces = np.zeros_like(scene.mesh.points)
    tip = np.linalg.norm(scene.mesh.points - 1, axis=1).argmin()
    forces[tip] = (0, 0, -1e4)
    error = rest(replace(scene, gravity_vector=(0, 0, 0), forces=forces)).discretisation_error
    place = next(place for place in error.places if place.kind == "point load")
    np.testing.assert_allclose(place.centre, (1, 1, 1))


# What is told, beside refined answers


def test_the_frequency_of_a_beam():
    """The first frequency beside that of edges a quarter as long."""
    scene = replace(beam((5, 1, 1)), modes=1)
    one, fine = (ModalMethod().solve(s, order=2) for s in (scene, finer(scene, 2)))
    error = float(one.frequencies[0] / fine.frequencies[0] - 1)
    assert 0.7 < one.error / error < 1.4
    assert np.isnan(ModalMethod().solve(scene, order=1).error)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "cells", "axis", "moves", "nu", "before"),
    [
        ((1, 1, 0.25), (4, 4, 1), 2, (0, 1, 2), 0.49, 4.45),  # a rubber pad between plates
        ((5, 1, 1), (1, 1, 1), 0, (2,), 0.3, 9.2),  # a beam guided at its end
    ],
)
@pytest.mark.truth("middles of edges across the body")
def test_nothing_across_the_body_is_held(size, cells, axis, moves, nu, before):
    """Edges from one held face to another were held too: so many times the force."""
    mesh = with_uniform(box_mesh(size, cells), E=1e6, nu=nu, rho=1000.0)
    x = mesh.points[:, axis]
    held = Supports.clamp(len(x), x < 1e-9)
    held = held.with_fixed(x > size[axis] - 1e-9, moves, np.array([0.0, 0.0, -0.01])[-len(moves) :])
    scene = Scene(mesh=mesh, supports=held)
    one, fine = rest(scene), finer(scene, 2)
    force = top_force(rest(fine), fine, 2)
    off = abs(top_force(one, scene, 2) / force - 1)
    assert off < 0.5 * (before - 1)
    told = one.discretisation_error
    assert not told.why
    assert 0.4 < told.reaction / (off / (1 + off)) < 2.5
    assert told.value > 0.01  # and it is not compared with itself


# Refinement


def test_a_cut_mesh_is_the_same_body():
    """Conforming, of the same volume, surface, supports and load; parents keep their material."""
    scene = beam((4, 2, 2))
    mesh = scene.mesh
    E = np.linspace(1e9, 2e9, len(mesh.tets))
    mesh = mesh.with_material(ElementMaterial(E, 0 * E + 0.3, 0 * E + 1e3))
    end = faces_at(mesh, 0, 5.0)
    load = spread_force(mesh, end, (0, 0, -1e3))
    scene = replace(scene, mesh=mesh, tractions=(load,))
    for marked in ([0], [3, 17, 40]):
        cut = bisected(scene, np.array(marked))
        fine = cut.mesh
        assert len(fine.tets) > len(scene.mesh.tets)
        assert fine.volumes.min() > 0
        assert fine.volume == pytest.approx(mesh.volume, rel=1e-12)
        assert fine.material.E @ fine.volumes == pytest.approx(E @ mesh.volumes, rel=1e-12)
        inside = np.abs(fine.points[fine.boundary.faces] - (2.5, 0.5, 0.5)) / (2.5, 0.5, 0.5)
        assert (np.abs(inside.max(axis=(1, 2)) - 1) < 1e-9).all()  # no face within: it conforms
        ends = np.abs(fine.points[:, 0]) < 1e-9
        np.testing.assert_array_equal(cut.held.fixed.all(axis=1), ends)
        one, two = (resultant(s.mesh, s.tractions[0]) for s in (scene, cut))
        np.testing.assert_allclose(two.force, one.force, rtol=1e-12)
        np.testing.assert_allclose(two.area, one.area, rtol=1e-12)
        scene = cut


@pytest.mark.slow
@pytest.mark.truth("refinement until the error is small")
def test_it_is_refined_until_the_error_is_small():
    scene = beam((5, 1, 1))
    goal = 0.02
    assert SAFETY * rest(scene).discretisation_error.value > goal
    refined = refine_scene(scene, goal)
    assert not refined.why
    assert refined.error <= goal
    exact = rest(finer(scene, 2)).max_displacement
    assert abs(rest(refined.scene).max_displacement / exact - 1) < goal


def test_it_says_where_it_does_not_get_there(monkeypatch):
    monkeypatch.setattr("autophyx_tet.fem.solve.error.LARGEST_P2", 600)
    refined = refine_scene(beam((5, 1, 1)), 1e-3)
    assert refined.error > 1e-3
    assert refined.why.kind == "refinement.too_large"


def test_simulate_refines():
    scene = beam((5, 1, 1))
    found = simulate(scene.mesh, fix=["plane:x<0.001"], refine=2.0)
    assert len(found.mesh.tets) > len(scene.mesh.tets)
    assert largest_error(found.solved.discretisation_error) <= 0.02
    assert any("refined" in warning for warning in found.scene.warnings)
    with pytest.raises(UsageError, match="--refine"):
        simulate(scene.mesh, scenario="drop", refine=2.0)


def test_the_sentence_names_what_the_number_is_of():
    said = discretisation(rest(beam((4, 1, 1), (1, 0.05, 0.05)))).sentence
    assert "largest displacement within about" in said
    assert "cubic elements would add" in said
