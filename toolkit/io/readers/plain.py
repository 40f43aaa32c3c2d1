"""Formats with one surface, or several named solids, and no tree of nodes: STL, text clouds."""

from __future__ import annotations

from pathlib import Path

from ....converters.registry import Format, Keeps
from ..references import References
from .asset_formats import AssetContent, NamedSurface
from .surface_scene import cloud_of, parse_scene, surface_meshes


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
