"""Loads, supports and limits of a rest against exact answers, as a user meets them."""

import json

import autophyx_tet as apx
import meshio
import numpy as np
import pytest
from autophyx_tet.converters import write_mesh
from autophyx_tet.fem import ElementMaterial, TetMesh, box_mesh, load_table
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.table import load_cross_strengths, load_strengths
from autophyx_tet.toolkit.verdict.simulation import StaticSimulation

from .command import run_here

OAK = "white oak (along grain)"


def uniform(mesh, *, E=1e7, nu=0.3, rho=1000.0):
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=E, nu=nu, rho=rho))


def of_row(mesh, name):
    value = load_table().exact(name).value()
    return uniform(mesh, E=value.E, nu=value.nu, rho=value.rho)


def bar():
    """A bar of two halves, .3 x .1 x .1 m, in cells of .05 m."""
    mesh = uniform(box_mesh((0.3, 0.1, 0.1), (6, 2, 2)), E=1e8, rho=500.0)
    right = (mesh.centroids[:, 0] > 0.15).astype(int)
    return TetMesh(mesh.points, mesh.tets, right, ("left", "right"), mesh.material)


def hollow(cells=6):
    """A closed box with walls one cell thick, outside of a cube of 1 m."""
    mesh = box_mesh((1, 1, 1), (cells,) * 3)
    at = mesh.centroids * cells
    tets = mesh.tets[((at < 1) | (at > cells - 1)).any(axis=1)]
    ids, tets = np.unique(tets, return_inverse=True)
    return uniform(TetMesh.oriented(mesh.points[ids], tets.reshape(-1, 4)), E=1e9, rho=500.0)


def solve(mesh, **stated) -> StaticSimulation:
    found = apx.simulate(mesh, **stated)
    assert isinstance(found, StaticSimulation)
    return found


def arc(r, y):
    """Area of half a disc of radius ``r`` up to a chord at ``y`` from its middle."""
    return y * np.sqrt(r * r - y * y) + r * r * np.arcsin(y / r)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "area"),
    [
        ("near:0.2,0.05,0.1,0.03", np.pi * 0.03**2),
        # A ball that is wider than the bar: a strip of its disc, and half a disc on either side.
        ("near:0.2,0.05,0.1,0.06", 2 * arc(0.06, 0.05) + np.pi * (0.06**2 - 0.05**2)),
        ("near:0,0,0.1,0.04", 3 * np.pi * 0.04**2 / 4),
        ("box:0.26,0,0.1,0.29,0.1,0.1", 0.03 * 0.1),
        ("box:0.2,0,0.1,0.275,0.1,0.1", 0.075 * 0.1),
        ("plane:x>0.27", 0.1**2 + 4 * 0.03 * 0.1),
        ("plane:x>0.3", 0.1**2),
        ("part:right", 0.1**2 + 4 * 0.15 * 0.1),
    ],
)
@pytest.mark.truth("a place cuts faces")
def test_a_place_has_its_own_area_whatever_the_faces(place, area):
    """p A to round-off, through faces that lie in it in part; p as asked for is told."""
    (load,) = solve(bar(), fix=["plane:x<0"], pressure={place: 1000.0}, gravity=0).numbers["loads"]
    assert load["area"] == pytest.approx(area, rel=1e-9)
    normal = solve(bar(), fix=["plane:x<0"], load={place: (0, 0, -7.0)}, gravity=0)
    (load,) = normal.numbers["loads"]
    np.testing.assert_allclose(load["force"], (0, 0, -7.0), atol=1e-12)
    assert load["area"] == pytest.approx(area, rel=1e-9)
    np.testing.assert_allclose(normal.numbers["reaction"], (0, 0, 7.0), atol=1e-8)


@pytest.mark.parametrize(
    ("place", "at"),
    [("box:0.83,0,0.1,0.9,0.07,0.1", (0.865, 0.035)), ("near:0.6,0.06,0.1,0.03", (0.6, 0.06))],
)
def test_a_load_acts_where_it_is_within_a_face(place, at):
    """Its moments about the clamp are those of its middle; a disc's to a hundredth of an edge."""
    mesh = box_mesh((1.0, 0.1, 0.1), (4, 1, 1))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e9, nu=0.3, rho=1.0))
    bent = apx.simulate(mesh, fix=("plane:x<0",), load={place: (0, 0, -8)}, gravity=0)
    (clamp,) = bent.numbers["reactions"]
    arm = np.array([at[1] - 0.05, at[0]])  # of the middle, from that of the clamp
    off = 1e-9 if place.startswith("box") else 2e-3
    np.testing.assert_allclose(clamp["torque"][:2] / 8, [arm[0], -arm[1]], atol=off)


