"""What trimesh reads of a file: its surfaces in their places, with the names around them."""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...converters.carriers import is_density
from ...converters.grids import density_surface, read_density
from ...converters.points.table import PointTable, read_points
from ...converters.points.views import splat_body
from ...converters.registry import Format, Keeps
from ...fem.errors import InputError
from ...predictors.asset import UpAxis
from .formats import AssetContent, NamedSurface, References

if TYPE_CHECKING:
    import trimesh


# Pictures of a material, by trimesh's names: those that a skin is made of, and the others.
TEXTURES = ("image", "baseColorTexture", "metallicRoughnessTexture")
UNSEEN_TEXTURES = ("emissiveTexture", "normalTexture", "occlusionTexture")


def parse_scene(path: Path, data: bytes, references: References, **options: Any) -> trimesh.Scene:
    """Parse with trimesh, changing nothing; textures are decoded."""
    import trimesh

    scene = trimesh.load_scene(
        io.BytesIO(data),
        file_type=path.suffix[1:].lower(),
        resolver=references,  # type: ignore[arg-type]
        process=False,
        **options,
    )
    # Decode the pictures that a skin is made of, once, and let go of all others
    visuals = (getattr(geometry, "visual", None) for geometry in scene.geometry.values())
    materials = (getattr(visual, "material", None) for visual in visuals)
    for material in {id(material): material for material in materials}.values():
        for kind in UNSEEN_TEXTURES:
            if getattr(material, kind, None) is not None:
                setattr(material, kind, None)
        for kind in TEXTURES:
            image = getattr(material, kind, None)
            if image is None:
                continue
            try:
                image.load()
            except Exception as error:  # a parser of untrusted bytes may raise anything
                setattr(material, kind, None)
                name = getattr(material, "name", None) or "without a name"
                reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
                references.warn(
                    f"a texture of material {name} cannot be decoded ({reason}): its parts have "
                    "the plain colour of the material; export the texture again"
                )
    return scene


def surface_meshes(scene: trimesh.Scene) -> list[tuple[str, trimesh.Trimesh]]:
    """Surfaces of a scene by name."""
    return [(name, mesh) for name, mesh in scene.geometry.items() if is_surface(mesh)]


def node_surfaces(scene: trimesh.Scene) -> list[NamedSurface]:
    """One surface per node that shows a mesh, where its node puts it."""
    surfaces = []
    for node in sorted(scene.graph.nodes_geometry):
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if is_surface(mesh):
            path = node_path(scene, node)
            names = (node, str(geometry), *path[1:])
            surfaces.append(NamedSurface(placed(mesh, transform), names, mesh_material_name(mesh)))
    return surfaces


def placed(mesh: trimesh.Trimesh, transform: np.ndarray) -> trimesh.Trimesh:
    """Return a copy of a mesh where ``transform`` (4, 4) puts it."""
    mesh = mesh.copy()
    mesh.apply_transform(transform)
    return mesh


def node_path(scene: trimesh.Scene, node: str) -> list[str]:
    """Names of a node and of the nodes above it, nearest first."""
    parents = scene.graph.transforms.parents
    names = [node]
    while names[-1] in parents:
        names.append(parents[names[-1]])
    return names


def is_surface(geometry: Any) -> bool:
    """Whether a geometry has triangles."""
    return getattr(geometry, "faces", None) is not None and len(geometry.faces) > 0


def mesh_material_name(mesh: trimesh.Trimesh) -> str | None:
    """Name of the material of a surface, if it has one."""
    return getattr(getattr(mesh.visual, "material", None), "name", None)


def cloud_of(scene: trimesh.Scene) -> np.ndarray | None:
    """All points of a scene without triangles."""
    points = [np.asarray(g.vertices, np.float64) for g in scene.geometry.values()]
    return np.concatenate(points) if points and sum(map(len, points)) else None


def refuse_entities(path: Path, text: bytes) -> None:
    """No XML entities: they can read files and grow without bound."""
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError(f"{path}: declares XML entities, which are not read: export it again")


# glTF, text and binary: metres, +Y up, by the standard.


