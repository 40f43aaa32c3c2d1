"""--drive and --motion: splats move with the mesh, a file a frame, in their own format."""

import json

import numpy as np
import pytest
from autophyx_tet.converters.embedding import Driven, ParticleNeighbours
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.points.gaussians import gaussians
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.fem.solve.result import Breakage, ParticleRun
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.driving import Actor, drive, transfer_motion
from autophyx_tet.toolkit.simulation.simulate import simulate

from ..converters.test_driving import splats
from ..fem.bodies import hammer


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A hammer on disk, and splats in its head, in centimetres."""
    folder = tmp_path_factory.mktemp("drive")
    write_mesh(folder / "hammer.msh", hammer(0.02))
    table = splats(dtype=np.float32)
    place = np.array([0.31, 0.001, 0.001]) + 0.01 * table.positions
    table = table.with_columns(dict(zip("xyz", 100 * place.T.astype(np.float32), strict=True)))
    write_points(folder / "s.ply", table)
    return folder


@pytest.mark.slow
def test_splats_follow_the_head(scene, tmp_path, capsys):
    """Moved by 2 mm downwards, in centimetres: the last frame is .2 lower, the first is the file.

    The head is steel that only moves; the same frames come of the written motion.
    """
    call = ["simulate", str(scene / "hammer.msh"), "--fix", "plane:x<0", "--order", "1"]
    call += ["--move", "plane:x>0.3=0,0,-0.002", "--gravity", "0"]
    call += ["--drive", str(scene / "s.ply"), "--drive-scale", "0.01", "-o", str(tmp_path / "m")]
    assert main([*call, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["drive"]["outside"] == 0
    frames = sorted((tmp_path / "m").glob("s_*.ply"))
    assert len(frames) == document["drive"]["frames"] == 6
    start, first, last = (read_points(p) for p in (scene / "s.ply", frames[0], frames[-1]))
    np.testing.assert_allclose(first.positions, start.positions, atol=1e-5)
    np.testing.assert_allclose(last.positions - start.positions, [[0, 0, -0.2]] * 400, atol=1e-5)
    assert list(last.columns) == list(start.columns)
    again = transfer_motion(
        scene / "hammer.msh", scene / "s.ply", motion=tmp_path / "m" / "motion.pvd",
        output=tmp_path / "again", scale=0.01,
    )  # fmt: skip
    assert again.frames == 6
    np.testing.assert_allclose(read_points(again.files[-1]).positions, last.positions, atol=1e-5)
    assert main(["transfer", str(scene / "hammer.msh"), str(scene / "s.ply"), "--motion",
                 str(tmp_path / "m" / "motion.pvd"), "-o", str(tmp_path / "cli")]) == 0  # fmt: skip
    said = capsys.readouterr()
    assert "400 moved over 6 frames; 400 outside" in said.out
    assert "--scale" in said.err  # metres were taken: that cannot be right, and it is said


def test_splats_of_the_body_itself_raise_no_doubt(tmp_path):
    """A hair outside of its surface they follow; a tenth of its length away, it is asked."""
    mesh = hammer(0.02)
    still = [np.zeros_like(mesh.points)]
    middle = mesh.points[mesh.boundary.faces].mean(axis=1)
    faces = mesh.points[mesh.boundary.faces]
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    length = np.ptp(mesh.points, axis=0).max()
    for share, doubts in ((1e-3, 0), (0.1, 1)):
        places = middle + share * length * normal
        write_points(tmp_path / "on.ply", PointTable(dict(zip("xyz", places.T, strict=True))))
        found = drive(mesh, still, tmp_path / "on.ply", folder=tmp_path / f"{share}")
        assert found.outside > 0.5 * found.moved  # said in any case
        assert len(found.warnings) == doubts


def test_what_cannot_be_driven_is_one_line(scene, tmp_path):
    mesh = scene / "hammer.msh"
    with pytest.raises(UsageError, match="wanted a folder"):
        simulate(mesh, drive=scene / "s.ply", output=tmp_path / "x.pvd")
    with pytest.raises(UsageError, match="give a folder"):
        simulate(mesh, drive=scene / "s.ply")
    with pytest.raises(InputError, match="no such file"):
        simulate(mesh, drive=scene / "none.ply", output=tmp_path / "x")
    with pytest.raises(UsageError, match="metres per unit, got 0"):
        simulate(mesh, drive=scene / "s.ply", drive_scale=0.0, output=tmp_path / "x")
    simulate(hammer(0.02), fix="part:handle", output=tmp_path / "m.pvd", order=1)
    with pytest.raises(InputError, match="is not the source"):
        transfer_motion(
            hammer(0.01), scene / "s.ply", motion=tmp_path / "m.pvd", output=tmp_path / "y"
        )
    assert not (tmp_path / "x").exists()
    assert not (tmp_path / "y").exists()


def test_what_leaves_the_grid_leaves_the_picture():
    """Splats of particles that left are clear in the file, not drawn, and counted."""
    grid = np.stack(np.meshgrid(*3 * [np.arange(5) * 0.1]), axis=-1).reshape(-1, 3)
    left = np.stack([np.zeros(125, bool), grid[:, 0] > 0.25])
    F = np.tile(np.eye(3, dtype=np.float32), (2, 125, 1, 1))
    nothing = Breakage(0.0, 0.0, (), (np.nan,) * 3, 1, 1, 1.0)
    run = ParticleRun(
        spacing=0.2, nodes=(9, 9, 9), substeps=1, plan="", outside=50, stationary=0, rigid=0,
        bodies=0, capped=0, lagrangian=False, notes=(), laws=(), breakage=nothing,
        part=np.zeros(125, int), positions=np.stack([grid, grid]).astype(np.float32),
        gradients=F, left=left,
    )  # fmt: skip
    table = splats(hi=0.4)
    driven = Driven(table, ParticleNeighbours.of(run, table.positions), np.ones(400, bool), 1.0)
    gone = table.positions[:, 0] > 0.26
    start, end = (gaussians(frame).opacity for frame in driven.frames(range(2)))
    np.testing.assert_array_equal(start, gaussians(table).opacity)
    assert (end[gone] < 1e-30).all()
    stays = table.positions[:, 0] < 0.24
    np.testing.assert_array_equal(end[stays], start[stays])
    actor = Actor(driven, range(2))
    assert (actor.frame(1).opacity[gone] == 0).all()
    assert gone.sum() <= actor.gone.sum() <= (~stays).sum()
