"""Carriers as assets: the closed surface of splats or of a density grid, the points of a cloud."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...converters.grids import density
from ...converters.isosurface import density_surface, splat_surface
from ...converters.points import table as points
from ...converters.transfer import is_density
from .readers import Content, Surface


def read_volume(path: Path) -> Content:
    """Splats and density grids as one closed surface, a cloud as its finite points.

    Our own archive of a density grid is metres by contract; nothing else names its unit.
    """
    if is_density(path):
        surface = density_surface(density.read_density(path))
        return Content([Surface(surface)], metres=1.0 if path.suffix.lower() == ".npz" else None)
    table = points.read_points(path)
    if table.is_splat:
        return Content([Surface(splat_surface(table))])
    positions = table.positions
    return Content([], cloud=positions[np.isfinite(positions).all(axis=1)])
