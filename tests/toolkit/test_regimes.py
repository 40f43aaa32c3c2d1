"""Rests beyond small displacements, through the command with its defaults, beside exact values."""

import json

import meshio
import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.fem.elements.assembly import discretise
from autophyx_tet.fem.elements.elastic import displacement_gradients
from autophyx_tet.fem.elements.space import element_points
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.toolkit.simulation.simulate import simulate
from scipy.integrate import solve_bvp

from ..fem.bodies import with_uniform
from .command import run_here
from .test_textbook import shell


def simulated(tmp_path, mesh, *words):
    """The ``sag`` of the document of the command, all its sentences, and displacements [m]."""
    path, out = tmp_path / "body.msh", tmp_path / "rest.vtu"
    write_mesh(path, mesh)
    done = run_here("simulate", path, *words, "--gravity", "0", "-o", out, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    sentences = [verdict["sentence"] for verdict in document["sag"]["verdicts"]]
    moved = meshio.read(out).point_data["displacement"]
    return document["sag"], " ".join([*sentences, *document["warnings"]]), moved


L, SIDE, E = 1.0, 0.01, 2e11
BENDING = E * SIDE**4 / 12


@pytest.mark.slow
@pytest.mark.parametrize(
    ("alpha", "w", "u"), [(0.5, 0.16225, 0.01577), (1.0, 0.30172, 0.05643), (5.0, 0.71379, 0.38763)]
)
@pytest.mark.truth("rotation: cantilever")
def test_cantilever_under_a_dead_force(tmp_path, alpha, w, u):
    """Elastica (Mattiasson 1981): P L^2 / E I bends the end by w L and shortens it by u L."""
    mesh = with_uniform(box_mesh((L, SIDE, SIDE), (60, 1, 1)), E=E, nu=0.0, rho=7850.0)
    force = f"plane:x>1=0,0,{-alpha * BENDING / L**2}"
    answer, said, moved = simulated(tmp_path, mesh, "--fix", "plane:x<0", "--load", force)
    tip = moved[mesh.points[:, 0] == L].mean(axis=0)
    assert -tip[2] == pytest.approx(w * L, rel=2e-3)  # shear of a rod 100 times as long as thick
    assert -tip[0] == pytest.approx(u * L, rel=1e-2)  # of the second order in that
    assert answer["law"] == "neohookean"
    assert "the linear answer turns by" in said


@pytest.mark.slow
@pytest.mark.parametrize(("load", "ratio"), [(200, 1.347), (1000, 2.651)])
@pytest.mark.truth("membranes: clamped plate")
def test_clamped_plate(tmp_path, load, ratio):
    """w / t of a clamped plate under q a^4 / E t^4, by CalculiX with NLGEOM on the same nodes."""
    thick, modulus = 0.01, 7e10
    mesh = with_uniform(box_mesh((1, 1, thick), (20, 20, 1)), E=modulus, nu=0.3, rho=2700.0)
    sides = [w for at in ("x<0", "x>1", "y<0", "y>1") for w in ("--fix", f"plane:{at}")]
    pressure = f"plane:z>{thick}={load * modulus * thick**4}"
    answer, said, _ = simulated(tmp_path, mesh, *sides, "--pressure", pressure)
    assert answer["max_displacement"] / thick == pytest.approx(ratio, rel=3e-3)
    assert "followed with the neo-Hookean law" in said
    assert "more than 1000 times its load" in said  # what is drawn taut does not buckle


@pytest.mark.slow
@pytest.mark.parametrize(("share", "aside"), [(0.5, 50.0), (0.9, 5.0), (1.2, 0.5)])
@pytest.mark.truth("a column that is pushed aside too")
def test_a_column_that_is_pushed_aside_buckles_at_eulers_load(tmp_path, share, aside):
    """Its path has no end: it bends ever more near that load; by tan(k L) - k L below it."""
    side, modulus = 0.02, 7e10
    stiff = modulus * side**4 / 12
    load = share * np.pi**2 / 4 * stiff
    mesh = with_uniform(box_mesh((side, side, 1), (1, 1, 20)), E=modulus, nu=0.0, rho=1000.0)
    push = ("--load", f"plane:z>1={aside},0,{-load}")
    answer, said, moved = simulated(tmp_path, mesh, "--fix", "plane:z<0", *push)
    assert answer["load_factor"] == pytest.approx(1 / share, rel=0.03)  # steps of the path
    assert ("It buckles" in said) == (share > 1)
    if share < 1:
        k = np.sqrt(load / stiff)
        bent = aside * (np.tan(k) - k) / (load * k)
        assert moved[:, 0].max() == pytest.approx(bent, rel=0.01)  # of small turns, up to .05


@pytest.mark.slow
@pytest.mark.truth("a load factor that its path has passed")
def test_a_pressure_that_follows_a_cantilever_never_buckles_it(tmp_path):
    """Elastica under a load across it: M' = -F x t, F' = -q n from the tip, solved as an ODE.

    It bends on without an end, so that no multiple of the load is one at which it buckles.
    """
    side, modulus, pressure = 0.02, 2e9, 3000.0
    q, stiff = pressure * side, modulus * side**4 / 12

    def slopes(s, y):
        angle, moment, fx, fy, *_ = y
        c, s = np.cos(angle), np.sin(angle)
        return np.vstack([moment / stiff, s * fx - c * fy, -q * s, q * c, c, s])

    ends = lambda a, b: np.array([a[0], a[4], a[5], *b[1:4]])  # noqa: E731
    s = np.linspace(0, 1, 200)
    start = np.vstack([np.zeros((4, 200)), s, 0 * s])
    exact = solve_bvp(slopes, ends, s, start, tol=1e-8).y[4:, -1] - [1, 0]
    mesh = with_uniform(box_mesh((1, side, side), (16, 1, 2)), E=modulus, nu=0.0, rho=1.0)
    words = ("--fix", "plane:x<0", "--pressure", f"plane:z>{side}={pressure}")
    answer, said, moved = simulated(tmp_path, mesh, *words)
    tip = moved[mesh.points[:, 0] == 1].mean(axis=0)
    assert tip[[0, 2]] == pytest.approx(exact, rel=5e-3)  # shear and mesh
    assert answer["load_factor_passed"]
    assert answer["load_factor"] > 2
    assert "more than" in said


@pytest.mark.slow
@pytest.mark.parametrize("angle", [1.2, 4.0])
@pytest.mark.truth("rotation: a moment")
def test_a_moment_bends_a_rod_to_an_arc(tmp_path, angle):
    """M L / E I is the angle of the arc, however far past a right one; shear there is none."""
    mesh = with_uniform(box_mesh((1, 0.02, 0.02), (24, 2, 2)), E=1e9, nu=0.0, rho=1.0)
    torque = f"plane:x>1=0,{-angle * 1e9 * 0.02**4 / 12},0"
    _, said, moved = simulated(tmp_path, mesh, "--fix", "plane:x<0", "--torque", torque)
    tip = moved[mesh.points[:, 0] == 1].mean(axis=0)
    assert tip[2] == pytest.approx((1 - np.cos(angle)) / angle, rel=2e-3)  # (h / L)^2 and cells
    assert tip[0] == pytest.approx(np.sin(angle) / angle - 1, rel=2e-3)
    assert "buckles was not checked" in said  # the torque has no energy


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.25, 0.7])
@pytest.mark.truth("snaps: balloon")
def test_a_rubber_balloon_has_a_largest_pressure(tmp_path, share):
    """p = mu / 2 (4 / b + 1 / b^4 - 4 / a - 1 / a^4) by the stretches of its outer and inner face.

    Its slowest vibrations are none of that: it swells all over, and past the top bursts.
    """
    inner, outer, nu = 0.09, 0.1, 0.495
    mesh = shell(inner, outer, layers=1)
    a = np.linspace(1, 2, 2001)
    b = np.cbrt(1 + (inner / outer) ** 3 * (a**3 - 1))
    pressure = 1e6 / (1 + nu) / 4 * (4 / b + b**-4 - 4 / a - a**-4)
    top = pressure.argmax()
    poles = []
    for side in (outer, -outer):
        poles += ["--fix", f"near:{side},0,0,1e-3:yz", "--fix", f"near:0,{side},0,1e-3:xz"]
    load = f"inside:all={share * pressure[top]}"
    mesh = with_uniform(mesh, E=1e6, nu=nu, rho=1e3)
    answer, _, moved = simulated(tmp_path, mesh, *poles, "--pressure", load)
    assert answer["load_factor"] == pytest.approx(1 / share, rel=2e-2)  # nu is not a half
    out = np.isclose(np.linalg.norm(mesh.points, axis=1), outer)
    swollen = np.linalg.norm((mesh.points + moved)[out], axis=1).mean() / outer
    right = np.interp(share * pressure[top], pressure[: top + 1], b[: top + 1])
    assert swollen - 1 == pytest.approx(right - 1, rel=0.08)  # faces of 22 degrees


