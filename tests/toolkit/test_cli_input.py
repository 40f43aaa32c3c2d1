"""The command line on bad input: one clear line, the exit code of its kind, nothing written."""

import io
import json
import os
import subprocess
import sys

import pytest
import trimesh
from autophyx_tet.converters.mesh.meshdata import read_mesh
from autophyx_tet.toolkit.batch import read_manifest
from autophyx_tet.toolkit.cli.main import main

from .command import run_cli, run_here

CALLS = [run_here, pytest.param(run_cli, marks=pytest.mark.slow)]  # and as a user would


def rows_for(call, rows):
    """All rows in this process; in one of its own one of each exit code, which is what it adds."""
    return rows if call is run_here else {code: row for row in rows if (code := row[1])}.values()


def _empty(folder):
    (folder / "a.obj").write_text("")
    return "a.obj"


def _empty_glb(folder):
    (folder / "a.glb").write_bytes(b"")
    return "a.glb"


def _nan(folder):
    (folder / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv nan 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    return "a.obj"


def _flat(folder):
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]).export(
        folder / "a.stl"
    )
    return "a.stl"


def _suffix(folder):
    (folder / "a.docx").write_text("hello")
    return "a.docx"


def _missing(folder):
    return "nowhere.glb"


def _folder(folder):
    (folder / "d.obj").mkdir()
    return "d.obj"


BAD_ASSETS = (
    (_empty, 3, "empty"),
    (_empty_glb, 3, "empty"),
    (_nan, 3, "finite"),
    (_flat, 4, "volume"),
    (_suffix, 3, ".glb"),
    (_missing, 3, "nowhere.glb"),
    (_folder, 3, "d.obj"),
)


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("verb", ["convert", "run"])
def test_bad_asset_ends_in_one_line_and_leaves_nothing(verb, call, tmp_path):
    for number, (make, code, words) in enumerate(rows_for(call, BAD_ASSETS)):
        folder = tmp_path / str(number)
        folder.mkdir()
        asset = folder / make(folder)
        before = sorted(folder.rglob("*"))
        target = folder / ("out.msh" if verb == "convert" else "out")
        done = call(verb, asset, "-o", target, "--json")
        assert done.returncode == code, (make.__name__, done.stderr)
        lines = done.stderr.strip().splitlines()
        assert len(lines) == 1, (make.__name__, done.stderr)
        assert words in lines[0], make.__name__
        assert done.stdout == "", make.__name__
        assert sorted(folder.rglob("*")) == before, make.__name__


BAD_WORDS = (
    (["--text", "oak " * 2500], 2, "4000"),
    (["--part", "handle=oak"], 2, "handle"),
    (["--material", "cube=unobtainium"], 2, "unobtainium"),
    (["--part", "no equals sign"], 2, "NAME="),
    (["--alpha", "7"], 2, "alpha"),
)


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_bad_words_end_in_one_line_and_leave_nothing(call, cube_msh, tmp_path):
    for options, code, words in rows_for(call, BAD_WORDS):
        done = call("assign", cube_msh, *options, "-o", tmp_path / "m.msh")
        assert done.returncode == code, (options, done.stderr)
        assert len(done.stderr.strip().splitlines()) == 1, (options, done.stderr)
        assert words in done.stderr, options
        assert not list(tmp_path.iterdir()), options


@pytest.mark.parametrize("call", CALLS)
def test_bad_output_is_refused_before_the_work(call, cube, tmp_path):
    for output in ("missing/folder/out.msh", "out.docx"):
        done = call("convert", cube, "-o", tmp_path / output)
        assert done.returncode == 3, output
        assert len(done.stderr.strip().splitlines()) == 1, (output, done.stderr)


