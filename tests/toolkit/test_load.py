"""Loading: what a file says survives (metres, names, places), what it lacks is said."""

import copy
import json
import re
import struct
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from autophyx_tet.fem.errors import InputError, UsageError
from autophyx_tet.toolkit.asset.bonsai import write_bonsai
from autophyx_tet.toolkit.asset.load import METRES, load_asset
from autophyx_tet.toolkit.asset.repair import repair
from autophyx_tet.toolkit.asset.surface import component_volumes

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex {v}\nproperty float x\nproperty float y\n"
    "property float z\nelement face {f}\nproperty list uchar int vertex_indices\nend_header\n"
)


def _box(tmp_path, suffix, **extents):
    path = tmp_path / f"box{suffix}"
    trimesh.creation.box((1, 2, 4)).export(path)
    return path


def test_every_format_gives_the_same_box(tmp_path):
    """A box of 1 x 2 x 4 m keeps its area and volume in every format."""
    for suffix in (".obj", ".ply", ".stl", ".off", ".glb", ".gltf"):
        asset = load_asset(_box(tmp_path, suffix))
        (part,) = asset.parts
        assert part.name == "box"
        assert asset.size == pytest.approx((1, 2, 4)), suffix
        assert abs(part.mesh.volume) == pytest.approx(8), suffix
        metric = suffix in (".glb", ".gltf")
        assert asset.up == ("y" if metric or suffix == ".obj" else "z"), suffix
        assert bool(asset.warnings) != metric, suffix


def test_units(tmp_path):
    for unit, factor in METRES.items():
        asset = load_asset(_box(tmp_path, ".stl"), units=unit)
        assert asset.size.max() == pytest.approx(4 * factor), unit
        assert asset.metres_per_unit == factor


def test_size_is_the_longest_side(tmp_path):
    asset = load_asset(_box(tmp_path, ".stl"), size=0.1)
    assert asset.size == pytest.approx((0.025, 0.05, 0.1))
    assert not any("unit" in w for w in asset.warnings)


def test_a_forgotten_unit_is_warned_about(tmp_path):
    path = tmp_path / "chair.stl"
    trimesh.creation.box((500, 500, 900)).export(path)
    assert any("900 m is unusual: likely mm, --units mm" in w for w in load_asset(path).warnings)
    trimesh.creation.box((80, 80, 80)).export(path)
    assert any("80 m is unusual: likely mm" in w for w in load_asset(path).warnings)
    assert not any("unusual" in w for w in load_asset(path, units="mm").warnings)
    trimesh.creation.box((8e-4, 8e-4, 8e-4)).export(path)
    (told,) = load_asset(path).warnings  # one line for both guesses
    assert "0.0008 m is unusual: --size" in told
    assert told.endswith("nor does it say which axis is up: taken as +Z; --up sets it")


def test_nobody_is_asked_for_a_unit_that_was_given(tmp_path):
    """An odd size that was stated is said as a fact, not asked about again."""
    path = tmp_path / "bridge.stl"
    trimesh.creation.box((80, 10, 10)).export(path)
    for given in ({"units": "m"}, {"size": 8e-4}):
        asset = load_asset(path, **given)
        assert asset.size_stated
        (said,) = (w for w in asset.warnings if "unusual" in w)
        assert said.endswith("is unusual: as was stated")
        assert not any("--units" in w or "--size" in w for w in asset.warnings)
    assert not load_asset(path).size_stated


def test_node_transforms_names_and_materials(tmp_path):
    """A mesh used by two nodes gives two parts, each where its node puts it."""
    scene = trimesh.Scene()
    leg = trimesh.creation.box((1, 1, 1))
    leg.visual = trimesh.visual.TextureVisuals(
        uv=np.zeros((len(leg.vertices), 2)),
        material=trimesh.visual.material.PBRMaterial(name="oak"),
    )
    for i, name in enumerate(("left leg", "right leg")):
        scene.add_geometry(
            leg, node_name=name, geom_name="leg",
            transform=trimesh.transformations.translation_matrix((10 * i, 0, 0)),
        )  # fmt: skip
    path = tmp_path / "legs.glb"
    scene.export(path)
    asset = load_asset(path)
    assert sorted(asset.part_names) == ["left leg", "right leg"]
    assert asset.bounds == pytest.approx(np.array([[-0.5] * 3, [10.5, 0.5, 0.5]]))
    assert all("oak" in part.labels for part in asset.parts)


