"""PLY as an asset: faces, triangle strips, Gaussian splats, or points alone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....converters.registry import Format
from ....fem.errors import InputError
from ..references import References
from .asset_formats import AssetContent, NamedSurface
from .carrier import read_carrier
from .surface_scene import cloud_of, parse_scene, surface_meshes

if TYPE_CHECKING:
    import trimesh


def read_ply_surface(path: Path, data: bytes, references: References) -> AssetContent:
    """PLY: faces, triangle strips, Gaussian splats, or points alone."""
    if _is_splat(data):
        return read_carrier(path, data, references)
    scene = parse_scene(path, data, references)
    surfaces = [NamedSurface(mesh) for _, mesh in surface_meshes(scene)]
    if not surfaces:
        surfaces = [
            NamedSurface(mesh) for g in scene.geometry.values() for mesh in _strips(path, g)
        ]
    return AssetContent(surfaces, cloud=None if surfaces else cloud_of(scene))


PLY_SURFACE = Format("PLY surface, splats or cloud", (".ply",), read=read_ply_surface)


def _is_splat(data: bytes) -> bool:
    """Whether a PLY's header names the columns of Gaussians, plain or packed."""
    header = data[: data.find(b"end_header")]
    return b" packed_position" in header or (b" opacity" in header and b" scale_0" in header)


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
