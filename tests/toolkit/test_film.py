"""Films of splats: the driver fits the budget, what was made stays, and a stopped film goes on."""

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from autophyx_tet.converters.points.gaussians import SH_C0, standard_columns
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.fem import METHODS, Scene, Supports, box_mesh
from autophyx_tet.fem.errors import UsageError
from autophyx_tet.fem.material import ElementMaterial
from autophyx_tet.fem.mpm.materials import MaterialClass, Substance
from autophyx_tet.fem.mpm.method import MpmMethod
from autophyx_tet.fem.mpm.time_step import BUDGET, largest_modulus
from autophyx_tet.fem.scenarios import Drop, Spin, Wind
from autophyx_tet.toolkit import driving
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.film import film
from autophyx_tet.toolkit.options import SimulateOptions
from autophyx_tet.toolkit.simulation import budget
from autophyx_tet.toolkit.simulation.budget import MOST_PARTICLES, WITHIN, coarsened, paced, planned
from autophyx_tet.toolkit.simulation.simulate import simulate
from PIL import Image

SOFT = {"E": 2e5, "nu": 0.3, "rho": 300.0}
FEW = {"seconds": 0.2, "budget": 60.0}  # 6 frames


def matter(mesh, **numbers):
    return mesh.with_material(ElementMaterial.uniform(len(mesh.tets), **SOFT | numbers))


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """A capture: a shell of splats of .1 m in a file of centimetres, and dust around it."""
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(4000, 3))
    ways *= 5 / np.linalg.norm(ways, axis=1, keepdims=True)
    ways = np.concatenate([ways, rng.uniform(-20, 20, (40, 3))])
    count, turn = len(ways), np.array([1.0, 0, 0, 0])
    colour = (np.tile([0.8, 0.3, 0.2], (count, 1)) - 0.5) / SH_C0
    columns = standard_columns(
        ways, np.full((count, 3), np.log(0.2)), np.tile(turn, (count, 1)), np.full(count, 0.9),
        colour,
    )  # fmt: skip
    path = tmp_path_factory.mktemp("film") / "ball.ply"
    write_points(path, PointTable(columns))
    return path


@pytest.mark.slow
def test_the_driver_is_the_finest_that_fits(monkeypatch):
    """More seconds make a finer grid, up to what a film needs; what is held is a reduced body."""
    taken = budget.ParticleSeconds(step=2e-7, listing=6e-3)  # of any machine the same
    monkeypatch.setattr(budget, "particle_seconds", lambda _: taken)
    mesh = matter(box_mesh((0.1, 0.02, 0.02), (10, 2, 2)))
    falls = Drop(height=0.1).scene(mesh)

    def plan(budget, spent=0.0):
        known = {"method": "dynamics", "picture": 0.1, "spent": spent}
        return planned(falls, SimulateOptions(budget=budget), **known)

    grids = [plan(budget) for budget in (1e4, 24.0, 1.0)]
    assert {one.options.solver for one in grids} == {"mpm"}
    assert grids[0].cells > grids[1].cells > grids[2].cells == 16
    assert 8 * mesh.volume / (0.1 / grids[0].cells) ** 3 <= MOST_PARTICLES
    assert grids[1].solve + grids[1].draw <= 24 / WITHIN
    assert [one.fits for one in grids] == [True, True, False]
    assert plan(1e4, spent=1e4 / WITHIN).cells == 16  # all of it is gone
    held = Scene(mesh=mesh, supports=Supports.clamp(len(mesh.points), mesh.points[:, 2] == 0))
    one = planned(held, SimulateOptions(budget=60.0), method="statics", picture=0.1)
    assert (one.options.solver, one.options.order) == ("lbs", 2)
    water = {"body": Substance(kind=MaterialClass.FLUID, viscosity=1.0)}
    known = {"method": "statics", "picture": 0.1, "substances": water}
    flows = planned(held, SimulateOptions(budget=60.0), **known)
    assert flows.options.solver == "mpm"


def test_what_is_held_needs_no_tets():
    """A bar whose lower half is held: the other moves as it did, by half of the tets."""
    mesh = matter(box_mesh((0.1, 0.1, 0.4), (2, 2, 8)))
    supports = Supports.clamp(len(mesh.points), mesh.points[:, 2] < 0.21)
    scene = Wind(speed=5.0).scene(mesh)
    scene = replace(scene, supports=supports)
    film_of = paced(scene, SimulateOptions(solver="lbs"))
    assert 2 * len(film_of.mesh.tets) == len(mesh.tets)
    assert film_of.mesh.points is mesh.points
    whole, part = (
        METHODS["statics"].solve(one, law="linear", order=1).displacement
        for one in (scene, replace(scene, mesh=film_of.mesh, tractions=film_of.tractions))
    )
    assert np.abs(whole).max() > 1e-5
    np.testing.assert_allclose(part, whole, atol=1e-9 * np.abs(whole).max())


