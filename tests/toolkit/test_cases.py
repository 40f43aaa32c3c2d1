"""Cases that failed once, each a kind of file: read right to 2 %, or refused for the true reason.

Every file is made here; right values are exact, of cubes and boxes.
"""

import base64
import builtins
import json

import numpy as np
import pytest
from autophyx_tet.fem.errors import InputError
from autophyx_tet.toolkit.asset import foreign
from autophyx_tet.toolkit.asset.load import load_asset

from . import writers
from .command import run_here
from .writers import CORNERS, QUADS, TRIANGLES, Gltf

GUESSES = ("axis is up", "no unit", "unusual")  # told of every file that does not say


def read(path, **options):
    """Parts by name with their volumes, size, and warnings that are not of every such file."""
    asset = load_asset(path, **options)
    volumes = {part.name: float(part.mesh.volume) for part in asset.parts}
    told = [str(w) for w in asset.warnings if not any(guess in w for guess in GUESSES)]
    return volumes, asset.size, told


def expect(path, volumes, *, size=None, told=(), **options):
    """The parts are these, to 2 % of their volumes, and just these words are told."""
    found, extent, words = read(path, **options)
    if isinstance(volumes, dict):
        assert found == {name: pytest.approx(v, rel=0.02) for name, v in volumes.items()}
    else:
        assert sum(found.values()) == pytest.approx(volumes, rel=0.02)
    if size is not None:
        assert extent == pytest.approx(size, rel=0.02)
    told = (told,) if isinstance(told, str) else told
    assert len(words) == len(told), words
    for word, pattern in zip(words, told, strict=True):
        assert pattern in word
    return found


@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("part.x_t", "STEP"), ("body.CATPart", "STEP"), ("asm.iam", "STEP"), ("a.FCStd", "STEP"),
        ("model.3dxml", "STEP"), ("chair.blend", "glTF"), ("house.usdz", "glTF"), ("a.ztl", "glTF"),
        ("scan.e57", "PLY, LAS or XYZ"), ("plate.gcode", "sliced"), ("asm.stpz", "unpack"),
        ("chair.mtl", "the .obj"), ("chair.png", "wanted a shape"),
    ],
)  # fmt: skip
def test_files_of_other_programs_are_refused_by_their_name(tmp_path, name, way):
    (tmp_path / name).write_bytes(b"0" * 99)
    with pytest.raises(InputError, match=rf"\.{name.split('.')[1].lower()} files are not.*{way}"):
        load_asset(tmp_path / name)


# glTF


def test_vrm_is_gltf(tmp_path):
    """An avatar: the bones and springs of its extensions change no shape."""
    g = Gltf(extensionsUsed=["VRMC_vrm", "VRMC_springBone"])
    g.node(mesh=g.mesh(g.cube()), name="body")
    (tmp_path / "a.vrm").write_bytes(g.write(tmp_path / "a.glb").read_bytes())
    expect(tmp_path / "a.vrm", {"body": 1})


def test_gltf_instances_are_placed(tmp_path):
    """EXT_mesh_gpu_instancing, though it is not required: three bricks and not one."""
    g = Gltf(extensionsUsed=["EXT_mesh_gpu_instancing"])
    places = g.accessor(np.array([[0.0, 0, 0], [2, 0, 0], [4, 0, 0]]))
    g.node(
        mesh=g.mesh(g.cube()), name="brick",
        extensions={"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}},
    )  # fmt: skip
    expect(g.write(tmp_path / "a.glb"), {"brick": 3}, size=(5, 1, 1))


def test_gltf_lines_beside_triangles_are_left_out(tmp_path):
    g = Gltf()
    edge = {"attributes": {"POSITION": g.accessor(CORNERS)}, "mode": 1}
    g.node(mesh=g.mesh(g.cube(), edge), name="frame")
    expect(g.write(tmp_path / "a.glb"), {"frame": 1}, told="1 primitives of points or lines")


def test_gltf_other_scenes_are_told_and_the_default_one_is_read(tmp_path):
    g = Gltf()
    mesh = g.mesh(g.cube())
    g.tree["nodes"] = [{"mesh": mesh, "name": "one"}, {"mesh": mesh, "name": "two"}]
    g.tree |= {"scenes": [{"nodes": [0]}, {"nodes": [1]}], "scene": 1}
    expect(g.write(tmp_path / "a.glb"), {"two": 1}, told="1 more scenes")


def test_gltf_for_newer_readers_is_refused(tmp_path):
    g = Gltf()
    g.tree["asset"]["minVersion"] = "2.1"
    g.node(mesh=g.mesh(g.cube()))
    with pytest.raises(InputError, match=r"is glTF 2\.1, wanted 2\.0"):
        load_asset(g.write(tmp_path / "a.glb"))


def test_gltf_chunks_have_kinds_and_not_places(tmp_path):
    """A chunk of another kind stands before the binary one."""
    g = Gltf()
    g.node(mesh=g.mesh(g.cube()), name="box")
    data = g.write(tmp_path / "a.glb").read_bytes()
    at = 20 + int.from_bytes(data[12:16], "little")
    other = (8).to_bytes(4, "little") + b"ACME" + bytes(8)
    size = (len(data) + len(other)).to_bytes(4, "little")
    (tmp_path / "a.glb").write_bytes(data[:8] + size + data[12:at] + other + data[at:])
    expect(tmp_path / "a.glb", {"box": 1})


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"mode": 0, "extensions": {"KHR_gaussian_splatting": {}}}, "KHR_gaussian_splatting"),
        ({"mode": 1}, "1 primitives of points or lines"),
    ],
)
def test_gltf_splats_or_lines_alone_are_named(tmp_path, more, why):
    g = Gltf(extensionsUsed=["KHR_gaussian_splatting"])
    g.node(mesh=g.mesh({"attributes": {"POSITION": g.accessor(CORNERS)}} | more))
    with pytest.raises(InputError, match=why):
        load_asset(g.write(tmp_path / "a.glb"))


