"""Laws of materials with a grain: exact transformations, invariance, refusals."""

import numpy as np
import pytest
from autophyx_tet.fem.elements.assembly import discretise, linear_stiffness
from autophyx_tet.fem.elements.elastic import ElasticBody
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.grain import axes_about, longest_axis, ring_mean, with_grains
from autophyx_tet.fem.laws.law import Law
from autophyx_tet.fem.material import ElementMaterial, mandel_vector, orthotropic_tensor
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.fem.scene.loads import Traction
from autophyx_tet.fem.scene.supports import Supports, find_supports
from autophyx_tet.fem.solve.dynamics import Damping, Dynamics
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.solve.schemes import Scheme
from autophyx_tet.fem.solve.statics import nodal_stress, solve_static
from autophyx_tet.fem.table import OrthotropicConstants, load_grains

from .bodies import faces_at, random_rotation, shaken_box

OAK = load_grains()["white oak (along grain)"].constants(1.2e10)
SIZE = (1.0, 0.2, 0.2)


def grained(axes, constants=OAK, cells=(3, 2, 2)) -> TetMesh:
    """Bar along x of a material with a grain along the first row of ``axes``."""
    mesh = shaken_box(SIZE, cells, E=constants.E_L, nu=0.3, rho=700.0)
    assert mesh.material is not None
    everywhere = np.arange(len(mesh.tets))
    return mesh.with_material(mesh.material.with_grain(everywhere, constants, np.asarray(axes)))


def about_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("order", [1, 2])
def test_off_axis_bar(order):
    """1 / E = c^4 / E_L + s^4 / E_R + (1 / G_LR - 2 nu_LR / E_L) c^2 s^2 (Lekhnitskii 1963).

    A bar on three points, pulled at both ends, is stressed alike everywhere: exact on any mesh.
    """
    for angle in np.radians([0.0, 20.0, 45.0, 70.0, 90.0]):
        mesh = grained(about_z(angle))
        ends = [faces_at(mesh, 0, x) for x in (0.0, 1.0)]
        pull = [
            Traction(f, s * np.tile([1e5, 0, 0], (len(f), 1)))
            for f, s in zip(ends, (-1, 1), strict=True)
        ]
        held = find_supports(mesh, "x", three_point=True).supports
        result = solve_static(mesh, held, traction=pull, order=order, tolerance=1e-12)
        c, s = np.cos(angle), np.sin(angle)
        a = OAK
        inverse = c**4 / a.E_L + s**4 / a.E_R + (1 / a.G_LR - 2 * a.nu_LR / a.E_L) * (c * s) ** 2
        assert result.strain[:, 0, 0] == pytest.approx(1e5 * inverse, rel=1e-8)
        across = 1 / a.G_LR - 2 * a.nu_LR / a.E_L
        slope = (2 / a.E_L - across) * s * c**3 - (2 / a.E_R - across) * s**3 * c
        assert 2 * result.strain[:, 0, 1] == pytest.approx(1e5 * slope, rel=1e-7, abs=1e-14)
        np.testing.assert_allclose(nodal_stress(result)[:, 0, 0], 1e5, rtol=1e-8)


def test_turning_everything_turns_the_answer():
    """Mesh, grain, weight turned together; the frequencies do not see it."""
    axes, turn = random_rotation(1), random_rotation(2)
    mesh, gravity = grained(axes), np.array([1.0, -3.0, -9.0])
    assert mesh.material is not None
    plain = ElementMaterial(mesh.material.E, mesh.material.nu, mesh.material.rho)
    everywhere = np.arange(len(mesh.tets))
    turned = TetMesh(
        mesh.points @ turn.T, mesh.tets, mesh.region,
        material=plain.with_grain(everywhere, OAK, axes @ turn.T),
    )  # fmt: skip
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    u = solve_static(mesh, held, gravity_vector=gravity, order=2, tolerance=1e-12)
    v = solve_static(turned, held, gravity_vector=turn @ gravity, order=2, tolerance=1e-12)
    largest = np.abs(u.displacement).max()
    np.testing.assert_allclose(v.displacement, u.displacement @ turn.T, atol=1e-8 * largest)
    assert v.energy == pytest.approx(u.energy, rel=1e-8)
    tones = [natural_modes(m, 3, supports=held).frequencies for m in (mesh, turned)]
    np.testing.assert_allclose(tones[0], tones[1], rtol=1e-6)


