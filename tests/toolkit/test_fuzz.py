"""Hostile input: whatever the bytes or triangles, an asset or one clear sentence, and no hoard.

No crash, no hang, and no allocation because a file says so: a thousand bytes that claim ten
billion vertices cost no more than a thousand bytes.
"""

import base64
import json
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError, NoVolumeError
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS, References, read_content
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.asset.readers import CARRIER
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids
from autophyx_tet.toolkit.meshing.convert import tetrahedralize
from hypothesis import given, settings
from hypothesis import strategies as st

PEAK = 200 * 2**20  # bytes that reading one of these small files may take at most
NUMBERS = (
    b"1e308", b"-1e308", b"nan", b"inf", b"-1", b"4294967295", b"99999999999",
    b"\xff\xff\xff\x7f", b"\xff" * 4, b"\0" * 8,
)  # fmt: skip


def _embedded_gltf(**accessor) -> bytes:
    """One triangle, its numbers inside; ``accessor`` overwrites what is said about its points."""
    points = np.eye(3, dtype=np.float32).tobytes()
    data = points + np.arange(3, dtype=np.uint32).tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": uri, "byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"} | accessor,
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    return json.dumps(tree).encode()


def _glb(tree: bytes) -> bytes:
    """A binary glTF of one JSON chunk."""
    tree += b" " * (-len(tree) % 4)
    return b"glTF" + struct.pack("<III", 2, 20 + len(tree), len(tree)) + b"JSON" + tree


def _valid_files() -> dict[str, bytes]:
    """A small thing in every format, as bytes by suffix."""
    box = trimesh.creation.box((1, 2, 3))
    files = {
        suffix: trimesh.exchange.export.export_mesh(box, None, file_type=suffix[1:])
        for suffix in ASSET_FORMATS
        if suffix not in (".gltf", ".xyz", *CARRIER.suffixes)
    }
    files[".gltf"] = _embedded_gltf()
    cloud = np.random.default_rng(0).normal(size=(30, 3))
    files[".xyz"] = "\n".join(" ".join(f"{x:.4f}" for x in row) for row in cloud)
    return {k: v.encode() if isinstance(v, str) else bytes(v) for k, v in files.items()}


FILES = _valid_files()
BINARY_PLY = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\n"
    b"property float y\nproperty float z\nelement face %d\n"
    b"property list uchar int vertex_indices\nend_header\n"
)
CLAIMS = {
    "vertices.ply": BINARY_PLY % (10**10, 1) + bytes(100),
    "faces.ply": BINARY_PLY % (3, 10**10) + bytes(100),
    "ascii.ply": (BINARY_PLY % (10**10, 1)).replace(b"binary_little_endian", b"ascii") + b"0 0 0\n",
    "vertices.off": b"OFF\n10000000000 1 0\n0 0 0\n",
    "corners.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n10000000000 0 1 2\n",
    "triangles.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(100),
    "accessor.gltf": _embedded_gltf(count=10**10),
    "offset.gltf": _embedded_gltf(byteOffset=10**10),
    "accessor.glb": _glb(_embedded_gltf(count=10**10)),
    "index.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 10000000000\n",
    "number.xyz": b"1e308 1e308 nan\n" * 3,
}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_costs_nothing(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(CLAIMS[name])
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as error:
            load_asset(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert name in str(error.value)
    assert peak < PEAK


@given(
    st.sampled_from(sorted(FILES)),
    st.floats(0, 1),
    st.lists(st.tuples(st.floats(0, 1), st.sampled_from(NUMBERS)), max_size=4),
)
@settings(max_examples=60, deadline=None)
def test_corrupted_files_are_read_or_refused(suffix, keep, strikes):
    """Truncated and overwritten files of every format: surfaces or one sentence, nothing else."""
    data = bytearray(FILES[suffix][: int((0.2 + 0.8 * keep) * len(FILES[suffix]))])
    for place, number in strikes:
        at = int(place * len(data))
        data[at : at + len(number)] = number
    path = Path(f"fuzz{suffix}")
    try:
        content = read_content(path, bytes(data), References(Path()))
    except InputError:
        return
    for surface in content.surfaces:
        assert surface.mesh.faces.shape[1:] == (3,)


SOUPS = st.tuples(st.integers(0, 2**31), st.integers(3, 12), st.integers(1, 30))


def _soup(seed: int, points: int, faces: int, size: float = 1.0) -> trimesh.Trimesh:
    """Random triangles on a few points of a coarse grid: repeated, null, crossing, flat, open."""
    rng = np.random.default_rng(seed)
    where = size * rng.integers(0, 4, (points, 3)).astype(float)
    return trimesh.Trimesh(where, rng.integers(0, points, (faces, 3)), process=False)


@given(SOUPS, st.sampled_from([1e-9, 1.0, 1e9]))
@settings(max_examples=60, deadline=None)
def test_soups_are_repaired_or_sheets(soup, size):
    """Repair ends, keeps every index in range, and every solid it finds has a volume."""
    mesh = _soup(*soup, size)
    if not np.ptp(mesh.vertices[mesh.faces], axis=(0, 1)).max() > 0:
        return  # one point: refused on loading
    surface, _ = repair([Part("soup", mesh)])
    assert surface.faces.size == 0 or surface.faces.max() < len(surface.points)
    assert np.isfinite(surface.points).all()
    solids = Solids.of(surface, 1, thinnest=1e-3 * size)
    assert bool(solids.shells) == (len(solids.surface.faces) > 0)


@pytest.mark.long
@given(SOUPS)
@settings(max_examples=15, deadline=None)
def test_soups_convert_or_say_why(soup):
    """A mesh of positive tets with a closed boundary, or an error of ours: nothing else."""
    mesh = _soup(*soup)
    if not np.ptp(mesh.vertices[mesh.faces], axis=(0, 1)).max() > 0:
        return
    options = {"edge_length_rel": 0.3, "epsilon_rel": 2e-2, "time_limit": 60.0}
    try:
        made, report = tetrahedralize(Asset("soup", (Part("soup", mesh),)), **options)
    except NoVolumeError:
        return
    assert (made.volumes > 0).all()
    assert report.quality.boundary.bad_edges == 0
