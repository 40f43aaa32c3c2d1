"""The whole job on real furniture: dirty, multi-part, textured, of real size."""

import json
from pathlib import Path

import numpy as np
import pytest
from autophyx_tet.converters.mesh.meshdata import read_mesh
from autophyx_tet.fem.table import load_table
from autophyx_tet.research.datasets import sweethome3d
from autophyx_tet.toolkit.cli.main import main

pytestmark = [pytest.mark.real, pytest.mark.slow]

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
OBJECTS = (BENCHMARKS / "data" / "real_pieces.txt").read_text().split()
CHAIR = "KatorLegaz/cafe-chair"


@pytest.fixture(scope="session")
def furniture():
    """Objects of the three open sources by key."""
    return {i.key: i for source in sweethome3d.SOURCES for i in sweethome3d.catalog(source)}


def run(capsys, item, folder, *texts):
    """Run the whole job on one object at its real size."""
    obj = sweethome3d.extract(item, folder / "asset")
    said = [word for text in texts for word in ("--text", text)]
    size = max(item.size)
    code = main(["run", str(obj), "--size", str(size), *said, "-o", str(folder / "out"), "--json"])
    out, err = capsys.readouterr()
    assert code == 0, err
    return json.loads(out)


@pytest.mark.parametrize("key", OBJECTS)
def test_real_object_becomes_a_body_of_named_materials(key, furniture, tmp_path, capsys):
    """Watertight, no inverted tet, mass = sum of rho V, a named material on every part."""
    item = furniture[key]
    document = run(capsys, item, tmp_path, f"a {item.name.lower()}")
    mesh = read_mesh(tmp_path / "out" / "mesh.msh")
    assert (mesh.volumes > 0).all()
    kept = {g["name"]: g["ok"] for g in document["report"]["guarantees"]}
    assert kept["tets without volume"]
    assert kept["boundary edges not on two faces"]
    _, count = np.unique(np.sort(_edges(mesh.boundary.faces), axis=1), axis=0, return_counts=True)
    assert (count == 2).all()
    assert document["mass"] == pytest.approx(mesh.material.rho @ mesh.volumes, rel=1e-9)
    assert document["mass"] == pytest.approx(sum(p["mass"] for p in document["parts"]), rel=1e-9)
    names = {row.name for row in load_table()}
    assert {part["material"].removeprefix("like ") for part in document["parts"]} <= names
    assert {part["name"] for part in document["parts"]} == set(mesh.region_names)
    # The asset's longest side, to the envelope of the conversion on both sides.
    longest = np.ptp(mesh.bounds, axis=0).max()
    assert longest <= max(item.size) * 1.01
    assert 0 <= document["sag"]["max_displacement"] < np.inf


def _edges(faces):
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def test_words_change_what_a_chair_does(furniture, tmp_path, capsys):
    """Steel and oak against rubber and foam: E of the frame > 100x, displacement > 30x."""
    item = furniture[CHAIR]
    texts = ("a steel frame with an oak seat", "a rubber frame with a foam seat")
    document = run(capsys, item, tmp_path, *texts)
    stiff, soft = document["cases"]
    frame = [p["name"] for p in stiff["parts"] if "'a steel frame'" in p["why"]]
    assert frame
    E = [{p["name"]: p["E"] for p in case["parts"]} for case in (stiff, soft)]
    for name in frame:
        assert E[0][name] > 100 * E[1][name]
    moved = [case["sag"]["max_displacement"] for case in (stiff, soft)]
    assert moved[1] > 30 * moved[0]
