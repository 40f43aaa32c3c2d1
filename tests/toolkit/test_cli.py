"""The command line as a user meets it: help, start-up, JSON, one clear line for every bad input."""

import json
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.cli import COMMANDS, main

HEAVY = {"torch", "warp", "open3d", "pymeshlab", "pytetwild", "igl", "trimesh", "meshio", "scipy"}


def run_cli(*arguments, cwd=None):
    """Run in a process of its own, as a user would."""
    return subprocess.run(
        [sys.executable, "-m", "autophyx_tet.toolkit.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=600,
    )


@pytest.mark.parametrize("command", [None, *COMMANDS])
def test_help_loads_no_heavy_package(command):
    code = (
        "import sys\nfrom autophyx_tet.toolkit.cli import main\n"
        f"try: main({[command, '--help'] if command else ['--help']})\n"
        "except SystemExit as done: assert done.code == 0\n"
        "print(*sorted({m.split('.')[0] for m in sys.modules}))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "usage" in out.stdout
    assert not set(out.stdout.splitlines()[-1].split()) & HEAVY


@pytest.fixture
def cube(tmp_path):
    path = tmp_path / "cube.obj"
    trimesh.creation.box((0.1, 0.1, 0.1)).export(path)
    return path


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


@pytest.mark.parametrize(
    ("make", "code", "words"),
    [
        (_empty, 3, "empty"),
        (_empty_glb, 3, "empty"),
        (_nan, 3, "finite"),
        (_flat, 4, "volume"),
        (_suffix, 3, ".glb"),
        (_missing, 3, "nowhere.glb"),
        (_folder, 3, "d.obj"),
    ],
)
@pytest.mark.parametrize("verb", ["convert", "run"])
def test_bad_asset_ends_in_one_line_and_leaves_nothing(make, code, words, verb, tmp_path):
    asset = tmp_path / make(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    target = tmp_path / ("out.msh" if verb == "convert" else "out")
    done = run_cli(verb, asset, "-o", target, "--json")
    assert done.returncode == code, done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert words in lines[0]
    assert done.stdout == ""
    assert sorted(tmp_path.rglob("*")) == before


@pytest.fixture(scope="module")
def cube_msh(tmp_path_factory):
    """A converted cube, 10 cm, made once."""
    folder = tmp_path_factory.mktemp("cube")
    trimesh.creation.box((0.1, 0.1, 0.1)).export(folder / "cube.obj")
    target = folder / "cube.msh"
    assert main(["convert", str(folder / "cube.obj"), "-o", str(target), "-q"]) == 0
    return target


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--text", "oak " * 2500], 2, "4000"),
        (["--part", "handle=oak"], 2, "handle"),
        (["--material", "cube=unobtainium"], 2, "unobtainium"),
        (["--part", "no equals sign"], 2, "NAME="),
        (["--alpha", "7"], 2, "alpha"),
    ],
)
def test_bad_words_end_in_one_line_and_leave_nothing(options, code, words, cube_msh, tmp_path):
    done = run_cli("assign", cube_msh, *options, "-o", tmp_path / "m.msh")
    assert done.returncode == code, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert words in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("output", ["missing/folder/out.msh", "out.docx"])
def test_bad_output_is_refused_before_the_work(output, cube, tmp_path):
    done = run_cli("convert", cube, "-o", tmp_path / output)
    assert done.returncode == 3
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr


def test_missing_texture_is_a_warning(tmp_path):
    """An OBJ whose MTL names an image that is not there converts, with a warning (exit 0)."""
    cube = trimesh.creation.box((0.1, 0.1, 0.1))
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in cube.vertices)
    faces = "".join("f " + " ".join(f"{i + 1}/1" for i in face) + "\n" for face in cube.faces)
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{vertices}vt 0 0\nusemtl skin\n{faces}")
    (tmp_path / "a.mtl").write_text("newmtl skin\nmap_Kd gone.png\n")
    done = run_cli("convert", tmp_path / "a.obj", "-o", tmp_path / "a.msh", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert any("gone.png" in warning for warning in document["warnings"])


def test_simulate_without_material_says_what_to_do(cube_msh, tmp_path):
    done = run_cli("simulate", cube_msh, "-o", tmp_path / "s.vtu")
    assert done.returncode == 3
    assert "assign" in done.stderr


def test_unknown_option_is_exit_2(cube):
    assert run_cli("convert", cube, "--frobnicate").returncode == 2


def test_assign_and_simulate_from_files(cube_msh, tmp_path):
    """oak cube: table values on every tet; then a sag that scales with 1/E."""
    from autophyx_tet.converters.table import read_mesh
    from autophyx_tet.fem.table import load_table

    target = tmp_path / "m.msh"
    done = run_cli("assign", cube_msh, "--text", "oak cube", "-o", target, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["schema"] == 1
    oak = load_table().exact("oak").value()
    mesh = read_mesh(target)
    np.testing.assert_allclose(mesh.material.E, oak.E, rtol=1e-6)  # the promise of the design
    np.testing.assert_allclose(mesh.material.nu, oak.nu, rtol=1e-6)
    np.testing.assert_allclose(mesh.material.rho, oak.rho, rtol=1e-6)
    assert document["mass"] == pytest.approx(oak.rho * 1e-3, rel=1e-3)  # cube of 1e-3 m^3
    solved = run_cli("simulate", target, "-o", tmp_path / "s.vtu", "--json")
    assert solved.returncode == 0, solved.stderr
    assert 0 < json.loads(solved.stdout)["sag"]["sag_ratio"] < 1e-4  # rho g l / E is 1e-8
