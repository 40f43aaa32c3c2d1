"""glTF, text and binary: metres, +Y up, by the standard."""

from __future__ import annotations

from pathlib import Path

from ....converters.registry import Format, Keeps
from ....fem.errors import InputError
from ..references import References
from .asset_formats import AssetContent
from .surface_scene import node_surfaces, parse_scene


def read_gltf(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per node and material, in world coordinates."""
    surfaces = node_surfaces(parse_scene(path, data, references))
    if not surfaces and references.warnings:
        raise InputError(f"{path}: {references.warnings[0]}")
    return AssetContent(surfaces, metres=1.0, up="y")


GLTF = Format(
    "glTF", (".glb", ".gltf"), read=read_gltf, keeps=frozenset({Keeps.UNIT, Keeps.UP, Keeps.PARTS})
)