def test_a_disc_on_a_block_sinks_as_boussinesq_says():
    """2 (1 - nu^2) p a / E in its middle, of a disc less than a cell wide; 6 %: block and mesh."""
    mesh = box_mesh((1.0, 1.0, 1.0), (6, 6, 6))
    mesh = mesh.with_material(ElementMaterial.uniform(216 * 6, E=1e6, nu=0.3, rho=1.0))
    place = "near:0.5,0.5,1,0.1"
    pressed = apx.simulate(mesh, fix=("plane:z<0",), pressure={place: 1e3}, gravity=0)
    middle = np.linalg.norm(mesh.points - [0.5, 0.5, 1.0], axis=1).argmin()
    sinks = -pressed.displacement[middle, 2]
    assert sinks == pytest.approx(2 * 0.91 * 1e3 * 0.1 / 1e6, rel=0.06)


@pytest.mark.truth("a load on what is fixed")
def test_a_load_on_what_is_held_is_told():
    """All of it, half of it on a third of the edges, none: by share, and in words where all is."""
    on = solve(bar(), fix=["part:left"], load={"part:left": (0, 0, -100)}, gravity=0)
    assert on.numbers["loads"][0]["on_fixed"] == 1
    assert any("acts on fixed points alone" in warning for warning in on.warnings)
    part = solve(bar(), fix=["plane:x<0.2"], load={"part:right": (0, 0, -100)}, gravity=0)
    # 4 strips of .05 of .15 m are held: 4 x .05 x .1 of the .07 m2 that the part shows, and of the
    # cells beside them the edges on the plane, a sixth: 1 / 2 x 1 / 3 of as much.
    assert part.numbers["loads"][0]["on_fixed"] == pytest.approx((0.02 + 0.02 / 6) / 0.07)
    off = solve(bar(), fix=["plane:x<0"], load={"plane:x>0.3": (0, 0, -100)}, gravity=0)
    assert off.numbers["loads"][0]["on_fixed"] == 0
    assert not off.warnings


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"load": {"part:right": (0, 0, 0)}}, "nothing acts on the body"),
        ({"pressure": {"box:0.2,0,0.1,0.3,0,0.1": 5.0}}, "no face on the surface"),
        ({"pressure": {"inside:all": 5.0}}, "no cavity"),
        ({"move": {"plane:x<0": (0.001, 0, 0)}}, "all of its points are held"),
        ({"load": {"plane:x>0.3": (1, 0, 0)}, "supports": "three-point"}, "takes its place"),
    ],
)
@pytest.mark.truth("a load that reaches nothing")
def test_what_would_do_nothing_is_refused(stated, words):
    with pytest.raises(UsageError, match=words):
        solve(bar(), fix=["plane:x<0"], gravity=0, **stated)


def test_moves_that_fight_are_told():
    """Six points are moved by both: the first is followed there, and says so."""
    both = {"plane:x>0.3": (0.001, 0, 0), "plane:z>0.1": (0, 0, 0.001)}
    found = solve(bar(), fix=["plane:x<0"], move=both, gravity=0)
    wanted = "6 of its points are moved otherwise by --move plane:x>0.3"
    assert any(wanted in warning for warning in found.warnings)


@pytest.mark.truth("forces by place")
def test_jaws_carry_one_force_each():
    """A bar of nu 0 pressed by two jaws: E A e on each, and none in their sum."""
    mesh = uniform(box_mesh((0.1, 0.1, 0.1), (3, 3, 3)), nu=0.0)
    jaws = {"plane:x<0": (0.001, 0, 0), "plane:x>0.1": (-0.001, 0, 0)}
    fix = ["box:0.1,0,0,0.1,0,0:yz"]
    numbers = solve(mesh, fix=fix, move=jaws, gravity=0, law="linear").numbers
    force = {one["place"]: one["force"][0] for one in numbers["reactions"]}
    assert force["plane:x<0"] == pytest.approx(1e7 * 0.01 * 0.02, rel=1e-6)
    assert force["plane:x>0.1"] == pytest.approx(-1e7 * 0.01 * 0.02, rel=1e-6)
    total = sum(one["force"] for one in numbers["reactions"])
    np.testing.assert_allclose(total, numbers["reaction"], atol=1e-9)


