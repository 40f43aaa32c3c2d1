"""Simulate --solver mpm: options, files, page, picture, splats that follow, failures."""

import json
import re
from base64 import b64decode
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters import npz
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.mesh.vtk import read_pvd
from autophyx_tet.converters.npz import load_npz, save_npz
from autophyx_tet.converters.points.table import read_points, write_points
from autophyx_tet.fem.errors import NoVolumeError, UsageError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.mpm.materials import MaterialClass, triaxial_friction
from autophyx_tet.fem.table import load_contents, load_flows, load_table
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.predictors.field import MaterialField
from autophyx_tet.predictors.grid import Grid
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.meshing import convert as conversion
from autophyx_tet.toolkit.meshing.ftetwild import NoFilling
from autophyx_tet.toolkit.meshing.stuffing.mesher import filled
from autophyx_tet.toolkit.options import SimulateOptions
from autophyx_tet.toolkit.pipeline import assign, convert
from autophyx_tet.toolkit.simulation.scenario import flowing_substances, particle_method, substances
from autophyx_tet.toolkit.simulation.simulate import simulate
from PIL import Image

from ..converters.test_driving import splats


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """A bar of jelly on disk, 0.4 m long."""
    mesh = box_mesh((0.4, 0.1, 0.1), (8, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e5, nu=0.3, rho=500.0))
    path = tmp_path_factory.mktemp("bar") / "bar.msh"
    write_mesh(path, mesh)
    return path


def _frame(film, number):
    film.seek(number)
    return film.convert("RGB")


@pytest.mark.slow
def test_a_fall_is_written_reported_and_drawn(bar, tmp_path, capsys):
    """From the command line: motion, page, GIF; the document counts what was done."""
    call = ["simulate", str(bar), "--scenario", "fall", "--fall-height", "0.1", "--grid", "8"]
    files = [tmp_path / name for name in ("fall.pvd", "fall.html", "fall.gif")]
    call += ["-o", str(files[0]), "--report", str(files[1]), "--picture", str(files[2]), "--json"]
    assert main(call) == 0
    document = json.loads(capsys.readouterr().out)
    assert all(path.stat().st_size for path in files)
    found = document["motion"]["particles"]
    assert found["count"] == 8 * 2 * 2 * 8  # eight a cell
    assert found["substeps"] > 0
    assert "some" in found["plan"]
    assert document["motion"]["frames"] == 51
    page = files[1].read_text()
    assert "Material points" in page
    assert "<dt>Law</dt><dd>neo-Hookean" in page
    film = page.split("data:image/gif;base64,")[1].split('"')[0]
    with Image.open(BytesIO(b64decode(film))) as moving:
        assert moving.n_frames == 24
        first, last = (np.asarray(_frame(moving, i)) for i in (0, 23))
    rows = [np.flatnonzero((shot < 250).any(axis=(1, 2))).mean() for shot in (first, last)]
    assert rows[1] > rows[0] + 10  # it lies lower, in pixels


