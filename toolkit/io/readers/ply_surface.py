"""PLY as an asset: faces, triangle strips, Gaussian splats, or points alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....converters.registry import Format
from ....fem.errors import InputError
from ..references import References
from .asset_formats import AssetContent, NamedSurface
from .carrier import read_carrier
from .ply_strips import binary_strips
from .surface_scene import cloud_of, parse_scene, surface_meshes

if TYPE_CHECKING:
    import trimesh


def read_ply_surface(path: Path, data: bytes, references: References) -> AssetContent:
    """PLY: faces, triangle strips, Gaussian splats, or points alone."""
    if _is_splat(data):
        return read_carrier(path, data, references)
    if (found := binary_strips(path, data)) is not None:
        return AssetContent([NamedSurface(mesh) for mesh in _triangles(path, *found)])
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


def _strips(path: Path, geometry: Any) -> Iterator[trimesh.Trimesh]:
    """Triangles of a text PLY's element ``tristrips``, which trimesh reads and leaves aside."""
    raw = geometry.metadata.get("_ply_raw", {}).get("tristrips", {}).get("data")
    if raw is None:
        return
    (columns,) = raw.values() if isinstance(raw, dict) else [raw[raw.dtype.names[0]]]
    rows = [np.ravel(row).astype(np.int64) for row in columns]
    yield from _triangles(path, geometry.vertices, rows)


def _triangles(
    path: Path, points: np.ndarray, rows: Sequence[np.ndarray]
) -> Iterator[trimesh.Trimesh]:
    """One surface of all strips, if there are any; -1 ends a strip within a row."""
    import trimesh

    parts = [part for row in rows for part in np.split(row, np.flatnonzero(row < 0))]
    strips = [strip for part in parts if len(strip := part[part >= 0]) > 2]
    if strips and max(map(np.max, strips)) >= len(points):
        raise InputError(f"{path}: a triangle strip names a vertex that is not there")
    if strips:
        faces = trimesh.util.triangle_strips_to_faces(strips)
        yield trimesh.Trimesh(points, faces, process=False)