# The cube of a thousand steps, and its triangles, packed by the encoder of meshoptimizer 1.3.
MESHOPT_CUBE = {
    "ATTRIBUTES": "oAEAwAAALwEAwAAABgEMzAAALzAvAQzMAAAGBQYBP/8AA"
    "C8wLzAvMC8CBlZWVgAAAAAAAAAAAAAAAAAAAAAA"
    "AAAAAAAAAAAAAAAAAAAAAAAA",
    "TRIANGLES": "4f7///7//1g3YaW3qA8G/wIEAj8NCmMVCTUCAHaHVmd4qYZliWiYAWkAAA==",
}


def test_gltf_meshopt_is_unpacked_and_a_broken_stream_is_named(tmp_path):
    """EXT_meshopt_compression: the bytes of a packed view of 8-byte rows, and nonsense."""
    ours = base64.b64decode(MESHOPT_CUBE["ATTRIBUTES"]), base64.b64decode(MESHOPT_CUBE["TRIANGLES"])
    for points, faces, broken in ((*ours, False), (b"\xa5" + bytes(90), ours[1], True)):
        g = Gltf(
            extensionsUsed=["EXT_meshopt_compression", "KHR_mesh_quantization"],
            extensionsRequired=["EXT_meshopt_compression", "KHR_mesh_quantization"],
        )
        views = []
        for data, count, stride, mode in (
            (points, 8, 8, "ATTRIBUTES"), (faces, 36, 2, "TRIANGLES"),
        ):  # fmt: skip
            place = g.view(data)
            packed = g.tree["bufferViews"][place]
            g.tree["bufferViews"][place] = {
                "buffer": 0, "byteOffset": 0, "byteLength": count * stride, "byteStride": stride,
                "extensions": {
                    "EXT_meshopt_compression": packed
                    | {"byteStride": stride, "count": count, "mode": mode}
                },
            }  # fmt: skip
            views.append(place)
        g.tree["accessors"] = [
            {"bufferView": views[0], "componentType": 5123, "count": 8, "type": "VEC3"},
            {"bufferView": views[1], "componentType": 5123, "count": 36, "type": "SCALAR"},
        ]
        g.node(mesh=g.mesh({"attributes": {"POSITION": 0}, "indices": 1}), name="box")
        path = g.write(tmp_path / "a.glb")
        if broken:
            with pytest.raises(InputError, match="EXT_meshopt_compression"):
                load_asset(path)
        else:
            expect(path, {"box": 1000**3}, size=(1000, 1000, 1000))


def test_gltf_shape_keys_have_their_default_weights(tmp_path):
    g = Gltf()
    higher = g.accessor(np.where(CORNERS == 1, [0, 1, 0], 0))
    g.node(mesh=g.mesh(g.cube(targets=[{"POSITION": higher}]), weights=[1.0]), name="cheek")
    g.node(
        mesh=0, name="other", weights=[0.5], translation=[3, 0, 0],
    )  # fmt: skip
    expect(g.write(tmp_path / "a.glb"), {"cheek": 2, "other": 1.5})


def test_gltf_hidden_nodes_are_left_out(tmp_path):
    """KHR_node_visibility hides a node and what is below it."""
    g = Gltf(extensionsUsed=["KHR_node_visibility"])
    below = g.node(root=False, mesh=g.mesh(g.cube()), name="below")
    g.node(mesh=0, name="seen", translation=[3, 0, 0])
    g.node(name="gone", children=[below], extensions={"KHR_node_visibility": {"visible": False}})
    expect(g.write(tmp_path / "a.glb"), {"seen": 1}, told="1 hidden nodes were left out")


def test_gltf_primitives_of_several_materials_have_stable_names(tmp_path):
    g = Gltf(materials=[{"name": "Oak"}, {"name": "Steel"}])
    g.node(
        mesh=g.mesh(g.cube(material=0), g.cube(np.add(CORNERS, (1, 0, 0)), material=1)),
        name="Table",
    )
    expect(g.write(tmp_path / "a.glb"), {"Oak": 1, "Steel": 1})
    assert all("Table" in part.labels for part in load_asset(tmp_path / "a.glb").parts)


def test_gltf_joints_place_a_skin_and_its_node_does_not(tmp_path):
    """A node of scale 100 above a skin whose joint halves it: half a metre, not a hundred."""
    g = Gltf()
    joint = g.node(name="joint", scale=[0.5, 1, 0.5], translation=[0, 2, 0])
    inverse = g.accessor(np.eye(4).T.reshape(1, 16))
    g.tree["skins"] = [{"joints": [joint], "inverseBindMatrices": inverse}]
    primitive = g.cube()
    primitive["attributes"] |= {
        "JOINTS_0": g.accessor(np.zeros((8, 4)), "u1"),
        "WEIGHTS_0": g.accessor(np.tile([255, 0, 0, 0], (8, 1)), "u1", normalized=True),
    }
    g.node(mesh=g.mesh(primitive), name="body", skin=0, scale=[100, 100, 100])
    path = g.write(tmp_path / "a.glb")
    expect(path, {"body": 0.25}, size=(0.5, 1, 0.5))
    assert load_asset(path).bounds[0] == pytest.approx([0, 2, 0])


def test_gltf_sparse_positions_replace_those_of_the_view(tmp_path):
    """The upper corners are moved from 1 to 3; once without any view below them."""
    for below in (True, False):
        g = Gltf()
        top = np.flatnonzero(CORNERS[:, 1] == 1)
        rows = top if below else np.arange(8)
        values = CORNERS[rows] * [1, 3, 1]
        primitive = g.cube()
        accessor = g.tree["accessors"][primitive["attributes"]["POSITION"]]
        accessor["sparse"] = {
            "count": len(rows),
            "indices": {"bufferView": g.view(rows.astype("u1").tobytes()), "componentType": 5121},
            "values": {"bufferView": g.view(values.astype("<f4").tobytes())},
        }
        if not below:
            del accessor["bufferView"], accessor["byteOffset"]
        g.node(mesh=g.mesh(primitive), name="wedge")
        expect(g.write(tmp_path / "a.glb"), {"wedge": 3}, size=(1, 3, 1))


