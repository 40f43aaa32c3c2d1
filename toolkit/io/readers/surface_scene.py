"""What trimesh reads of a file: its surfaces in their places, with the names around them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....fem.errors import InputError
from ..references import References
from .asset_formats import NamedSurface

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
    _decode_textures(scene, references)
    return scene


def _decode_textures(scene: trimesh.Scene, references: References) -> None:
    """Decode the pictures that a skin is made of, once, and let go of all others.

    An image that Pillow has only opened decodes itself in whoever first asks for a pixel, and two
    threads that ask at the same time break each other's stream.
    """
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
