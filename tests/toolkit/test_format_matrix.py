"""Some 1,500 files, each of another combination of features, beside independent readers.

Ours, the exact volume, and assimp, lib3mf or plyfile agree in volume, box, parts and names.
"""

import itertools

import numpy as np
import pytest
from autophyx_tet.toolkit.asset.load import load_asset

from . import writers
from .writers import CORNERS, QUADS, TRIANGLES, Gltf

pytestmark = pytest.mark.slow
EXACT = 1e-4  # of float32, and of what is printed with six digits


def volume(points, faces):
    """Signed volume of a closed surface."""
    a, b, c = np.moveaxis(np.asarray(points, float)[faces], 1, 0)
    return float(np.einsum("ni,ni->", np.cross(a, b), c) / 6)


def ours(path):
    """Volume and box of every part by name."""
    return {
        part.name: (float(part.mesh.volume), np.array(part.mesh.bounds))
        for part in load_asset(path).parts
    }


def by_assimp(path):
    """The same by assimp, its meshes put where their nodes are, by the nodes' names."""
    assimp = pytest.importorskip("assimp_py")
    scene = assimp.import_file(str(path), assimp.Process_Triangulate | assimp.Process_SortByPType)
    found = {}

    def walk(node, above):
        matrix = above @ np.array(node.transformation, float)
        for number in node.mesh_indices:
            mesh = scene.meshes[number]
            points = np.asarray(mesh.vertices, float).reshape(-1, 3)
            points = points @ matrix[:3, :3].T + matrix[:3, 3]
            faces = np.asarray(mesh.indices, int).reshape(-1, 3)
            turned = np.linalg.det(matrix[:3, :3]) < 0
            found.setdefault(node.name, []).append((points, faces[:, ::-1] if turned else faces))
        for child in node.children:
            walk(child, matrix)

    walk(scene.root_node, np.eye(4))
    return {
        name: (
            sum(volume(*piece) for piece in pieces),
            np.array([f([f(p, axis=0) for p, _ in pieces], axis=0) for f in (np.min, np.max)]),
        )
        for name, pieces in found.items()
    }


def agree(one, other, what, *, names=True):
    """Two readings are of the same parts in the same places."""
    if not names:
        one, other = (dict(enumerate(d.values())) for d in (one, other))
    assert set(one) == set(other), (what, one, other)
    for name, (size, box) in one.items():
        assert size == pytest.approx(other[name][0], rel=EXACT), (what, name)
        assert box == pytest.approx(other[name][1], abs=EXACT * np.abs(box).max()), (what, name)


# glTF: how positions, indices and triangles are stored, times where their nodes are.

POSITIONS = (("f4", False), ("u2", True), ("i2", True), ("u1", True), ("i1", True), ("u2", False))
INDICES = ("u1", "u2", "u4", None)
MODES = {4: TRIANGLES.ravel(), 5: writers.STRIP, 6: None}
TURN = [0.5, 0.5, 0.5, 0.5]  # about (1, 1, 1) by 120 degrees
NODES = {
    "plain": {},
    "trs": {"translation": [1, 2, 3], "rotation": TURN, "scale": [1, 2, 3]},
    "matrix": {"matrix": [0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]},
    "mirror": {"scale": [-1, 1, 2]},
}
# A pyramid of two fans: its sides around the tip, its base around a corner.
PYRAMID = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1], [1, 1, 1]])
WHOLE = 2  # the size of the cube where its corners are whole numbers
FANS = (np.array([4, 0, 3, 2, 1, 0]), np.array([0, 1, 2, 3]))


