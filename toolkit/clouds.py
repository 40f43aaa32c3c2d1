"""Point clouds: a surface through points that came without triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..fem.errors import InputError
from .child import ChildFailure, run_guarded
from .readers import Content, Surface

FEWEST, MOST = 100, 2_000_000  # points: fewer say nothing about a surface, more need no more detail
DEPTH = 8  # of the octree: 256 cells along the longest side
NEIGHBOURS = 20  # points that a normal is fitted to
TRIM = 0.01  # share of the surface's vertices with the fewest points around them that is cut away
TIME_LIMIT = 300.0  # s
# Of the size: points exactly on one sphere have no Delaunay triangulation to orient normals along.
JOGGLE = 1e-7


def reconstructed(path: Path, content: Content) -> Content:
    """Replace a cloud by the surface through it, by screened Poisson reconstruction."""
    import trimesh

    cloud = np.unique(np.asarray(content.cloud, np.float64), axis=0)
    if not np.isfinite(cloud).all():
        raise InputError(f"{path}: its points have coordinates that are not finite")
    if not FEWEST <= len(cloud) <= MOST:
        raise InputError(
            f"{path}: holds no triangle, and {len(cloud)} different points: wanted triangles, or a "
            f"cloud of {FEWEST} to {MOST} points on a surface"
        )
    lo, size = cloud.min(axis=0), float(np.ptp(cloud, axis=0).max())
    joggle = np.random.default_rng(0).uniform(-JOGGLE, JOGGLE, cloud.shape)
    try:
        surface = run_guarded(
            "poisson",
            {"points": (cloud - lo) / size + joggle},
            {"depth": DEPTH, "neighbours": NEIGHBOURS, "trim": TRIM},
            time_limit=TIME_LIMIT,
        )
    except ChildFailure as failure:
        raise InputError(
            f"{path}: no surface through its {len(cloud)} points: {failure}"
        ) from failure
    if not len(surface["faces"]):
        raise InputError(f"{path}: no surface through its {len(cloud)} points")
    mesh = trimesh.Trimesh(surface["points"] * size + lo, surface["faces"], process=False)
    return content._replace(surfaces=[Surface(mesh)])