def cylinder(radius, length, across, along):
    """A cylinder along z, mapped from a box."""
    flat = box_mesh((2, 2, length), (across, across, along), lo=(-1, -1, 0))
    x, y, z = flat.points.T
    round_ = [radius * x * np.sqrt(1 - y**2 / 2), radius * y * np.sqrt(1 - x**2 / 2), z]
    return TetMesh.oriented(np.stack(round_, axis=1), flat.tets)


@pytest.mark.long
@pytest.mark.truth("rotation: twisted rod")
def test_a_rod_that_is_turned_keeps_its_radius_and_volume(tmp_path):
    """A torque of 1.5 G J / L turns its end by 1.5 rad; radius and volume stay."""
    R, length, modulus = 0.01, 0.2, 1e9
    mesh = with_uniform(cylinder(R, length, 6, 10), E=modulus, nu=0.3, rho=1000.0)
    torque = modulus / 2.6 * np.pi * R**4 / 2 / length * 1.5
    place = f"plane:z>{length}=0,0,{torque}"
    _, _, moved = simulated(tmp_path, mesh, "--fix", "plane:z<0", "--torque", place)
    x, y = mesh.points, mesh.points + moved
    end = np.isclose(x[:, 2], length) & (np.hypot(x[:, 0], x[:, 1]) > 0.99 * R)
    before, after = (p[end, 0] + 1j * p[end, 1] for p in (x, y))
    # The polygon of 24 sides is 3 % softer than the circle
    assert np.angle(after / before).mean() == pytest.approx(1.5, rel=0.04)
    assert np.abs(after).mean() == pytest.approx(R, rel=1e-3)


