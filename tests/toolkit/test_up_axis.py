"""``--up`` with a minus, as COLMAP's splats need it: from the command line to the pictures."""

import json
from typing import get_args

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.points.gaussians import standard_columns
from autophyx_tet.converters.points.table import PointTable, write_points
from autophyx_tet.fem.scene.up import UpAxis, half_turn, up_vector
from autophyx_tet.predictors.appearance.views import hemisphere, ring
from autophyx_tet.predictors.asset import Asset, Part, upright
from autophyx_tet.predictors.film.predictor import Frame
from autophyx_tet.predictors.grid import Grid, PartVoxels
from autophyx_tet.toolkit.asset.document import Sidecar
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.report.picture import asset_panel, render_png
from PIL import Image

from .command import run_here

pytestmark = pytest.mark.blockers
DOWNWARDS = ("-x", "-y", "-z")
TEXT = "the cone is rubber"


def cone(sign=1.0):
    """A cone 0.2 m high whose tip is at ``sign`` y, wide end at y = 0."""
    made = trimesh.creation.cone(0.05, 0.2, sections=24)
    turn = [[1, 0, 0], [0, 0, 1], [0, -1, 0]] if sign > 0 else [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return trimesh.Trimesh(made.vertices @ np.array(turn).T, made.faces)


@pytest.mark.parametrize("up", get_args(UpAxis))
def test_upright_is_a_rotation_that_brings_up_to_z(up):
    turn = upright(np.eye(3), up)
    assert np.linalg.det(turn) == pytest.approx(1)
    assert upright(up_vector(up), up) == pytest.approx([0, 0, 1])
    points = np.random.default_rng(0).normal(size=(5, 3))
    assert upright(points, up) == pytest.approx(upright(points * half_turn(up), up[-1]))


@pytest.mark.parametrize("up", DOWNWARDS)
def test_the_network_and_the_cameras_see_the_asset_turned_over(up):
    part = np.full((5, 6, 7), -1)
    part[1:4, 1:5, 1:6] = np.arange(60).reshape(3, 4, 5)
    names, grid = tuple(map(str, range(60))), Grid(np.zeros(3), 0.1, part.shape)
    over = np.flip(part, tuple(np.flatnonzero(half_turn(up) < 0)))
    ours = Frame.of(PartVoxels(grid, part, names), up)
    theirs = Frame.of(PartVoxels(grid, over, names), up[-1])
    np.testing.assert_array_equal(ours.forward(part), theirs.forward(over))
    again = ours.back(ours.forward(part), PartVoxels(grid, part, names))
    np.testing.assert_array_equal(again[part >= 0], part[part >= 0])
    bounds, turn = np.array([[-1.0, -2, -3], [1, 2, 3]]), half_turn(up)
    for around in (hemisphere, ring):
        for our, their in zip(
            around(bounds, count=5, up=up), around(bounds, count=5, up=up[-1]), strict=True
        ):
            assert turn[:, None] * our.pose[:3] == pytest.approx(their.pose[:3], abs=1e-12)


def test_a_picture_shows_it_upright(tmp_path):
    """The cone upside down in its file, up being -y, looks as the plain one does."""
    pictures = []
    for sign, up in ((1.0, "y"), (-1.0, "-y"), (-1.0, "y")):
        asset = Asset("cone", (Part("cone", cone(sign)),), up=up)
        path = render_png(tmp_path / f"{up}{sign}.png", [asset_panel(asset)], up=up, pixels=96)
        with Image.open(path) as image:
            pictures.append(np.asarray(image.convert("L")).astype(float))
    # Rays are drawn at random, and the cone has flat sides.
    assert np.abs(pictures[0] - pictures[1]).mean() < 2
    assert np.abs(pictures[0] - pictures[2]).mean() > 5


@pytest.mark.long
def test_every_command_takes_the_minus(tmp_path):
    """Both spellings, a file of options, a batch, the mesh's sidecar; the same answer each time."""
    cone(-1.0).export(tmp_path / "cone.stl")
    cone(1.0).export(tmp_path / "plain.stl")
    coarse = ("--edge-length-rel", "0.15", "--units", "m")
    moved = {}
    for name, up in (("cone", ("--up", "-y")), ("plain", ("--up", "y"))):
        mesh, stiff = tmp_path / f"{name}.msh", tmp_path / f"{name}-stiff.msh"
        for words in (
            ("convert", tmp_path / f"{name}.stl", *up, *coarse, "-o", mesh),
            ("assign", mesh, "--text", TEXT, "-o", stiff),
        ):
            done = run_here(*words)
            assert done.returncode == 0, done.stderr
        done = run_here("simulate", stiff, "--json", "-o", tmp_path / "sag.vtu")
        assert done.returncode == 0, done.stderr
        moved[name] = json.loads(done.stdout)["sag"]["max_displacement"]
        assert Sidecar.read(stiff).up == ("y" if name == "plain" else "-y")
    plain = moved["plain"]
    assert moved["cone"] == pytest.approx(plain, rel=0.1)  # two meshes of one cone
    (tmp_path / "options.toml").write_text('up = "-y"\n')
    stiff = tmp_path / "plain-stiff.msh"
    done = run_here("simulate", stiff, "--up", "-y", "--json", "-o", tmp_path / "other.vtu")
    assert done.returncode == 0, done.stderr
    # The plain cone on its tip gives way far more than on its wide end.
    assert json.loads(done.stdout)["sag"]["max_displacement"] > 2 * plain
    for up in (("--up=-y",), ("--config", tmp_path / "options.toml")):
        target = tmp_path / "also.msh"
        done = run_here("convert", tmp_path / "cone.stl", *up, *coarse, "-o", target)
        assert done.returncode == 0, done.stderr
        assert Sidecar.read(target).up == "-y"
        target.unlink()
    done = run_here("convert", tmp_path / "cone.stl", "--up", "-w", "-o", tmp_path / "w.msh")
    assert done.returncode == 2
    (tmp_path / "rows.csv").write_text(f"asset,text,up,units\ncone.stl,{TEXT},-y,m\n")
    done = run_here("batch", tmp_path / "rows.csv", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    run = json.loads((tmp_path / "out" / "cone" / "run.json").read_text())
    assert "-y" in json.dumps(run)


@pytest.mark.long
def test_a_splat_of_colmap_rests_on_its_right_end(tmp_path):
    """A cone of splats, its tip at -y: clamped at its wide end, as the plain one with y up."""
    answers = []
    for sign, up in ((-1.0, "-y"), (1.0, "y")):
        surface = cone(sign)
        points, _ = trimesh.sample.sample_surface_even(surface, 3000, seed=0)
        count = len(points)
        table = standard_columns(
            points,
            np.full((count, 3), np.log(0.004)),
            np.tile([1.0, 0, 0, 0], (count, 1)),
            np.full(count, 0.9),
            np.zeros((count, 3)),
        )
        path = tmp_path / f"cone{up}.ply"
        write_points(path, PointTable(table))
        out = tmp_path / f"out{up}"
        done = run_here(
            "run", path, "--up", up, "--units", "m", "--text", TEXT, "--mesher", "stuffing",
            "--edge-length-rel", 0.12, "-o", out,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert load_asset(path, up=up, units="m").up == up
        run = json.loads((out / "run.json").read_text())
        answers.append(run["cases"][0]["sag"])
    ours, theirs = answers
    # Two reconstructions and lattices of the same cone.
    assert ours["max_displacement"] == pytest.approx(theirs["max_displacement"], rel=0.2)