def test_gltf_strips_and_fans_are_triangles(tmp_path):
    """A strip around a cube; a fan of a pyramid's sides beside plain triangles of its base."""
    g = Gltf()
    strip = {"attributes": {"POSITION": g.accessor(CORNERS)}, "mode": 5}
    strip["indices"] = g.accessor(writers.STRIP, "u1")
    base = [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1, 0]]
    points = g.accessor(np.array(base, float))
    fan = {"attributes": {"POSITION": points}, "mode": 6}
    fan["indices"] = g.accessor(np.array([4, 0, 3, 2, 1, 0]), "u2")
    flat = {"attributes": {"POSITION": points}}
    flat["indices"] = g.accessor(np.array([0, 1, 2, 0, 2, 3]), "u2")
    g.node(mesh=g.mesh(strip), name="box", translation=[5, 0, 0])
    g.node(mesh=g.mesh(fan, flat), name="roof")
    found, _, told = read(g.write(tmp_path / "a.glb"))
    assert not told
    assert {n: abs(v) for n, v in found.items()} == {
        "box": pytest.approx(1), "roof": pytest.approx(4 / 3),
    }  # fmt: skip


def test_gltf_a_required_extension_that_is_not_known_is_named(tmp_path):
    g = Gltf(extensionsUsed=["ACME_surface"], extensionsRequired=["ACME_surface"])
    g.node(mesh=g.mesh(g.cube()))
    with pytest.raises(InputError, match="requires ACME_surface"):
        load_asset(g.write(tmp_path / "a.glb"))
    del g.tree["extensionsRequired"]
    expect(g.write(tmp_path / "a.glb"), 1, told="uses ACME_surface, which is not read")


def test_gltf_normalised_integers_are_shares(tmp_path):
    """A cube of 32767 steps with a node that makes it 2 m: not 65,534 m."""
    g = Gltf(extensionsUsed=["KHR_mesh_quantization"], extensionsRequired=["KHR_mesh_quantization"])
    for kind, most in (("i2", 32767), ("u2", 65535), ("i1", 127), ("u1", 255)):
        primitive = {
            "attributes": {"POSITION": g.accessor(CORNERS * most, kind, normalized=True, stride=8)},
            "indices": g.accessor(TRIANGLES.ravel(), "u2"),
        }
        g.node(mesh=g.mesh(primitive), name=kind, scale=[2, 2, 2], translation=[3.0 * most, 0, 0])
    expect(g.write(tmp_path / "a.glb"), dict.fromkeys(("i2", "u2", "i1", "u1"), 8))


# 3MF


CUBE_3MF = writers.threemf_mesh(CORNERS * 10, TRIANGLES)
SMALL_3MF = writers.threemf_mesh(CORNERS * 40, TRIANGLES)


def test_3mf_ids_are_of_their_own_model_file(tmp_path):
    """The production extension: two files whose objects both have id 1 are two bodies."""
    links = "".join(
        f'<object id="{i}" type="model" name="{name}"><components>'
        f'<component p:path="/3D/Objects/{name}.model" objectid="1" {place}/></components></object>'
        for i, (name, place) in enumerate(
            (("cap", ""), ("pin", 'transform="1 0 0 0 1 0 0 0 1 100 0 0"')), 5
        )
    )
    further = {
        "3D/Objects/cap.model": f'<object id="1" type="model">{SMALL_3MF}</object>',
        "3D/Objects/pin.model": f'<object id="1" type="model">{CUBE_3MF}</object>',
    }
    build = '<item objectid="5"/><item objectid="6"/>'
    path = writers.threemf(tmp_path / "a.3mf", links, build, further=further)
    expect(path, {"cap": 0.04**3, "pin": 0.01**3}, size=(0.11, 0.04, 0.04))


@pytest.mark.parametrize("kind", ["support", "solidsupport", "other"])
def test_3mf_supports_and_helpers_are_no_matter(tmp_path, kind):
    resources = (
        f'<object id="1" type="model" name="vase">{CUBE_3MF}</object>'
        f'<object id="2" type="{kind}" name="prop">{SMALL_3MF}</object>'
    )
    build = '<item objectid="1"/><item objectid="2"/>'
    path = writers.threemf(tmp_path / "a.3mf", resources, build)
    expect(path, {"vase": 1e-6}, told=f"1 objects of the kind {kind}")
    only = writers.threemf(tmp_path / "b.3mf", resources, '<item objectid="2"/>')
    with pytest.raises(InputError, match=f"no body.*{kind}"):
        load_asset(only)


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("ParameterModifier", "kind ParameterModifier are no matter"),
        ("NegativeVolume", "the holes that a slicer cuts with them are full here"),
    ],
)
def test_3mf_parts_of_slicers_have_names_and_modifiers_are_left_out(tmp_path, kind, told):
    """PrusaSlicer keeps volumes as ranges of triangles, Bambu Studio as components."""
    both = writers.threemf_mesh(
        np.concatenate([CORNERS * 10, CORNERS * 10 + [20, 0, 0], CORNERS * 40]),
        np.concatenate([TRIANGLES + 8 * i for i in range(3)]),
    )
    volume = (
        '<volume firstid="{}" lastid="{}"><metadata type="volume" key="name" value="{}"/>'
        '<metadata type="volume" key="volume_type" value="{}"/></volume>'
    ).format
    settings = {
        "Metadata/Slic3r_PE_model.config": '<config><object id="1">'
        + volume(0, 11, "leg", "ModelPart")
        + volume(12, 23, "seat", "ModelPart")
        + volume(24, 35, "denser", kind)
        + "</object></config>"
    }
    path = writers.threemf(
        tmp_path / "a.3mf", f'<object id="1" type="model">{both}</object>', '<item objectid="1"/>',
        settings=settings,
    )  # fmt: skip
    expect(path, {"leg": 1e-6, "seat": 1e-6}, told=told)


def test_3mf_a_required_extension_that_is_not_read_is_named(tmp_path):
    space = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"
    head = f'xmlns:b="{space}" requiredextensions="b"'
    resources = f'<object id="1" type="model">{CUBE_3MF}</object>'
    path = writers.threemf(tmp_path / "a.3mf", resources, '<item objectid="1"/>', head=head)
    with pytest.raises(InputError, match="beamlattice"):
        load_asset(path)
    beams = CUBE_3MF.replace("</mesh>", "<b:beamlattice/></mesh>")
    path = writers.threemf(
        tmp_path / "b.3mf", f'<object id="1" type="model">{beams}</object>',
        '<item objectid="1"/>', head=f'xmlns:b="{space}"',
    )  # fmt: skip
    expect(path, 1e-6, told="beamlattice of the file are not read")