def test_a_clamp_carries_its_moment():
    """A cantilever: the load on it, and its moment about the middle of the root, P L."""
    found = solve(bar(), fix=["plane:x<0"], load={"plane:x>0.3": (0, 0, -10.0)}, gravity=0)
    (root,) = found.numbers["reactions"]
    np.testing.assert_allclose(root["force"], (0, 0, 10.0), atol=1e-8)
    np.testing.assert_allclose(root["torque"], (0, -10.0 * 0.3, 0), atol=1e-8)


@pytest.mark.parametrize("body", ["solid", "hollow"])
@pytest.mark.truth("outer faces")
def test_wind_sees_the_outside_alone(body):
    """rho v^2 / 2 c A of a cube of 1 m, with a closed cavity or without."""
    mesh = uniform(box_mesh((1, 1, 1), (3, 3, 3)), E=1e9) if body == "solid" else hollow()
    drag = -solve(mesh, scenario="wind", wind_speed=10.0).numbers["reaction"]
    np.testing.assert_allclose(drag, (0.5 * 1.225 * 100 * 1.2, 0, 0), atol=1e-6)


@pytest.mark.slow
@pytest.mark.truth("outer faces")
def test_pressure_is_outside_unless_it_is_said_to_be_inside():
    """Areas of a box with walls of a sixth: 6 m2 outside, 6 (2/3)^2 inside, and both are told."""
    sides = {"all": 6.0, "inside:all": 6 * (2 / 3) ** 2, "inside:box:0,0,0,1,1,0.4": None}
    for place, area in sides.items():
        numbers = solve(hollow(), fix=["near:0,0,0,0.3"], pressure={place: 1e3}, gravity=0).numbers
        (load,) = numbers["loads"]
        # Floor and sides up to .4 of a cavity from 1 / 6 to 5 / 6
        wide = 2 / 3
        wanted = area or wide**2 + 4 * wide * (0.4 - 1 / 6)
        assert load["area"] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.truth("upright by piece")
def test_each_piece_stands_by_itself():
    """Two towers: a sheared one tips beside one that stands, though the hull of both holds it."""
    tower = box_mesh((0.2, 0.2, 1.0), (2, 2, 8))
    leans = tower.points + 0.25 * tower.points[:, [2]] * [1.0, 0, 0]
    points = np.concatenate([leans, tower.points + np.array([0.6, 0, 0])])
    tets = np.concatenate([tower.tets, tower.tets + len(tower.points)])
    found = solve(uniform(TetMesh.oriented(points, tets), E=1e9, rho=500.0))
    (upright,) = (check for check in found.checks() if check.name == "upright")
    assert upright.outcome == "failed"
    assert upright.value == pytest.approx(0.1 - 0.125, abs=1e-6)  # half its foot less half its lean


def pulled(stress, row, across, grain=()):
    """A block of a row with its grain along x, pulled with ``stress`` [Pa] along x or y."""
    mesh = of_row(box_mesh((0.3, 0.1, 0.1), (6, 2, 2)), row)
    axis, end, area = ("y", 0.1, 0.03) if across else ("x", 0.3, 0.01)
    beside = "box:0,0.1,0,0,0.1,0:z" if axis == "x" else "box:0.3,0,0,0.3,0,0:z"
    fix = [f"plane:{axis}<0:{axis}", "box:0,0,0,0,0,0:xyz", beside]
    way = np.eye(3)["xyz".index(axis)] * stress * area
    known = {"materials": {"body": row}, "grain": grain or ["part:body=1,0,0"], "law": "linear"}
    found = solve(mesh, fix=fix, load={f"plane:{axis}>{end}": tuple(way)}, gravity=0, **known)
    (safety,) = found.safety
    return safety, found


