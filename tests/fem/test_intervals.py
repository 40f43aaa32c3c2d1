"""Ranges of the table become intervals: exact scaling of one material, monotone for several."""

import numpy as np
import pytest
from autophyx_tet.fem import uncertainty as likely
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh
from autophyx_tet.fem.scenarios import Sag
from autophyx_tet.fem.scene.scene import Scene
from autophyx_tet.fem.solve.equilibrium import StaticMethod
from autophyx_tet.fem.solve.modal import natural_modes
from autophyx_tet.fem.table import MaterialValue, load_table
from autophyx_tet.fem.uncertainty import (
    Interval,
    Likely,
    displacement_interval,
    frequency_intervals,
    likely_answers,
    mass_range,
    material_ranges,
    open_ranges,
    shifted_lattice,
    with_likely,
)
from threadpoolctl import threadpool_info

from .bodies import shaken_box

STEEL, OAK = (load_table().exact(name) for name in ("carbon steel", "oak"))


def bar(second=STEEL) -> TetMesh:
    """Standing bar of two parts: steel, and ``second`` above it."""
    mesh = shaken_box((0.1, 0.1, 0.4), (2, 2, 6), amount=0.0)
    upper = mesh.centroids[:, 2] > 0.2
    E, nu, rho = (
        np.where(upper, getattr(second.value(), name), getattr(STEEL.value(), name))
        for name in ("E", "nu", "rho")
    )
    names = ("foot", "head")
    return TetMesh(mesh.points, mesh.tets, upper.astype(int), names, ElementMaterial(E, nu, rho))


def test_one_material_scales_exactly():
    """u ~ rho / E, f ~ sqrt(E / rho), m ~ rho."""
    mesh, rows = bar(), {"foot": "carbon steel", "head": "carbon steel"}
    ranges = material_ranges(mesh, rows)
    assert ranges is not None
    scene = Sag().scene(mesh)
    result = StaticMethod().solve(scene)
    value, E, rho = STEEL.value(), STEEL.E, STEEL.rho
    found = displacement_interval(scene, result, ranges)
    assert found is not None
    u = result.max_displacement
    assert found.low == pytest.approx(u * value.E / E.max * rho.min / value.rho, rel=1e-6)
    assert found.high == pytest.approx(u * value.E / E.min * rho.max / value.rho, rel=1e-6)
    mass = mass_range(mesh, ranges)
    assert mass.high == pytest.approx(mesh.mass * rho.max / value.rho, rel=1e-12)
    modes = natural_modes(mesh, 2, supports=scene.held)
    for f, (low, high) in zip(
        modes.frequencies, frequency_intervals(mesh, modes, ranges), strict=True
    ):
        assert low == pytest.approx(f * (E.min / value.E * value.rho / rho.max) ** 0.5, rel=1e-9)
        assert high == pytest.approx(f * (E.max / value.E * value.rho / rho.min) ** 0.5, rel=1e-9)


def test_two_materials_enclose_the_answer():
    """The value as taken lies inside; a part of no row, or of an apparent E, adds nothing."""
    mesh, rows = bar(OAK), {"foot": "carbon steel", "head": OAK.name}
    wide, narrow = material_ranges(mesh, rows), material_ranges(mesh, {"foot": "carbon steel"})
    assert wide is not None
    assert narrow is not None
    scene = Sag().scene(mesh)
    result = StaticMethod().solve(scene)
    outer, inner = (displacement_interval(scene, result, r) for r in (wide, narrow))
    assert outer is not None
    assert inner is not None
    assert outer.low < inner.low < result.max_displacement < inner.high < outer.high
    assert material_ranges(mesh, {}) is None
    assert material_ranges(mesh, {"foot": "expanded polystyrene"}) is None


