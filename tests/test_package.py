"""The wheel: what it holds, how large it is, and that it works away from the checkout."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

ROOMS = ("fem", "predictors", "converters", "toolkit", "research")
DATA = {
    ".csv",
    ".safetensors",
    ".md",
    ".css",
    ".html",
    ".js",
    ".toml",
    ".json",
    ".jsonl",
    ".txt",
    ".tsv",
}
# Bytes: 15.8 MB are the weights of the FiLM network, 7.6 MB those of the network of ranges, 4.6 MB
# those of the phrases, 3.8 MB those of the regions, 3.1 MB those of the tagger; the rest is code
# and data. Far below an index's usual 100 MB.
LARGEST_WHEEL = 37e6
# One metre, so that the size option has something to do.
CUBE = """
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory) -> Path:
    """Built of a copy, so that no build folder is left in, or taken from, the checkout."""
    copy, built = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    skip = shutil.ignore_patterns("__pycache__")
    for room in ROOMS:
        shutil.copytree(root / room, copy / room, ignore=skip)
    for name in ("__init__.py", "setup.py", "pyproject.toml", "README.md", "LICENSE", "NOTICE"):
        shutil.copy(root / name, copy)
    _call(sys.executable, "-m", "build", "--wheel", "--no-isolation", "-o", built, copy)
    (path,) = built.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def command(wheel, tmp_path_factory) -> Path:
    """The program of a fresh environment that has our wheel and finds the others' packages.

    The packages we depend on are those of the environment that runs the tests, by a path file;
    the editable install there is not seen, because path files inside it are not followed.
    """
    folder = tmp_path_factory.mktemp("environment")
    _call(sys.executable, "-m", "venv", "--without-pip", folder)
    python = folder / "bin" / "python"
    _call(sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", wheel)
    (site,) = folder.glob("lib/python*/site-packages")
    paths = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site / "dependencies.pth").write_text("\n".join(sorted(paths)) + "\n")
    where = _call(python, "-c", "import autophyx_tet; print(autophyx_tet.__file__)", cwd=folder)
    assert Path(where.strip()).is_relative_to(site)
    return folder / "bin" / "autophyx-tet"


def _call(*words, cwd=None) -> str:
    done = subprocess.run([*map(str, words)], cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def test_wheel_holds_the_rooms_and_their_data(wheel, root):
    """Every module, weight, table and template of the tree, and nothing else."""
    inside = {
        name.removeprefix("autophyx_tet/")
        for name in zipfile.ZipFile(wheel).namelist()
        if name.startswith("autophyx_tet/")
    }
    tree = {
        path.relative_to(root).as_posix()
        for room in ROOMS
        for path in (root / room).rglob("*")
        if path.suffix in {".py"} | DATA and "__pycache__" not in path.parts
    }
    assert inside == tree | {"__init__.py"}


def test_wheel_stays_small(wheel):
    """A download that nobody thinks about."""
    assert wheel.stat().st_size < LARGEST_WHEEL


def test_wheel_states_its_licence(wheel):
    """An SPDX expression, the licence and the attributions."""
    files = zipfile.ZipFile(wheel)
    (name,) = (name for name in files.namelist() if name.endswith(".dist-info/METADATA"))
    facts = Parser().parsestr(files.read(name).decode())
    assert facts["License-Expression"] == "Apache-2.0"
    assert set(facts.get_all("License-File")) == {"LICENSE", "NOTICE"}


def test_installed_program_works_in_another_folder(command, tmp_path):
    """Help, table, and a cube of steel of 10 cm: 7.85 kg, without the checkout."""
    assert "convert" in _call(command, "--help", cwd=tmp_path)
    rows = json.loads(_call(command, "materials", "oak", "--json", cwd=tmp_path))["materials"]
    assert any("oak" in row["name"] for row in rows)
    (tmp_path / "cube.obj").write_text(CUBE)
    sizes = ("--size", "0.1", "--edge-length-rel", "0.3", "--cache", tmp_path / "cache")
    _call(command, "convert", "cube.obj", "-o", "cube.msh", *sizes, cwd=tmp_path)
    words = ("assign", "cube.msh", "--text", "made of steel", "-o", "steel.msh", "--json")
    done = json.loads(_call(command, *words, cwd=tmp_path))
    assert done["mass"] == pytest.approx(7.85, rel=0.03)
    assert os.listdir(tmp_path / "cache")
