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


def parse_scene(path: Path, data: bytes, references: References, **options: Any) -> trimesh.Scene:
    """Parse with trimesh, changing nothing."""
    import trimesh

    return trimesh.load_scene(
        io.BytesIO(data),
        file_type=path.suffix[1:].lower(),
        resolver=references,  # type: ignore[arg-type]
        process=False,
        **options,
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
            mesh = mesh.copy()
            mesh.apply_transform(transform)
            names = _ancestry(scene, node, str(geometry))
            surfaces.append(NamedSurface(mesh, names, mesh_material_name(mesh)))
    return surfaces


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


def _ancestry(scene: trimesh.Scene, node: str, geometry: str) -> tuple[str, ...]:
    """Names of a node, of its mesh and of the nodes above it, nearest first."""
    parents = scene.graph.transforms.parents
    names = [node, geometry]
    while node in parents:
        node = parents[node]
        names.append(node)
    return tuple(names)