def gltf_of(position, index, mode, node, layout, *, size=1):
    """A document of one cube, or of a pyramid where triangles are fans; and its volume."""
    kind, normalized = position
    g = Gltf(extensionsUsed=["KHR_mesh_quantization"])
    points, lists = (PYRAMID, FANS) if mode == 6 else (CORNERS, (MODES[mode],))
    points = points * size
    unit = 1 if normalized or kind == "f4" else WHOLE
    most = 1 if kind == "f4" else np.iinfo(kind).max if normalized else WHOLE
    primitives = []
    for order in lists:
        corners, order = (points[order], None) if index is None else (points, order)
        row = np.dtype(kind).itemsize * 3
        stride = {"tight": 0 if row % 4 == 0 else row + (-row) % 4, "strided": 20}[layout]
        offset = 8 if layout == "strided" else 0
        place = g.accessor(
            corners * most, kind, normalized=normalized, stride=stride, offset=offset,
            min=(corners * most).min(0).tolist(), max=(corners * most).max(0).tolist(),
        )  # fmt: skip
        primitive = {"attributes": {"POSITION": place}, "mode": mode}
        if order is not None:
            primitive["indices"] = g.accessor(order, index)
        primitives.append(primitive)
    mesh = g.mesh(*primitives, name="shape")
    inner = g.node(root=False, mesh=mesh, name="thing", **NODES[node])
    g.node(children=[inner], translation=[0, 0, 10], name="above")
    matrix = NODES[node].get("matrix")
    scale = np.prod(NODES[node].get("scale", [1, 1, 1]))
    factor = abs(np.linalg.det(np.reshape(matrix, (4, 4)))) if matrix else abs(scale)
    return g, factor * unit**3 * (1 / 3 if mode == 6 else 1)


@pytest.mark.parametrize("position", POSITIONS, ids=lambda p: f"{p[0]}{'n' * p[1]}")
@pytest.mark.parametrize("mode", MODES)
def test_gltf_of_every_storage(tmp_path, position, mode):
    """576 files: types of numbers and indices, kinds of triangles, layouts, places of nodes."""
    count = 0
    for index, node, layout in itertools.product(INDICES, NODES, ("tight", "strided")):
        g, right = gltf_of(position, index, mode, node, layout)
        path = g.write(tmp_path / "a.glb")
        found = ours(path)
        what = position, index, mode, node, layout
        assert list(found) == ["thing"], what
        size, _ = found["thing"]
        assert abs(size) == pytest.approx(right, rel=EXACT), what
        # assimp knows positions as floats alone: the same shape, so stored
        size = WHOLE if position == ("u2", False) else 1
        twin, _ = gltf_of(("f4", False), index, mode, node, layout, size=size)
        agree(found, by_assimp(twin.write(tmp_path / "twin.glb")), what)
        count += 1
    assert count == 32


def cube_with(feature, g):
    """A primitive with a feature of the format; the volume that it has then."""
    primitive = g.cube()
    if feature == "sparse":
        top = np.flatnonzero(CORNERS[:, 1] == 1)
        accessor = g.tree["accessors"][primitive["attributes"]["POSITION"]]
        values = (CORNERS[top] * [1, 3, 1]).astype("<f4")
        accessor["sparse"] = {
            "count": len(top),
            "indices": {"bufferView": g.view(top.astype("u1").tobytes()), "componentType": 5121},
            "values": {"bufferView": g.view(values.tobytes())},
        }
        accessor["max"] = [1, 3, 1]
        return primitive, {}, {}, 3
    if feature == "morph":
        higher = g.accessor(np.where(CORNERS == 1, [0, 1, 0], 0))
        return primitive | {"targets": [{"POSITION": higher}]}, {"weights": [1.0]}, {}, 2
    if feature == "draco":
        import DracoPy

        packed = DracoPy.encode(CORNERS.astype("f4"), TRIANGLES.astype("u4"))
        g.tree["accessors"] = [
            {"componentType": 5126, "count": 8, "type": "VEC3", "min": [0] * 3, "max": [1] * 3},
            {"componentType": 5125, "count": 36, "type": "SCALAR"},
        ]
        extension = {"bufferView": g.view(packed), "attributes": {"POSITION": 0}}
        extensions = {"KHR_draco_mesh_compression": extension}
        plain = {"attributes": {"POSITION": 0}, "indices": 1}
        return plain | {"extensions": extensions}, {}, {}, 1
    if feature == "instances":
        places = g.accessor(np.array([[0.0, 0, 0], [5, 0, 0]]))
        sizes = g.accessor(np.array([[1.0, 1, 1], [2, 2, 2]]))
        attributes = {"TRANSLATION": places, "SCALE": sizes}
        extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
        return primitive, {}, {"extensions": extension}, 9
    if feature == "skin":
        joint = g.node(name="joint", scale=[2, 2, 2])
        other = g.node(name="other", scale=[2, 2, 2], translation=[0, 4, 0])
        g.tree["skins"] = [{"joints": [joint, other]}]
        half = np.where(CORNERS[:, 1:2] == 1, [[0, 1, 0, 0]], [[1, 0, 0, 0]])
        primitive["attributes"] |= {
            "JOINTS_0": g.accessor(np.tile([0, 1, 0, 0], (8, 1)), "u2"),
            "WEIGHTS_0": g.accessor(half, "f4"),
        }
        return primitive, {}, {"skin": 0}, 2 * 2 * 6
    return primitive, {}, {}, 1


