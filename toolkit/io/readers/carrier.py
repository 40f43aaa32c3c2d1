"""Carriers as assets: the surface of splats or of a density grid, the points of a cloud."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....converters.carriers import is_density
from ....converters.grids.density_file import read_density
from ....converters.grids.isosurface import density_surface
from ....converters.points.point_file import read_points
from ....converters.points.splats.opacity_surface import splat_surface
from ....converters.registry import Format
from ..references import References
from .asset_formats import AssetContent, NamedSurface


def read_carrier(path: Path, data: bytes, references: References) -> AssetContent:
    """Read splats and density grids as one closed surface, a cloud as its finite points.

    Our own archive of a density grid is metres by contract; nothing else names its unit.
    """
    if is_density(path):
        grid = read_density(path)
        surface = NamedSurface(density_surface(grid))
        cells = " × ".join(map(str, grid.density.shape))
        metres = 1.0 if path.suffix.lower() == ".npz" else None
        return AssetContent([surface], metres=metres, samples=f"a grid of {cells} cells")
    table = read_points(path)
    if table.is_splat:
        surface, samples = NamedSurface(splat_surface(table)), f"{len(table):,} Gaussians"
        return AssetContent([surface], samples=samples)
    positions = table.positions
    return AssetContent([], cloud=positions[np.isfinite(positions).all(axis=1)])


_SPLATS, _CLOUDS = (".splat", ".spz", ".ksplat"), (".pcd", ".las", ".laz")
_GRIDS = (".npz", ".nvdb", ".ingp", ".msgpack", ".pt", ".pth", ".ckpt", ".safetensors")
CARRIER = Format("splats, cloud or density grid", (*_SPLATS, *_GRIDS, *_CLOUDS), read=read_carrier)
