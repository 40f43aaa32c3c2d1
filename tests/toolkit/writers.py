"""Small files as the world writes them, made by hand: cubes in every dress of their formats."""

import base64
import json
import struct
import zipfile

import numpy as np

# The unit cube: corners, and its sides as quads wound outward.
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
QUADS = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)
TRIANGLES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])
# One strip around the six sides of the cube; every other triangle is turned.
STRIP = np.array([0, 1, 2, 3, 7, 1, 5, 0, 4, 2, 6, 7, 4, 5])
KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Gltf:
    """A glTF document that grows."""

    def __init__(self, **more):
        self.bytes = bytearray()
        self.tree = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [],
            "meshes": [], "accessors": [], "bufferViews": [], **more,
        }  # fmt: skip

    def view(self, data, **more):
        self.bytes += bytes(-len(self.bytes) % 4)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data), **more}
        self.bytes += data
        self.tree["bufferViews"].append(view)
        return len(self.tree["bufferViews"]) - 1

    def accessor(self, rows, kind="f4", *, stride=0, offset=0, normalized=False, **more):
        """An accessor of an array; with a stride its rows are that many bytes apart."""
        rows = np.ascontiguousarray(rows, dtype=f"<{kind}")
        rows = rows.reshape(len(rows), -1)
        data, step = rows.tobytes(), rows.shape[1] * rows.itemsize
        if stride:
            data = b"".join(
                data[i : i + step].ljust(stride, b"\xaa") for i in range(0, len(data), step)
            )
        view = {"byteStride": stride} if stride else {}
        known = {
            "bufferView": self.view(bytes(offset) + data, **view), "byteOffset": offset,
            "componentType": KINDS[kind], "count": len(rows), "type": WIDTHS[rows.shape[1]],
        } | ({"normalized": True} if normalized else {})  # fmt: skip
        if kind == "f4" and rows.shape[1] == 3:
            known |= {"min": rows.min(0).tolist(), "max": rows.max(0).tolist()}
        self.tree["accessors"].append(known | more)
        return len(self.tree["accessors"]) - 1

    def mesh(self, *primitives, **more):
        self.tree["meshes"].append({"primitives": list(primitives), **more})
        return len(self.tree["meshes"]) - 1

    def node(self, *, root=True, **more):
        self.tree["nodes"].append(more)
        if root:
            self.tree["scenes"][0]["nodes"].append(len(self.tree["nodes"]) - 1)
        return len(self.tree["nodes"]) - 1

    def cube(self, points=CORNERS, **more):
        """A primitive of the cube's triangles over some points."""
        attributes = {"POSITION": self.accessor(points)}
        return {"attributes": attributes, "indices": self.accessor(TRIANGLES.ravel(), "u2")} | more

    def write(self, path, *, container="glb"):
        """As .glb, or as .gltf with its bytes inside or in a file beside it."""
        tree = {name: value for name, value in self.tree.items() if value != []}
        buffer = {"byteLength": len(self.bytes)}
        if container == "glb":
            text = json.dumps(tree | {"buffers": [buffer]}).encode()
            text += b" " * (-len(text) % 4)
            body = bytes(self.bytes) + bytes(-len(self.bytes) % 4)
            chunks = struct.pack("<I4s", len(text), b"JSON") + text
            chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
            path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
            return path
        path = path.with_suffix(".gltf")
        if container == "inside":
            data = base64.b64encode(self.bytes).decode()
            buffer["uri"] = f"data:application/octet-stream;base64,{data}"
        else:
            path.with_suffix(".bin").write_bytes(self.bytes)
            buffer["uri"] = f"{path.stem}.bin"
        path.write_text(json.dumps(tree | {"buffers": [buffer]}))
        return path