FEATURES = ("plain", "sparse", "morph", "draco", "instances", "skin")
EXTENSIONS = {"draco": "KHR_draco_mesh_compression", "instances": "EXT_mesh_gpu_instancing"}
# What assimp reads as we do; it shows shape keys and skins as they were before, and one instance.
ASSIMP_READS = ("plain", "sparse")


@pytest.mark.parametrize("feature", FEATURES)
def test_gltf_features_in_every_container(tmp_path, feature):
    """108 files: a feature, its bytes in three places, required, used or silent, scaled nodes."""
    for container, said, scale in itertools.product(
        ("glb", "inside", "beside"), ("required", "used", "silent"), (1, 3)
    ):
        names = [EXTENSIONS[feature]] if feature in EXTENSIONS else []
        lists = {"required": ("extensionsUsed", "extensionsRequired"), "used": ("extensionsUsed",)}
        g = Gltf(**{key: names for key in lists.get(said, ()) if names})
        primitive, mesh, node, right = cube_with(feature, g)
        g.node(mesh=g.mesh(primitive, **mesh), name="part", scale=[scale] * 3, **node)
        path = g.write(tmp_path / "a.glb", container=container)
        factor = 1 if feature == "skin" else scale**3  # a skin's own node does not scale it
        ((name, (size, _)),) = ours(path).items()
        what = feature, container, said, scale
        assert (name, size) == ("part", pytest.approx(right * factor, rel=1e-3)), what
        if feature in ASSIMP_READS:
            agree(ours(path), by_assimp(path), what)


# 3MF beside the consortium's own reader.


def by_lib3mf(path):
    """Volume and box [m] of every object that the build lists, by name."""
    lib3mf = pytest.importorskip("lib3mf")
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.QueryReader("3mf").ReadFromFile(str(path))
    units = dict(zip(lib3mf.ModelUnit, (1e-6, 1e-3, 1e-2, 0.0254, 0.3048, 1.0), strict=True))
    metres = units[model.GetUnit()]
    found = {}

    def matrix(transform):
        rows = np.array([list(row) for row in transform.Fields])
        return np.vstack([np.hstack([rows[:3], np.zeros((3, 1))]), [*rows[3], 1]])

    def walk(thing, place, name):
        if thing.IsMeshObject():
            mesh = model.GetMeshObjectByID(thing.GetResourceID())
            points = np.array([list(p.Coordinates) for p in mesh.GetVertices()])
            faces = np.array([list(t.Indices) for t in mesh.GetTriangleIndices()])
            points = metres * (np.column_stack([points, np.ones(len(points))]) @ place)[:, :3]
            size = volume(points, faces) * np.sign(np.linalg.det(place[:3, :3]))
            found[name] = (size, np.array([points.min(0), points.max(0)]))
            return
        whole = model.GetComponentsObjectByID(thing.GetResourceID())
        for i in range(whole.GetComponentCount()):
            part = whole.GetComponent(i)
            own = matrix(part.GetTransform()) if part.HasTransform() else np.eye(4)
            walk(part.GetObjectResource(), own @ place, part.GetObjectResource().GetName())

    items = model.GetBuildItems()
    while items.MoveNext():
        item = items.GetCurrent()
        thing = item.GetObjectResource()
        walk(thing, matrix(item.GetObjectTransform()), thing.GetName())
    return found


