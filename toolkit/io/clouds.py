"""Point clouds: a surface through points that came without triangles."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError, NoVolumeError
from ..native.child import ChildFailure, run_guarded
from .readers.asset_formats import AssetContent, NamedSurface

if TYPE_CHECKING:
    import trimesh

FEWEST, MOST = 100, 2_000_000  # points: fewer say nothing about a surface, more need no more detail
DEPTH = 8  # of the octree: 256 cells along the longest side
NEIGHBOURS = 20  # points that a normal is fitted to
TRIM = 0.01  # share of the surface's vertices with the fewest points around them that is cut away
TIME_LIMIT = 300.0  # s
# Surface farther from all points than this many times their spacing there is a guess. Clouds of
# whole bodies have none of it; of a half ball's surface, closed, the lid is a third.
FAR, SPACING_NEIGHBOUR = 3.0, 6
GUESS_TOLD, GUESS_MOST = 0.05, 0.4  # shares of the area: said as a warning, refused
# Of the size: points exactly on one sphere have no Delaunay triangulation to orient normals along.
JOGGLE = 1e-7


def reconstructed(path: Path, content: AssetContent) -> AssetContent:
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
    guess = guessed_share(mesh, cloud)
    if guess > GUESS_MOST:
        raise NoVolumeError(
            f"{path}: its {len(cloud)} points cover no closed surface: {guess:.0%} of the one "
            f"through them would be a guess, wanted at most {GUESS_MOST:.0%}; scan all sides, or "
            "close the surface in a modeller"
        )
    told = f"{guess:.0%} of the surface through the {len(cloud)} points is a guess: none is near"
    return content._replace(
        surfaces=[NamedSurface(mesh)],
        samples=f"{len(cloud):,} points",
        warnings=(*content.warnings, *([told] if guess > GUESS_TOLD else [])),
    )


def guessed_share(mesh: trimesh.Trimesh, cloud: Float[np.ndarray, "n 3"]) -> float:
    """Share of a surface's area that lies far from all points, by their spacing there."""
    from scipy.spatial import KDTree

    tree = KDTree(cloud)
    spacing = tree.query(cloud, k=SPACING_NEIGHBOUR + 1)[0][:, -1]
    spacing = np.maximum(spacing, np.median(spacing))
    distance, nearest = tree.query(mesh.triangles_center)
    far = distance > FAR * spacing[nearest]
    return float(mesh.area_faces[far].sum() / mesh.area)