@pytest.mark.parametrize("row", [OAK, "Douglas fir (along grain)", "CFRP (along fibre)"])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.truth("wood across its grain")
@pytest.mark.slow
def test_what_has_a_grain_is_judged_along_and_across_it(row, sign):
    """Uniaxial stress: the factor is the row's own strength of that direction over it."""
    along, across = load_strengths()[row], load_cross_strengths()[row]
    limit = across.tension if sign > 0 else across.compression
    safety, found = pulled(sign * 2 * limit, row, across=True)
    assert safety.factor == pytest.approx(0.5, rel=1e-3)
    assert (safety.direction, safety.side) == ("across", "tension" if sign > 0 else "compression")
    (strength,) = (check for check in found.checks() if check.name == "strength")
    assert strength.outcome == "failed"
    assert "across the grain" in strength.sentence
    safety, _ = pulled(sign * along.limit(compression=sign < 0) / 4, row, across=False)
    assert safety.factor == pytest.approx(4.0, rel=1e-3)
    assert safety.direction == "along"


@pytest.mark.parametrize("supports", ["base", "three-point"])
def test_a_block_stands_on_its_base_however_it_is_held(supports):
    """Three corners of a rectangle have its middle on their edge; its base reaches half a side."""
    mesh = box_mesh((0.3, 0.2, 0.05), (3, 2, 1))
    mesh = mesh.with_material(ElementMaterial.uniform(36, E=1e8, nu=0.3, rho=500.0))
    stands = next(c for c in apx.simulate(mesh, supports=supports).checks() if c.name == "upright")
    assert stands.value == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (0.4, 1.0, 0.3)])
@pytest.mark.truth("three points that turn what swells")
def test_three_points_let_a_body_swell_without_a_turn(tmp_path, sides):
    """Under a pressure all around all of it is scaled by -p (1 - 2 nu) / E; 1e-3: of p / E."""
    path, out = tmp_path / "block.msh", tmp_path / "rest.vtu"
    write_mesh(path, uniform(box_mesh(sides, (2, 2, 2)), E=1e6))
    words = ("--supports", "three-point", "--gravity", 0, "--pressure", "all=-1000")
    assert run_here("simulate", path, *words, "-o", out).returncode == 0
    grid = meshio.read(out)
    swells = np.column_stack([grid.points, np.ones(len(grid.points))])
    moved = np.linalg.lstsq(swells, grid.point_data["displacement"], rcond=None)[0][:3]
    np.testing.assert_allclose(moved, 4e-4 * np.eye(3), atol=4e-7)


@pytest.mark.parametrize(("level", "outcome"), [(0.1, "doubtful"), (0.02, "passed"), (0.25, None)])
@pytest.mark.truth("a support that ends within elements")
def test_a_support_that_cuts_elements_is_told(tmp_path, level, outcome):
    """Points at 0 and .25 m alone are held: by x < .1 a cantilever has 1 m to bend for its .9."""
    path, out = tmp_path / "beam.msh", tmp_path / "rest.vtu"
    write_mesh(path, uniform(box_mesh((1.0, 0.05, 0.05), (4, 1, 1)), E=7e10))
    words = ("--fix", f"plane:x<{level}", "--load", "plane:x>1=0,0,-10", "--gravity", 0)
    done = run_here("simulate", path, *words, "-o", out, "--json")
    verdicts = {one["detail"]: one for one in json.loads(done.stdout)["sag"]["verdicts"]}
    if outcome is None:
        assert "supports" not in verdicts
        return
    found = verdicts["supports"]
    assert (found["outcome"], found["value"]) == (outcome, pytest.approx(level))
    assert (verdicts["holds shape"]["outcome"] == "doubtful") == (outcome == "doubtful")


@pytest.mark.truth("wood across its grain")
def test_a_slanted_grain_follows_tsai_and_hill():
    """c^4 / X^2 + s^4 / Y^2 + (1 / S^2 - 1 / X^2) s^2 c^2 of a pull at 30 degrees to the grain."""
    X, own = load_strengths()[OAK].limit(), load_cross_strengths()[OAK]
    c, s = np.cos(np.pi / 6), 0.5
    square = c**4 / X**2 + s**4 / own.tension**2 + (1 / own.shear**2 - 1 / X**2) * (s * c) ** 2
    safety, _ = pulled(1e7, OAK, across=False, grain=[f"part:body={c},{s},0"])
    assert safety.factor == pytest.approx(1 / (1e7 * np.sqrt(square)), rel=1e-3)


