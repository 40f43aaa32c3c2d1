"""OBJ: objects or groups by material, indices that count back made absolute."""

from __future__ import annotations

import re
from pathlib import Path

from ....converters.registry import Format, Keeps
from ..references import References, used_materials
from .asset_formats import AssetContent, NamedSurface
from .surface_scene import cloud_of, mesh_material_name, parse_scene, surface_meshes

_COUNTED_LINE = re.compile(r"^(?:v|vt|vn|f)[ \t].*$", flags=re.MULTILINE)


def read_obj(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface per object (or group, where there are no objects) and material."""
    text = absolute_indices(data.decode(errors="replace"))
    references.materials = used_materials(text)
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
        return " ".join(["f", *(_absolute_corner(corner, count) for corner in rest)])

    return _COUNTED_LINE.sub(absolute, text)


def _absolute_corner(corner: str, count: dict[str, int]) -> str:
    pairs = zip(corner.split("/"), count.values(), strict=False)
    return "/".join(str(n + 1 + int(i)) if i.startswith("-") else i for i, n in pairs)