@pytest.mark.slow
def test_what_can_bounce_is_not_made_rigid_by_a_finer_grid():
    """Rubber is too stiff for 48 cells within 40,000 steps a second, not for 16; steel for all.

    On 28 cells of the length it would be more particles than a film needs.
    """
    mesh = box_mesh((0.03, 0.03, 0.1), (2, 2, 6))
    grids = []
    for E, nu, rho in ((5.5e5, 0.49, 1000.0), (2e11, 0.3, 7800.0)):
        falls = Drop(height=0.1).scene(matter(mesh, E=E, nu=nu, rho=rho))
        plan = planned(falls, SimulateOptions(budget=60.0), method="dynamics", picture=0.1)
        most = largest_modulus(nu, rho, 0.1 / plan.cells, 1 / BUDGET)
        grids.append((plan.cells, bool(most > E)))
    assert grids[0][0] < 24
    assert grids[0][1]
    assert grids[1] == (24, False)


@pytest.mark.slow
def test_a_coarse_body_is_the_body():
    """Two bars, one on the other, 12,000 tets: mass to 1 %, parts by name, moduli by place."""
    mesh = box_mesh((0.1, 0.1, 0.4), (10, 10, 20))
    upper = mesh.centroids[:, 2] > 0.2
    mesh = type(mesh)(mesh.points, mesh.tets, upper.astype(int), ("low", "high"))
    E = np.where(upper, 1e5, 1e6)
    mesh = mesh.with_material(ElementMaterial(E, np.full(len(E), 0.3), np.full(len(E), 300.0)))
    body = coarsened(mesh, most=2000)
    assert len(body.tets) < 4000
    assert body.mass == pytest.approx(mesh.mass, rel=0.01)
    assert set(body.region_names) == {"low", "high"}
    high = body.region == body.region_names.index("high")
    assert (body.material.E[high] == 1e5).mean() > 0.98
    assert coarsened(body, most=4000) is body


