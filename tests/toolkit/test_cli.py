"""The command line as a user meets it: help, start-up, JSON, one clear line for every bad input."""

import inspect
import json
import re
import shlex
import subprocess
import sys
import tomllib

import autophyx_tet
import numpy as np
import pytest
import trimesh
import tyro
from autophyx_tet.toolkit.cli.main import COMMANDS, main

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
        "import sys\nfrom autophyx_tet.toolkit.cli.main import main\n"
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


@pytest.mark.slow
def test_assign_and_simulate_from_files(cube_msh, tmp_path):
    """oak cube: table values on every tet; then a sag that scales with 1/E."""
    from autophyx_tet.converters.mesh.mesh_file import read_mesh
    from autophyx_tet.fem.scene.materials import load_table

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


# The verbs that the design of the product promises, and no others.
VERBS = (
    "run", "convert", "assign", "simulate", "transfer", "export", "features", "info", "materials",
    "doctor", "dataset", "train", "evaluate", "batch",
)  # fmt: skip


def test_help_names_every_verb_and_every_exit_code():
    text = run_cli("--help").stdout
    listed = re.search(r"\{([\w,\s]+)\}", text)[1]
    assert set(re.findall(r"\w+", listed)) == set(VERBS)
    words = " ".join(text.split())
    for code in (0, 1, 2, 3, 4, 5, 6, 130):
        assert re.search(rf"\b{code} [a-zE]", words), code
    assert "--tyro-print-completion" in words


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["converts", "a.obj"], "did you mean convert?"),
        (["frobnicate"], "there are convert"),
        (["convert", "a.obj", "-o", "a.msh", "--sizes", "3"], "--size"),
    ],
)
def test_did_you_mean(arguments, words):
    done = run_cli(*arguments)
    assert done.returncode == 2
    assert words in done.stderr + done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_the_examples_of_the_help_parse(command):
    """Every command shows at least one call of itself, and its words are options of its own."""
    words = " ".join(inspect.getdoc(COMMANDS[command]).split())
    calls = re.findall(rf"autophyx-tet {command} [^;]+", words)
    assert calls
    for call in calls:
        tyro.cli(COMMANDS[command], args=shlex.split(call)[2:])


def test_a_reader_that_goes_away_is_no_error():
    """`--help | head -1`: the rest is not written, and nothing is said about it."""
    command = f'"{sys.executable}" -m autophyx_tet.toolkit.cli --help | head -n 1'
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert (len(done.stdout.splitlines()), done.stderr) == (1, "")


def test_the_version_is_told(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"autophyx-tet {autophyx_tet.__version__}\n"


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_knows_the_verbs(shell):
    script = run_cli("--tyro-print-completion", shell).stdout
    assert all(verb in script for verb in VERBS)


def printed(capsys, *arguments):
    assert main([*arguments, "--print-config"]) == 0
    return capsys.readouterr().out


def test_a_printed_configuration_is_read_again(tmp_path, capsys):
    """--config of what --print-config printed gives the same options; the command line wins."""
    given = ["--size", "0.5", "--part", 'a="oak, \\dark"', "--strict", "--scenario", "hang"]
    given += ["--text", "steel", "--text", "a 'soft' foam\ttoo"]
    text = printed(capsys, "run", "a.glb", "-o", "out", *given)
    options = tomllib.loads(text)
    assert (options["size"], options["strict"], options["scenario"]) == (0.5, True, "hang")
    assert options["text"] == ["steel", "a 'soft' foam\ttoo"]
    (tmp_path / "run.toml").write_text(text)
    config = ["--config", str(tmp_path / "run.toml")]
    assert printed(capsys, "run", "b.glb", "-o", "out", *config) == text
    wins = printed(capsys, "run", "b.glb", "-o", "out", *config, "--size", "2")
    assert tomllib.loads(wins) == options | {"size": 2.0}


def test_a_configuration_that_is_none_or_wrong_is_refused(tmp_path):
    (tmp_path / "no.toml").write_text("size = = 3")
    (tmp_path / "unknown.toml").write_text("sizes = 3")
    call = ("convert", "a.obj", "-o", "a.msh", "--config")
    broken = run_cli(*call, tmp_path / "no.toml")
    assert broken.returncode == 3
    assert len(broken.stderr.strip().splitlines()) == 1
    assert run_cli(*call, tmp_path / "unknown.toml").returncode == 2


def test_dry_run_writes_nothing_and_estimates_within_its_range(cube, tmp_path, capsys):
    """The cube at the default edge has 4,943 tets (measured once): inside the range given."""
    before = sorted(tmp_path.rglob("*"))
    call = ["run", str(cube), "--text", "oak", "-o", str(tmp_path / "out"), "--dry-run", "--json"]
    assert main(call) == 0
    document = json.loads(capsys.readouterr().out)
    tets = document["estimates"]["tets"]
    assert tets["low"] < 4943 < tets["high"]
    assert any("oak" in step for step in document["steps"])
    assert sorted(tmp_path.rglob("*")) == before


def test_doctor_lists_what_the_package_requires(capsys):
    """Every requirement of the package is told with its version, and a device, weights, caches."""
    assert main(["doctor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["libraries"]["numpy"] == np.__version__
    assert {"batch", "openclip", "usd"} <= set(document["extras"])
    assert document["devices"][0]["name"] == "cpu"
    # The smallest is a head of 58 kB; what stands for a file that was not fetched is under 1 kB.
    assert all(file["bytes"] > 1e4 for file in document["weights"])
    assert "kernels" in {cache["name"] for cache in document["caches"]}


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "gif"])
def test_simulate_draws_a_picture(suffix, cube_msh, tmp_path, capsys):
    """A picture that is not blank; the GIF moves: its frames differ."""
    from PIL import Image

    mesh, picture = str(tmp_path / "m.msh"), tmp_path / f"p.{suffix}"
    assert main(["assign", str(cube_msh), "--text", "rubber", "-o", mesh, "-q"]) == 0
    call = ["simulate", mesh, "-o", str(tmp_path / "s.vtu"), "--order", "1", "-q"]
    assert main([*call, "--picture", str(picture)]) == 0
    with Image.open(picture) as image:
        first = np.asarray(image.convert("RGB"), dtype=float)
        image.seek(getattr(image, "n_frames", 1) - 1)
        last = np.asarray(image.convert("RGB"), dtype=float)
    assert first.std() > 10
    assert (abs(first - last).max() > 10) == (suffix == "gif")