CANTILEVER = {"size": (1.0, 0.25, 0.25), "cells": (16, 4, 4)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "cells", "both", "damping"),
    # Measured -1.5, 2.3, 1.5, 1.5 and 3.2 %; damped at about the slowest tone, to rest in a second.
    [
        (0, 8, False, 14),
        (0, 12, False, 14),
        (0, 16, False, 14),
        (2, 16, False, 14),
        (0, 16, True, 40),
    ],
)
def test_particles_bend_as_the_finite_elements_do(axis, cells, both, damping):
    """A cantilever and a beam between walls, away from the origin, by the verb: 5 % of quadratic
    tets, whose own answer is within 1 % of the beam's."""
    size, count = (np.roll(CANTILEVER[key], axis).tolist() for key in ("size", "cells"))
    low = np.array([0.013, 0.2, -0.37])
    mesh = box_mesh(tuple(size), tuple(count), lo=tuple(low))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.3, rho=1e3))
    ends, name = (low[axis], low[axis] + 1), "xyz"[axis]
    fix = (f"plane:{name}<{ends[0]}", f"plane:{name}>{ends[1]}")[: 1 + both]
    down = ",".join(map(str, np.roll((0, 0, -1), axis)))
    known = {"fix": fix, "gravity": 0.2, "gravity_dir": down}
    tip = np.isclose(mesh.points[:, axis], low[axis] + (0.5 if both else 1.0))
    wanted = simulate(mesh, **known).displacement[tip].mean(axis=0)
    found = simulate(mesh, solver="mpm", grid=cells, damping=damping, **known)
    across = found.displacement[tip].mean(axis=0)
    assert np.linalg.norm(across - wanted) < 0.05 * np.linalg.norm(wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("matter", "breaks"),
    # The free length is stretched by 43 %: 0.8e5 Pa. What holds 1e6 Pa is brittle for the grid:
    # its cracks cost 140 times their energy, but it is as strong as was said.
    [
        ("brittle,tension=2e3,fracture_energy=1", True),
        ("brittle,tension=9e4,fracture_energy=1", False),
        ("brittle,tension=1e6,fracture_energy=1000", False),
        ("jelly", None),
    ],
)
@pytest.mark.truth("strength of particles")
def test_what_tears_is_told_and_nothing_below_its_strength(matter, breaks):
    """A bar pulled apart: the answer says whether it broke, where, and into how many pieces."""
    mesh = box_mesh((0.3, 0.06, 0.06), (10, 2, 2))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=2e5, nu=0.3, rho=1e3))
    torn = simulate(mesh, scenario="tear", grid=10, matter=(f"body={matter}",))
    told = torn.particles.breakage
    assert told.judged == (0.0 if breaks is None else 1.0)
    assert (told.fraction > 0, told.pieces > 1) == (bool(breaks), bool(breaks))
    assert told.parts == (("body",) if breaks else ())
    assert told.pieces_before == 1
    if breaks:
        assert 0.045 < told.place[0] < 0.255  # between the grips
        assert torn.numbers["breakage"]["pieces"] == told.pieces