@pytest.mark.slow
@pytest.mark.truth("rotation: twisted rod")
def test_a_turned_body_keeps_its_volume():
    """Of the quadratic elements: the integral of J is 1 within .1 %, what the law itself takes."""
    R, length, modulus = 0.01, 0.1, 1e9
    mesh = with_uniform(cylinder(R, length, 4, 6), E=modulus, nu=0.3, rho=1000.0)
    torque = modulus / 2.6 * np.pi * R**4 / 2 / length * 0.75
    place = {f"plane:z>{length}": (0, 0, torque)}
    rest = simulate(mesh, fix=["plane:z<0"], torque=place, gravity=0).solved
    H = displacement_gradients(
        discretise(mesh, 2), rest.static.node_displacement, element_points(2)
    )
    J = np.linalg.det(H + np.eye(3)).mean(axis=1)
    assert mesh.volumes @ J == pytest.approx(mesh.volume, rel=1e-3)


HEIGHT, THICK = 0.03, 0.01
PLACE = f"box:0.4999,0,{HEIGHT + THICK - 1e-4},0.5001,1,1"
CALCULIX_LIMIT = 19.76  # N, by benchmarks/large_displacements.py: prescribed displacement


def arch():
    """A shallow arch, clamped at both ends."""
    flat = box_mesh((1.0, 0.02, THICK), (40, 1, 2))
    lift = 4 * HEIGHT * flat.points[:, 0] * (1 - flat.points[:, 0])
    mesh = TetMesh.oriented(flat.points + np.outer(lift, [0, 0, 1]), flat.tets)
    return with_uniform(mesh, E=2e9, nu=0.3, rho=1000.0)


