"""Names of a glTF's parts: of its nodes, meshes and materials, the same in every run."""

import json
import os
import re
import struct
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from autophyx_tet.toolkit.asset.document import read_known
from autophyx_tet.toolkit.asset.load import load_asset

from .command import run_cli, run_here

pytestmark = pytest.mark.blockers


def _glb(path, nodes, meshes, materials=()):
    """A GLB of unit cubes, a primitive each: mesh (name, [(material or None, place)]).

    A third number of a primitive is its mode; 1 is lines. ``extras`` mark a node that is a child.
    """
    box = trimesh.creation.box((1, 1, 1))
    views, accessors, told, blob = [], [], [], b""

    def add(array, kind, code):
        nonlocal blob
        data = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": code, "count": len(array), "type": kind}
        )
        blob += data
        return len(accessors) - 1

    for name, primitives in meshes:
        made = []
        for material, place, *mode in primitives:
            points = (box.vertices + np.asarray(place)).astype(np.float32)
            primitive = {"attributes": {"POSITION": add(points, "VEC3", 5126)}}
            if mode:
                primitive["mode"] = mode[0]
            else:
                primitive["indices"] = add(box.faces.astype(np.uint16).ravel(), "SCALAR", 5123)
            if material is not None:
                primitive["material"] = material
            made.append(primitive)
        told.append({"primitives": made} | ({"name": name} if name else {}))
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": told,
        "nodes": nodes,
        "scenes": [{"nodes": [k for k in range(len(nodes)) if not nodes[k].get("extras")]}],
        "materials": [{"name": name} if name else {} for name in materials],
    }
    if not materials:
        del document["materials"]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
    return path