def test_what_is_exact_has_no_range():
    """Of E, nu and rho all stated there is none; of E alone u ~ rho; other parts keep theirs."""
    mesh, rows = bar(), {"foot": "carbon steel", "head": "carbon steel"}
    exact = dict.fromkeys(rows, ("E", "nu", "rho"))
    scene = Sag().scene(mesh)
    assert material_ranges(mesh, rows, exact=exact) is None
    assert likely_answers(scene, rows, exact=exact) is None
    ranges = material_ranges(mesh, rows, exact=dict.fromkeys(rows, ("E",)))
    assert ranges is not None
    result = StaticMethod().solve(scene)
    found = displacement_interval(scene, result, ranges)
    assert found is not None
    scale = STEEL.rho.max / STEEL.value().rho
    assert found.high == pytest.approx(result.max_displacement * scale, rel=1e-6)
    (one,) = open_ranges(mesh, rows, exact={"foot": ("E", "nu", "rho")})
    assert (one.tets == (mesh.region == 1)).all()
    two = open_ranges(mesh, rows, exact={"foot": ("nu",)})
    assert [row.nu.min == row.nu.max for row in two] == [True, False]


def test_ends_hold_what_is_likely():
    """Poisson's ratio moves what is likely, and not the ends: they are widened to it."""
    ends = {"mass": Interval(1.0, 2.0), "frequencies": (Interval(3.0, 4.0), Interval(5.0, 6.0))}
    known = Likely(Interval(0.9, 1.5), None, (Interval(3.1, 4.2),), 256, 0.0)
    found = with_likely({**ends, "max_displacement": None}, known)
    assert found["mass"] == (0.9, 2.0)
    assert found["frequencies"] == ((3.0, 4.2), (5.0, 6.0))
    assert found["max_displacement"] is None
    assert found["likely"] is known
    assert with_likely(ends, None) == {**ends, "likely": None}


def test_a_lattice_fills_the_cube_evenly():
    """Every direction has one point in each of n slices; means of smooth functions scatter less.

    The mean of x y over [0, 1]^2 is 1 / 4: of 64 points at random it scatters by .028, here by a
    quarter of that at most.
    """
    rng = np.random.default_rng(1)
    points = shifted_lattice(96, 5, rng)
    assert points.shape == (96, 5)
    assert ((0 <= points) & (points < 1)).all()
    for column in points.T:
        assert len(set(np.floor((96 * (column - column.min() + 1e-9)).round(6)))) == 96
    means = [np.prod(shifted_lattice(64, 2, rng), axis=1).mean() for _ in range(200)]
    assert np.std(means) < 0.007
    assert np.mean(means) == pytest.approx(0.25, abs=1e-3)


def test_what_is_likely_of_one_material_is_its_law():
    """u ~ rho / E and f ~ sqrt(E / rho): their quantiles are those of the product of the draws.

    log E and log rho are even in their ranges, so that log (rho / E) is a trapezoid with known
    quantiles; steel's nu has next to no range. 256 points miss a quantile by 1 %.
    """
    mesh, rows = bar(), {"foot": "carbon steel", "head": "carbon steel"}
    scene = Sag().scene(mesh)
    modes = natural_modes(mesh, 2, supports=scene.held)
    result = StaticMethod().solve(scene)
    found = likely_answers(scene, rows, result=result, modes=modes)
    assert found is not None
    assert found.max_displacement is not None
    assert found.samples >= 256
    assert found.error < 5e-3
    spans = [np.log(span.max / span.min) for span in (STEEL.E, STEEL.rho)]
    short, long = sorted(spans)
    # The trapezoid's density is flat in the middle; its lower tail has mass short / (2 long).
    share = 0.05
    if share <= short / (2 * long):
        tail = np.sqrt(2 * share * short * long)
    else:
        tail = share * long + short / 2
    reach = (short + long) / 2 - tail  # of log (rho / E) about its middle
    value = STEEL.value()
    middle = np.log(value.rho / value.E) - np.log(mesh.material.rho[0] / mesh.material.E[0])
    for sign, u, f in zip((-1, 1), found.max_displacement, found.frequencies[0][::-1], strict=True):
        assert u / result.max_displacement == pytest.approx(np.exp(middle + sign * reach), rel=0.01)
        wanted = np.exp(-(middle + sign * reach) / 2)
        assert f / modes.frequencies[0] == pytest.approx(wanted, rel=0.01)


