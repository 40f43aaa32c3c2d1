"""COLLADA: unit and up axis are in the file."""

from __future__ import annotations

import re
from pathlib import Path

from ....converters.registry import Format, Keeps
from ..references import References
from .asset_formats import AssetContent
from .surface_scene import node_surfaces, parse_scene, refuse_entities


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