PLACES = {
    "none": "", "moved": "1 0 0 0 1 0 0 0 1 5 6 7", "scaled": "2 0 0 0 3 0 0 0 1 0 0 0",
    "turned": "0 1 0 -1 0 0 0 0 1 1 1 1", "mirrored": "-1 0 0 0 1 0 0 0 1 0 0 0",
}  # fmt: skip


@pytest.mark.parametrize("unit", ["micron", "millimeter", "centimeter", "inch", "foot", "meter"])
def test_3mf_beside_lib3mf(tmp_path, unit):
    """300 files: units, places of items and of components, one file or several."""
    cube = writers.threemf_mesh(CORNERS * [1, 2, 3], TRIANGLES)
    attribute = ' transform="{}"'.format
    for (one, place), (two, inner), split in itertools.product(
        PLACES.items(), PLACES.items(), (False, True)
    ):
        place = attribute(place) if place else ""
        inner = attribute(inner) if inner else ""
        mesh = f'<object id="1" type="model" name="leg">{cube}</object>'
        where = ' p:path="/3D/Objects/leg.model"' if split else ""
        whole = (
            '<object id="2" type="model" name="table"><components>'
            f'<component objectid="1"{where}{inner}/></components></object>'
        )
        further = {"3D/Objects/leg.model": mesh} if split else {}
        own = whole if split else mesh + whole
        path = writers.threemf(
            tmp_path / "a.3mf", own, f'<item objectid="2"{place}/>', unit=unit, further=further
        )
        agree(ours(path), by_lib3mf(path), (unit, one, two, split))


# OBJ beside assimp, for the dresses that both read; the others against the exact volume.


@pytest.mark.parametrize("polygon", [3, 4])
def test_obj_of_every_index(tmp_path, polygon):
    """192 files: forms of corners, counted back or not, white space, ends of lines, objects."""
    faces = TRIANGLES if polygon == 3 else QUADS
    forms = ("{v}", "{v}/{t}", "{v}//{n}", "{v}/{t}/{n}")
    for form, back, blank, end, key in itertools.product(
        forms, (False, True), (" ", "\t"), ("\n", "\r\n", "\r"), ("o", "g")
    ):
        lines = []
        for number, name in enumerate(("leg", "top")):
            lines += [f"{key} {name}"]
            lines += ["v {} {} {}".format(*np.add(p, (3 * number, 0, 0))) for p in CORNERS]
            lines += ["vt 0 0"] * 8 + ["vn 0 0 1"] * 8
            first = 0 if back else 8 * number + 1
            for face in faces:
                index = [i - 8 if back else i + first for i in face]
                lines.append("f " + " ".join(form.format(v=i, t=i, n=i) for i in index))
        path = tmp_path / "a.obj"
        path.write_bytes(end.join(lines).replace(" ", blank).encode() + end.encode())
        found, what = ours(path), (form, back, blank, end, key)
        assert {n: v for n, (v, _) in found.items()} == {"leg": 1.0, "top": 1.0}, what
        if end != "\r" and blank == " ":
            agree(found, by_assimp(path), what)


# PLY beside plyfile.


