"""Readers of surface files: suffix -> named triangle surfaces, the unit and the up axis."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...fem.errors import AutophyxError, InputError
from ...predictors.asset import UpAxis
from .references import References, used_materials

if TYPE_CHECKING:
    import trimesh

MAX_UNPACKED_BYTES = 2 * 2**30  # of an archive: more is a bomb or a scan
# Metres of the units that 3MF names; it means millimetres where it names none.
THREEMF_METRES = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip


class Surface(NamedTuple):
    """One piece of a file: a triangle surface and the names around it, nearest first."""

    mesh: trimesh.Trimesh
    node: tuple[str, ...] = ()
    material: str | None = None


class Content(NamedTuple):
    """What a file holds: surfaces, and metres per unit and up axis where it states them.

    ``cloud`` (n, 3) are points without triangles; ``up_guess`` is what most such files do;
    ``warnings`` are sentences for the user.
    """

    surfaces: list[Surface]
    metres: float | None = None
    up: UpAxis | None = None
    up_guess: UpAxis = "z"
    cloud: np.ndarray | None = None
    warnings: tuple[str, ...] = ()


def read(path: Path, data: bytes, references: References) -> Content:
    """Read a file by its suffix; whatever a parser stumbles over becomes one sentence."""
    suffix = path.suffix.lower()
    try:
        return READERS[suffix](path, data, references)
    except AutophyxError:
        raise
    except Exception as error:  # a parser of untrusted bytes may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise InputError(
            f"{path}: is not a valid {suffix[1:]} file ({reason}): export it again"
        ) from error


def parse(path: Path, data: bytes, references: References, **options: Any) -> trimesh.Scene:
    """Parse with trimesh, changing nothing."""
    import trimesh

    return trimesh.load_scene(
        io.BytesIO(data),
        file_type=path.suffix[1:].lower(),
        resolver=references,  # type: ignore[arg-type]
        process=False,
        **options,
    )


def read_plain(path: Path, data: bytes, references: References) -> Content:
    """Formats with one surface, or several named solids, and no tree of nodes."""
    scene = parse(path, data, references)
    named = len(scene.geometry) > 1
    surfaces = [Surface(mesh, (name,) if named else ()) for name, mesh in meshes(scene)]
    return Content(surfaces, cloud=None if surfaces else _cloud(scene))


def read_ply(path: Path, data: bytes, references: References) -> Content:
    """PLY: faces, triangle strips, Gaussian splats, or points alone."""
    if _is_splat(data):
        return read_carrier(path, data, references)
    scene = parse(path, data, references)
    surfaces = [Surface(mesh) for _, mesh in meshes(scene)]
    if not surfaces:
        surfaces = [Surface(mesh) for g in scene.geometry.values() for mesh in _strips(path, g)]
    return Content(surfaces, cloud=None if surfaces else _cloud(scene))


def read_carrier(path: Path, data: bytes, references: References) -> Content:
    """Gaussian splats, density grids and clouds with columns: see ``volumes``."""
    from .volumes import read_volume

    return read_volume(path)


def _is_splat(data: bytes) -> bool:
    """Whether a PLY's header names the columns of Gaussians, plain or packed."""
    header = data[: data.find(b"end_header")]
    return b" packed_position" in header or (b" opacity" in header and b" scale_0" in header)


def read_obj(path: Path, data: bytes, references: References) -> Content:
    """OBJ: one surface per object (or group, where there are no objects) and material."""
    text = absolute_indices(data.decode(errors="replace"))
    references.materials = used_materials(text)
    objects = re.search(r"^o[ \t]+\S", text, flags=re.MULTILINE) is not None
    scene = parse(
        path,
        text.encode(),
        references,
        group_material=True,
        split_objects=objects,
        split_groups=not objects,
    )
    surfaces = []
    for name, mesh in meshes(scene):
        material = _material_name(mesh)
        surfaces.append(Surface(mesh, (name.removesuffix(f"_{material}"),), material))
    return Content(surfaces, up_guess="y", cloud=None if surfaces else _cloud(scene))


def read_off(path: Path, data: bytes, references: References) -> Content:
    """OFF with polygons of any size and per-face colours, which trimesh stumbles over."""
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
    triangles = _fans(corners)
    mesh = trimesh.Trimesh(points.reshape(-1, 3), triangles, process=False, validate=False)
    return Content([Surface(mesh)] if len(triangles) else [], cloud=points if len(points) else None)


def read_gltf(path: Path, data: bytes, references: References) -> Content:
    """GLTF and GLB: one surface per node and material, in world coordinates; metres, +Y up."""
    surfaces = _nodes(parse(path, data, references))
    if not surfaces and references.warnings:
        raise InputError(f"{path}: {references.warnings[0]}")
    return Content(surfaces, metres=1.0, up="y")


