"""--drive and --motion: splats move with the mesh, a file a frame, in their own format."""

import json

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import write_mesh
from autophyx_tet.converters.points.table import PointTable, read_points, write_points
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.toolkit.cli.main import main
from autophyx_tet.toolkit.driving import drive, transfer_motion
from autophyx_tet.toolkit.pipeline import simulate

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