def by_plyfile(path):
    plyfile = pytest.importorskip("plyfile")
    read = plyfile.PlyData.read(str(path))
    points = np.stack([np.asarray(read["vertex"][axis], float) for axis in "xyz"], axis=1)
    rows = read["face"].data["vertex_indices"]
    faces = [(r[0], r[i], r[i + 1]) for r in rows for i in range(1, len(r) - 1)]
    box = np.array([points.min(0), points.max(0)])
    return {"a": (volume(points, np.array(faces, int)), box)}


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_of_every_type(tmp_path, form):
    """162 files: forms, types of numbers, of counts and of indices, polygons of any lengths."""
    triangles = TRIANGLES.tolist()
    mixed = [*QUADS[:3].tolist(), *QUADS[3:, [0, 1, 2]].tolist(), *QUADS[3:, [0, 2, 3]].tolist()]
    for real, count, index, polygons in itertools.product(
        ("float", "double"), ("uchar", "int", "uint"), ("int", "uint", "ushort"),
        (triangles, QUADS.tolist(), mixed),
    ):  # fmt: skip
        path = tmp_path / "a.ply"
        data = writers.ply(
            CORNERS * [1, 2, 3], polygons, form=form, real=real, count=count, index=index
        )
        path.write_bytes(data)
        agree(ours(path), by_plyfile(path), (form, real, count, index, len(polygons)))


# COLLADA beside assimp.

FLAT = " ".join(map(str, TRIANGLES.ravel()))
QUAD = " ".join(map(str, QUADS.ravel()))
INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'
POLYGONS = {
    "triangles": f'<triangles count="12">{INPUT}<p>{FLAT}</p></triangles>',
    "polylist": f'<polylist count="6">{INPUT}<vcount>{"4 " * 6}</vcount><p>{QUAD}</p></polylist>',
}
CHANGES = {
    "none": "",
    "translate": "<translate>1 2 3</translate>",
    "scale": "<scale>1 2 3</scale>",
    "rotate": "<rotate>0 0 1 90</rotate>",
    "matrix": "<matrix>0 -1 0 5 2 0 0 6 0 0 1 7 0 0 0 1</matrix>",
    "all": "<translate>1 2 3</translate><rotate>1 0 0 90</rotate><scale>2 2 2</scale>",
}
AXES = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
# assimp turns what it reads to +y.
TO_Y = {
    "X_UP": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], "Y_UP": np.eye(3),
    "Z_UP": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
}  # fmt: skip


@pytest.mark.parametrize("kind", POLYGONS)
def test_collada_of_every_node(tmp_path, kind):
    """216 files: changes of two nodes one above the other, units, axes."""
    for (one, above), (two, below), axis in itertools.product(
        CHANGES.items(), CHANGES.items(), AXES
    ):
        scene = (
            f'<node id="u" name="upper">{above}<node id="l" name="lower">{below}'
            '<instance_geometry url="#g"/></node></node>'
        )
        path = writers.collada(
            tmp_path / "a.dae",
            scene,
            unit='<unit meter="0.1"/>',
            axis=axis,
            polygons=POLYGONS[kind],
        )
        asset = load_asset(path)
        assert (asset.part_names, asset.up) == (("lower",), AXES[axis])
        ((size, box),) = ours(path).values()
        turned = np.sort(box @ np.transpose(TO_Y[axis]), axis=0)
        agree({"l": (size, turned)}, by_assimp(path), (kind, one, two, axis))


# STL beside assimp.


def test_stl_of_every_dress(tmp_path):
    """Text in cases and indents, bytes with heads, of one solid or two."""
    box = CORNERS * [1, 2, 3]
    text = writers.stl_text(box, TRIANGLES, name="leg")
    two = text + writers.stl_text(np.add(box, (5, 0, 0)), TRIANGLES, name="top")
    dresses = [text, text.upper(), text.replace("\n", "\n   "), text.replace("\n", "\r\n")]
    files = [d.encode() for d in dresses]
    heads = (b"", b"made by hand", b"solid is no text", b"\xff" * 80)
    files += [writers.stl_bytes(box, TRIANGLES, head=head) for head in heads]
    path = tmp_path / "a.stl"
    path.write_text(text)
    right = by_assimp(path)  # which knows but some of the dresses
    for number, data in enumerate(files):
        path.write_bytes(data)
        agree(ours(path), right, number, names=False)
    path.write_bytes(two.encode())
    found = ours(path)
    assert set(found) == {"leg", "top"}
    agree(found, by_assimp(path), "two", names=False)
