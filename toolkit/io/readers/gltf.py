"""glTF, text and binary: metres, +Y up, by the standard."""

from __future__ import annotations

import json
import struct
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
    return AssetContent(surfaces, metres=1.0, up="y", warnings=_textures_not_read(data))


def gltf_json(data: bytes) -> bytes:
    """Return the JSON document of a glTF file, text or binary."""
    if data[:4] != b"glTF":
        return data
    (size,) = struct.unpack_from("<I", data, 12)
    return data[20 : 20 + size]


def _textures_not_read(data: bytes) -> tuple[str, ...]:
    """A sentence about textures in KTX2, which no library of ours decodes."""
    images = json.loads(gltf_json(data)).get("images", [])
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