@pytest.mark.slow
@pytest.mark.parametrize("load", [2.0, 15.0, 25.0])
@pytest.mark.truth("snaps: arch")
def test_arch_snaps_at_one_load(tmp_path, load):
    """Whatever acts, below and beyond it, the limit load is the same, and CalculiX's to 1 %."""
    answer, said, _ = simulated(
        tmp_path, arch(), "--fix", "plane:x<0", "--fix", "plane:x>1",
        "--load", f"{PLACE}=0,0,{-load}",
    )  # fmt: skip
    assert answer["load_factor"] * load == pytest.approx(CALCULIX_LIMIT, rel=0.01)
    assert ("It buckles" in said) == (load > CALCULIX_LIMIT)
    if load > CALCULIX_LIMIT:
        assert "it snaps at" in said
        assert answer["max_displacement"] > HEIGHT  # through, to the other side


@pytest.mark.truth("frequencies of the loaded state")
def test_frequency_of_a_loaded_column(tmp_path):
    """At .95 of Euler's load a cantilever column has f = 3.79 Hz, by its characteristic equation.

    EI w'''' + P w'' = rho A omega^2 w; sqrt(1 - P / P_E) of the free one is a bound, 3.65 Hz.
    """
    side, modulus = 0.02, 2e11
    mesh = with_uniform(box_mesh((side, side, 1), (2, 2, 40)), E=modulus, nu=0.0, rho=7850.0)
    force = 0.95 * np.pi**2 * modulus * side**4 / 12 / 4
    answer, said, _ = simulated(
        tmp_path, mesh, "--fix", "plane:z<0", "--load", f"plane:z>1=0,0,{-force}"
    )
    # .1 % in the load at which it buckles is 1 % here
    assert answer["frequencies"][0] == pytest.approx(3.791, rel=0.02)
    assert "frequency under its load" in said


@pytest.mark.slow
@pytest.mark.truth("frequencies of the loaded state")
def test_frequency_of_a_wire(tmp_path):
    """A wire of 1 mm under 100 N: f = sqrt(T / rho A) / 2 L = 56.4 Hz, and 1.3 % by its bending."""
    side = 0.001
    mesh = with_uniform(box_mesh((1, side, side), (200, 1, 1)), E=2e11, nu=0.3, rho=7850.0)
    answer, _, _ = simulated(
        tmp_path, mesh, "--fix", "plane:x<0", "--fix", "plane:x>1:yz",
        "--load", "plane:x>1=100,0,0",
    )  # fmt: skip
    clamped = 1 + np.sqrt(2e11 * side**4 / 12 / 100)
    assert answer["frequencies"][0] == pytest.approx(56.43 * clamped, rel=0.005)


@pytest.mark.parametrize("law", ["neohookean", "corotated"])
@pytest.mark.truth("a law that is asked for")
def test_a_law_is_followed_at_rest(tmp_path, law):
    """Where the linear law would be enough too."""
    mesh = with_uniform(box_mesh((1, 1, 1), (2, 2, 2)), E=1e6, nu=0.3, rho=1000.0)
    answer, said, _ = simulated(
        tmp_path, mesh, "--fix", "plane:z<0", "--pressure", "plane:z>1=1000", "--law", law
    )
    assert answer["law"] == law
    assert "as asked" in said


@pytest.mark.truth("a law that is asked for")
def test_vibrations_follow_no_finite_law(tmp_path):
    """They are small: another law than the linear one is refused in one line."""
    path = tmp_path / "body.msh"
    write_mesh(path, with_uniform(box_mesh((1, 1, 1), (2, 2, 2)), E=1e6, nu=0.3, rho=1000.0))
    words = ("--scenario", "modal", "--law", "neohookean", "-o", tmp_path / "rest.vtu")
    done = run_here("simulate", path, *words)
    assert done.returncode == 2
    assert "--law" in done.stderr


@pytest.mark.truth("crash: a stretched band")
def test_a_pulled_band_does_not_buckle(tmp_path):
    """Rubber that is drawn to one and a half times its length is stable there."""
    mesh = with_uniform(box_mesh((1, 0.2, 0.02), (10, 2, 1)), E=1e6, nu=0.45, rho=1000.0)
    answer, said, _ = simulated(tmp_path, mesh, "--fix", "plane:x<0", "--move", "plane:x>1=0.5,0,0")
    assert "does not buckle" in said
    assert answer["load_factor"] > 1
    assert "collapses" not in said


