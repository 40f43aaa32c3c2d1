"""Motions as glTF: shape keys that are the displacement, read by others and by Blender itself."""

import json
import struct
from importlib.util import find_spec
from typing import get_args

import numpy as np
import pytest
import trimesh
from autophyx_tet.converters.mesh.gltf_motion import to_y, write_motion_glb
from autophyx_tet.fem.errors import InputError
from autophyx_tet.fem.mesh import TetMesh, box_mesh
from autophyx_tet.fem.scene.up import UpAxis, up_vector

TIMES = np.array([0.0, 0.1, 0.25])


@pytest.fixture
def moving():
    """A bar of two parts that is bent along x with the square of its height."""
    box = box_mesh((0.2, 0.1, 0.4), (2, 1, 4))
    top = (box.centroids[:, 2] > 0.2).astype(int)
    mesh = TetMesh(box.points, box.tets, top, ("low", "high"))
    bend = np.zeros_like(mesh.points)
    bend[:, 0] = mesh.points[:, 2] ** 2
    return mesh, np.array([0.0, 0.5, 1.0])[:, None, None] * bend


def parsed(path):
    """The JSON of a GLB, and its accessors as arrays, read by the specification alone."""
    data = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    document = json.loads(data[20 : 20 + size])
    binary = data[28 + size :]
    widths, types = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}, {5126: "<f4", 5125: "<u4", 5121: "u1"}
    arrays = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        wide = widths[accessor["type"]]
        count = accessor["count"] * wide
        array = np.frombuffer(binary, types[accessor["componentType"]], count, view["byteOffset"])
        arrays.append(array.reshape(-1, wide))
    return document, arrays


def test_every_shape_key_is_the_displacement_of_its_frame(moving, tmp_path):
    """Base plus key is the moved surface, turned so that z becomes y; weights pick one a time."""
    mesh, displacement = moving
    document, arrays = parsed(write_motion_glb(tmp_path / "m.glb", mesh, TIMES, displacement))
    (primitive,) = document["meshes"][0]["primitives"]
    rest = arrays[primitive["attributes"]["POSITION"]]
    back = rest @ to_y("z")
    far = np.linalg.norm(back[:, None] - mesh.points, axis=2)
    point = far.argmin(axis=1)
    assert far.min(axis=1).max() < 1e-6
    np.testing.assert_allclose(rest[:, 1], mesh.points[point, 2], atol=1e-7)
    for target, u in zip(primitive["targets"], displacement, strict=True):
        np.testing.assert_allclose(arrays[target["POSITION"]] @ to_y("z"), u[point], atol=1e-7)
    (sampler,) = document["animations"][0]["samplers"]
    np.testing.assert_allclose(arrays[sampler["input"]].ravel(), TIMES, rtol=1e-6)
    np.testing.assert_array_equal(arrays[sampler["output"]].reshape(3, 3), np.eye(3))


@pytest.mark.parametrize("up", get_args(UpAxis))
def test_the_turn_is_a_rotation_that_takes_up_to_y(up):
    np.testing.assert_array_equal(to_y(up) @ up_vector(up), [0, 1, 0])
    assert np.linalg.det(to_y(up)) == pytest.approx(1)


def test_trimesh_reads_a_closed_surface_of_the_same_volume(moving, tmp_path):
    mesh, displacement = moving
    path = write_motion_glb(tmp_path / "m.glb", mesh, TIMES, displacement)
    surface = trimesh.load(path, force="mesh", process=False)
    surface.merge_vertices(merge_norm=True, merge_tex=True)
    plain = trimesh.Trimesh(surface.vertices, surface.faces, process=True)
    assert plain.volume == pytest.approx(mesh.volume, rel=1e-6)  # float32 in the file


def test_times_that_do_not_rise_are_refused(moving, tmp_path):
    mesh, displacement = moving
    with pytest.raises(InputError, match="rising"):
        write_motion_glb(tmp_path / "m.glb", mesh, TIMES[::-1], displacement)
    assert not list(tmp_path.iterdir())


# Blender as a module is 350 MB and of one Python alone: tested where `pip install bpy` was done.
if find_spec("bpy"):

    @pytest.mark.external
    def test_blender_has_every_frame(moving, tmp_path):
        """Blender's importer makes a shape key a frame, and turns +y up to its own +z up."""
        import bpy

        mesh, displacement = moving
        path = write_motion_glb(tmp_path / "m.glb", mesh, TIMES, displacement)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.import_scene.gltf(filepath=str(path))
        (body,) = (thing for thing in bpy.data.objects if thing.type == "MESH")
        basis, *keys = body.data.shape_keys.key_blocks
        rest = np.array([body.matrix_world @ v.co for v in basis.data])
        point = np.linalg.norm(rest[:, None] - mesh.points, axis=2).argmin(axis=1)
        np.testing.assert_allclose(rest, mesh.points[point], atol=1e-6)
        for key, u in zip(keys, displacement, strict=True):
            moved = np.array([body.matrix_world @ v.co for v in key.data])
            np.testing.assert_allclose(moved, (mesh.points + u)[point], atol=1e-6)
        assert body.data.shape_keys.animation_data is not None