def test_alike_in_all_directions_is_isotropic():
    """With E, nu and G = E / 2 (1 + nu) along all axes, the answer is that without a grain."""
    E, nu = 1e6, 0.3
    G = E / 2 / (1 + nu)
    mesh = grained(random_rotation(3), OrthotropicConstants(E, E, E, G, G, G, nu, nu, nu))
    assert mesh.material is not None
    plain = mesh.with_material(
        ElementMaterial(mesh.material.E, mesh.material.nu, mesh.material.rho)
    )
    held = Supports.clamp(len(mesh.points), mesh.points[:, 0] == 0)
    answers = [solve_static(m, held, gravity_vector=(0, 0, -9.81)) for m in (mesh, plain)]
    largest = np.abs(answers[1].displacement).max()
    np.testing.assert_allclose(*(a.displacement for a in answers), atol=1e-7 * largest)
    np.testing.assert_allclose(*(a.stress for a in answers), atol=1e-6 * answers[1].von_mises.max())


def test_a_rod_rings_with_the_modulus_along_it():
    """A rod that contracts not (nu = 0), held to move along x: f = sqrt(E / rho) / 4 L."""
    constants = OAK._replace(nu_LR=0.0, nu_LT=0.0, nu_RT=0.0)
    for axes, E in ((np.eye(3), OAK.E_L), (about_z(np.pi / 2), OAK.E_R)):
        mesh = grained(axes, constants, cells=(6, 1, 1))
        held = Supports.none(len(mesh.points)).with_fixed(slice(None), (1, 2))
        held = held.with_fixed(mesh.points[:, 0] == 0, 0)
        (found,) = natural_modes(mesh, 1, supports=held).frequencies
        assert found == pytest.approx(np.sqrt(E / 700.0) / 4, rel=1e-3)


def spread(body, seed, size):
    """A seeded displacement [m] of its nodes: a strain of ``size`` everywhere, and noise."""
    rng, x = np.random.default_rng(seed), body.grid.space.nodes
    return x @ (rng.normal(size=(3, 3)) * size) + 0.05 * size * rng.normal(size=x.shape)


@pytest.mark.parametrize("order", [1, 2])
def test_a_finite_law_sees_the_grain(order):
    """Its tangent at rest is the anisotropic stiffness; turns cost nothing; forces are gradients.

    Far from rest the force is the central difference of the energy, the tangent that of the force,
    and the projected tangent has no negative part.
    """
    mesh = grained(random_rotation(3), cells=(1, 1, 1))
    grid = discretise(mesh, order)
    body = ElasticBody(grid, mesh.material, Law.NEO_HOOKEAN)
    x = grid.space.nodes
    exact = linear_stiffness(grid, mesh.material).values.numpy()
    at_rest = body.tangent(np.zeros_like(x)).values.numpy()
    np.testing.assert_allclose(at_rest, exact, atol=1e-9 * np.abs(exact).max())  # round-off
    u, turn = spread(body, 1, 0.2), random_rotation(7)
    turned = (x + u) @ turn.T - x
    assert body.response(turned).energy == pytest.approx(body.response(u).energy, rel=1e-9)
    d = spread(body, 2, 1.0)
    ahead, back = (body.response(u + h * d) for h in (1e-5, -1e-5))
    slope = (ahead.energy - back.energy) / 2e-5
    assert (body.response(u).force * d).sum() == pytest.approx(slope, rel=1e-6)
    change = (ahead.force - back.force) / 2e-5
    np.testing.assert_allclose(body.tangent(u).times(d), change, atol=1e-6 * np.abs(change).max())
    K = body.tangent(u, projected=True).to_scipy().toarray()
    assert np.linalg.eigvalsh(K).min() > -1e-9 * np.abs(K).max()