@pytest.mark.truth("free motions are no frequencies")
def test_motions_that_nothing_resists_are_told(tmp_path):
    """A box that lies on rollers slides in two ways and turns in one: none of them is stiff."""
    path = tmp_path / "body.msh"
    write_mesh(path, with_uniform(box_mesh((1, 1, 1), (2, 2, 2)), E=1e6, nu=0.3, rho=1000.0))
    words = ("--scenario", "modal", "--fix", "plane:z<0:z", "-o", tmp_path / "rest.vtu", "--json")
    done = run_here("simulate", path, *words)
    said = " ".join(v["sentence"] for v in json.loads(done.stdout)["modal"]["verdicts"])
    assert "moves freely about z, along x, along y" in said
    assert "is stiff" not in said


@pytest.mark.truth("no green beside a rest not found")
def test_nothing_is_good_of_a_rest_that_was_not_found(monkeypatch):
    """A beam rolled up by a torque, exact w = 0.46 L: 0.50 L by the linear answer, which is told.

    Its mesh leaves 1 % of that, and it is below its linear buckling load: both are in doubt.
    """
    monkeypatch.setattr("autophyx_tet.fem.solve.nonlinear.MOST_FACTORS", 2)
    monkeypatch.setattr("autophyx_tet.fem.solve.nonlinear.LEAST_FACTORS", 2)
    mesh = with_uniform(box_mesh((1.0, 0.04, 0.04), (10, 2, 2)), E=1e8, nu=0.0, rho=1e3)
    torque = {"plane:x>1": (0.0, -1e8 * 0.04**4 / 12, 0.0)}
    found = simulate(mesh, fix=["plane:x<0"], torque=torque, gravity=0)
    assert not found.solved.trusted
    outcomes = {check.name: check.outcome for check in found.verdicts()}
    assert outcomes["holds shape"] == "failed"
    assert outcomes["discretisation"] == outcomes["buckling"] == "doubtful"
    assert "linear answer: how it comes to lie was not found" in found.verdicts()[2].sentence


@pytest.mark.truth("crash: a ball driven into a cube")
def test_a_ball_is_not_driven_through_what_is_held(tmp_path):
    """A ball of .02 m at 3 m/s reaches the clamped base of a cube .28 m below after .093 s."""
    path = tmp_path / "cube.msh"
    write_mesh(path, with_uniform(box_mesh((0.1,) * 3, (2, 2, 2)), E=1e6, nu=0.3, rho=1000.0))
    words = ("--scenario", "drop", "--drop-height", "0.5", "--fix", "plane:z<0")
    ball = ("--obstacle", "sphere:0.05,0.05,0.3,0.02=0,0,-3")
    done = run_here("simulate", path, *words, *ball, "-o", tmp_path / "o.pvd")
    assert done.returncode == 2
    time = float(done.stderr.split("held, at ")[1].split(" s")[0])
    assert 0.28 / 3 <= time < 0.12  # within a frame


@pytest.mark.slow
@pytest.mark.truth("middles of edges across the body")
def test_a_pad_of_one_cell_tells_what_its_force_is_off_by(tmp_path):
    """Rubber between bonded plates: the error of the force that they need, and no green beside."""
    forces = []
    for cells in ((4, 4, 1), (8, 8, 4)):
        mesh = with_uniform(box_mesh((0.1, 0.1, 0.02), cells), E=2e6, nu=0.49, rho=1100.0)
        pressed = ("--fix", "plane:z<0", "--move", "plane:z>0.02=0,0,-4e-4", "--law", "linear")
        answer, said, _ = simulated(tmp_path, mesh, *pressed)
        forces.append(max(place["force"][2] for place in answer["reactions"]))
        if len(forces) == 1:
            told = answer["gap"]["reaction"]
            assert "In doubt because of its mesh: its shape" in said
    coarse, fine = forces
    assert 0.5 < told / (1 - fine / coarse) < 2
