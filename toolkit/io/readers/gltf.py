"""glTF, text and binary: metres, +Y up, by the standard."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....converters.registry import Format, Keeps
from ....fem.errors import InputError
from ..references import References
from .asset_formats import AssetContent, NamedSurface
from .surface_scene import is_surface, mesh_material_name, node_path, parse_scene, placed

if TYPE_CHECKING:
    import trimesh


def read_gltf(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per node and material, in world coordinates."""
    document = json.loads(gltf_json(data))
    surfaces = _primitives(parse_scene(path, data, references), document)
    if not surfaces and references.warnings:
        raise InputError(f"{path}: {references.warnings[0]}")
    return AssetContent(surfaces, metres=1.0, up="y", warnings=_textures_not_read(document))


def _primitives(scene: trimesh.Scene, document: dict[str, Any]) -> list[NamedSurface]:
    """One surface per node and primitive, with the names that the file gives node and mesh.

    trimesh hangs the primitives of a mesh that has several under nodes of its own, whose names are
    drawn at random, and counts up the mesh's name for each; they come here in the file's order.
    """
    nodes, meshes = _nodes_by_name(document), document.get("meshes", [])
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
    return [surface for *_, surface in sorted(found, key=lambda entry: entry[:2])]


def _nodes_by_name(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Nodes of the file under the names that trimesh gives them: their own, counted if equal."""
    from trimesh.util import unique_name

    nodes: dict[str, dict[str, Any]] = {}
    counts: dict[str | None, int] = {}
    for number, node in enumerate(document.get("nodes", [])):
        nodes[unique_name(node.get("name", str(number)), nodes, counts=counts)] = node
    if "world" in nodes:  # the name of trimesh's own root
        nodes[unique_name("world", nodes)] = nodes["world"]
    return nodes


def gltf_json(data: bytes) -> bytes:
    """Return the JSON document of a glTF file, text or binary."""
    if data[:4] != b"glTF":
        return data
    (size,) = struct.unpack_from("<I", data, 12)
    return data[20 : 20 + size]


def _textures_not_read(document: dict[str, Any]) -> tuple[str, ...]:
    """A sentence about textures in KTX2, which no library of ours decodes."""
    images = document.get("images", [])
    names = [
        str(image.get("name") or image.get("uri") or f"image {number}")
        for number, image in enumerate(images)
        if "ktx2" in (image.get("mimeType", "") + image.get("uri", "")[-5:]).lower()
    ]
    if not names:
        return ()
    some = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    return (
        f"{len(names)} of {len(images)} textures are KTX2, which is not read ({some}): their parts "
        "have the plain colours of their materials; export the textures as PNG or JPEG",
    )


GLTF = Format(
    "glTF", (".glb", ".gltf"), read=read_gltf, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)
