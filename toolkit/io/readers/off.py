"""OFF with polygons of any size and per-face colours, which trimesh stumbles over."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ....converters.registry import Format
from ..references import References
from .asset_formats import AssetContent, NamedSurface


def read_off(path: Path, data: bytes, references: References) -> AssetContent:
    """Read one surface, its polygons cut into fans of triangles."""
    import trimesh

    lines = [line.split("#")[0].split() for line in data.decode(errors="replace").splitlines()]
    words = [line for line in lines if line]
    if re.fullmatch(r"(ST)?C?N?4?OFF", words[0][0].upper()) is None:
        raise ValueError(f"starts with {words[0][0][:20]!r}")
    first = words[0][1:] or words.pop(1)
    vertices, faces = (int(n) for n in first[:2])
    if vertices + faces > len(words) - 1:
        raise ValueError(f"announces {vertices} vertices and {faces} faces, has fewer lines")
    points = np.array([[float(x) for x in w[:3]] for w in words[1 : vertices + 1]])
    polygons = words[vertices + 1 : vertices + faces + 1]
    if any(int(w[0]) >= len(w) for w in polygons):
        raise ValueError("a face announces more corners than it has")
    corners = [[int(i) for i in w[1 : int(w[0]) + 1]] for w in polygons]
    triangles = _fans(corners)
    mesh = trimesh.Trimesh(points.reshape(-1, 3), triangles, process=False, validate=False)
    return AssetContent(
        [NamedSurface(mesh)] if len(triangles) else [], cloud=points if len(points) else None
    )


OFF = Format("OFF", (".off",), read=read_off)


def _fans(polygons: list[list[int]]) -> np.ndarray:
    """Triangles (n, 3) that fan out from the first corner of each polygon."""
    triangles = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)