def test_3mf_materials_of_objects_and_triangles_have_names_and_colours(tmp_path):
    """A box whose lower half of the triangles is oak; of the rest the object's steel."""
    from autophyx_tet.predictors.appearance.surface import skin_of

    oak = [writers.threemf_mesh(CORNERS * 10, TRIANGLES[:6], 'pid="7" p1="1"')]
    mesh = CUBE_3MF.replace(
        CUBE_3MF.partition("<triangles>")[2].partition("</triangles>")[0],
        oak[0].partition("<triangles>")[2].partition("</triangles>")[0]
        + writers.threemf_mesh([], TRIANGLES[6:]).partition("<triangles>")[2].partition("</tri")[0],
    )
    resources = (
        '<basematerials id="7"><base name="steel" displaycolor="#0000FF"/>'
        '<base name="oak" displaycolor="#FF0000FF"/></basematerials>'
        f'<object id="1" type="model" pid="7" pindex="0" name="box">{mesh}</object>'
    )
    path = writers.threemf(tmp_path / "a.3mf", resources, '<item objectid="1"/>')
    found = {}
    for part in load_asset(path).parts:
        colour = skin_of(part.mesh)(np.array([0]), np.full((1, 3), 1 / 3))[0, :3]
        found[part.name] = (len(part.mesh.faces), colour.round(1).tolist())
    assert found == {"steel": (6, [0, 0, 1]), "oak": (6, [1, 0, 0])}


SHAPES_3MF = {
    "booleanshape": ("booleanoperations/2023/07", '<e:booleanshape objectid="1"/>'),
    "displacementmesh": ("displacement/2022/07", "<e:displacementmesh/>"),
    "levelset": ("volumetric/2022/01", '<e:levelset functionid="9" meshid="1"/>'),
}


@pytest.mark.parametrize("shape", SHAPES_3MF)
def test_3mf_shapes_that_are_no_meshes_are_named(tmp_path, shape):
    """Beside a body they are told; alone they are the reason of the refusal."""
    space, body = SHAPES_3MF[shape]
    head = f'xmlns:e="http://schemas.3mf.io/3dmanufacturing/{space}"'
    resources = (
        f'<object id="1" type="model" name="leg">{CUBE_3MF}</object>'
        f'<object id="2" type="model" name="other">{body}</object>'
    )
    items = '<item objectid="1"/>', '<item objectid="2"/>'
    path = writers.threemf(tmp_path / "a.3mf", resources, "".join(items), head=head)
    expect(path, {"leg": 1e-6}, told=f"{shape} of the file are not read")
    path = writers.threemf(tmp_path / "b.3mf", resources, items[1], head=head)
    with pytest.raises(InputError, match=f"no body: {shape}"):
        load_asset(path)


def test_3mf_what_is_not_printable_or_secret_is_told(tmp_path):
    resources = f'<object id="1" type="model" name="leg">{CUBE_3MF}</object>'
    build = '<item objectid="1" printable="0"/>'
    path = writers.threemf(tmp_path / "a.3mf", resources, build)
    expect(path, {"leg": 1e-6}, told="1 items of the build are marked as not printable")
    settings = {"Secure/keystore.xml": "<keystore/>"}
    with pytest.raises(InputError, match="is encrypted"):
        load_asset(writers.threemf(tmp_path / "b.3mf", resources, build, settings=settings))


def test_3mf_components_of_themselves_end(tmp_path):
    resources = (
        '<object id="1" type="model"><components><component objectid="1"/></components></object>'
    )
    with pytest.raises(InputError, match="contain themselves"):
        load_asset(writers.threemf(tmp_path / "a.3mf", resources, '<item objectid="1"/>'))


# OBJ


def obj_cube(*, at=0.0, first=0):
    lines = ["v {} {} {}".format(*np.add(p, (at, 0, 0))) for p in CORNERS]
    return lines + ["f {} {} {} {}".format(*(q + 1 + first)) for q in QUADS]


OBJ_DRESSES = {
    "bom": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "cr": lambda text: text.replace("\n", "\r").encode(),
    "tabs": lambda text: text.replace(" ", "\t").encode(),
    "indents": lambda text: text.replace("\n", "\n  \t").encode(),
    "comments": lambda text: text.replace("\n", " # said here\n").encode(),
    "continued": lambda text: text.replace(" ", " \\\n").encode(),
    "trailing": lambda text: text.replace("\n", "  \n\n").encode(),
    "utf-16": lambda text: text.encode("utf-16"),
    "capitals": lambda text: text.replace("v ", "V ").replace("f ", "F ").encode(),
}


@pytest.mark.parametrize("dress", OBJ_DRESSES)
def test_obj_white_space_is_blanks_or_tabs_and_lines_end_anyhow(tmp_path, dress):
    path = tmp_path / "box.obj"
    path.write_bytes(OBJ_DRESSES[dress]("\n".join(obj_cube()) + "\n"))
    expect(path, {"box": 1}, size=(1, 1, 1))
    parts = ["o leg", *obj_cube(), "o top", *obj_cube(at=3, first=8)]
    path.write_bytes(OBJ_DRESSES[dress]("\n".join(parts) + "\n"))
    expect(path, {"leg": 1, "top": 1})


def test_obj_lines_beside_faces_are_told_and_alone_are_the_reason(tmp_path):
    """Vertices of polylines or of free-form surfaces are no cloud of points."""
    path = tmp_path / "a.obj"
    path.write_text("\n".join([*obj_cube(), "l 1 2 3", "p 4"]))
    expect(path, 1, told="1 polylines were left out")
    rows = [f"v {x} 0 0" for x in range(200)]
    for more, why in (("l 1 2 3", "1 polylines"), ("surf 0 1 0 1 1 2", "free-form curves")):
        path.write_text("\n".join([*rows, more]))
        with pytest.raises(InputError, match=why):
            load_asset(path)