def test_strengths_across_are_sourced_or_said_to_be_estimates():
    """Wood is weaker across; a row that the handbook has not is a share of its own strength."""
    across, along = load_cross_strengths(), load_strengths()
    for name, own in across.items():
        assert own.tension < along[name].limit(), name
        assert own.compression < along[name].limit(compression=True), name
        assert bool(own.source) or len(own.estimated) == 3, name
    assert across["oak, European (along grain)"].estimated == ("tension", "compression", "shear")
    assert across[OAK].estimated == ()


def strut(row, share):
    """Slender clamped column of a row, under ``share`` of Euler's load at the middle of its E."""
    side, length = 0.02, 1.0
    value = load_table().exact(row).value()
    mesh = of_row(box_mesh((side, side, length), (1, 1, 20)), row)
    load = share * np.pi**2 * value.E * side**4 / 12 / (4 * length**2)
    known = {"materials": {"body": row}, "law": "linear"}
    return solve(mesh, fix=["plane:z<0"], load={"plane:z>1": (0, 0, -load)}, gravity=0, **known)


@pytest.mark.truth("worst E of buckling")
def test_buckling_takes_the_soft_end_as_strength_takes_the_weak_one():
    """Dead loads, one row: the factor goes with E, and its soft end decides."""
    row = load_table().exact("rigid PVC")
    soft = row.E.min / row.value().E
    share = (1 + 1 / soft) / 2 * soft  # between: it stands in the middle and not at the soft end
    found = strut("rigid PVC", share)
    (check,) = (check for check in found.checks() if check.name == "buckling")
    middle = found.solved.load_factor.value
    assert middle == pytest.approx(1 / share, rel=0.02)  # one cell across, clamped at its root
    assert check.value == pytest.approx(middle * soft, rel=1e-6)
    assert check.outcome == "failed"
    assert "soft end" in check.sentence


@pytest.mark.truth("frequencies as nu nears a half")
def test_frequencies_do_not_lock_where_nu_may_be_a_half():
    """f ~ sqrt(E) of a slender rubber rod: a nu of .45 to .495 hardly changes its bending."""
    row = load_table().exact("rubber (natural, vulcanized)")
    mesh = of_row(box_mesh((0.05, 0.05, 0.4), (2, 2, 8)), row.name)
    known = {"materials": {"body": row.name}, "law": "linear"}
    found = solve(mesh, fix=["plane:z<0"], load={"plane:z>0.4": (1e-4, 0, 0)}, gravity=0, **known)
    low, high = found.intervals["likely"].frequencies[0]
    wide = (row.E.max / row.E.min) ** 0.45  # nine tenths of E, even in its logarithm; f its root
    assert high / low == pytest.approx(wide, rel=0.03)  # rho adds a little
    assert high / found.frequencies[0] == pytest.approx(np.sqrt(wide), rel=0.02)


@pytest.mark.truth("free motions are no frequencies")
def test_free_motions_of_vibrations_have_names():
    mesh = uniform(box_mesh((0.3, 0.1, 0.1), (6, 2, 2)), E=1e8, rho=500.0)
    every = ("about x", "about y", "about z", "along x", "along y", "along z")
    for stated, names in (
        ({"supports": "free"}, every),
        ({"fix": ["plane:z<0:z"]}, ("about z", "along x", "along y")),
        ({"fix": ["box:0,0,0,0,0.1,0"]}, ("about y",)),
        ({}, ()),
    ):
        found = apx.simulate(mesh, scenario="modal", **stated)
        assert found.numbers["free"] == names
        assert any("Nothing stops it" in warning for warning in found.warnings) == bool(names)


@pytest.mark.truth("forces by place")
def test_the_command_tells_places_too(tmp_path):
    """Loads and reactions by place in JSON, as Python has them."""
    path = tmp_path / "bar.msh"
    write_mesh(path, bar())
    place = "near:0.3,0.05,0.05,0.02"
    stated = (
        "--fix",
        "plane:x<0",
        "--load",
        f"{place}=0,0,-5",
        "--gravity",
        0,
        "--json",
        "-o",
        tmp_path / "rest.vtu",
    )
    done = run_here("simulate", path, *stated)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)["sag"]
    (load,), (root,) = document["loads"], document["reactions"]
    assert load["area"] == pytest.approx(np.pi * 0.02**2, rel=1e-9)
    assert (load["place"], root["place"]) == (place, "plane:x<0")
    np.testing.assert_allclose(root["force"], (0, 0, 5), atol=1e-6)
