"""glTF 2.0, text and binary: what a scene shows at rest, in world coordinates, metres, +Y up.

Sections are those of the specification, https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote_to_bytes

import numpy as np

from ...converters.registry import Format, Keeps
from ...fem.errors import InputError
from ...fem.note import Note
from .formats import AssetContent, NamedSurface, References, decoded

if TYPE_CHECKING:
    import trimesh
    from trimesh.visual.material import PBRMaterial


# 3.6.2.2, component types; 3.6.2.3, components of a type
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
TRIANGLES, STRIP, FAN = 4, 5, 6  # 3.7.2.1, modes of a primitive; those below are points and lines
MOST_ZEROS = 20_000_000  # elements of an accessor without bytes: as many as triangles

# Extensions that are read, and by their beginnings those that change nothing of a shape at rest.
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression", "MESHOPT_compression")
DRACO, INSTANCES = "KHR_draco_mesh_compression", "EXT_mesh_gpu_instancing"
VISIBLE, TRANSFORM = "KHR_node_visibility", "KHR_texture_transform"
GAUSSIANS = "KHR_gaussian_splatting"  # of a primitive of points
READ = (*MESHOPT, DRACO, INSTANCES, VISIBLE, TRANSFORM, "KHR_mesh_quantization")
HARMLESS = (
    "KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_",
    "KHR_animation_", "KHR_xmp", "KHR_techniques_", "KHR_node_selectability", "KHR_audio",
    "KHR_node_hoverability", "MSFT_lod", "EXT_mesh_manifold", "EXT_mesh_features", "AGI_",
    "EXT_structural_metadata", "KHR_interactivity", "KHR_xmp_json_ld", "CESIUM_primitive_outline",
    "VRM", "FB_ngon_encoding",
)  # fmt: skip


def read_gltf(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per node and primitive that the scene shows.

    Raises InputError: Where it requires an extension that is not read, or is not valid.
    """
    tree, chunk = chunks(data)
    asset = tree.get("asset", {})
    least = str(asset.get("minVersion", asset.get("version", "2.0")))  # 3.2: that of a reader
    if least.split(".")[0] != "2" or ("minVersion" in asset and least != "2.0"):
        raise InputError("gltf.version", path=path, version=least)
    required, unknown = (
        [e for e in tree.get(key, ()) if e not in READ and not e.startswith(HARMLESS)]
        for key in ("extensionsRequired", "extensionsUsed")
    )
    if required:
        raise InputError("gltf.required", path=path, names=", ".join(required))
    file = _File(path, tree, chunk, references)
    shown = sorted(file.shown(), key=lambda entry: entry[0])
    surfaces, points, left = [], [], 0
    for node_names, placements, mesh, number in shown:
        for primitive in mesh.get("primitives", ()):
            read = file.primitive(primitive, number)
            if read is None:
                if GAUSSIANS in primitive.get("extensions", ()):
                    raise InputError("gltf.gaussians", path=path)
                if primitive.get("mode") == 0:
                    points.append(file.points(primitive, number))
                left += 1
                continue
            names = (node_names[0], mesh.get("name", ""), *node_names[1:])
            material = primitive.get("material")
            for placed in placements:
                surfaces.append(
                    NamedSurface(
                        _placed(read, placed),
                        names,
                        None if material is None else tree["materials"][material].get("name"),
                        -1 if material is None else material,
                    )
                )
    warnings = [*file.ktx2()]
    if unknown:
        warnings.append(Note("gltf.unknown", names=", ".join(unknown)))
    if file.hidden:
        warnings.append(Note("gltf.hidden", count=file.hidden))
    if (others := len(tree.get("scenes", ())) - 1) > 0:
        warnings.append(Note("gltf.scenes", others=others))
    if left and (surfaces or not points):
        warnings.append(Note("gltf.lines", count=left))
    cloud = np.concatenate(points) if points and not surfaces else None
    return AssetContent(surfaces, metres=1.0, up="y", cloud=cloud, warnings=tuple(warnings))


GLTF = Format(
    "glTF",
    (".glb", ".gltf", ".vrm"),
    read=read_gltf,
    keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS}),
)


def chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """JSON document and binary chunk of a glTF file, text or binary (4.4)."""
    if data[:4] != b"glTF":
        return json.loads(data), b""
    found, at = {}, 12
    while at + 8 <= len(data):
        size, kind = struct.unpack_from("<I4s", data, at)
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    return json.loads(found[b"JSON"]), found.get(b"BIN\0", b"")


class Primitive(NamedTuple):
    """Triangles ``faces`` over ``points`` before their node moves them, and how they look.

    ``visual`` are colours of the points, shape (points, 3 or 4), or trimesh's texture and material.
    """

    points: np.ndarray
    faces: np.ndarray
    visual: Any


def _placed(primitive: Primitive, matrix: np.ndarray) -> trimesh.Trimesh:
    """Surface where a matrix (4, 4) puts it; a mirrored one is wound the other way."""
    import trimesh

    points = primitive.points @ matrix[:3, :3].T + matrix[:3, 3]
    faces = primitive.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else primitive.faces
    known: dict[str, Any] = {"process": False, "validate": False}
    if isinstance(primitive.visual, np.ndarray):
        return trimesh.Trimesh(points, faces, vertex_colors=primitive.visual, **known)
    visual = None if primitive.visual is None else primitive.visual.copy()
    return trimesh.Trimesh(points, faces, visual=visual, **known)