def test_obj_groups_and_materials_become_parts(tmp_path):
    """One part per object and material; pieces of the same are joined; names without the .mtl."""
    a, b = ("".join(f"v {x + dx} {y} {z}\n" for x, y, z in np.eye(3)) for dx in (0, 5))
    path = tmp_path / "chair.obj"
    path.write_text(
        f"mtllib gone.mtl\no seat\n{a}usemtl oak\nf 1 2 3\nusemtl foam\nf 3 2 1\n"
        f"o back\n{b}usemtl oak\nf 4 5 6\nusemtl oak\nf 6 5 4\n"
    )
    asset = load_asset(path)
    assert set(asset.part_names) == {"seat_oak", "foam", "back"}
    faces = {part.name: len(part.mesh.faces) for part in asset.parts}
    assert faces == {"seat_oak": 1, "foam": 1, "back": 2}
    assert any("gone.mtl" in w for w in asset.warnings)


def test_relative_indices_count_back_from_their_line(tmp_path):
    path = tmp_path / "back.obj"
    moved = TRIANGLE.replace("v ", "v 5")  # beside the first
    path.write_text(f"{TRIANGLE}f -3 -2 -1\n{moved}vt 0 0\nf -3/-1 -2/-1 -1/-1\n")
    (part,) = load_asset(path).parts
    mesh = part.mesh
    assert len(mesh.faces) == 2
    assert np.ptp(mesh.vertices[mesh.faces[1]][:, 0]) <= 10
    assert mesh.vertices[mesh.faces[1]][:, 0].min() >= 50