def threemf_mesh(points, faces, attributes=""):
    """A mesh of 3MF, with further attributes of every triangle."""
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in points)
    triangles = "".join(
        '<triangle v1="{}" v2="{}" v3="{}" {}/>'.format(*face, attributes) for face in faces
    )
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONS = (
    '<?xml version="1.0"?><Relationships '
    'xmlns="http://schemas.openxmlformats.org/package/2006/relationships">{}</Relationships>'
)
TYPES = (
    '<?xml version="1.0"?><Types '
    'xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" '
    'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)


def threemf(path, resources, build, *, unit="millimeter", head="", further=(), settings=None):
    """A package of a model of resources and items, and of further model files by name."""
    model = (
        f'<?xml version="1.0" encoding="UTF-8"?><model unit="{unit}" xml:lang="en-US" '
        f'xmlns="{CORE}" xmlns:p="{PRODUCTION}" {head}>'
        "<resources>{}</resources><build>{}</build></model>"
    )
    kind = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
    link = '<Relationship Target="/{}" Id="r{}" Type="{}"/>'.format
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("[Content_Types].xml", TYPES)
        archive.writestr("_rels/.rels", RELATIONS.format(link("3D/3dmodel.model", 0, kind)))
        archive.writestr("3D/3dmodel.model", model.format(resources, build))
        for name, inner in dict(further).items():
            archive.writestr(name, model.format(inner, ""))
        if further:
            links = "".join(link(name, i, kind) for i, name in enumerate(dict(further)))
            archive.writestr("3D/_rels/3dmodel.model.rels", RELATIONS.format(links))
        for name, text in (settings or {}).items():
            archive.writestr(name, text)
    return path


def collada(
    path, scene, *, unit='<unit meter="1"/>', axis="Z_UP", polygons=None, more="", points=CORNERS
):
    """A document with the cube as geometry ``g`` and the nodes of a scene."""
    if polygons is None:
        corners = " ".join(map(str, QUADS.ravel()))
        polygons = (
            '<polylist count="6"><input semantic="VERTEX" source="#v" offset="0"/>'
            f"<vcount>{'4 ' * 6}</vcount><p>{corners}</p></polylist>"
        )
    numbers = " ".join(f"{x:g}" for x in np.ravel(points))
    path.write_text(
        '<?xml version="1.0" encoding="utf-8"?><COLLADA version="1.4.1" '
        'xmlns="http://www.collada.org/2005/11/COLLADASchema">'
        f"<asset>{unit}<up_axis>{axis}</up_axis></asset><library_geometries>"
        '<geometry id="g" name="peg"><mesh><source id="p"><float_array id="pa" count="24">'
        f'{numbers}</float_array><technique_common><accessor source="#pa" count="8" stride="3">'
        '<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>'
        '</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" '
        f'source="#p"/></vertices>{polygons}</mesh></geometry></library_geometries>{more}'
        f'<library_visual_scenes><visual_scene id="s">{scene}</visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    return path


def stl_text(points, faces, *, name="x", end=True, vertex="vertex {:e} {:e} {:e}"):
    """Text of a solid."""
    lines = [f"solid {name}"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [vertex.format(*points[i]) for i in face]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, *([f"endsolid {name}"] if end else [])]) + "\n"


def stl_bytes(points, faces, *, head=b"", count=None, tail=b""):
    """Bytes of a solid, which may announce another count."""
    rows = np.zeros(len(faces), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows["v"] = points[faces]
    count = len(faces) if count is None else count
    return head.ljust(80, b"\0") + struct.pack("<I", count) + rows.tobytes() + tail


def ply(points, polygons, *, form="ascii", real="float", count="uchar", index="int", oneline=False):
    """A PLY file of polygons of any lengths."""
    codes = {"float": "f", "double": "d", "uchar": "B", "int": "i", "uint": "I", "ushort": "H"}
    head = (
        f"ply\nformat {form} 1.0\ncomment made by hand\nelement vertex {len(points)}\n"
        + "".join(f"property {real} {axis}\n" for axis in "xyz")
        + f"element face {len(polygons)}\nproperty list {count} {index} vertex_indices\n"
        + "end_header\n"
    )
    if form == "ascii":
        rows = [" ".join(map(repr, map(float, p))) for p in points]
        rows += [f"{len(p)} {' '.join(map(str, p))}" for p in polygons]
        return (head + (" " if oneline else "\n").join(rows) + "\n").encode()
    order = "<" if "little" in form else ">"
    body = struct.pack(f"{order}{np.size(points)}{codes[real]}", *np.ravel(points))
    for p in polygons:
        body += struct.pack(f"{order}{codes[count]}{len(p)}{codes[index]}", len(p), *p)
    return head.encode() + body


def step(boxes):
    """STEP AP214 text of boxes by name, (low, high) corners in mm: a product each."""
    lines, number = [], 0

    def add(text):
        nonlocal number
        number += 1
        lines.append(f"#{number} = {text};")
        return f"#{number}"

    app = add("APPLICATION_CONTEXT('automotive design')")
    add(f"APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,{app})")
    length = add("( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )")
    angle = add("( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) )")
    solid = add("( NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT() )")
    fuzz = add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),{length},'a','b')")
    context = add(
        "( GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT"
        f"(({fuzz})) GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid})) "
        "REPRESENTATION_CONTEXT('c','3D') )"
    )

    def point(p):
        return add("CARTESIAN_POINT('',({:.6f},{:.6f},{:.6f}))".format(*p))

    def direction(d):
        return add("DIRECTION('',({:.6f},{:.6f},{:.6f}))".format(*d))

    for name, (low, high) in boxes.items():
        low, high = np.array(low, float), np.array(high, float)
        corners = low + CORNERS * (high - low)
        places = [point(p) for p in corners]
        vertices = [add(f"VERTEX_POINT('',{place})") for place in places]
        edges, faces = {}, []
        for quad in QUADS:
            loop = []
            for a, b in zip(quad, np.roll(quad, -1), strict=True):
                key = (min(a, b), max(a, b))
                if key not in edges:
                    along = corners[key[1]] - corners[key[0]]
                    vector = add(f"VECTOR('',{direction(along / np.linalg.norm(along))},1.)")
                    line = add(f"LINE('',{places[key[0]]},{vector})")
                    ends = f"{vertices[key[0]]},{vertices[key[1]]}"
                    edges[key] = add(f"EDGE_CURVE('',{ends},{line},.T.)")
                way = ".T." if a < b else ".F."
                loop.append(add(f"ORIENTED_EDGE('',*,*,{edges[key]},{way})"))
            side = corners[quad[1]] - corners[quad[0]]
            normal = np.cross(side, corners[quad[2]] - corners[quad[0]])
            axis = add(
                f"AXIS2_PLACEMENT_3D('',{places[quad[0]]},"
                f"{direction(normal / np.linalg.norm(normal))},"
                f"{direction(side / np.linalg.norm(side))})"
            )
            bound = add(f"EDGE_LOOP('',({','.join(loop)}))")
            outer = add(f"FACE_OUTER_BOUND('',{bound},.T.)")
            plane = add(f"PLANE('',{axis})")
            faces.append(add(f"ADVANCED_FACE('',({outer}),{plane},.T.)"))
        shell = add(f"CLOSED_SHELL('',({','.join(faces)}))")
        body = add(f"MANIFOLD_SOLID_BREP('{name}',{shell})")
        shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('{name}',({body}),{context})")
        own = add(f"PRODUCT_CONTEXT('',{app},'mechanical')")
        product = add(f"PRODUCT('{name}','{name}','',({own}))")
        formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        design = add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{app},'design')")
        definition = add(f"PRODUCT_DEFINITION('design','',{formation},{design})")
        defined = add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
        add(f"SHAPE_DEFINITION_REPRESENTATION({defined},{shape})")
    head = (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','2026-01-01T00:00:00',"
        "(''),(''),'','','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\n"
        "ENDSEC;\nDATA;\n"
    )
    return head + "\n".join(lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"
