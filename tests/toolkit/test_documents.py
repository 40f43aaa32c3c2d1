"""`docs/json.md` names the keys of every document: no more, no fewer, and all of it is JSON."""

import json
import re

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.cli.main import main

SCHEMA = 1


@pytest.fixture(scope="module")
def documented(root):
    """The keys of every command's table."""
    page = (root / "docs" / "json.md").read_text()
    sections = re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", page, re.DOTALL | re.MULTILINE)
    return {
        verb: set(
            re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| (`.*?) \|", text, re.MULTILINE)))
        )
        for verb, text in sections
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A cube of 10 cm and a few points inside it."""
    folder = tmp_path_factory.mktemp("documents")
    trimesh.creation.box((0.1, 0.1, 0.1)).export(folder / "cube.stl")
    np.savetxt(folder / "cloud.xyz", np.random.default_rng(0).uniform(-0.05, 0.05, (20, 3)))
    return folder


def printed(capsys, folder, *words):
    """The document of a command that is called in ``folder``."""
    code = main([*(str(folder / word[1:]) if word[0] == "@" else word for word in words), "--json"])
    out, err = capsys.readouterr()
    assert code == 0, err
    document = json.loads(out)
    assert document.pop("schema") == SCHEMA
    return document


COARSE = ("--edge-length-rel", "0.3", "--units", "m", "--no-cache")
CALLS = {
    "convert": ("@cube.stl", "-o", "@cube.msh", *COARSE),
    "assign": ("@cube.msh", "--text", "oak", "-o", "@oak.msh"),
    "simulate": ("@oak.msh", "-o", "@sag.vtu", "--order", "1"),
    "transfer": ("@oak.msh", "@cloud.xyz", "-o", "@out.ply"),
    "export": ("@oak.msh", "--for", "calculix", "-o", "@oak.inp"),
    "features": ("@cube.stl", "-o", "@cube.npz", "--encoder", "occupancy", "--cells", "8"),
    "info": ("@oak.msh",),
    "materials": ("oak",),
    "doctor": (),
}


@pytest.fixture(scope="module")
def made(folder):
    """Files that later commands need."""
    for verb in ("convert", "assign"):
        words = [str(folder / word[1:]) if word[0] == "@" else word for word in CALLS[verb]]
        assert main([verb, *words, "-q"]) == 0


@pytest.mark.slow
def test_the_documented_keys_are_those_printed(documented, made, folder, capsys):
    for verb, call in CALLS.items():
        assert set(printed(capsys, folder, verb, *call)) == documented[verb], verb


@pytest.mark.slow
def test_run_and_batch_too(documented, folder, tmp_path, capsys):
    """A batch of one row, and the document of its run."""
    row = "asset,text,edge_length_rel,units,order\ncube.stl,oak,0.3,m,1\n"
    (folder / "manifest.csv").write_text(row)
    call = ("batch", "@manifest.csv", "-o", str(tmp_path / "out"), "--workers", "1")
    document = printed(capsys, folder, *call)
    assert set(document) == documented["batch"]
    run = json.loads((tmp_path / "out" / "cube" / "run.json").read_text())
    assert run.pop("schema") == SCHEMA
    assert set(run) == documented["run"]