def test_missing_texture_is_a_warning_and_the_hash_sees_what_is_there(tmp_path):
    path, material = tmp_path / "a.obj", tmp_path / "a.mtl"
    path.write_text(f"mtllib a.mtl\n{TRIANGLE}vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    material.write_text("newmtl m\nmap_Kd wood.png\n")
    asset = load_asset(path)
    assert any("wood.png" in w for w in asset.warnings)
    material.write_text("newmtl m\nKd 1 0 0\n")
    other = load_asset(path)
    assert not any("wood.png" in w for w in other.warnings)
    assert other.source_hash != asset.source_hash
    assert load_asset(path).source_hash == other.source_hash


def test_references_stay_in_the_folder(tmp_path):
    (tmp_path / "secret.mtl").write_text("newmtl m\nKd 1 0 0\n")
    folder = tmp_path / "asset"
    folder.mkdir()
    for reference in ("../secret.mtl", "/etc/passwd", "..\\secret.mtl"):
        (folder / "a.obj").write_text(f"mtllib {reference}\n{TRIANGLE}usemtl m\nf 1 2 3\n")
        asset = load_asset(folder / "a.obj")
        assert any("outside the asset's folder" in w for w in asset.warnings), reference


def test_gltf_buffer_outside_the_folder_is_an_error(tmp_path):
    (tmp_path / "data.bin").write_bytes(np.eye(3, dtype=np.float32).tobytes())
    folder = tmp_path / "asset"
    folder.mkdir()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "../data.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    (folder / "a.gltf").write_text(json.dumps(tree))
    with pytest.raises(InputError, match="outside the asset's folder"):
        load_asset(folder / "a.gltf")


BAD = {
    "empty.obj": b"",
    "empty.glb": b"",
    "header.glb": b"glTF",
    "garbage.stl": b"solid nothing\n",
    "points.obj": TRIANGLE.encode(),
    "unknown.xyzzy": b"1",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "inf.obj": b"v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "huge.obj": b"v 1e308 0 0\nv -1e308 0 0\nv 0 1e308 0\nf 1 2 3\n",
    "index.obj": f"{TRIANGLE}f 1 2 9\n".encode(),
    "index.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1 7\n",
    "index.ply": (PLY.format(v=3, f=1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 5\n").encode(),
    "negative.ply": (PLY.format(v=3, f=1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n").encode(),
    "claims.ply": (PLY.format(v=10**10, f=1) + "0 0 0\n").encode(),
    "claims.off": b"OFF\n3000000000 1000000000 0\n0 0 0\n",
    "claims.stl": b"\0" * 80 + struct.pack("<I", 10**9) + b"\0" * 50,
    "point.obj": b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n",
}


def test_bad_files_end_in_one_clear_sentence(tmp_path):
    for name, content in BAD.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(InputError) as error:
            load_asset(path)
        assert error.value.exit_code == 3
        assert name in str(error.value)
        assert "\n" not in str(error.value), name


def test_missing_path_and_folder(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_asset(tmp_path / "nothing.obj")
    with pytest.raises(InputError, match="is a folder"):
        load_asset(tmp_path)


def test_wrong_scale_is_a_usage_error(tmp_path):
    for scale in ({"size": 1.0, "units": "mm"}, {"size": 0.0}, {"size": np.nan}):
        with pytest.raises(UsageError):
            load_asset(_box(tmp_path, ".stl"), **scale)


def test_draco(tmp_path):
    """A Draco-compressed glb gives the same sphere up to its quantisation (14 bits)."""
    ball = trimesh.creation.icosphere(2)
    path = tmp_path / "ball.glb"
    ball.export(path, extension_draco=True)
    assert b"KHR_draco_mesh_compression" in path.read_bytes()
    asset = load_asset(path)
    assert asset.parts[0].mesh.volume == pytest.approx(ball.volume, rel=1e-3)


def test_bonsai_parts(tmp_path):
    path = write_bonsai(tmp_path / "bonsai.glb")
    asset = load_asset(path)
    assert {"pot", "soil", "trunk", "foliage"} <= set(asset.part_names)
    assert asset.up == "y"
    assert not asset.warnings


def test_off_polygons(tmp_path):
    """A polygon of n corners gives n - 2 triangles; colours after the corners are no corners."""
    points = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 0.5 0\n"
    cases = {".off": "4 0 1 2 3\n3 0 1 4\n", ".OFF": "5 0 1 2 3 4 255 0 0\n"}
    for suffix, polygon in cases.items():
        path = tmp_path / f"house{suffix}"
        path.write_text(f"COFF # colours\n5 {polygon.count(chr(10))} 0\n{points}{polygon}")
        assert len(load_asset(path).parts[0].mesh.faces) == 3, suffix


def test_ply_triangle_strips(tmp_path):
    """Strips of n vertices give n - 2 triangles, wound alternately; -1 ends a strip."""
    path = tmp_path / "strips.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
        "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n9 0 1 2 3 4 -1 0 1 2\n"
    )
    mesh = load_asset(path).parts[0].mesh
    assert len(mesh.faces) == 4
    assert np.cross(
        mesh.triangles[:, 1] - mesh.triangles[:, 0], mesh.triangles[:, 2] - mesh.triangles[:, 0]
    )[:, 2] == pytest.approx(1)


def test_3mf_keeps_its_unit(tmp_path):
    """A 3MF box of 40 says millimetres by itself: 0.04 m."""
    path = tmp_path / "box.3mf"
    trimesh.creation.box((10, 20, 40)).export(path)
    asset = load_asset(path)
    assert asset.size == pytest.approx((0.01, 0.02, 0.04))
    assert asset.up == "z"


def test_dae_keeps_its_unit_and_up_axis(tmp_path):
    path = tmp_path / "box.dae"
    text = trimesh.exchange.dae.export_collada(trimesh.creation.box((10, 20, 40))).decode()
    header = '<asset><unit name="cm" meter="0.01"/><up_axis>X_UP</up_axis>'
    path.write_text(re.sub(r"<asset>(.*?)(<unit[^>]*>)?(<up_axis>.*?</up_axis>)?(?=</asset>)",
                           header, text, flags=re.DOTALL))  # fmt: skip
    asset = load_asset(path)
    assert asset.size.max() == pytest.approx(0.4)
    assert asset.up == "x"


def test_xml_entities_are_refused(tmp_path):
    path = tmp_path / "evil.dae"
    path.write_text(
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><a/>'
    )
    with pytest.raises(InputError, match="entities"):
        load_asset(path)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".ply", ".xyz"])
def test_point_cloud_of_a_ball(tmp_path, suffix):
    """5,000 points on a sphere of radius 2 m enclose 4/3 pi r^3 within 2 %."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(5000, 3))
    points *= 2 / np.linalg.norm(points, axis=1, keepdims=True)
    path = tmp_path / f"ball{suffix}"
    trimesh.PointCloud(points).export(path)
    asset = load_asset(path)
    surface, _ = repair(asset.parts)
    assert component_volumes(surface).sum() == pytest.approx(4 / 3 * np.pi * 8, rel=0.02)


def test_plain_triangles_need_no_trimesh_and_are_one_of_its_meshes(tmp_path):
    """An STL is loaded without it; asked for more than its triangles it has what a mesh has."""
    path = _box(tmp_path, ".stl")
    code = (
        "import sys, autophyx_tet as apx\n"
        f"asset = apx.load_asset({str(path)!r}, units='mm')\n"
        "assert asset.size.tolist() == [.001, .002, .004], asset.size\n"
        "assert 'trimesh' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    mesh = load_asset(path).parts[0].mesh
    mesh.vertices = 2 * mesh.vertices
    assert mesh.volume == pytest.approx(64)
    mesh.vertices = mesh.vertices / 2  # by now a mesh of trimesh holds them
    assert (mesh.volume, mesh.area) == pytest.approx((8, 28))
    mesh.visual.face_colors = [255, 0, 0, 255]
    copied = copy.deepcopy(mesh)
    assert copied.visual.face_colors[0].tolist() == [255, 0, 0, 255]