@pytest.mark.parametrize(("unit", "metres"), [("inches", 0.0254), ("MM", 1e-3), ("meters", 1)])
def test_remarks_that_say_the_unit(tmp_path, unit, metres):
    """SketchUp writes it into its OBJ; PLY files have remarks too."""
    path = tmp_path / "a.obj"
    path.write_text("\n".join([f"# File units = {unit}", "# 8 units", *obj_cube()]))
    expect(path, metres**3, size=(metres,) * 3)
    assert not any("no unit" in w for w in load_asset(path).warnings)
    data = writers.ply(CORNERS, QUADS.tolist())
    path = tmp_path / "a.ply"
    path.write_bytes(data.replace(b"made by hand", f"units: {unit}".encode()))
    expect(path, metres**3)


def test_obj_decimal_commas_are_named(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("\n".join(obj_cube()).replace(".", ","))
    with pytest.raises(InputError, match="decimal commas"):
        load_asset(path)


@pytest.mark.parametrize(
    ("encoding", "names"), [("cp1252", ("Füße", "Rücken")), ("gbk", ("桌腿", "桌面"))]
)
def test_obj_names_in_other_alphabets(tmp_path, encoding, names):
    path = tmp_path / "a.obj"
    parts = [f"o {names[0]}", *obj_cube(), f"o {names[1]}", *obj_cube(at=3, first=8)]
    path.write_bytes("\n".join(parts).encode(encoding))
    expect(path, dict.fromkeys(names, 1), told="names are read as")
    path.write_bytes("\n".join(parts).encode())
    expect(path, dict.fromkeys(names, 1))


def test_obj_options_before_the_name_of_a_texture(tmp_path):
    """-s, -o, -bm and -clamp take numbers; what is left, blanks and all, is the name."""
    from PIL import Image

    for name in ("oak 1.png", "2.png"):
        Image.new("RGB", (2, 2), (200, 100, 50)).save(tmp_path / name)
    options = "-s 1 1 1 -o .5 0 -bm 1.0 -clamp on"
    (tmp_path / "a.mtl").write_text(
        f"newmtl oak\nmap_Kd {options} oak 1.png\nnewmtl ash\nmap_Kd -s 1 1 2.png\n"
    )
    leg = ["mtllib a.mtl", "o leg", "usemtl oak", *obj_cube()]
    top = ["o top", "usemtl ash", *obj_cube(at=2, first=8)]
    (tmp_path / "a.obj").write_text("\n".join(leg + top))
    expect(tmp_path / "a.obj", {"leg": 1, "top": 1})  # no texture is told as missing


def test_obj_groups_inside_an_object_are_its_parts(tmp_path):
    path = tmp_path / "a.obj"
    lines = ["o chair"]
    for number, name in enumerate(("seat", "legs", "back")):
        lines += [f"g {name}", *obj_cube(at=3 * number, first=8 * number)]
    path.write_text("\n".join(lines))
    expect(path, {"seat": 1, "legs": 1, "back": 1})
    assert all("chair" in part.labels for part in load_asset(path).parts)


def test_obj_objects_of_one_name_are_two(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("\n".join(["o leg", *obj_cube(), "o leg", *obj_cube(at=3, first=8)]))
    expect(path, {"leg": 1, "leg.1": 1})


def test_obj_materials_without_a_library_are_names(tmp_path):
    path = tmp_path / "a.obj"
    cubes = [obj_cube(at=3 * i, first=8 * i) for i in range(3)]
    lines = ["o lamp", *cubes[0], "o table", "usemtl red oak", *cubes[1], "usemtl steel", *cubes[2]]
    path.write_text("\n".join(lines))
    expect(path, 3)
    labels = {label for part in load_asset(path).parts for label in part.labels}
    assert labels >= {"lamp", "table", "red oak", "steel"}


# PLY, OFF, STL


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_polygons_of_several_lengths(tmp_path, form):
    """A cube of four quads and four triangles, and one whose polygons have one corner count."""
    path = tmp_path / "a.ply"
    mixed = [*QUADS[:4].tolist(), *QUADS[4:, [0, 1, 2]].tolist(), *QUADS[4:, [0, 2, 3]].tolist()]
    for polygons in (mixed, QUADS.tolist(), TRIANGLES.tolist()):
        path.write_bytes(writers.ply(CORNERS, polygons, form=form))
        expect(path, {"a": 1}, size=(1, 1, 1))


def test_ply_lines_that_end_in_cr_and_wide_indices(tmp_path):
    path = tmp_path / "a.ply"
    text = writers.ply(CORNERS, QUADS.tolist())
    for dressed in (text.replace(b"\n", b"\r"), text.replace(b"uchar int ", b"uint64 int64 ")):
        path.write_bytes(dressed)
        expect(path, 1, size=(1, 1, 1))


def test_ply_decimal_commas_are_named(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 3\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0,5 0 0\n1 0 0\n0 1,5 0\n3 0 1 2\n")
    with pytest.raises(InputError, match="decimal commas"):
        load_asset(tmp_path / "a.ply")


def test_ply_text_of_one_line(tmp_path):
    (tmp_path / "a.ply").write_bytes(writers.ply(CORNERS, QUADS.tolist(), oneline=True))
    expect(tmp_path / "a.ply", 1)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_ply_vertices_behind_faces_or_with_lists_of_their_own(tmp_path, form):
    """The order of elements is free, and a vertex may list its neighbours."""
    text = form == "ascii"
    points, faces = [], []
    for p in CORNERS:
        plain = "{:g} {:g} {:g} 2 7 7\n".format(*p).encode()
        packed = np.array(p, "<f4").tobytes() + b"\x02" + np.array([7, 7], "<i4").tobytes()
        points.append(plain if text else packed)
    for t in TRIANGLES:
        plain = "3 {} {} {}\n".format(*t).encode()
        faces.append(plain if text else b"\x03" + np.array(t, "<i4").tobytes())
    vertex = (
        "".join(f"property float {axis}\n" for axis in "xyz") + "property list uchar int near\n"
    )
    elements = [
        (f"element vertex {len(points)}\n{vertex}", b"".join(points)),
        (f"element face {len(faces)}\nproperty list uchar int vertex_indices\n", b"".join(faces)),
    ]
    for order in (elements, elements[::-1]):
        head = f"ply\nformat {form} 1.0\n" + "".join(declared for declared, _ in order)
        body = b"".join(rows for _, rows in order)
        (tmp_path / "a.ply").write_bytes(head.encode() + b"end_header\n" + body)
        expect(tmp_path / "a.ply", 1, size=(1, 1, 1))


def off_cube():
    rows = [f"{len(CORNERS)} {len(QUADS)} 0", *("{:g} {:g} {:g}".format(*p) for p in CORNERS)]
    return rows + ["4 {} {} {} {}".format(*q) for q in QUADS]


def test_off_without_a_keyword_and_on_one_line(tmp_path):
    path = tmp_path / "a.off"
    for text in ("\n".join(off_cube()), "OFF " + " ".join(off_cube())):
        path.write_text(text)
        expect(path, 1, size=(1, 1, 1))
    path.write_text("OFF\n" + "\n".join(off_cube()), encoding="utf-8-sig")
    expect(path, 1)
    first, *others = off_cube()
    points = [f"{row} 0 0 1 255 0 0" for row in others[:8]]
    path.write_text("\n".join(["NCOFF", first, *points, *others[8:]]))
    expect(path, 1)
    path.write_text("\n".join(off_cube()[:-2]))
    with pytest.raises(InputError, match="announces 8 vertices and 6 faces, and ends before"):
        load_asset(path)
    path.write_text("OFF BINARY\n" + "\n".join(off_cube()))
    with pytest.raises(InputError, match="OFF BINARY"):
        load_asset(path)


def test_stl_with_a_wrong_count_and_tail(tmp_path):
    path = tmp_path / "a.stl"
    path.write_bytes(writers.stl_bytes(CORNERS, TRIANGLES, head=b"streamed", count=0))
    expect(path, 1, told="announces 0 triangles and holds 12")
    path.write_bytes(writers.stl_bytes(CORNERS, TRIANGLES, head=b"solid facet of x"))
    expect(path, 1)
    path.write_bytes(writers.stl_bytes(CORNERS, TRIANGLES, count=6))
    expect(path, 1, told="announces 6 triangles and holds 12")
    path.write_bytes(writers.stl_bytes(CORNERS, TRIANGLES, tail=b"x" * 37))
    expect(path, 1, told="37 bytes behind the last triangle")
    path.write_bytes(writers.stl_bytes(CORNERS, TRIANGLES)[:-100])
    with pytest.raises(InputError, match="announces 12 triangles and holds 10: it is cut short"):
        load_asset(path)


def test_stl_text_that_does_not_end(tmp_path):
    path = tmp_path / "a.stl"
    text = writers.stl_text(CORNERS, TRIANGLES, end=False)
    path.write_text(text)
    expect(path, 1, told="without endsolid")
    path.write_text(text[: text.rindex("vertex")])
    with pytest.raises(InputError, match="within a triangle, after 11 whole ones"):
        load_asset(path)
    path.write_text(text.replace(".", ","))
    with pytest.raises(InputError, match="decimal commas"):
        load_asset(path)


def test_stl_solids_of_one_name_are_two(tmp_path):
    """Also behind the mark that some editors put before a text."""
    text = "".join(
        writers.stl_text(CORNERS + np.array([place, 0, 0]), TRIANGLES, name="leg")
        for place in (0, 2)
    )
    for dressed in (text, text.replace("\n", "\r"), " ".join(text.split())):
        (tmp_path / "a.stl").write_text(dressed, encoding="utf-8-sig")
        expect(tmp_path / "a.stl", {"leg": 1, "leg.1": 1}, size=(3, 1, 1))


def test_stl_a_header_that_says_the_unit(tmp_path):
    path = tmp_path / "a.stl"
    head = b"COLOR=\x80\x80\x80\xffUNITS=mm"
    path.write_bytes(writers.stl_bytes(CORNERS * 20, TRIANGLES, head=head))
    expect(path, 0.02**3, size=(0.02, 0.02, 0.02))
    assert not any("unit" in w for w in load_asset(path).warnings)


# COLLADA

INSTANCE = '<instance_geometry url="#g"/>'


def test_collada_units_by_a_parser(tmp_path):
    """A comment is no unit, a comma is a point in some countries, and nothing is no length."""
    node = f'<node id="n" name="peg">{INSTANCE}</node>'
    path = tmp_path / "a.dae"
    old = '<!-- was <unit meter="0.0254"/> --><unit meter="0.001" name="millimeter"/>'
    expect(writers.collada(path, node, unit=old, points=CORNERS * 1000), {"peg": 1})
    comma = '<unit meter="0,010000"/>'
    expect(writers.collada(path, node, unit=comma, points=CORNERS * 100), {"peg": 1})
    for nothing in ("0", "", "nan", "-1", "metre"):
        with pytest.raises(InputError, match="wanted a number above 0"):
            load_asset(writers.collada(path, node, unit=f'<unit meter="{nothing}"/>'))


def test_collada_what_is_placed_and_not_there_is_told(tmp_path):
    """A node, a mesh or a rig of another document: left out by name; the reason where all is."""
    path = tmp_path / "a.dae"
    lost = '<node name="far"><instance_node url="other.dae#n"/></node>'
    here = f'<node name="peg">{INSTANCE}</node>'
    writers.collada(path, here + lost)
    expect(path, {"peg": 1}, told="the file places 'other.dae#n', which is not in it")
    writers.collada(path, lost)
    with pytest.raises(InputError, match="no triangle that is read: the file places 'other"):
        load_asset(path)


def test_collada_polygons_with_holes_are_told(tmp_path):
    corner = '<input semantic="VERTEX" source="#v" offset="0"/>'
    quads = "".join("<p>{} {} {} {}</p>".format(*q) for q in QUADS)
    holed = "<ph><p>0 1 3 2</p><h>4 6 7 5</h></ph>"
    node = f'<node name="peg">{INSTANCE}</node>'
    kinds = f'<polygons count="7">{corner}{quads}{holed}</polygons>'
    path = writers.collada(tmp_path / "a.dae", node, polygons=kinds)
    expect(path, {"peg": 1}, told="1 polygons with holes")
    kinds = f'<polygons count="1">{corner}{holed}</polygons>'
    with pytest.raises(InputError, match="1 polygons with holes"):
        load_asset(writers.collada(tmp_path / "b.dae", node, polygons=kinds))


def test_collada_instances_are_parts_by_their_nodes(tmp_path):
    nodes = (
        f'<node id="a" name="left">{INSTANCE}</node><node id="b" name="right">'
        f"<translate>3 0 0</translate><scale>1 2 1</scale>{INSTANCE}</node>"
    )
    path = writers.collada(tmp_path / "a.dae", nodes)
    expect(path, {"left": 1, "right": 2}, size=(4, 2, 1))


def skin(joints):
    """A controller of the cube bound to one joint, and a node that shows it."""
    sources = (
        '<source id="j"><Name_array id="ja" count="1">hip</Name_array></source>'
        '<source id="b"><float_array id="ba" count="16">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1'
        '</float_array></source><source id="w"><float_array id="wa" count="1">1</float_array>'
        "</source>"
    )
    body = (
        '<joints><input semantic="JOINT" source="#j"/><input semantic="INV_BIND_MATRIX" '
        'source="#b"/></joints><vertex_weights count="8"><input semantic="JOINT" source="#j" '
        'offset="0"/><input semantic="WEIGHT" source="#w" offset="1"/>'
        f"<vcount>{'1 ' * 8}</vcount><v>{'0 0 ' * 8}</v></vertex_weights>"
    )
    controller = (
        '<library_controllers><controller id="c"><skin source="#g"><bind_shape_matrix>'
        "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix>"
        f"{sources + body if joints else '<joints/>'}</skin></controller></library_controllers>"
    )
    nodes = (
        '<node id="k" sid="hip" type="JOINT" name="hip"><translate>0 0 5</translate>'
        "<rotate>0 0 1 90</rotate><scale>1 1 2</scale></node>"
        '<node id="n" name="peg"><scale>100 100 100</scale><instance_controller url="#c">'
        "<skeleton>#k</skeleton></instance_controller></node>"
    )
    return controller, nodes


def test_collada_joints_place_a_skin(tmp_path):
    """Turned by 90 degrees, doubled in height and lifted: by the joint, not by the node."""
    controller, nodes = skin(joints=True)
    path = writers.collada(tmp_path / "a.dae", nodes, more=controller)
    expect(path, {"peg": 2}, size=(1, 1, 2))
    assert load_asset(path).bounds[0] == pytest.approx([-1, 0, 5])
    controller, nodes = skin(joints=False)
    path = writers.collada(tmp_path / "a.dae", nodes, more=controller)
    with pytest.raises(InputError, match="the skin of peg"):
        load_asset(path)


# FBX, STEP

FBX = """; FBX 7.4.0 project file
FBXHeaderExtension:  {{
	FBXHeaderVersion: 1003
	FBXVersion: 7400
}}
GlobalSettings:  {{
	Version: 1000
	Properties70:  {{
		P: "UpAxis", "int", "Integer", "",1
		P: "UnitScaleFactor", "double", "Number", "",1
	}}
}}
Objects:  {{
	Geometry: 100, "Geometry::legmesh", "Mesh" {{
		Vertices: *24 {{
			a: {points}
		}}
		PolygonVertexIndex: *24 {{
			a: {polygons}
		}}
		GeometryVersion: 124
	}}
	Model: 200, "Model::leg", "Mesh" {{
		Version: 232
		Properties70:  {{
			P: "Lcl Translation", "Lcl Translation", "", "A",300,0,0
			P: "Lcl Scaling", "Lcl Scaling", "", "A",1,2,1
		}}
	}}
	Model: 300, "Model::hip", "LimbNode" {{
		Version: 232
	}}
	Deformer: 400, "Deformer::skin", "Skin" {{
		Version: 101
	}}
	Deformer: 500, "SubDeformer::cluster", "Cluster" {{
		Version: 100
		Indexes: *8 {{
			a: 0,1,2,3,4,5,6,7
		}}
		Weights: *8 {{
			a: 1,1,1,1,1,1,1,1
		}}
		Transform: *16 {{
			a: 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1
		}}
		TransformLink: *16 {{
			a: 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1
		}}
	}}
}}
Connections:  {{
	C: "OO",200,0
	C: "OO",300,0
	C: "OO",100,200
	C: "OO",400,100
	C: "OO",500,400
	C: "OO",300,500
}}
"""


def fbx():
    """A cube of 100 cm, stretched to two by its node, bound to a bone."""
    polygons = QUADS.copy()
    polygons[:, 3] = -polygons[:, 3] - 1
    return FBX.format(
        points=",".join(f"{x:g}" for x in (CORNERS * 100).ravel()),
        polygons=",".join(map(str, polygons.ravel())),
    )


def test_fbx_with_a_skin_keeps_names_and_its_unit(tmp_path):
    (tmp_path / "a.fbx").write_text(fbx())
    expect(tmp_path / "a.fbx", {"leg": 2}, size=(1, 2, 1))


STEP_BOXES = {"post": ((0, 0, 0), (10, 10, 40)), "plate": ((-20, -20, -5), (30, 30, 0))}


@pytest.mark.slow
def test_step_of_two_parts_gives_two_named_parts(tmp_path):
    pytest.importorskip("cascadio")
    path = tmp_path / "part.step"
    path.write_text(writers.step(STEP_BOXES))
    expect(path, {"post": 4e-6, "plate": 1.25e-5}, size=(0.05, 0.05, 0.045))


@pytest.mark.external
@pytest.mark.parametrize(("unit", "side"), [("2,2HMM", 0.001), ("1,2HIN", 0.0254), ("6,1HM", 1)])
def test_iges_is_in_the_unit_that_it_names(tmp_path, unit, side):
    """A box of 10 x 20 x 30 units; the remarks of the global section end in column 72."""
    pytest.importorskip("cascadio")
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(0, 0, 0, 10, 20, 30)
    gmsh.model.occ.synchronize()
    gmsh.write(str(tmp_path / "box.igs"))
    gmsh.finalize()
    text = (tmp_path / "box.igs").read_text()
    (line,) = (row for row in text.split("\n") if "2HMM" in row)
    other = line[:72].rstrip().replace("2,2HMM", unit).ljust(72) + line[72:]
    (tmp_path / "box.igs").write_text(text.replace(line, other))
    expect(tmp_path / "box.igs", 6000 * side**3, size=np.array([10, 20, 30]) * side)


@pytest.mark.slow
def test_step_runs_with_materials_of_its_parts(tmp_path):
    """`run part.step --text ...`: steel 4 cm3 and oak 12.5 cm3, weighed."""
    pytest.importorskip("cascadio")
    (tmp_path / "part.step").write_text(writers.step(STEP_BOXES))
    text = "the post is steel, the plate is oak"
    done = run_here("run", tmp_path / "part.step", "--text", text, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    document = json.loads((tmp_path / "out" / "mesh.msh.json").read_text())
    parts = {p["name"]: p["material"] for p in document["record"]["assign"]["parts"]}
    assert "steel" in parts["post"]
    assert "oak" in parts["plate"]


def test_step_without_the_extra_says_how_to_get_it(tmp_path, monkeypatch):
    (tmp_path / "part.step").write_text(writers.step(STEP_BOXES))
    monkeypatch.setattr(foreign, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"needs the extra cad \(pip install.*or export it"):
        load_asset(tmp_path / "part.step")


# Text clouds


def ball(count=3000):
    """Points on a ball of half a metre, along a golden spiral."""
    i = np.arange(count) + 0.5
    height, turn = 1 - 2 * i / count, i * np.pi * (1 + 5**0.5)
    flat = np.sqrt(1 - height**2)
    return 0.5 * np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height]) + [1, 2, 3]


def rows(separator=" ", *, point=".", before="", after=""):
    lines = (separator.join(f"{x:.6f}" for x in row).replace(".", point) for row in ball())
    return [f"{before}{line}{after}" for line in lines]


CLOUDS = {
    "plain": rows(),
    "comma": rows(","),
    "comma_blank": rows(", "),
    "semicolon": rows(";"),
    "tab": rows("\t"),
    "decimal_comma": rows(" ", point=","),
    "semicolon_decimal_comma": rows(";", point=","),
    "count": ["3000", *rows()],
    "hash": ["# scanner export", *rows()],
    "header": ["//X Y Z R G B", *rows(after=" 120 30 20")],
    "header_names": ["x,y,z,intensity", *rows(",", after=",7")],
}


@pytest.mark.slow
@pytest.mark.parametrize("dress", CLOUDS)
def test_cloud_texts(tmp_path, dress):
    path = tmp_path / "a.xyz"
    path.write_text("\n".join(CLOUDS[dress]) + "\n")
    expect(path, np.pi / 6, size=(1, 1, 1))


@pytest.mark.slow
def test_cloud_lines_without_numbers_are_told(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("\n".join([*rows()[:5], "nan nan nan", *rows()[5:]]))
    expect(path, np.pi / 6, told="1 of 3001 points have no finite position")


def test_cloud_that_is_a_molecule_or_counts_its_rows_is_refused(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("\n".join(["3000", "water", *rows(before="C ")]))
    with pytest.raises(InputError, match="atoms of a molecule"):
        load_asset(path)
    path.write_text("\n".join(f"{i} {line}" for i, line in enumerate(rows())))
    with pytest.raises(InputError, match="first column counts the rows"):
        load_asset(path)


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.blend", b"BLENDER-v300", "export it as glTF"),
        ("a.ifc", b"ISO-10303-21;", "export its solids as STEP"),
        ("a.zip", b"PK", "unpack it first"),
        ("a.glb", b"version https://git-lfs.github.com/spec/v1\noid sha256:1", "git lfs pull"),
        ("a.stl", b"<!DOCTYPE html><html><body>404", "is a web page"),
        ("a.stl", b"\x1f\x8b\x08\0" + bytes(200), "packed by gzip.*no .stl file: unpack"),
        ("a.dae", b"PK\x03\x04" + bytes(200), "a zip archive.*no .dae file: unpack"),
        ("a.obj", b"glTF" + bytes(200), "a glTF file.*no .obj file: rename it to .glb"),
        ("a.inp", b"*HEADING", "save its tets as .msh"),
        ("a.obj", bytes(range(256)) * 20, "holds no triangle: wanted a surface"),
        ("a.sog", b"PK", "export the splats as .ply"),
    ],
)
def test_what_is_no_asset_is_refused_by_name(tmp_path, name, data, reason):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=reason):
        load_asset(tmp_path / name)


def test_ply_textures_of_vertices_and_of_corners(tmp_path):
    """A red picture that a comment names, with places at vertices, or at the corners of faces."""
    from autophyx_tet.predictors.appearance.surface import skin_of
    from PIL import Image

    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "skin.png")
    head = "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 8\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    places = "property float s\nproperty float t\n"
    face = "element face 12\nproperty list uchar int vertex_indices\n"
    corner = "property list uchar float texcoord\n"
    points = ["{:g} {:g} {:g}".format(*p) for p in CORNERS]
    faces = ["3 {} {} {}".format(*f) for f in TRIANGLES]
    for text in (
        [head + places + face + "end_header", *(f"{p} 0.5 0.5" for p in points), *faces],
        [head + face + corner + "end_header", *points, *(f"{f} 6 {'.5 ' * 6}" for f in faces)],
    ):
        (tmp_path / "a.ply").write_text("\n".join(text))
        (part,) = load_asset(tmp_path / "a.ply").parts
        assert part.mesh.volume == pytest.approx(1)
        colour = skin_of(part.mesh)(np.array([0]), np.full((1, 3), 1 / 3))
        assert colour[0, :3] == pytest.approx([1, 0, 0], abs=0.02)


def test_the_extra_is_not_needed_to_list_suffixes(monkeypatch):
    """Names of formats are known without importing what reads them."""
    known = builtins.__import__

    def refuse(name, *rest):
        assert not name.startswith(("cascadio", "assimp"))
        return known(name, *rest)

    monkeypatch.setattr(builtins, "__import__", refuse)
    from autophyx_tet.toolkit.asset.formats import ASSET_FORMATS

    assert {".step", ".fbx", ".3mf"} <= set(ASSET_FORMATS)
