"""What is seen of an asset, on the voxels of its mesh: colours, and features of pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ..predictors.asset import Asset
from ..predictors.encoders import speaking_encoder
from ..predictors.images.appearance import Appearance
from ..predictors.images.cell_looks import cell_looks
from ..predictors.matter.looks import LOOK
from ..predictors.voxels import PartVoxels
from .features import features
from .options import FeatureOptions

if TYPE_CHECKING:
    from ..predictors.images.features import VoxelFeatures

VIEWS, CELLS = 8, 32  # as the network's evidence was measured; more bound no more voxels right


def appearance_of(asset: Asset, voxels: PartVoxels, *, encoder: str | None = None) -> Appearance:
    """Look at an asset: the colours of its surface, and what an image encoder sees if one is named.

    The asset lies where its mesh does, in metres.
    """
    looks = _looks(asset, voxels)
    seen = Appearance(looks[..., :3], finish=looks[..., 3:])
    if encoder is None:
        return seen
    options = FeatureOptions(encoder=encoder, views=VIEWS, cells=CELLS)
    words = speaking_encoder(encoder)
    pictured = features(asset, options=options).voxels
    return replace(seen, features=_features(pictured, voxels), words=words)


def _looks(asset: Asset, voxels: PartVoxels) -> Float[np.ndarray, "nx ny nz 7"]:
    """Look of the nearest surface, of every occupied cell."""
    occupied = voxels.occupied
    out = np.zeros((*occupied.shape, LOOK), dtype=np.float32)
    out[occupied] = cell_looks(asset, voxels.grid.centers()[occupied])
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
