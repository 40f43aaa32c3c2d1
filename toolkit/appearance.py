"""What is seen of an asset, on the voxels of its mesh: colours, and features of pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ..predictors.asset import Asset
from ..predictors.encoders import speaking_encoder
from ..predictors.images.surface_colour import skin_of
from ..predictors.images.surface_voxels import random_points
from ..predictors.predictor import Appearance
from ..predictors.voxels import PartVoxels
from .features import features
from .options import FeatureOptions

if TYPE_CHECKING:
    from ..predictors.images.features import VoxelFeatures

POINTS = 50_000  # on the surface, for the colours: ten for each outer cell of a cube of 64
NEAREST = 4  # points whose colours are averaged
VIEWS, CELLS = 8, 32  # as the network's evidence was measured; more bound no more voxels right


def appearance_of(asset: Asset, voxels: PartVoxels, *, encoder: str | None = None) -> Appearance:
    """Look at an asset: the colours of its surface, and what an image encoder sees if one is named.

    The asset lies where its mesh does, in metres.
    """
    colours = _colours(asset, voxels)
    if encoder is None:
        return Appearance(colours)
    options = FeatureOptions(encoder=encoder, views=VIEWS, cells=CELLS)
    words = speaking_encoder(encoder)
    seen = features(asset, options=options).voxels
    return Appearance(colours, _features(seen, voxels), words)


def _colours(asset: Asset, voxels: PartVoxels) -> Float[np.ndarray, "nx ny nz 3"]:
    """Colour of the nearest surface, of every occupied cell."""
    from scipy.spatial import KDTree

    rng = np.random.default_rng(0)
    area = sum(float(part.mesh.area) for part in asset.parts)
    points, colours = [], []
    for part in asset.parts:
        count = max(NEAREST, round(POINTS * float(part.mesh.area) / area))
        faces, weights = random_points(part.mesh, count, rng)
        points.append(np.einsum("nc,nck->nk", weights, part.mesh.triangles[faces]))
        colours.append(skin_of(part.mesh)(faces, weights)[:, :3])
    occupied = voxels.occupied
    tree = KDTree(np.concatenate(points))
    _, nearest = tree.query(voxels.grid.centers()[occupied], k=NEAREST)
    out = np.zeros((*occupied.shape, 3), dtype=np.float32)
    out[occupied] = np.concatenate(colours)[nearest].mean(axis=1)
    return out


def _features(seen: VoxelFeatures, voxels: PartVoxels) -> Float[np.ndarray, "nx ny nz D"]:
    """Features of the nearest cell that has some, of every occupied cell."""
    from scipy.spatial import KDTree

    occupied = voxels.occupied
    known = KDTree(seen.grid.to_world(seen.cells))
    _, nearest = known.query(voxels.grid.centers()[occupied])
    out = np.zeros((*occupied.shape, seen.values.shape[1]), dtype=np.float32)
    out[occupied] = seen.values[nearest]
    return out