TWO = [(0, (0, 0, 0)), (1, (2, 0, 0))]
# name: (nodes, meshes, materials), names of the parts in the order of the file.
CASES = {
    "a mesh of two materials": (
        ([{"name": "Table", "mesh": 0}], [("Mesh.001", TWO)], ["Oak", "Steel"]),
        ["Oak", "Steel"],
    ),
    "materials without names": (
        ([{"name": "Table", "mesh": 0}], [("Mesh.001", TWO)], ["", ""]),
        ["Table", "Table.1"],
    ),
    "materials of one name": (
        ([{"name": "Table", "mesh": 0}], [("Mesh.001", TWO)], ["Oak", "Oak"]),
        ["Table_Oak", "Table_Oak.1"],
    ),
    "primitives of one material are one part": (
        ([{"name": "Table", "mesh": 0}], [("", [TWO[0], (0, (4, 0, 0)), TWO[1]])], ["Oak", "Tin"]),
        ["Oak", "Tin"],
    ),
    "primitives without materials are one part": (
        ([{"name": "Table", "mesh": 0}], [("", [(None, (0, 0, 0)), (None, (2, 0, 0))])], []),
        ["Table"],
    ),
    "lines beside a surface": (
        ([{"name": "frame", "mesh": 0}], [("m", [(None, (0, 0, 0)), (None, (0, 0, 0), 1)])], []),
        ["frame"],
    ),
    "only the mesh has a name": (
        ([{"mesh": 0}], [("Bench", [(None, (0, 0, 0)), (None, (2, 0, 0))])], []),
        ["Bench"],
    ),
    "nothing has a name": (
        ([{"mesh": 0}], [("", TWO)], ["", ""]),
        ["asset", "asset.1"],
    ),
    "two nodes show one mesh": (
        (
            [{"name": "a", "mesh": 0}, {"name": "b", "mesh": 0, "translation": [0, 3, 0]}],
            [("leg", TWO)],
            ["Oak", "Steel"],
        ),
        ["a_Oak", "a_Steel", "b_Oak", "b_Steel"],
    ),
    "two nodes of one name": (
        (
            [{"name": "Leg", "mesh": 0}, {"name": "Leg", "mesh": 0, "translation": [0, 3, 0]}],
            [("leg", TWO)],
            ["Oak", "Steel"],
        ),
        ["Leg_Oak", "Leg_Steel", "Leg_1_Oak", "Leg_1_Steel"],
    ),
    "two meshes of one name": (
        (
            [{"mesh": 0}, {"mesh": 1, "translation": [0, 3, 0]}],
            [("Leg", TWO), ("Leg", TWO)],
            ["Oak", "Steel"],
        ),
        ["Leg_Oak", "Leg_Steel", "Leg_Oak.1", "Leg_Steel.1"],
    ),
    "a node with the name of the loader's root": (
        ([{"name": "world", "mesh": 0}], [("Globe", TWO)], ["Oak", "Steel"]),
        ["Oak", "Steel"],
    ),
    "a node whose name ends like a hash": (
        (
            [{"name": "Arm", "children": [1]}, {"name": "Arm_a1b2c3", "mesh": 0, "extras": {1: 1}}],
            [("m", [(0, (0, 0, 0)), (1, (2, 0, 0), 1)])],
            ["Oak", "Steel"],
        ),
        ["Arm_a1b2c3"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_parts_go_by_names_of_the_file(tmp_path, case):
    """Names are those of node, mesh and material; every cube is in the part of its material."""
    (nodes, meshes, materials), names = CASES[case]
    asset = load_asset(_glb(tmp_path / "asset.glb", nodes, meshes, materials))
    assert asset.part_names == tuple(names)
    surfaces = sum(len(p) == 2 for node in nodes if "mesh" in node for p in meshes[node["mesh"]][1])
    assert sum(part.mesh.volume for part in asset.parts) == pytest.approx(surfaces)
    given = {*materials, *(name for name, _ in meshes), *(node.get("name", "") for node in nodes)}
    labels = {re.sub(r"_\d$", "", label) for part in asset.parts for label in part.labels}
    assert labels <= given


@pytest.mark.slow
def test_two_processes_read_the_same_names(tmp_path):
    """Other hash seeds, other draws of random numbers: the same names and labels."""
    for number, ((nodes, meshes, materials), _) in enumerate(CASES.values()):
        _glb(tmp_path / f"asset{number}.glb", nodes, meshes, materials)
    read = (
        "import sys; from pathlib import Path\n"
        "from autophyx_tet.toolkit.asset.load import load_asset\n"
        "for path in sorted(Path(sys.argv[1]).glob('*.glb')):\n"
        "    parts = load_asset(path).parts\n"
        "    print(path.name, [(p.name, p.labels, p.mesh.bounds.tolist()) for p in parts])\n"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", read, tmp_path],
            capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    ]  # fmt: skip
    assert said[0] == said[1]
    assert said[0].count("\n") == len(CASES)


@pytest.mark.slow
def test_convert_and_assign_agree_on_names(tmp_path):
    """A part of the mesh is found in the asset by its name, in a later process; words find it."""
    (nodes, meshes, materials), _ = CASES["two nodes show one mesh"]
    asset = _glb(tmp_path / "table.glb", nodes, meshes, materials)
    solid, stiff = tmp_path / "table.msh", tmp_path / "stiff.msh"
    done = run_cli("convert", asset, "-o", solid, "--edge-length-rel", 0.2)
    assert done.returncode == 0, done.stderr
    done = run_here(
        "assign", solid, "--asset", asset, "--text", "the a steel is rubber",
        "--part", "b_Oak=balsa", "--part", "b_Steel=copper", "--json", "-o", stiff,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    parts = {part["name"]: part["material"] for part in json.loads(done.stdout)["parts"]}
    assert sorted(parts) == ["a_Oak", "a_Steel", "b_Oak", "b_Steel"]
    assert "balsa" in parts["b_Oak"]
    assert "copper" in parts["b_Steel"]
    assert "rubber" in parts["a_Steel"]
    assert read_known(stiff, asset)[0].region_names == tuple(sorted(parts))