class _File:
    """The document with what its parts are made of."""

    def __init__(
        self, path: Path, tree: dict[str, Any], chunk: bytes, references: References
    ) -> None:
        self.path, self.tree, self.chunk, self.references = path, tree, chunk, references
        self.nodes: list[dict[str, Any]] = tree.get("nodes", [])
        self.hidden = 0
        self._buffers: dict[int, bytes] = {}
        self._views: dict[int, tuple[bytes, int]] = {}
        self._materials: dict[int, PBRMaterial] = {}
        self._images: dict[int, Any] = {}

    # Bytes and numbers (3.6)

    def buffer(self, number: int) -> bytes:
        """Bytes of a buffer: the binary chunk, within the document, or in a file."""
        if number not in self._buffers:
            uri = self.tree["buffers"][number].get("uri")
            try:
                self._buffers[number] = self.chunk if uri is None else self._bytes(uri)
            except FileNotFoundError as error:
                raise InputError("gltf.buffer", path=self.path, error=error) from error
        return self._buffers[number]

    def _bytes(self, uri: str) -> bytes:
        """What stands in a reference itself, or in the file that it names."""
        if not uri.startswith("data:"):
            return self.references.get(uri)
        head, _, body = uri.partition(",")
        plain = unquote_to_bytes(body)
        return base64.b64decode(plain) if ";base64" in head else plain

    def view(self, number: int) -> tuple[bytes, int]:
        """Bytes of a buffer view, unpacked, and the step from element to element, 0 if packed."""
        if number not in self._views:
            view = self.tree["bufferViews"][number]
            extensions = view.get("extensions", {})
            packed = next((extensions[name] for name in MESHOPT if name in extensions), None)
            source = packed or view
            begin, size = int(source.get("byteOffset", 0)), int(source["byteLength"])
            data = self.buffer(source["buffer"])
            if not 0 <= begin <= begin + size <= len(data):
                raise ValueError(f"buffer view {number} leaves its buffer of {len(data)} bytes")
            data, step = data[begin : begin + size], int(source.get("byteStride", 0))
            if packed:
                try:
                    data = unpacked(data, packed).tobytes()
                except (ValueError, StopIteration) as error:
                    raise InputError("gltf.meshopt", path=self.path, reason=error) from error
            self._views[number] = data, step
        return self._views[number]

    def _cells(self, view: int, begin: int, kind: np.dtype, width: int, count: int) -> np.ndarray:
        """``count`` rows of ``width`` numbers of a buffer view from byte ``begin`` on."""
        data, step = self.view(view)
        size = width * kind.itemsize
        step = step or size
        if begin < 0 or count < 0 or (count and begin + (count - 1) * step + size > len(data)):
            raise ValueError(f"{count} numbers leave their buffer view of {len(data)} bytes")
        rows = np.ndarray((count, size), np.uint8, data, begin, (step, 1)) if count else None
        if rows is None:
            return np.zeros((0, width), kind)
        return np.ascontiguousarray(rows).view(kind)

    def accessor(self, number: int) -> np.ndarray:
        """Numbers of an accessor (count, components), sparse ones filled in; normalised as real."""
        accessor = self.tree["accessors"][number]
        kind, width = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        count, sparse = int(accessor["count"]), accessor.get("sparse")
        if "bufferView" in accessor:
            begin = int(accessor.get("byteOffset", 0))
            values = self._cells(accessor["bufferView"], begin, kind, width, count)
        elif not 0 <= count <= MOST_ZEROS:
            raise ValueError(f"accessor {number} announces {count} zeros")
        else:
            values = np.zeros((count, width), kind)
        if sparse:
            at, new, many = sparse["indices"], sparse["values"], int(sparse["count"])
            index_kind = np.dtype(COMPONENTS[at["componentType"]])
            begin = int(at.get("byteOffset", 0))
            rows = self._cells(at["bufferView"], begin, index_kind, 1, many)[:, 0]
            values = values.copy()
            begin = int(new.get("byteOffset", 0))
            values[rows] = self._cells(new["bufferView"], begin, kind, width, many)
        return _real(values) if accessor.get("normalized") else values

    # The scene (3.5)

    @cached_property
    def worlds(self) -> list[np.ndarray]:
        """Matrix (4, 4) of every node in the world."""
        above = {c: n for n, node in enumerate(self.nodes) for c in node.get("children", ())}
        worlds: dict[int, np.ndarray] = {}
        for start in range(len(self.nodes)):
            way = [start]
            while way[-1] in above and way[-1] not in worlds:
                way.append(above[way[-1]])
                if len(way) > len(self.nodes):
                    raise ValueError("a node is among its own children")
            for number in reversed(way):
                if number not in worlds:
                    parent = worlds[above[number]] if number in above else np.eye(4)
                    worlds[number] = parent @ _local(self.nodes[number])
        return [worlds[number] for number in range(len(self.nodes))]

    def shown(self) -> Iterator[tuple[tuple[str, ...], list[np.ndarray], dict[str, Any], int]]:
        """Nodes with meshes: names of a node and those above, placements, mesh and number."""
        from trimesh.util import unique_name

        names: dict[str, int] = {}
        counts: dict[str | None, int] = {}
        for number, node in enumerate(self.nodes):
            names[unique_name(str(node.get("name", number)), names, counts=counts)] = number
        called = list(names)
        scenes = self.tree.get("scenes", [])
        below = {child for node in self.nodes for child in node.get("children", ())}
        roots = [number for number in range(len(self.nodes)) if number not in below]
        if scenes:
            roots = scenes[self.tree.get("scene", 0)].get("nodes", [])
        waiting: list[tuple[Any, tuple[str, ...]]] = [(root, ()) for root in reversed(roots)]
        seen = set()
        while waiting:
            number, above = waiting.pop()
            if number in seen:
                continue
            seen.add(number)
            node = self.nodes[number]
            extensions = node.get("extensions", {})
            if not extensions.get(VISIBLE, {}).get("visible", True):
                self.hidden += 1
                continue
            here = (called[number], *above)
            waiting += [(child, here) for child in reversed(node.get("children", ()))]
            if "mesh" not in node:
                continue
            # 3.7.3.3: joints place a skinned mesh, its own node does not
            world = np.eye(4) if "skin" in node else self.worlds[number]
            placements = [world @ one for one in self._instances(extensions.get(INSTANCES))]
            yield here, placements, self.tree["meshes"][node["mesh"]], number

    def _instances(self, extension: dict[str, Any] | None) -> list[np.ndarray]:
        if extension is None:
            return [np.eye(4)]
        parts = {
            key: _real(self.accessor(extension["attributes"][name]))
            for name, key in (
                ("TRANSLATION", "translation"), ("ROTATION", "rotation"), ("SCALE", "scale"),
            )
            if name in extension["attributes"]
        }  # fmt: skip
        rows = zip(*parts.values(), strict=True)
        return [_local(dict(zip(parts, row, strict=True))) for row in rows]

    # Meshes (3.7)

    def _corners(self, primitive: dict[str, Any]) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Attributes of the vertices, and the vertices in the order of the corners."""
        packed = primitive.get("extensions", {}).get(DRACO)
        if packed is None:
            attributes = {name: self.accessor(n) for name, n in primitive["attributes"].items()}
            count = len(attributes.get("POSITION", ()))
            index = primitive.get("indices")
            order = np.arange(count) if index is None else self.accessor(index)[:, 0]
            return attributes, order.astype(np.int64)
        import DracoPy

        mesh = DracoPy.decode(self.view(packed["bufferView"])[0])
        attributes = {}
        for name, unique in packed["attributes"].items():
            values = np.asarray(mesh.get_attribute_by_unique_id(unique)["data"])
            values = values.reshape(len(mesh.points), -1)
            accessor = self.tree["accessors"][primitive["attributes"][name]]
            attributes[name] = _real(values) if accessor.get("normalized") else values
        return attributes, np.asarray(mesh.faces, np.int64).reshape(-1)

    def points(self, primitive: dict[str, Any], number: int) -> np.ndarray:
        """Points (n, 3) of a primitive in the world."""
        points, world = self.accessor(primitive["attributes"]["POSITION"]), self.worlds[number]
        return points.astype(np.float64) @ world[:3, :3].T + world[:3, 3]

    def primitive(self, primitive: dict[str, Any], number: int) -> Primitive | None:
        """Triangles of a primitive of a node as they are at rest; None of points and lines."""
        mode = primitive.get("mode", TRIANGLES)
        if mode < TRIANGLES or "POSITION" not in primitive.get("attributes", ()):
            return None
        attributes, order = self._corners(primitive)
        points = attributes["POSITION"].astype(np.float64)
        first = np.arange(max(len(order) - 2, 0))[:, None]
        if mode == TRIANGLES or DRACO in primitive.get("extensions", {}):
            faces = order[: len(order) // 3 * 3].reshape(-1, 3)
        elif mode == STRIP:  # every other triangle is turned
            faces = order[first + np.where(first % 2, [1, 0, 2], [0, 1, 2])]
        elif mode == FAN:
            faces = order[np.where([True, False, False], 0, first + np.arange(3))]
        else:
            raise ValueError(f"mode {mode} of a primitive")
        if faces.size and not 0 <= faces.min() <= faces.max() < len(points):
            raise ValueError(f"a triangle names vertex {faces.max()} of {len(points)}")
        node = self.nodes[number]
        mesh = self.tree["meshes"][node["mesh"]]
        weights = node.get("weights", mesh.get("weights", ()))
        for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
            if weight and "POSITION" in target:
                points = points + weight * self.accessor(target["POSITION"])
        if "skin" in node and "JOINTS_0" in attributes:
            points = self._skinned(points, attributes, self.tree["skins"][node["skin"]])
        return Primitive(points, faces, self._visual(primitive, attributes))

    def _skinned(
        self, points: np.ndarray, attributes: dict[str, np.ndarray], skin: dict[str, Any]
    ) -> np.ndarray:
        """Points after their joints (3.7.3.3)."""
        joints = [self.worlds[joint] for joint in skin["joints"]]
        if "inverseBindMatrices" in skin:  # column after column
            inverse = self.accessor(skin["inverseBindMatrices"]).astype(np.float64)
            inverse = inverse.reshape(-1, 4, 4).transpose(0, 2, 1)[: len(joints)]
            joints = [joint @ one for joint, one in zip(joints, inverse, strict=True)]
        sets = range(sum(name.startswith("JOINTS_") for name in attributes))
        of = np.concatenate([attributes[f"JOINTS_{i}"] for i in sets], axis=1)
        share = np.concatenate([_real(attributes[f"WEIGHTS_{i}"]) for i in sets], axis=1)
        total = share.sum(axis=1, keepdims=True)
        share = share / np.where(total > 0, total, 1)
        moved = np.zeros_like(points)
        for number, matrix in enumerate(joints):
            weight = (share * (of == number)).sum(axis=1, keepdims=True)
            moved += weight * (points @ matrix[:3, :3].T + matrix[:3, 3])
        return np.where(total > 0, moved, points)

    # Looks (3.9)

    def _visual(self, primitive: dict[str, Any], attributes: dict[str, np.ndarray]) -> Any:
        """Material with its texture, or colours of the vertices."""
        from trimesh.visual import TextureVisuals

        colours = attributes.get("COLOR_0")
        if colours is not None:
            colours = np.round(255 * np.clip(_real(colours), 0, 1)).astype(np.uint8)
        number = primitive.get("material")
        if number is None:
            return colours
        material, base = self.tree["materials"][number], {}
        for source in (material.get("pbrMetallicRoughness", {}), *_glossy(material)):
            base = source.get("baseColorTexture", source.get("diffuseTexture", base))
        change = base.get("extensions", {}).get(TRANSFORM, {})
        uv = attributes.get(f"TEXCOORD_{change.get('texCoord', base.get('texCoord', 0))}")
        if uv is not None:
            uv = _real(uv)[:, :2] * change.get("scale", (1, 1))
            cos, sin = (f(change.get("rotation", 0.0)) for f in (np.cos, np.sin))
            uv = uv @ [[cos, -sin], [sin, cos]] + change.get("offset", (0, 0))  # as viewers do
            uv = uv * [1, -1] + [0, 1]  # pictures are counted from below here
        visual = TextureVisuals(uv=uv, material=self._material(number))
        if colours is not None:
            visual.vertex_attributes["color"] = colours
        return visual

    def _material(self, number: int) -> PBRMaterial:
        from trimesh.visual.material import PBRMaterial

        if number not in self._materials:
            material = self.tree["materials"][number]
            look: dict[str, Any] = dict(material.get("pbrMetallicRoughness", {}))
            for glossy in _glossy(material):
                look = {
                    "baseColorFactor": glossy.get("diffuseFactor"),
                    "baseColorTexture": glossy.get("diffuseTexture"),
                    "metallicFactor": 0.0,
                    "roughnessFactor": 1 - glossy.get("glossinessFactor", 1.0),
                }
            name = material.get("name")
            textures = {
                key: self._image(look.get(key), name)
                for key in ("baseColorTexture", "metallicRoughnessTexture")
            }
            self._materials[number] = PBRMaterial(
                name=name,
                baseColorFactor=look.get("baseColorFactor"),
                metallicFactor=look.get("metallicFactor"),
                roughnessFactor=look.get("roughnessFactor"),
                alphaMode=material.get("alphaMode"),
                alphaCutoff=material.get("alphaCutoff"),
                doubleSided=material.get("doubleSided", False),
                **textures,
            )
        return self._materials[number]

    def _image(self, texture: dict[str, Any] | None, material: str | None) -> Any:
        """Picture of a texture; None where there is none, or none that is read."""
        if texture is None:
            return None
        entry = self.tree["textures"][texture["index"]]
        source = entry.get("source")
        for name, extension in entry.get("extensions", {}).items():
            if name.startswith("EXT_texture_"):  # WebP, AVIF
                source = extension.get("source", source)
        if source is None or _is_ktx2(self.tree["images"][source]):
            return None
        if source not in self._images:
            image = self.tree["images"][source]
            try:
                data = (
                    self.view(image["bufferView"])[0]
                    if "bufferView" in image
                    else self._bytes(image.get("uri", ""))
                )
                self._images[source] = decoded(data, material, self.references)
            except FileNotFoundError:  # told by the references
                self._images[source] = None
        return self._images[source]

    def ktx2(self) -> Iterator[str]:
        """Say which textures are not read."""
        images = self.tree.get("images", [])
        unread = [
            str(image.get("name") or image.get("uri") or f"image {number}")
            for number, image in enumerate(images)
            if _is_ktx2(image)
        ]
        if unread:
            more = f" and {len(unread) - 3} more" if len(unread) > 3 else ""
            some = ", ".join(unread[:3]) + more
            yield Note("gltf.ktx2", count=len(unread), images=len(images), some=some)


def _real(values: np.ndarray) -> np.ndarray:
    """Numbers as float64; whole ones as shares of the largest of their type (3.6.2.2)."""
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    return np.maximum(values / np.iinfo(values.dtype).max, -1.0)


def _local(node: dict[str, Any]) -> np.ndarray:
    """Matrix (4, 4) of a node by itself: given, or translation, rotation and scale (3.5.3)."""
    from scipy.spatial.transform import Rotation

    if "matrix" in node:
        return np.reshape(np.asarray(node["matrix"], np.float64), (4, 4)).T
    matrix = np.eye(4)
    turn = np.asarray(node.get("rotation", (0, 0, 0, 1)), np.float64)
    if turn.any():
        matrix[:3, :3] = Rotation.from_quat(turn).as_matrix()
    matrix[:3, :3] *= node.get("scale", (1, 1, 1))
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _glossy(material: dict[str, Any]) -> list[dict[str, Any]]:
    """The older way to say how a material looks, where it is there."""
    extensions = material.get("extensions", {})
    return [extensions[n] for n in ("KHR_materials_pbrSpecularGlossiness",) if n in extensions]


def _is_ktx2(image: dict[str, Any]) -> bool:
    return "ktx2" in (image.get("mimeType", "") + image.get("uri", "")[-5:]).lower()


# Buffers packed by EXT_meshopt_compression: attributes, triangles, indices, and their filters,
# after the bit streams that the extension's page specifies (Khronos glTF repository,
# extensions/2.0/Vendor/EXT_meshopt_compression, "Appendix A: Bitstream" and "B: Filters"): version
# 0 of attributes, 1 of triangles and indices.
GROUP, MOST = 16, 256  # elements of a group, and of a block
BLOCK_BYTES = 8192  # of a block at most, all byte channels together
TAIL = 32  # bytes at least behind the blocks, the last of them the first element
LONGEST = 256  # bytes of an element, by the specification


def unpacked(packed: bytes, extension: dict[str, Any]) -> np.ndarray:
    """Bytes (count, stride) of a buffer view, as its extension describes them.

    Raises ValueError: Where the stream is cut short, of another version, or announces too much.
    """
    count, stride = int(extension["count"]), int(extension["byteStride"])
    mode, applied = extension["mode"], extension.get("filter", "NONE")
    if not (0 < stride <= LONGEST and 0 <= count * stride <= 64 * len(packed)):
        raise ValueError(f"{count} elements of {stride} bytes in {len(packed)} bytes")
    if mode not in DECODERS or (mode == "ATTRIBUTES" and stride % 4):
        raise ValueError(f"no mode {mode} of elements of {stride} bytes")
    data = DECODERS[mode](packed, count, stride)
    if applied == "EXPONENTIAL":
        value = data.view("<i4")
        mantissa, exponent = (value << 8) >> 8, value >> 24
        return np.ldexp(mantissa.astype(np.float64), exponent).astype("<f4").view(np.uint8)
    if applied == "QUATERNION":
        three = data.view("<i2").reshape(count, 4).astype(np.int64)
        largest = three[:, 3] & 3
        parts = three[:, :3] / (three[:, 3:] | 3) / np.sqrt(2)
        rest = np.sqrt(np.maximum(0, 1 - (parts**2).sum(axis=1, keepdims=True)))
        place = (largest[:, None] + np.arange(1, 5)) % 4
        turned = np.empty((count, 4))
        np.put_along_axis(turned, place, np.hstack([parts, rest]), axis=1)
        return np.round(turned * 32767).astype("<i2").view(np.uint8)
    if applied not in ("NONE", "OCTAHEDRAL"):  # octahedral normals are not used
        raise ValueError(f"no filter {applied}")
    return data


def _attributes(packed: bytes, count: int, stride: int) -> np.ndarray:
    """Blocks of elements, byte channel after channel: zigzag differences in groups of 16."""
    if not packed or packed[0] != 0xA0 or len(packed) < 1 + max(TAIL, stride):
        raise ValueError("attributes are not of version 0")
    out, at = np.zeros((count, stride), np.uint8), 1
    before = np.frombuffer(packed, np.uint8)[-stride:]
    block = min(BLOCK_BYTES // stride // GROUP * GROUP, MOST)
    for begin in range(0, count, block):
        rows = min(block, count - begin)
        groups = -(-rows // GROUP)
        for channel in range(stride):
            head = packed[at : at + -(-groups // 4)]
            at += len(head)
            deltas = np.zeros((groups, GROUP), np.uint8)
            for group in range(groups):
                bits = (head[group // 4] >> 2 * (group % 4) & 3) << 1
                if bits == 6:
                    deltas[group] = np.frombuffer(packed, np.uint8, GROUP, at)
                    at += GROUP
                elif bits:  # fields of 2 or 4 bits, the highest first; all ones: a byte follows
                    field = np.frombuffer(packed, np.uint8, 2 * bits, at)
                    shifts = np.arange(8 - bits, -1, -bits, dtype=np.uint8)
                    fields = (field[:, None] >> shifts & ((1 << bits) - 1)).reshape(-1)
                    more = np.flatnonzero(fields == (1 << bits) - 1)
                    at += 2 * bits
                    fields[more] = np.frombuffer(packed, np.uint8, len(more), at)
                    at += len(more)
                    deltas[group] = fields
            flat = deltas.reshape(-1)[:rows]
            signed = flat >> 1 ^ -(flat & 1).astype(np.int8).view(np.uint8)
            out[begin : begin + rows, channel] = before[channel] + np.cumsum(signed, dtype=np.uint8)
        before = out[begin + rows - 1]
    return out


def _varint(stream: Iterator[int]) -> int:
    """Read a number, seven bits a byte, the lowest first."""
    value = 0
    for shift in range(0, 35, 7):
        byte = next(stream)
        value |= (byte & 127) << shift
        if byte < 128:
            break
    return value


def _zigzag(value: int) -> int:
    return value >> 1 ^ -(value & 1)


def _triangles(packed: bytes, count: int, stride: int) -> np.ndarray:
    """Triangles by an edge of the 16 last ones and a vertex of the 16 last ones, or a new one."""
    if count % 3 or packed[:1] != b"\xe1" or len(packed) < 1 + count // 3 + 16:
        raise ValueError("triangles are not of version 1")
    codes, table = packed[1 : 1 + count // 3], packed[-16:]
    stream = iter(packed[1 + count // 3 :])
    following = last = 0
    edges, vertices, out = [(0, 0)] * 16, [0] * 16, []  # the newest first
    for code in codes:
        if code < 0xF0:
            (a, b), third = edges[code >> 4], code & 15
            if third == 0:
                c, following = following, following + 1
            elif third < 13:
                c = vertices[third]
            else:
                step = _zigzag(_varint(stream)) if third == 15 else 2 * third - 27
                c = last = last + step
            if third == 0 or third >= 13:
                vertices = [c, *vertices[:15]]
            edges = [(a, c), (c, b), *edges[:14]]
        else:
            pair = table[code & 15] if code < 0xFE else next(stream)
            kinds = (15 if code == 0xFF else 0, pair >> 4, pair & 15)
            if code >= 0xFE and pair == 0:
                following = 0
            corners: list[int] = []
            for kind in kinds:
                if kind == 0:
                    corners.append(following)
                    following += 1
                elif kind == 15 and code >= 0xFE:
                    corners.append(-1)  # its number follows
                else:
                    corners.append(vertices[kind - 1])
            for order, corner in enumerate(corners):
                if corner < 0:
                    corners[order] = last = last + _zigzag(_varint(stream))
                if corner < 0 or kinds[order] == 0:
                    vertices = [corners[order], *vertices[:15]]
            a, b, c = corners
            edges = [(a, c), (c, b), (b, a), *edges[:13]]
        out.append((a, b, c))
    return np.array(out).astype(f"<u{stride}").reshape(-1, 1).view(np.uint8)


def _indices(packed: bytes, count: int, stride: int) -> np.ndarray:
    """Indices as differences to one of two last ones."""
    if packed[:1] != b"\xd1":
        raise ValueError("indices are not of version 1")
    stream, last, out = iter(packed[1:]), [0, 0], np.empty(count, np.int64)
    for number in range(count):
        value = _varint(stream)
        last[value & 1] += _zigzag(value >> 1)
        out[number] = last[value & 1]
    return out.astype(f"<u{stride}").reshape(-1, 1).view(np.uint8)


DECODERS = {"ATTRIBUTES": _attributes, "TRIANGLES": _triangles, "INDICES": _indices}