def read_gltf(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per node and material, in world coordinates."""
    document = json.loads(gltf_json(data))
    # One surface per node and primitive, with the names that the file gives node and mesh
    from trimesh.util import unique_name

    scene, meshes = parse_scene(path, data, references), document.get("meshes", [])
    # Nodes of the file under the names that trimesh gives them: their own, counted if equal
    nodes: dict[str, dict[str, Any]] = {}
    counts: dict[str | None, int] = {}
    for number, node in enumerate(document.get("nodes", [])):
        nodes[unique_name(node.get("name", str(number)), nodes, counts=counts)] = node
    if "world" in nodes:  # the name of trimesh's own root
        nodes[unique_name("world", nodes)] = nodes["world"]
    order = {geometry: number for number, geometry in enumerate(scene.geometry)}
    materials: dict[int, int] = {}
    found = []
    for shown in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[shown]
        mesh = scene.geometry[geometry]
        if not is_surface(mesh):
            continue
        names = node_path(scene, shown)
        names = names if shown in nodes else names[1:]
        mesh_name = meshes[nodes[names[0]]["mesh"]].get("name", "")
        material = id(getattr(mesh.visual, "material", None))
        surface = NamedSurface(
            placed(mesh, transform),
            (names[0], mesh_name, *names[1:]),
            mesh_material_name(mesh),
            materials.setdefault(material, len(materials)),
        )
        found.append((names[0], order[geometry], surface))
    surfaces = [surface for *_, surface in sorted(found, key=lambda entry: entry[:2])]
    if not surfaces and references.warnings:
        raise InputError(f"{path}: {references.warnings[0]}")
    images = document.get("images", [])
    unread = [
        str(image.get("name") or image.get("uri") or f"image {number}")
        for number, image in enumerate(images)
        if "ktx2" in (image.get("mimeType", "") + image.get("uri", "")[-5:]).lower()
    ]
    warnings = ()
    if unread:
        some = ", ".join(unread[:3]) + (f" and {len(unread) - 3} more" if len(unread) > 3 else "")
        warnings = (
            f"{len(unread)} of {len(images)} textures are KTX2, which is not read ({some}): their "
            "parts have the plain colours of their materials; export the textures as PNG or JPEG",
        )
    return AssetContent(surfaces, metres=1.0, up="y", warnings=warnings)


def gltf_json(data: bytes) -> bytes:
    """Return the JSON document of a glTF file, text or binary."""
    if data[:4] != b"glTF":
        return data
    (size,) = struct.unpack_from("<I", data, 12)
    return data[20 : 20 + size]


GLTF = Format(
    "glTF", (".glb", ".gltf"), read=read_gltf, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)


# OBJ: objects or groups by material, indices that count back made absolute.

_COUNTED_LINE = re.compile(r"^(?:v|vt|vn|f)[ \t].*$", flags=re.MULTILINE)


def read_obj(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per object (or group, where there are no objects) and material."""
    text = absolute_indices(data.decode(errors="replace"))
    names = re.findall(r"^usemtl[ \t]+(\S+)", text, flags=re.MULTILINE)
    references.materials = tuple(dict.fromkeys(names))
    objects = re.search(r"^o[ \t]+\S", text, flags=re.MULTILINE) is not None
    scene = parse_scene(
        path,
        text.encode(),
        references,
        group_material=True,
        split_objects=objects,
        split_groups=not objects,
    )
    surfaces = []
    for name, mesh in surface_meshes(scene):
        material = mesh_material_name(mesh)
        surfaces.append(NamedSurface(mesh, (name.removesuffix(f"_{material}"),), material))
    return AssetContent(surfaces, up_guess="y", cloud=None if surfaces else cloud_of(scene))


OBJ = Format("OBJ", (".obj",), read=read_obj, keeps=frozenset({Keeps.PARTS}))


def absolute_indices(text: str) -> str:
    """Rewrite an OBJ text's relative (negative) indices, which count back from their own line."""
    if not re.search(r"^f[ \t].*-\d", text, flags=re.MULTILINE):
        return text
    count = {"v": 0, "vt": 0, "vn": 0}

    def absolute(match: re.Match[str]) -> str:
        kind, *rest = match.group().split()
        if kind != "f":
            count[kind] += 1
            return match.group()
        corners = []
        for corner in rest:
            pairs = zip(corner.split("/"), count.values(), strict=False)
            corners.append("/".join(str(n + 1 + int(i)) if i[:1] == "-" else i for i, n in pairs))
        return " ".join(["f", *corners])

    return _COUNTED_LINE.sub(absolute, text)


# COLLADA: unit and up axis are in the file.


def read_collada(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per node and material."""
    refuse_entities(path, data)
    unit = re.search(rb"<unit[^>]*\bmeter=[\"']([\d.eE+-]+)", data)
    axis = re.search(rb"<up_axis>\s*([XYZ])_UP", data)
    return AssetContent(
        node_surfaces(parse_scene(path, data, references)),
        metres=float(unit.group(1)) if unit else 1.0,
        up=axis.group(1).decode().lower() if axis else "y",  # type: ignore[arg-type]
    )


COLLADA = Format(
    "COLLADA", (".dae",), read=read_collada, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)


# OFF with polygons of any size and per-face colours, which trimesh stumbles over.


def read_off(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface, its polygons cut into fans of triangles."""
    import trimesh

    lines = [line.split("#")[0].split() for line in data.decode(errors="replace").splitlines()]
    words = [line for line in lines if line]
    if re.fullmatch(r"(ST)?C?N?4?OFF", words[0][0].upper()) is None:
        raise ValueError(f"starts with {words[0][0][:20]!r}")
    first = words[0][1:] or words.pop(1)
    vertices, faces = (int(n) for n in first[:2])
    if vertices + faces > len(words) - 1:
        raise ValueError(f"announces {vertices} vertices and {faces} faces, has fewer lines")
    points = np.array([[float(x) for x in w[:3]] for w in words[1 : vertices + 1]])
    polygons = words[vertices + 1 : vertices + faces + 1]
    if any(int(w[0]) >= len(w) for w in polygons):
        raise ValueError("a face announces more corners than it has")
    corners = [[int(i) for i in w[1 : int(w[0]) + 1]] for w in polygons]
    fans = [(p[0], p[i], p[i + 1]) for p in corners for i in range(1, len(p) - 1)]
    triangles = np.array(fans, dtype=np.int64).reshape(-1, 3)
    mesh = trimesh.Trimesh(points.reshape(-1, 3), triangles, process=False, validate=False)
    return AssetContent(
        [NamedSurface(mesh)] if len(triangles) else [], cloud=points if len(points) else None
    )


OFF = Format("OFF", (".off",), read=read_off)


# 3MF: the unit is in the model, +Z up by the standard.

MAX_UNPACKED_BYTES = 2 * 2**30  # of an archive: more is a bomb or a scan
# Metres of the units that 3MF names; it means millimetres where it names none.
THREEMF_METRES = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip


def read_threemf(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per object of the build."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        models = [m for m in archive.infolist() if m.filename.lower().endswith(".model")]
        if sum(member.file_size for member in archive.infolist()) > MAX_UNPACKED_BYTES:
            raise InputError(f"{path}: unpacks to more than {MAX_UNPACKED_BYTES} bytes")
        texts = [archive.read(model) for model in models]
    for text in texts:
        refuse_entities(path, text)
    unit = re.search(rb"<model[^>]*\bunit=[\"'](\w+)", b"".join(texts))
    metres = THREEMF_METRES.get(unit.group(1).decode().lower() if unit else "millimeter")
    return AssetContent(node_surfaces(parse_scene(path, data, references)), metres=metres, up="z")


THREEMF = Format(
    "3MF", (".3mf",), read=read_threemf, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)


# Formats with one surface, or several named solids, and no tree of nodes: STL, text clouds.


def read_plain(path: Path, data: bytes, references: References) -> AssetContent:
    """Formats with one surface, or several named solids, and no tree of nodes."""
    scene = parse_scene(path, data, references)
    named = len(scene.geometry) > 1
    surfaces = [
        NamedSurface(mesh, (name,) if named else ()) for name, mesh in surface_meshes(scene)
    ]
    return AssetContent(surfaces, cloud=None if surfaces else cloud_of(scene))


STL = Format("STL", (".stl",), read=read_plain, keeps=frozenset({Keeps.PARTS}))
TEXT_CLOUD = Format("text cloud", (".xyz",), read=read_plain)


# Carriers as assets: the surface of splats or of a density grid, the points of a cloud.


def read_carrier(path: Path, data: bytes, references: References) -> AssetContent:
    """Read splats and density grids as one closed surface, a cloud as its finite points.

    Our own archive of a density grid is metres by contract; nothing else names its unit.
    """
    if is_density(path):
        grid = read_density(path)
        surface = NamedSurface(density_surface(grid))
        cells = " × ".join(map(str, grid.density.shape))
        metres = 1.0 if path.suffix.lower() == ".npz" else None
        return AssetContent([surface], metres=metres, samples=f"a grid of {cells} cells")
    table = read_points(path)
    if table.is_splat:
        return splat_content(table, references, up="y" if path.suffix.lower() == ".spz" else "-y")
    positions = table.positions
    return AssetContent([], cloud=positions[np.isfinite(positions).all(axis=1)])


def splat_content(table: PointTable, references: References, *, up: UpAxis) -> AssetContent:
    """The surface of splats: y points down in COLMAP, whose cameras most are trained by."""
    surface, told = splat_body(table, references.pruning)
    samples = f"{len(table):,} Gaussians"
    return AssetContent([NamedSurface(surface)], up_guess=up, samples=samples, warnings=tuple(told))


_SPLATS, _CLOUDS = (".splat", ".spz", ".ksplat"), (".pcd", ".las", ".laz")
_GRIDS = (".npz", ".nvdb", ".ingp", ".msgpack", ".pt", ".pth", ".ckpt", ".safetensors")
CARRIER = Format("splats, cloud or density grid", (*_SPLATS, *_GRIDS, *_CLOUDS), read=read_carrier)


# PLY as an asset: faces, triangle strips, Gaussian splats, or points alone.


def read_ply_surface(path: Path, data: bytes, references: References) -> AssetContent:
    """PLY: faces, triangle strips, Gaussian splats, or points alone."""
    header = data[: data.find(b"end_header")]
    if b" packed_position" in header or (b" opacity" in header and b" scale_0" in header):
        return read_carrier(path, data, references)
    if (found := binary_strips(path, data)) is not None:
        return AssetContent([NamedSurface(mesh) for mesh in _triangles(path, *found)])
    scene = parse_scene(path, data, references)
    surfaces = [NamedSurface(mesh) for _, mesh in surface_meshes(scene)]
    if not surfaces:
        # A text PLY's element ``tristrips``, which trimesh reads and leaves aside
        for geometry in scene.geometry.values():
            raw = geometry.metadata.get("_ply_raw", {}).get("tristrips", {}).get("data")
            if raw is not None:
                (columns,) = raw.values() if isinstance(raw, dict) else [raw[raw.dtype.names[0]]]
                rows = [np.ravel(row).astype(np.int64) for row in columns]
                meshes = _triangles(path, geometry.vertices, rows)
                surfaces += [NamedSurface(mesh) for mesh in meshes]
    return AssetContent(surfaces, cloud=None if surfaces else cloud_of(scene))


PLY_SURFACE = Format("PLY surface, splats or cloud", (".ply",), read=read_ply_surface)


def _triangles(
    path: Path, points: np.ndarray, rows: Sequence[np.ndarray]
) -> Iterator[trimesh.Trimesh]:
    """One surface of all strips, if there are any; -1 ends a strip within a row."""
    import trimesh

    parts = [part for row in rows for part in np.split(row, np.flatnonzero(row < 0))]
    strips = [strip for part in parts if len(strip := part[part >= 0]) > 2]
    if strips and max(map(np.max, strips)) >= len(points):
        raise InputError(f"{path}: a triangle strip names a vertex that is not there")
    if strips:
        faces = trimesh.util.triangle_strips_to_faces(strips)
        yield trimesh.Trimesh(points, faces, process=False)


# Triangle strips of a binary PLY, in lists of any lengths: trimesh reads only lists of one.

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip


class Strips(NamedTuple):
    """``points`` (n, 3) in the file's unit, and strips of their numbers, which -1 may divide."""

    points: np.ndarray
    rows: list[np.ndarray]


class _Element(NamedTuple):
    """An element of the header: its rows, its plain columns, or the two types of its list."""

    name: str
    count: int
    columns: list[tuple[str, str]]
    listed: tuple[str, str] | None


def binary_strips(path: Path, data: bytes) -> Strips | None:
    """Read the vertices and strips of a binary PLY; None of other files.

    Raises InputError: Where the file is cut short, or an element before the strips has lists.
    """
    header, _, body = data.partition(b"end_header")
    order = re.search(rb"format binary_(little|big)_endian", header)
    if order is None or b"element tristrips" not in header:
        return None
    body = body[body.index(b"\n") + 1 :]
    points, at = np.zeros((0, 3)), 0
    for element in _elements(header.decode("ascii", "replace"), "<>"[order[1] == b"big"]):
        if element.name == "tristrips" and element.listed:
            return Strips(points, _lists(path, element, body, at))
        if element.listed:
            break
        dtype = np.dtype(element.columns)
        if at + element.count * dtype.itemsize > len(body):
            raise InputError(f"{path}: ends before its {element.count} {element.name} elements do")
        table = np.frombuffer(body, dtype, element.count, at)
        if element.name == "vertex":
            points = np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)
        at += element.count * dtype.itemsize
    raise InputError(f"{path}: has lists before its triangle strips: export it with faces")


def _elements(header: str, order: str) -> list[_Element]:
    found: list[_Element] = []
    for words in map(str.split, header.splitlines()):
        if words[:1] == ["element"]:
            found.append(_Element(words[1], int(words[2]), [], None))
        elif words[:2] == ["property", "list"]:
            types = order + TYPES[words[2]], order + TYPES[words[3]]
            found[-1] = found[-1]._replace(listed=types)
        elif words[:1] == ["property"]:
            found[-1].columns.append((words[2], order + TYPES[words[1]]))
    return found


def _lists(path: Path, element: _Element, body: bytes, at: int) -> list[np.ndarray]:
    assert element.listed is not None
    length, value = map(np.dtype, element.listed)
    rows = []
    for _ in range(element.count):
        size = int(np.frombuffer(body[at : at + length.itemsize].ljust(length.itemsize), length)[0])
        at += length.itemsize
        if size < 0 or at + size * value.itemsize > len(body):
            raise InputError(f"{path}: ends before its triangle strips do")
        rows.append(np.frombuffer(body, value, size, at).astype(np.int64))
        at += size * value.itemsize
    return rows
