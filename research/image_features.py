"""What an image encoder sees of the furniture that predictors are scored on, kept in a cache.

The cells are those of the evaluation's upright cube. What is seen of an asset whose material is to
be assigned, on the voxels of its mesh, is ``appearance``.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from jaxtyping import Float16

from ..fem.errors import AutophyxError
from ..predictors.appearance.features import VoxelFeatures
from ..predictors.appearance.features import features as features_of
from ..predictors.asset import Asset, upright
from ..predictors.encoders import Encoder
from ..toolkit.asset.cache import digest, recalled, remember
from ..toolkit.features import VIEWS
from .datasets.real import CELLS, RealObject, cube
from .datasets.shapes import EMPTY
from .evaluation.held_out import ImageFeatures

log = logging.getLogger(__name__)


def cached_image_features(
    asset: Asset, voxels: RealObject, encoder: Encoder, *, cells: int, memory: Path | None
) -> ImageFeatures | None:
    """Features on the cells of an object at half the resolution of ``cells``.

    None where nothing could be seen; ``memory`` is the folder of what was seen before.
    """
    options = {"encoder": encoder.name, "cells": cells, "views": VIEWS, "asset": asset.source_hash}
    key = digest("image_features", {"label": voxels.label, "bounds": asset.bounds}, options)
    path = memory / f"{key}.npz" if memory and asset.source_hash else None
    if path is not None and (known := recalled(path)) is not None:
        return ImageFeatures(known["cells"].astype(int), known["values"])
    try:
        features = features_of(asset, encoder=encoder, cells=cells // 2, views=VIEWS)
    except AutophyxError as error:
        log.warning("%s is judged unseen: %s", voxels.name, error)
        return None
    seen = _on_cube(features, asset, voxels, cells // 2)
    if path is not None:
        made = {"cells": seen.cells.astype(np.uint8), "values": seen.values}
        remember(path, made)
    return seen


def _on_cube(features: VoxelFeatures, asset: Asset, voxels: RealObject, half: int) -> ImageFeatures:
    """Features of the nearest cell, on the cells of the cube."""
    from scipy.spatial import KDTree

    lo, h = cube(asset)
    size = CELLS // half
    occupied = (voxels.label != EMPTY).reshape(half, size, half, size, half, size)
    cells = np.argwhere(occupied.any(axis=(1, 3, 5)))
    places = upright(features.grid.to_world(features.cells), asset.up)
    _, nearest = KDTree(places).query(lo + (cells + 0.5) * size * h)
    return ImageFeatures(cells, features.values[nearest].astype(np.float16))


def slot_features(seen: ImageFeatures, voxels: RealObject) -> Float16[np.ndarray, "slots dim"]:
    """Mean unit feature of every slot of an object; zero of one that no cell holds."""
    half = CELLS // 2
    eighths = voxels.label.reshape(half, 2, half, 2, half, 2).transpose(0, 2, 4, 1, 3, 5)
    held = eighths[tuple(seen.cells.T)].reshape(len(seen.cells), 8)
    share = np.stack([(held == slot).mean(axis=1) for slot in range(len(voxels.slots))])
    sums = share @ seen.values.astype(np.float32)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return (sums / np.where(length > 0, length, 1)).astype(np.float16)