@pytest.mark.slow
@pytest.mark.truth("strength of particles")
@pytest.mark.parametrize(("share", "breaks"), [(1.1, False), (0.8, True)])
def test_a_bar_that_is_let_hang_breaks_by_twice_its_weight(tmp_path, capsys, share, breaks):
    """A weight that acts at once swings up to 2 rho g L of stress where the bar is held.

    Its strength may be a tenth above that, for what the grid adds there is taken off, or a fifth
    below: what is beside its grip, a cell and a half, is judged as what is below.
    """
    mesh = box_mesh((0.1, 0.1, 1), (2, 2, 20))
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e6, nu=0.0, rho=1e3))
    write_mesh(tmp_path / "bar.msh", mesh)
    strength = share * 2 * 1e3 * 9.81 * 0.95
    call = ["simulate", str(tmp_path / "bar.msh"), "--solver", "mpm", "--fix", "plane:z>0.95"]
    call += ["--grid", "20", "--matter", f"body=brittle,tension={strength},fracture_energy=1"]
    assert main([*call, "-o", str(tmp_path / "hung.pvd"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["motion"]["breakage"]
    assert (told["fraction"] > 0) == breaks


@pytest.mark.slow
def test_splats_follow_what_tears(tmp_path):
    """The halves of a torn bar take their splats along: a file a frame.

    It is narrow in its middle, as specimens are: an even one softens in many places at once.
    """
    mesh = box_mesh((0.4, 0.1, 0.1), (8, 2, 2))
    narrow = np.where(np.isclose(mesh.points[:, :1], 0.2), 0.7, 1.0)
    points = np.hstack([mesh.points[:, :1], 0.05 + narrow * (mesh.points[:, 1:] - 0.05)])
    mesh = replace(mesh, points=points)
    mesh = mesh.with_material(ElementMaterial.uniform(len(mesh.tets), E=1e5, nu=0.3, rho=500.0))
    bar = tmp_path / "bar.msh"
    write_mesh(bar, mesh)
    table = splats(dtype=np.float32)
    place = np.random.default_rng(0).uniform((0, 0, 0), (0.4, 0.1, 0.1), (len(table), 3))
    table = table.with_columns(dict(zip("xyz", place.T.astype(np.float32), strict=True)))
    write_points(tmp_path / "s.ply", table)
    result = simulate(
        bar, scenario="tear", grid=18, matter=("body=jelly,tension=3e3,fracture_energy=10",),
        drive=tmp_path / "s.ply", output=tmp_path / "torn",
    )  # fmt: skip
    frames = sorted((tmp_path / "torn").glob("s_*.ply"))
    assert len(frames) == 51
    with Image.open(tmp_path / "torn" / "s.webp") as film:
        assert film.n_frames == 51
    assert (result.driven.film.needles, result.driven.film.left) == (0, 0)
    before, after = (read_points(p).positions[:, 0] for p in (frames[0], frames[-1]))
    left, right = before < 0.04, before > 0.36
    assert (after - before)[left].mean() == pytest.approx(-0.06, abs=0.015)
    assert (after - before)[right].mean() == pytest.approx(0.06, abs=0.015)
    assert result.warnings == ()
    # None hangs in the crack: they follow particles, not tets that span it.
    assert np.diff(np.sort(after)).max() > 0.03


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    """A ball of splats of 0.1 m in files of decimetres, with the material that they carry."""
    table = splats(dtype=np.float32)
    ways = np.random.default_rng(0).standard_normal((len(table), 3))
    ways *= 0.5 / np.linalg.norm(ways, axis=1, keepdims=True)
    count = np.ones(len(table), dtype=np.float32)
    known = {"E": 1e5 * count, "nu": 0.3 * count, "rho": 500 * count, "part": np.int32(0 * count)}
    columns = dict(zip("xyz", ways.T.astype(np.float32), strict=True)) | known
    path = tmp_path_factory.mktemp("shell") / "shell.ply"
    write_points(path, table.with_columns(columns, comment=json.dumps({"part": ["ball"]})))
    return path


@pytest.mark.slow
def test_splats_that_carry_a_material_need_no_mesh(shell, tmp_path, capsys):
    """They are filled, fall by g t^2 / 2 in their own unit, and are written once a frame."""
    call = ["simulate", str(shell), "--scenario", "fall", "--grid", "8", "--drive-scale", "0.1"]
    assert main([*call, "--matter", "ball=snow", "-o", str(tmp_path / "out"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert any("filled" in warning for warning in document["warnings"])
    frames = sorted((tmp_path / "out").glob("shell_*.ply"))
    assert len(frames) == 51
    before, after = (read_points(frames[i]).positions for i in (0, 2))
    fell = (after - before)[:, 2]  # within a step of the integrator, dt / t
    assert fell == pytest.approx(-10 * 9.81 * 0.08**2 / 2, rel=0.02)


def no_mesh(solids, target, runner):
    """A mesher that gives up."""
    raise NoFilling("the engine gave up")


@pytest.mark.slow
def test_a_surface_that_gives_no_mesh_is_a_body_of_particles(tmp_path, monkeypatch):
    """Cubes with the volume of every part, told in a line; they fall by g t^2 / 2, by MPM alone."""
    own = {"ftetwild": no_mesh, "stuffing": no_mesh, "particles": filled}
    monkeypatch.setattr(conversion, "MESHERS", own)
    ball, post = trimesh.creation.icosphere(3, 0.5), trimesh.creation.box((0.1, 0.1, 0.6))
    post.apply_translation((0, 0, 0.8))
    asset = Asset("lolly", (Part("ball", ball), Part("post", post)))
    limits = {"max_tets": 10_000, "no_cache": True}
    with pytest.raises(NoVolumeError, match=r"no tet mesh after.*gave up.*--mesher particles"):
        convert(asset, **limits)
    # As `run --solver mpm` asks for it
    made = convert(asset, mesher="auto-or-particles", output=tmp_path / "lolly.msh", **limits)
    told = [line for line in made.warnings if "particles" in line]
    assert re.search(r"no tet mesh .*gave up.*cubes of .*--solver mpm.*steps up to", told[0])
    assert len(told) == 1
    volumes = pytest.approx([ball.volume, post.volume], rel=0.05)  # 20 cubes, 8 places in each
    assert made.mesh.region_volumes() == volumes
    away = made.mesh.volumes @ made.mesh.centroids / made.mesh.volume
    assert abs(away[:2]).max() < 0.1 * made.report.edge_length  # on the axis
    body = assign(tmp_path / "lolly.msh", "jelly", output=tmp_path / "jelly.msh")
    assert body.mesh.mass == pytest.approx(sum(body.mesh.material.rho * body.mesh.volumes))
    with pytest.raises(UsageError, match=r"body of particles.*--solver mpm.*gave up"):
        simulate(tmp_path / "jelly.msh", scenario="sag")
    moved = simulate(tmp_path / "jelly.msh", scenario="fall", solver="mpm", grid=8).animation
    _, once, twice = moved.displacement[:3, :, 2]
    # x(2 t) - 2 x(t) = -g t^2, whatever the steps; in single precision
    assert twice - 2 * once == pytest.approx(-9.81 * moved.times[1] ** 2, rel=1e-3)


def test_voxels_are_refused_where_elements_would_solve(shell, tmp_path):
    with pytest.raises(UsageError, match="no mesh: --solver mpm"):
        simulate(shell, scenario="sag")


@pytest.mark.slow
def test_a_run_that_fails_exits_with_6_and_leaves_its_log(bar, tmp_path, capsys, monkeypatch):
    """One line that says where and what to do, and a file with all that is known."""
    from autophyx_tet.fem.mpm import solver

    monkeypatch.setattr(solver, "MOST_INVERTED", -1.0)  # any state is a failure then
    out = tmp_path / "fall.pvd"
    assert main(["simulate", str(bar), "--scenario", "fall", "--grid", "8", "-o", str(out)]) == 6
    said = capsys.readouterr().err
    assert "inverted" in said
    assert "fall.log" in said
    known = json.loads((tmp_path / "fall.log").read_text())
    assert known["failure"]["part"] == "body"
    assert not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "code", "why"),
    [
        (["--grid", "8", "--damping", "nan"], 2, "--damping nan: wanted a rate >= 0"),
        (["--grid", "8", "--damping", "-1"], 2, "--damping -1: wanted a rate >= 0"),
        (["--grid", "0"], 2, "--grid 0: wanted at least 4 cells"),
        (["--grid", "8", "--tear-share", "0"], 3, "share"),
        (["--preset", "physgaussian", "--grid", "8"], 2, "physgaussian has its own --grid"),
        (["--grid", "100000"], 3, "nodes: wanted at most 30,000,000"),
    ],
)
def test_numbers_that_no_run_has_are_one_line(bar, tmp_path, capsys, options, code, why):
    call = ["simulate", str(bar), "--scenario", "tear", "-o", str(tmp_path / "o.pvd")]
    assert main([*call, *options]) == code
    said = capsys.readouterr().err
    assert why in said
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_bodies_that_no_run_can_follow_are_told(tmp_path, capsys):
    """Steel is rigid and counted; not-a-number is named; both in what the terminal says."""
    for E, code, why in ((2e11, 0, "rigid body"), (np.nan, 3, "E")):
        mesh = box_mesh((0.4, 0.1, 0.1), (4, 1, 1))
        steel = ElementMaterial.uniform(len(mesh.tets), E=2e11, nu=0.3, rho=7800.0)
        path = tmp_path / "body.npz"
        write_mesh(path, mesh.with_material(steel))
        if np.isnan(E):
            arrays = load_npz(path)
            arrays["E"][0] = np.nan
            save_npz(path, **arrays)
        call = ["simulate", str(path), "--scenario", "fall", "--grid", "8", "--fall-height", ".01"]
        assert main([*call, "-o", str(tmp_path / "o.pvd")]) == code
        assert why in capsys.readouterr().err


def fallen(path, mesh, capsys, *options):
    """Heights [m] of the points in every frame and what is told, of a fall by the command."""
    write_mesh(path / "body.msh", mesh)
    call = ["simulate", str(path / "body.msh"), "--scenario", "fall", *options, "--json"]
    assert main([*call, "-o", str(path / "o.pvd")]) == 0
    moved = [frame.point_data["displacement"][:, 2] for _, frame in read_pvd(path / "o.pvd")]
    heights = mesh.points[:, 2] + np.stack(moved)
    return heights, json.loads(capsys.readouterr().out)["motion"]


@pytest.mark.blockers
@pytest.mark.slow
@pytest.mark.parametrize("size", [0.05, 0.2, 1.0])
@pytest.mark.truth("crash: fall of what is stiff")
def test_a_steel_cube_falls_and_rests(size, tmp_path, capsys):
    """It falls by g t^2 / 2, lands within a cell, and from then on neither sinks nor rocks."""
    mesh = box_mesh((size,) * 3, (2, 2, 2))
    steel = ElementMaterial.uniform(len(mesh.tets), E=2e11, nu=0.3, rho=7850.0)
    heights, told = fallen(tmp_path, mesh.with_material(steel), capsys, "--grid", "16")
    fallen_by = heights[0].mean() - heights.mean(axis=1)
    cell, time = size / 16, 0.04 * np.arange(len(heights))
    exact = 9.81 * time**2 / 2
    # A step that adds g dt to the speed first falls g t dt / 2 too far, in the longest steps by
    # which it begins: those in which gravity crosses 0.4 cells.
    late = 9.81 * time * np.sqrt(0.4 * cell / 9.81) / 2
    falls = exact + late < size
    assert falls.sum() > 2
    assert (fallen_by - exact >= -1e-9 * size)[falls].all()
    assert (fallen_by - exact <= late + 1e-9 * size)[falls].all()
    rests = time > 1.2 * np.sqrt(2 * size / 9.81)
    assert np.abs(fallen_by[rests] - size).max() < cell  # surfaces are as sharp as the grid
    assert np.ptp(heights[rests], axis=0).max() < 1e-6 * size
    assert told["obstacle_forces"][-1][0] == pytest.approx(7850 * 9.81 * size**3, rel=1e-6)


@pytest.mark.blockers
@pytest.mark.slow
@pytest.mark.truth("crash: fall of what is stiff")
def test_a_stiff_body_falls_with_the_defaults(tmp_path, capsys):
    """A plastic ruler of 0.3 m lands flat, half a cell above the ground or in it."""
    mesh = box_mesh((0.3, 0.03, 0.01), (6, 2, 1))
    stiff = ElementMaterial.uniform(len(mesh.tets), E=2e9, nu=0.3, rho=1200.0)
    heights, _ = fallen(tmp_path, mesh.with_material(stiff), capsys)
    assert np.abs(heights[0] - heights[-1] - 0.3).max() < 0.3 / 64


@pytest.mark.slow
def test_a_stiff_part_falls_with_a_soft_one(tmp_path, capsys):
    """Steel under jelly: both land, the steel within a cell, and the jelly stays on it."""
    mesh = box_mesh((0.1, 0.1, 0.2), (2, 2, 4))
    soft = mesh.centroids[:, 2] > 0.1
    E, rho = np.where(soft, 1e5, 2e11), np.where(soft, 1000.0, 7850.0)
    matter = ElementMaterial(E, np.full(len(E), 0.3), rho)
    both = TetMesh(mesh.points, mesh.tets, soft.astype(np.int32), ("steel", "jelly"), matter)
    heights, _ = fallen(tmp_path, both, capsys, "--grid", "16")
    cell, low = 0.2 / 16, mesh.points[:, 2] < 0.05
    assert np.abs(heights[0] - heights[-1] - 0.2)[low].max() < cell
    assert np.abs(heights[0] - heights[-1] - 0.2).max() < 3 * cell  # the jelly sags


@pytest.mark.slow
def test_what_a_run_costs_is_told_in_a_log_too(bar, tmp_path, capsys):
    """Standard error is no terminal here: the plan is a line all the same, but for --quiet."""
    call = ["simulate", str(bar), "--scenario", "fall", "--grid", "8", "--fall-height", ".01"]
    assert main([*call, "-o", str(tmp_path / "o.pvd")]) == 0
    assert "expected: 256 particles" in capsys.readouterr().err
    assert main([*call, "-o", str(tmp_path / "o.pvd"), "--quiet"]) == 0
    assert "expected" not in capsys.readouterr().err


def test_matter_is_said_in_words():
    found = substances(["pot=stationary", "bread=jelly,tension=5e3,fracture_energy=20,seed=3"])
    assert found["pot"].kind == MaterialClass.STATIONARY
    assert (found["bread"].tension, found["bread"].seed) == (5e3, 3)
    for wrong, why in (
        ("bread", "wanted PART=CLASS"),
        ("bread=glue", "sand"),
        ("bread=jelly,tensoin=1", "did you mean 'tension'"),
        ("bread=jelly,tension=much", "no number"),
    ):
        with pytest.raises(UsageError, match=why):
            substances([wrong])


def test_what_is_not_said_is_taken_from_the_tables():
    """The middle of the sourced range; where there is none the number is asked for."""
    rows = {"pane": "soda-lime glass", "pile": "sand (uniform)", "can": "aluminium 6061-T6"}
    found = substances(["pane=brittle", "pile=sand", "can=metal"], rows)
    assert found["pane"].fracture_energy == pytest.approx(8.2)
    assert found["pane"].tears
    assert found["can"].yield_stress == pytest.approx(2.58e8)
    sine = np.sin(np.deg2rad((27 + 40) / 2))
    assert found["pile"].friction == pytest.approx(np.sqrt(2 / 3) * 2 * sine / (3 - sine))
    assert substances(["pane=brittle,fracture_energy=3"], rows)["pane"].fracture_energy == 3
    with pytest.raises(UsageError, match=r"give friction=\.\.\.: the tables know none of 'oak'"):
        substances(["leg=sand"], {"leg": "oak"})


def test_every_row_of_the_table_of_flow_is_of_a_known_material():
    """With a source or named as an estimate, and ranges the right way round."""
    names = {row.name for row in load_table().rows} | {row.name for row in load_contents().rows}
    for name, flow in load_flows().items():
        assert name in names
        assert (flow.source == "estimate") == bool(flow.estimated)
        spans = (flow.yield_stress, flow.viscosity, flow.friction, flow.fracture)
        assert any(spans)
        assert all(0 < span.min <= span.max for span in spans if span)


def test_what_particles_cannot_do_is_refused(bar):
    with pytest.raises(UsageError, match="do not ring"):
        simulate(bar, options=SimulateOptions(scenario="modal", solver="mpm"))
    with pytest.raises(UsageError, match="at least 4"):
        simulate(bar, options=SimulateOptions(scenario="fall", grid=2))
    with pytest.raises(UsageError, match="no part 'wing'"):
        simulate(bar, options=SimulateOptions(scenario="fall", grid=8, matter=("wing=snow",)))


def test_options_of_another_solver_or_scenario_are_refused(bar, tmp_path, capsys):
    """By name, from the command line, from a file and from Python: one line, exit 2, no solve."""
    mpm = {"grid": 32, "stiff": "cap", "matter": ("body=snow",), "damping": 1.0, "threads": 2}
    for name, value in (mpm | {"preset": "physgaussian"}).items():
        for solver in ("fem", "spring", "lbs"):
            with pytest.raises(UsageError, match=f"--{name}: wanted --solver mpm, not {solver}"):
                simulate(bar, scenario="wind", solver=solver, **{name: value})
    with pytest.raises(UsageError, match="--grid: wanted --solver mpm, not fem"):
        simulate(bar, scenario="sag", grid=32)
    for name, value in {"anchors": 99, "eta": 1.0, "handles": 3, "order": 2}.items():
        with pytest.raises(UsageError, match=rf"--{name}: wanted --solver [\w ]+, not mpm"):
            simulate(bar, scenario="fall", **{name: value})
    for name, value in {"tear_share": 0.2, "wind_speed": 5.0, "modes": 3}.items():
        option = name.replace("_", "-")
        with pytest.raises(UsageError, match=rf"--{option}: wanted --scenario \w+, not hang"):
            simulate(bar, scenario="hang", **{name: value})
    assert main(["simulate", str(bar), "-o", str(tmp_path / "a.vtu"), "--tear-share", "0.2"]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert told == ["autophyx-tet: --tear-share: wanted --scenario tear, not sag"]
    config = tmp_path / "c.toml"
    config.write_text("[simulate]\nstiff = 'cap'\n")
    assert main(["simulate", str(bar), "-o", str(tmp_path / "a.vtu"), "--config", str(config)]) == 2
    assert "--stiff: wanted --solver mpm, not fem" in capsys.readouterr().err


def test_a_part_that_flows_by_its_material_needs_no_word():
    """By its row, or by the class that a predictor found; numbers are the tables' own."""
    rows = {"heap": "like dry sand", "drift": "snow", "leg": "oak", "bolt": "carbon steel"}
    found, notes = flowing_substances(rows | {"pot": "oak"}, {"pot": "fluid"})
    kinds = {part: substance.kind for part, substance in found.items()}
    assert kinds == {
        "heap": MaterialClass.SAND, "drift": MaterialClass.SNOW, "pot": MaterialClass.FLUID,
    }  # fmt: skip
    span = load_flows()["sand (uniform)"].friction
    wanted = triaxial_friction(np.deg2rad((span.min + span.max) / 2))
    assert found["heap"].friction == pytest.approx(wanted)
    assert "heap: sand as like dry sand is, friction" in notes[0]
    assert "--matter heap=jelly" in notes[0]
    found, notes = flowing_substances({"dab": "mud"}, {})
    assert not found
    assert "the tables know no yield_stress of it: elastic;" in notes[0]


@pytest.mark.parametrize(("slope", "angle"), [(0.3266, 30.0), (0.6, 53.7), (0.9, 90.0)])
def test_a_slope_of_sand_is_told_as_an_angle(slope, angle):
    """.6, the tangent of 31 degrees, is a slope of 54: a heap of it runs out half as far."""
    options = SimulateOptions(matter=(f"heap=sand,friction={slope}",))
    (note,) = particle_method(options, {"heap": "like dry sand"}).notes
    assert note.kind == "scenario.slope"
    assert note.values["angle"] == pytest.approx(angle, abs=0.05)
    assert not particle_method(replace(options, matter=("heap=jelly",)), {"heap": "oak"}).notes


@pytest.mark.slow
def test_sand_slumps_where_jelly_stands(tmp_path):
    """A field of dry sand, from a file: its heap ends wider and lower than that of jelly."""
    grid = Grid(np.zeros(3), 0.05, (6, 6, 10))
    occupied = np.zeros(grid.shape, dtype=bool)
    occupied[1:5, 1:5, 1:9] = True
    full = occupied.astype(float)
    field = MaterialField(
        grid=grid, occupied=occupied, E=1e5 * full, nu=0.3 * full, rho=1600 * full,
        part=np.where(occupied, 0, -1), part_names=("heap",),
        material=np.where(occupied, 0, -1), material_names=("dry sand",),
    )  # fmt: skip
    npz.save(tmp_path / "heap.npz", field)
    known = {"scenario": "fall", "fall_height": 0.01, "grid": 8}
    flows = simulate(tmp_path / "heap.npz", **known)
    stands = simulate(tmp_path / "heap.npz", **known, matter=("heap=jelly",))
    assert "heap: sand as dry sand is" in " ".join(flows.warnings)
    heights = [np.ptp(r.particles.positions[-1][:, 2]) for r in (flows, stands)]
    assert heights[0] < 0.7 * heights[1]