def test_samples_of_a_predictor_are_bodies_of_their_own():
    """Drawn alike for the whole bar: m ~ rho, u ~ rho / E and f ~ sqrt(E / rho), draw by draw."""
    mesh, random = bar(), np.random.default_rng(2)
    E, rho = 10 ** random.uniform(9, 11, 7), random.uniform(500, 5000, 7)
    nu = float(mesh.material.nu[0])
    drawn = [MaterialValue(float(e), nu, float(r)) for e, r in zip(E, rho, strict=True)]
    draws = {"foot": drawn, "head": drawn}
    scene = Sag().scene(mesh)
    modes = natural_modes(mesh, 2, supports=scene.held)
    result = StaticMethod().solve(scene)
    found = likely_answers(scene, {}, draws=draws, result=result, modes=modes)
    assert found is not None
    assert (found.samples, found.drawn) == (7, 7)
    heavier, stiffer = rho / mesh.material.rho[0], E / mesh.material.E[0]
    assert found.max_displacement is not None
    laws = (
        (found.mass, mesh.mass * heavier),
        (found.max_displacement, result.max_displacement * heavier / stiffer),
        (found.frequencies[0], modes.frequencies[0] * np.sqrt(stiffer / heavier)),
    )
    for answer, known in laws:
        # One body in another unit of stress: only round-off differs.
        np.testing.assert_allclose(answer, np.quantile(known, (0.05, 0.95)), rtol=1e-7)
    ends = material_ranges(mesh, {}, draws)
    assert ends is not None
    lowest, highest = mesh.mass * heavier.min(), mesh.mass * heavier.max()
    np.testing.assert_allclose(
        mass_range(mesh, ends), (min(lowest, mesh.mass), max(highest, mesh.mass)), rtol=1e-12
    )


def test_samples_beside_a_row_keep_its_range():
    """The head's one draw is what it has: what is left open is the row of the foot, and no more."""
    mesh, rows = bar(), {"foot": "carbon steel", "head": "carbon steel"}
    scene = Sag().scene(mesh)
    asis = [
        MaterialValue(
            *(float(v[-1]) for v in (mesh.material.E, mesh.material.nu, mesh.material.rho))
        )
    ]
    found = likely_answers(scene, rows, draws={"head": asis})
    assert found is not None
    assert (found.samples, found.drawn) == (256, 1)
    foot = mesh.region == 0
    low, high = (mesh.volumes[foot].sum() * end for end in STEEL.rho)
    rest = mesh.mass - float((mesh.material.rho * mesh.volumes)[foot].sum())
    # log rho is even in the row's range, one draw in each of 256 strata: 1/256 of its span.
    for share, mass in zip((0.05, 0.95), found.mass, strict=True):
        wanted, wide = low ** (1 - share) * high**share, np.log(high / low)
        assert mass - rest == pytest.approx(wanted, rel=wide / 256)


def test_draws_are_bodies_that_the_solver_takes():
    """A foam whose Poisson's ratio may be below 0, which no mesh may have, is drawn from 0 on."""
    foam = load_table().exact("flexible PU foam")
    assert foam.nu.min < 0
    for row in open_ranges(bar(second=foam), {"foot": "carbon steel", "head": foam.name}):
        assert 0 <= row.nu.min <= row.nu.max < 0.5


def test_draws_are_solved_on_one_thread(monkeypatch):
    """Threads of BLAS wait for each other over vectors this small: 8 times the work when busy."""
    seen = []

    def ranges(*_):
        seen.extend(p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas")
        return []

    monkeypatch.setattr(likely, "open_ranges", ranges)
    assert likely_answers(Scene(mesh=bar()), {}) is None
    assert set(seen) == {1}