def test_a_motion_swings_as_stiff_as_the_grain_is():
    """A rod of nu = 0 in its first mode: u = (v / w) sin(w t) at its end, w = pi/2 sqrt(E / rho).

    By the trapezoidal rule in 100 steps a period; linear elements a sixth of it long are .3 % off.
    """
    constants = OAK._replace(nu_LR=0.0, nu_LT=0.0, nu_RT=0.0)
    for axes, E in ((np.eye(3), OAK.E_L), (about_z(np.pi / 2), OAK.E_R)):
        mesh = grained(axes, constants, cells=(6, 1, 1))
        x = mesh.points[:, 0]
        held = Supports.none(len(x)).with_fixed(slice(None), (1, 2)).with_fixed(x == 0, 0)
        w, v = np.pi / 2 * np.sqrt(E / 700.0), 1e-3
        start = np.zeros_like(mesh.points)
        start[:, 0] = v * np.sin(np.pi / 2 * x)
        options = {"scheme": Scheme.TRAPEZOIDAL, "self_contact": False, "order": 1}
        body = Dynamics(mesh, supports=held, velocity=start, **options)
        moved = np.array([s.u[x == 1.0, 0].mean() for s in body.run(np.pi / w / 50, 50)])
        assert moved.max() == pytest.approx(v / w, rel=0.02)
        assert np.argmax(moved) == pytest.approx(25, abs=1)
        assert abs(moved[-1]) < 0.05 * v / w


def test_what_knows_no_grain_says_so():
    mesh = grained(np.eye(3))
    with pytest.raises(InputError, match="knows no grain"):
        Dynamics(mesh, damping=Damping(stiffness=1e-4))
    assert mesh.material is not None
    with pytest.raises(InputError, match="three unit vectors"):
        mesh.material.with_grain(np.arange(2), OAK, 2 * np.eye(3))
    with pytest.raises(InputError, match="give energy away"):
        mesh.material.with_grain(np.arange(2), OAK._replace(nu_LT=5.0), np.eye(3))


def test_the_grain_runs_along_the_longest_axis():
    """Of a turned bar its axis; of a cube none is known; what is stated wins."""
    turn = random_rotation(4)
    bar = shaken_box(SIZE, (6, 2, 2), E=1.2e10, amount=0.0)
    turned = TetMesh(bar.points @ turn.T, bar.tets, bar.region, ("leg",), material=bar.material)
    everywhere = np.arange(len(bar.tets))
    axis = longest_axis(turned, everywhere)
    assert axis is not None
    assert abs(axis @ turn[:, 0]) == pytest.approx(1, abs=1e-3)
    cube = shaken_box((1, 1, 1), (3, 3, 3), amount=0.0)
    assert longest_axis(cube, np.arange(len(cube.tets))) is None
    rows = {"leg": "white oak (along grain)"}
    found = with_grains(turned, rows, {})
    assert found.mesh.material.tensor is not None
    assert found.notes[0].startswith("the grain is taken along leg (")
    along = with_grains(turned, rows, {"leg": turn[:, 1]}).mesh.material.tensor[0]
    compliance = np.linalg.inv(along)
    pull = mandel_vector(np.outer(turn[:, 1], turn[:, 1]))
    assert 1 / (pull @ compliance @ pull) == pytest.approx(1.2e10, rel=1e-9)
    with pytest.raises(UsageError, match="part:leg: 'steel' has no grain in the table"):
        with_grains(turned, {"leg": "steel"}, {"leg": turn[:, 1]})


def test_rings_in_all_directions_look_alike_from_the_side():
    """E across is the same all around the grain, between radial and tangential; E along stays."""
    axes = axes_about(np.array([0.0, 0.0, 2.0]))
    compliance = np.linalg.inv(orthotropic_tensor(ring_mean(OAK), axes))
    across = []
    for angle in np.linspace(0, np.pi, 7):
        side = np.array([np.cos(angle), np.sin(angle), 0])
        pull = mandel_vector(np.outer(side, side))
        across.append(1 / (pull @ compliance @ pull))
    assert across == pytest.approx([across[0]] * 7, rel=1e-9)
    assert compliance[2, 2] == pytest.approx(1 / OAK.E_L, rel=1e-9)
