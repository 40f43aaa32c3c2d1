"""Hostile input: whatever the bytes or triangles, an asset or one clear sentence, and no hoard.

No crash, no hang, and no allocation because a file says so: a thousand bytes that claim ten
billion vertices cost no more than a thousand bytes.
"""

import base64
import json
import struct
import tracemalloc
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError, NoVolumeError
from autophyx_tet.predictors.asset import Asset, Part
from autophyx_tet.toolkit.asset.foreign import CAD, FBX, SCENE
from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS, References, read_content
from autophyx_tet.toolkit.asset.load import load_asset
from autophyx_tet.toolkit.asset.readers import CARRIER
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.solids import Solids
from autophyx_tet.toolkit.meshing.convert import tetrahedralize
from hypothesis import given, settings
from hypothesis import strategies as st

from . import test_cases, writers
from .test_format_matrix import FEATURES, cube_with

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
        if suffix
        not in (".gltf", ".vrm", *CARRIER.suffixes, *FBX.suffixes, *SCENE.suffixes, *CAD.suffixes)
    }
    files[".gltf"] = _embedded_gltf()
    cloud = np.random.default_rng(0).normal(size=(30, 3))
    files[".xyz"] = "\n".join(" ".join(f"{x:.4f}" for x in row) for row in cloud)
    return {k: v.encode() if isinstance(v, str) else bytes(v) for k, v in files.items()}


def _rich_files() -> dict[str, list[bytes]]:
    """Files of many features: skins, sparse and packed accessors, components, settings, strips."""
    with TemporaryDirectory() as folder:
        found: dict[str, list[bytes]] = {".glb": [], ".3mf": [], ".dae": [], ".ply": [], ".obj": []}
        for feature in FEATURES:
            g = writers.Gltf()
            primitive, mesh, node, _ = cube_with(feature, g)
            g.node(mesh=g.mesh(primitive, **mesh), name="part", **node)
            found[".glb"].append(g.write(Path(folder, "a.glb")).read_bytes())
        inner = f'<object id="1" type="model">{test_cases.CUBE_3MF}</object>'
        whole = (
            '<object id="2" name="x"><components><component objectid="1" p:path="/3D/b.model" '
            'transform="1 0 0 0 1 0 0 0 1 9 0 0"/></components></object>'
        )
        path = writers.threemf(
            Path(folder, "a.3mf"), whole, '<item objectid="2"/>', further={"3D/b.model": inner}
        )
        found[".3mf"].append(path.read_bytes())
        controller, nodes = test_cases.skin(joints=True)
        path = writers.collada(Path(folder, "a.dae"), nodes, more=controller)
        found[".dae"].append(path.read_bytes())
    mixed = [*writers.QUADS[:3].tolist(), *writers.TRIANGLES[3:].tolist()]
    for form in ("ascii", "binary_big_endian"):
        found[".ply"].append(writers.ply(writers.CORNERS, mixed, form=form))
    lines = ["o a", "usemtl red oak", *test_cases.obj_cube(), "g b", "f -1 -2/-1 -3"]
    found[".obj"].append("\n".join(lines).encode())
    return found


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
    "zeros.gltf": _embedded_gltf(count=10**10).replace(
        b'"bufferView": 0, "componentType"', b'"componentType"'
    ),
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


RICH = [(suffix, data) for suffix, files in _rich_files().items() for data in files]
DAMAGE = st.tuples(
    st.integers(0, len(RICH) - 1),
    st.floats(0, 1),
    st.lists(st.tuples(st.floats(0, 1), st.sampled_from(NUMBERS)), max_size=4),
)


def _read_or_refuse(path: Path, data: bytes) -> None:
    """Read bytes as an asset within the bound of memory; errors of ours are an answer."""
    said = str(path)
    tracemalloc.start()
    try:
        read_content(path, data, References(path.parent))
    except InputError as error:
        said = str(error)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert str(path) in said
    assert peak < PEAK


def _damaged(data: bytes, keep: float, strikes: list[tuple[float, bytes]]) -> bytes:
    out = bytearray(data[: int((0.2 + 0.8 * keep) * len(data))])
    for place, number in strikes:
        at = int(place * len(out))
        out[at : at + len(number)] = number
    return bytes(out)


@given(DAMAGE)
@settings(max_examples=80, deadline=None)
def test_damaged_files_of_many_features(damage):
    number, keep, strikes = damage
    suffix, data = RICH[number]
    _read_or_refuse(Path(f"fuzz{suffix}"), _damaged(data, keep, strikes))


@pytest.mark.long
@given(DAMAGE)
@settings(max_examples=1500, deadline=None)
def test_damaged_files_of_many_features_at_length(damage):
    number, keep, strikes = damage
    suffix, data = RICH[number]
    _read_or_refuse(Path(f"fuzz{suffix}"), _damaged(data, keep, strikes))


GUARDED = {".step": writers.step(test_cases.STEP_BOXES).encode(), ".fbx": test_cases.fbx().encode()}


@pytest.mark.long
@given(st.sampled_from(sorted(GUARDED)), DAMAGE)
@settings(max_examples=20, deadline=None)
def test_damaged_files_of_native_readers(suffix, damage):
    """They crash in a process of their own, if they do."""
    _read_or_refuse(Path(f"fuzz{suffix}"), _damaged(GUARDED[suffix], *damage[1:]))


SOUPS = st.tuples(st.integers(0, 2**31), st.integers(3, 12), st.integers(1, 30))


def _soup(seed: int, points: int, faces: int, size: float = 1.0) -> trimesh.Trimesh:
    """Random triangles on a few points of a coarse grid: repeated, null, crossing, flat, open."""
    rng = np.random.default_rng(seed)
    where = size * rng.integers(0, 4, (points, 3)).astype(float)
    return trimesh.Trimesh(where, rng.integers(0, points, (faces, 3)), process=False)


@pytest.mark.slow
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


@pytest.mark.slow
@given(SOUPS)
@settings(max_examples=6, deadline=None)
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