@pytest.mark.parametrize("call", CALLS)
def test_missing_texture_is_a_warning(call, tmp_path):
    """An OBJ whose MTL names an image that is not there converts, with a warning (exit 0)."""
    cube = trimesh.creation.box((0.1, 0.1, 0.1))
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in cube.vertices)
    faces = "".join("f " + " ".join(f"{i + 1}/1" for i in face) + "\n" for face in cube.faces)
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{vertices}vt 0 0\nusemtl skin\n{faces}")
    (tmp_path / "a.mtl").write_text("newmtl skin\nmap_Kd gone.png\n")
    done = call("convert", tmp_path / "a.obj", "-o", tmp_path / "a.msh", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert any("gone.png" in warning for warning in document["warnings"])


@pytest.mark.parametrize("verb", ["assign", "simulate"])
def test_an_asset_in_the_place_of_a_mesh_is_told_the_way(verb, cube, tmp_path):
    done = run_here(verb, cube, "-o", tmp_path / ("a.msh" if verb == "assign" else "a.vtu"))
    assert done.returncode == 3
    assert "autophyx-tet run" in done.stderr
    assert "autophyx-tet convert" in done.stderr


@pytest.mark.slow
def test_a_terminal_without_greek_is_written_to():
    """What ASCII cannot show is a question mark, not a crash."""
    words = [sys.executable, "-m", "autophyx_tet", "materials", "oak"]
    plain = os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    done = subprocess.run(words, env=plain, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert b"kg/m?" in done.stdout


@pytest.mark.parametrize("call", CALLS)
def test_simulate_without_material_says_what_to_do(call, cube_msh, tmp_path):
    done = call("simulate", cube_msh, "-o", tmp_path / "s.vtu")
    assert done.returncode == 3
    assert "assign" in done.stderr


@pytest.mark.slow
def test_unknown_option_is_exit_2(cube):
    assert run_cli("convert", cube, "--frobnicate").returncode == 2


@pytest.mark.slow
def test_a_mesh_goes_through_a_pipe(cube_msh, tmp_path):
    """A dash is stdin and stdout: what came through has its materials, and no word more."""
    cli = [sys.executable, "-m", "autophyx_tet"]
    call = [*cli, "assign", "-", "--text", "the cube is oak", "-o", "-"]
    done = subprocess.run(call, input=cube_msh.read_bytes(), capture_output=True, check=True)
    (tmp_path / "oak.msh").write_bytes(done.stdout)
    assert read_mesh(tmp_path / "oak.msh").mass == pytest.approx(0.7, rel=0.2)  # a litre of oak
    seen = subprocess.run([*cli, "info", "-"], input=done.stdout, capture_output=True, check=True)
    assert b"tets" in seen.stdout


def test_stdout_holds_one_thing(cube_msh, tmp_path):
    for words in (("assign", cube_msh, "-o", "-", "--json"), ("simulate", cube_msh, "-o", "-")):
        done = run_here(*words)
        assert done.returncode == 2, words
        assert "stdout" in done.stderr


@pytest.mark.slow
def test_a_sentence_without_its_option_is_told_the_way(cube_msh, tmp_path):
    done = run_here("assign", cube_msh, "the cube is oak", "-o", tmp_path / "m.msh")
    assert done.returncode == 2
    assert "--text 'the cube is oak'" in done.stderr


def test_a_folder_is_a_batch(cube, tmp_path):
    """`run` says which verb takes a folder; that verb reads every asset in it, in order."""
    (tmp_path / "notes.txt").write_text("no asset")
    (tmp_path / "a.stl").write_bytes(b"")
    done = run_here("run", tmp_path, "-o", tmp_path / "out")
    assert done.returncode == 3
    assert "autophyx-tet batch" in done.stderr
    assert [(job.id, job.asset) for job in read_manifest(tmp_path)] == [
        ("a", "a.stl"),
        ("cube", "cube.obj"),
    ]


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_narrow_terminals_get_whole_sentences(encoding, cube_msh, tmp_path, monkeypatch):
    """Ticks, superscripts and Greek become what the terminal has; nothing crashes."""
    out = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", out)
    assert main(["info", str(cube_msh)]) == 0
    out.flush()
    assert b"tets" in out.buffer.getvalue()


@pytest.mark.slow
def test_info_tells_size_and_matter(cube_msh, tmp_path, capsys):
    """Sides [m], and E, nu and rho once a mesh has them; what is not there is not a suffix."""
    assert main(["info", str(cube_msh)]) == 0
    assert "0.1 x 0.1 x 0.1 m; no E, nu, rho: `assign` gives them" in capsys.readouterr().out
    oak = tmp_path / "oak.msh"
    assert main(["assign", str(cube_msh), "--text", "steel", "-o", str(oak), "-q"]) == 0
    capsys.readouterr()
    assert main(["info", str(oak)]) == 0
    told = capsys.readouterr().out
    assert "0.1 x 0.1 x 0.1 m\n" in told
    assert "e+11" in told  # of any steel
    assert main(["info", str(tmp_path / "nothere")]) == 3
    assert "no such file" in capsys.readouterr().err


@pytest.mark.parametrize("verb", ["info", "assign", "simulate"])
def test_an_asset_where_a_mesh_is_wanted_is_told_what_makes_one(verb, tmp_path, capsys):
    ball = tmp_path / "ball.stl"
    trimesh.creation.icosphere().export(ball)
    rest = {"assign": ["--text", "oak"], "info": []}.get(verb, [])
    rest += [] if verb == "info" else ["-o", str(tmp_path / "out.vtu")]
    assert main([verb, str(ball), *rest]) == 3
    assert "`autophyx-tet convert` makes the mesh" in capsys.readouterr().err