def read_3mf(path: Path, data: bytes, references: References) -> Content:
    """3MF: one surface per object of the build; the unit is in the model, +Z up by the standard."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        models = [m for m in archive.infolist() if m.filename.lower().endswith(".model")]
        if sum(member.file_size for member in archive.infolist()) > MAX_UNPACKED_BYTES:
            raise InputError(f"{path}: unpacks to more than {MAX_UNPACKED_BYTES} bytes")
        texts = [archive.read(model) for model in models]
    for text in texts:
        _refuse_entities(path, text)
    unit = re.search(rb"<model[^>]*\bunit=[\"'](\w+)", b"".join(texts))
    metres = THREEMF_METRES.get(unit.group(1).decode().lower() if unit else "millimeter")
    return Content(_nodes(parse(path, data, references)), metres=metres, up="z")


def read_dae(path: Path, data: bytes, references: References) -> Content:
    """COLLADA: one surface per node and material; unit and up axis are in the file."""
    _refuse_entities(path, data)
    unit = re.search(rb"<unit[^>]*\bmeter=[\"']([\d.eE+-]+)", data)
    axis = re.search(rb"<up_axis>\s*([XYZ])_UP", data)
    return Content(
        _nodes(parse(path, data, references)),
        metres=float(unit.group(1)) if unit else 1.0,
        up=axis.group(1).decode().lower() if axis else "y",  # type: ignore[arg-type]
    )


def _refuse_entities(path: Path, text: bytes) -> None:
    """No XML entities: they can read files and grow without bound."""
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError(f"{path}: declares XML entities, which are not read: export it again")


def meshes(scene: trimesh.Scene) -> list[tuple[str, trimesh.Trimesh]]:
    """Surfaces of a scene by name."""
    return [(name, mesh) for name, mesh in scene.geometry.items() if _is_surface(mesh)]


def _nodes(scene: trimesh.Scene) -> list[Surface]:
    """One surface per node that shows a mesh, where its node puts it."""
    surfaces = []
    for node in sorted(scene.graph.nodes_geometry):
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if _is_surface(mesh):
            mesh = mesh.copy()
            mesh.apply_transform(transform)
            names = _ancestry(scene, node, str(geometry))
            surfaces.append(Surface(mesh, names, _material_name(mesh)))
    return surfaces


def _is_surface(geometry: Any) -> bool:
    return getattr(geometry, "faces", None) is not None and len(geometry.faces) > 0


def _material_name(mesh: trimesh.Trimesh) -> str | None:
    return getattr(getattr(mesh.visual, "material", None), "name", None)


def _ancestry(scene: trimesh.Scene, node: str, geometry: str) -> tuple[str, ...]:
    """Names of a node, of its mesh and of the nodes above it, nearest first."""
    parents = scene.graph.transforms.parents
    names = [node, geometry]
    while node in parents:
        node = parents[node]
        names.append(node)
    return tuple(names)


def _cloud(scene: trimesh.Scene) -> np.ndarray | None:
    """All points of a scene without triangles."""
    points = [np.asarray(g.vertices, np.float64) for g in scene.geometry.values()]
    return np.concatenate(points) if points and sum(map(len, points)) else None


def _strips(path: Path, geometry: Any) -> Iterable[trimesh.Trimesh]:
    """Triangles of a PLY element ``tristrips``, which trimesh reads and leaves aside."""
    import trimesh

    raw = geometry.metadata.get("_ply_raw", {}).get("tristrips", {}).get("data")
    if raw is None:
        return
    (columns,) = raw.values() if isinstance(raw, dict) else [raw[raw.dtype.names[0]]]
    flat = np.concatenate([np.ravel(row) for row in columns]).astype(np.int64)
    strips = [s[s >= 0] for s in np.split(flat, np.flatnonzero(flat < 0))]
    strips = [strip for strip in strips if len(strip) > 2]
    if strips and max(map(np.max, strips)) >= len(geometry.vertices):
        raise InputError(f"{path}: a triangle strip names a vertex that is not there")
    if strips:
        faces = trimesh.util.triangle_strips_to_faces(strips)
        yield trimesh.Trimesh(geometry.vertices, faces, process=False)


def _fans(polygons: list[list[int]]) -> np.ndarray:
    """Triangles (n, 3) that fan out from the first corner of each polygon."""
    triangles = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


_COUNTED_LINE = re.compile(r"^(?:v|vt|vn|f)[ \t].*$", flags=re.MULTILINE)


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
        return " ".join(["f", *(_absolute_corner(corner, count) for corner in rest)])

    return _COUNTED_LINE.sub(absolute, text)


def _absolute_corner(corner: str, count: dict[str, int]) -> str:
    pairs = zip(corner.split("/"), count.values(), strict=False)
    return "/".join(str(n + 1 + int(i)) if i.startswith("-") else i for i, n in pairs)


Reader = Callable[[Path, bytes, References], Content]

CARRIERS = (
    ".splat",
    ".spz",
    ".ksplat",
    ".npz",
    ".nvdb",
    ".ingp",
    ".msgpack",
    ".pcd",
    ".las",
    ".laz",
)
READERS: dict[str, Reader] = {
    ".obj": read_obj,
    ".ply": read_ply,
    ".stl": read_plain,
    ".off": read_off,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".3mf": read_3mf,
    ".dae": read_dae,
    ".xyz": read_plain,
    **dict.fromkeys(CARRIERS, read_carrier),
}