@pytest.mark.slow
def test_a_spinning_body_turns_as_fast_as_asked_and_stretches():
    """Steel: X turns by 2 pi rate t about z through the middle; jelly becomes longer.

    Turns of particles themselves, dx^2 / 2 a mass, come of those of the body: its L^2 / 12 turn by
    2.3 % less.
    Of jelly rho w^2 L^2 / 8 / E = .02 is the mean strain of a bar that has come to rest in its
    turning frame; let go at once it swings between none and about twice that.
    """
    mesh = matter(box_mesh((0.4, 0.1, 0.06), (8, 2, 1)), E=2e11, rho=1000.0)
    scene = Spin(rate=2.0).scene(mesh)
    assert scene.duration == 1.0  # two turns
    scene = replace(scene, duration=0.1, frames=4)
    x = MpmMethod(grid=16).solve(scene).displacements[-1] + mesh.points
    turn = np.deg2rad(0.2 * 360) / (1 + 6 * (0.4 / 16) ** 2 / (0.4**2 + 0.1**2))
    R = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    middle = np.array([0.2, 0.05, 0.03])
    np.testing.assert_allclose(x, (mesh.points - middle) @ R.T + middle, atol=5e-4)
    soft = matter(mesh, E=1e5, rho=1000.0)
    run = MpmMethod(grid=16).solve(replace(scene, mesh=soft))
    places = run.particles.positions
    ends = places[:, [places[0, :, 0].argmin(), places[0, :, 0].argmax()]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert 1.005 < max(length) / length[0] < 1.08
    assert max(f.energy for f in run.frames) < 1.001 * run.frames[0].energy


@pytest.mark.slow
def test_a_stopped_film_goes_on(ball, tmp_path, monkeypatch):
    """Stopped amid the drawing: the frames so far are a film; again, it is the whole film's."""
    # A budget that no grid keeps: the coarsest one, however busy the machine is
    options = SimulateOptions(scenario="drop", drop_height=0.02, **{**FEW, "budget": 0.01})
    call = {"texts": ["jelly"], "simulate_options": options}
    from autophyx_tet.toolkit.options import ConvertOptions

    call["convert_options"] = ConvertOptions(size=0.1, up="z", edge_length=0.03, no_cache=True)
    whole = film(ball, output=tmp_path / "whole", **call)
    assert whole.film.frames == 6
    assert 4000 <= whole.film.drawn <= 4004  # of the dust two lie in the ball
    assert whole.film.drawn + whole.film.floating == 4040
    assert (whole.film.left, whole.film.needles, whole.resumed) == (0, 0, False)

    frame = driving.Actor.frame

    def stops(self, number):
        if number == 3:
            raise KeyboardInterrupt
        return frame(self, number)

    monkeypatch.setattr(driving.Actor, "frame", stops)
    with pytest.raises(KeyboardInterrupt):
        film(ball, output=tmp_path / "part", **call)
    with Image.open(tmp_path / "part" / "film.webp") as seen:
        assert seen.n_frames == 3
    monkeypatch.setattr(driving.Actor, "frame", frame)
    again = film(ball, output=tmp_path / "part", **call)
    assert again.resumed
    assert again.film.frames == 6
    assert again.film.files[0].read_bytes() == whole.film.files[0].read_bytes()


def frames_of(path) -> int:
    if not path.is_file():
        return 0
    with Image.open(path) as seen:
        for i in range(seen.n_frames):  # every one can be read
            seen.seek(i)
            seen.load()
        return seen.n_frames


@pytest.mark.long
def test_a_film_survives_signals(ball, tmp_path):
    """One command, stopped before its motion, amid its frames, killed amid them, and once more.

    After each its frames so far are a film, and at last it is the film of a call that was left
    alone.
    """
    call = [sys.executable, "-m", "autophyx_tet", "film", str(ball), "--text", "jelly"]
    call += ["--scenario", "drop", "--drop-height", "0.02", "--size", "0.1", "--up", "z"]
    # A budget that no grid keeps: the coarsest one, however busy the machine is
    call += ["--edge-length", "0.03", "--seconds", "1", "--budget", "0.01", "--no-cache", "-o"]
    out = tmp_path / "part"
    for wanted, number in ((-1, signal.SIGINT), (3, signal.SIGTERM), (9, signal.SIGKILL)):
        running = subprocess.Popen(
            [*call, str(out)],
            stderr=subprocess.PIPE,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        end = time.monotonic() + 300
        while not (out.is_dir() if wanted < 0 else frames_of(out / "film.webp") >= wanted):
            assert running.poll() is None
            assert time.monotonic() < end
            time.sleep(0.02)
        running.send_signal(number)
        told = running.communicate(timeout=60)[1].decode()
        assert running.returncode, told  # it was not done
        assert "Traceback" not in told
        frames = frames_of(out / "film.webp")
        assert max(wanted, 0) <= frames < 30
    for folder in (out, tmp_path / "whole"):
        subprocess.run([*call, str(folder)], check=True, capture_output=True, timeout=300)
        assert frames_of(folder / "film.webp") == 30
    assert (out / "film.webp").read_bytes() == (tmp_path / "whole" / "film.webp").read_bytes()


@pytest.mark.slow
def test_two_sentences_are_seen_side_by_side(ball, tmp_path, capsys):
    """The command: a film twice as wide, with the verdicts of each sentence."""
    call = [
        "film",
        str(ball),
        "-o",
        str(tmp_path / "two"),
        "--text",
        "soft rubber",
        "--text",
        "oak",
    ]
    call += ["--scenario", "wind", "--size", "0.1", "--up", "z", "--edge-length", "0.03"]
    assert main([*call, "--seconds", "0.1", "--no-cache", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [case["text"] for case in document["cases"]] == ["soft rubber", "oak"]
    energies = [
        v for case in document["cases"] for v in case["verdicts"] if v["detail"] == "energy"
    ]
    assert [v["mark"] for v in energies] == ["good", "good"]
    rows = [[part["material"] for part in case["parts"]] for case in document["cases"]]
    assert rows == [["soft rubber"], ["red oak (along grain)"]]
    with Image.open(tmp_path / "two" / "film.webp") as seen:
        assert (seen.size, seen.n_frames) == ((1024, 512), 3)


@pytest.mark.slow
def test_a_film_tells_what_was_not_understood(ball, tmp_path, capsys):
    """As `assign` does: the word, the axis and the unit of the file, and the row that is taken."""
    call = ["film", str(ball), "-o", str(tmp_path / "film"), "--text", "blorptastic"]
    call += ["--seconds", "0.1", "--no-cache"]
    assert main([*call, "--edge-length", "0.3"]) == 2  # of ten metres
    assert "too fine to drive a film" in capsys.readouterr().err
    assert main([*call, "--edge-length", "2"]) == 0
    shown = capsys.readouterr()
    assert "'blorptastic'" in shown.err
    assert "metres" in shown.err
    row = json.loads((tmp_path / "film" / "film.json").read_text())["cases"][0]["parts"][0]
    assert row["material"].split()[0] in shown.out


@pytest.mark.slow
def test_simulate_makes_a_film_within_a_budget(ball, tmp_path):
    """A mesh that has its material, and splats: a film, no file a frame."""
    mesh = matter(box_mesh((0.1, 0.1, 0.1), (5, 5, 5), lo=(-0.05, -0.05, -0.05)))
    made = simulate(
        mesh, scenario="wind", drive=ball, drive_scale=0.01, output=tmp_path / "out", **FEW
    )
    assert sorted(path.suffix for path in (tmp_path / "out").iterdir()) == [".key", ".mp4", ".webp"]
    assert made.driven.film.frames == 6
    with pytest.raises(UsageError, match="--drive"):
        simulate(mesh, output=tmp_path / "x.pvd", budget=10.0)
    assert read_points(ball).is_splat
