"""What is seen of cells: colour, opacity and finish of the surface that is nearest to each."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ..asset import Asset, upright
from .surface_colour import gloss_of, skin_of
from .surface_voxels import random_points

POINTS = 50_000  # on the surface: ten for each outer cell of a cube of 64
NEAREST = 4  # points of which the mean is taken


def cell_looks(
    asset: Asset, centres: Float[np.ndarray, "n 3"], *, turned: bool = False
) -> Float[np.ndarray, "n 7"]:
    """Return red, green, blue, opacity and ``Finish`` of what lies nearest to each centre.

    The centres lie where the asset does, or, ``turned``, where it would stand upright.
    """
    from scipy.spatial import KDTree

    rng = np.random.default_rng(0)
    area = sum(float(part.mesh.area) for part in asset.parts)
    points, looks = [], []
    for part in asset.parts:
        count = max(NEAREST, round(POINTS * float(part.mesh.area) / area))
        faces, weights = random_points(part.mesh, count, rng)
        at = np.einsum("nc,nck->nk", weights, part.mesh.triangles[faces])
        points.append(upright(at, asset.up) if turned else at)
        seen = (skin_of(part.mesh)(faces, weights), gloss_of(part.mesh)(faces, weights))
        looks.append(np.concatenate(seen, axis=1))
    _, nearest = KDTree(np.concatenate(points)).query(centres, k=NEAREST)
    return np.concatenate(looks)[nearest].mean(axis=1)
