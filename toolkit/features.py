"""The verb `features`: what an asset looks like, per voxel, in one .npz and one picture."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..converters.npz import save_npz
from ..predictors.appearance.features import (
    Appearance,
    VoxelFeatures,
    cell_appearance,
    features_of_views,
)
from ..predictors.appearance.features import features as features_of
from ..predictors.appearance.segmentation import Segmentation, best_segmentation
from ..predictors.asset import Asset
from ..predictors.encoders import ImageEncoder, load_encoder, speaking_encoder
from ..predictors.grid import PartVoxels
from ..predictors.matter import LOOK
from .asset import path_of
from .asset.cache import digest, recalled, remember
from .asset.coloured_grid import is_carrier, read_coloured_grid
from .asset.document import check_file
from .options import FeatureOptions, with_given

log = logging.getLogger(__name__)

# Of the appearance, as the network's evidence was measured; more bound no more voxels right.
VIEWS, CELLS = 8, 32
# The packages that compute the result: another version of one of them is another result.
PACKAGES = ("autophyx-tet", "numpy", "scipy", "torch", "embreex")


@dataclass(frozen=True, eq=False)
class Features:
    """Features of an asset's voxels, and the files they were written to.

    ``asset`` is None where there was no surface: photographs, splats, points or a density grid.
    ``parts`` are labels of the voxels by words, if words were given.
    """

    asset: Asset | None
    voxels: VoxelFeatures
    parts: Segmentation | None = None
    files: tuple[Path, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``features --json`` prints."""
        voxels = self.voxels
        return {
            "files": self.files,
            "encoder": voxels.encoder,
            "grid": {"lo": voxels.grid.lo, "h": voxels.grid.h, "shape": voxels.grid.shape},
            "voxels": len(voxels.cells),
            "seen": int(voxels.seen.sum()),
            "channels": voxels.values.shape[1],
            "residual": voxels.residual,
            "part_names": voxels.part_names,
            "parts": None if self.parts is None else self.parts.document(),
            "warnings": self.asset.warnings if self.asset else (),
        }


def features(
    asset: str | Path | Asset,
    *,
    output: str | Path | None = None,
    options: FeatureOptions | None = None,
    **given: Any,
) -> Features:
    """See an asset from a hemisphere of cameras and lift what an encoder sees onto its voxels.

    Parameters
    ----------
    asset
        A surface; Gaussian splats, a cloud of points or a density grid, which are looked at as they
        are; or a ``transforms.json`` of photographs with their cameras: then a small radiance field
        is fitted to them for the density.
    output
        The .npz to write.
    options
        How the asset is looked at, what is drawn and what is remembered; each may be ``given`` by
        name.

    Returns
    -------
    Features
        ``voxels``: cells, values (cells, channels) [1] and the grid [m]; labels by words.

    Raises
    ------
    InputError
        Where the asset cannot be read, an output not written, or the encoder's weights are absent.
    """
    from ..predictors.appearance.features import matter_bounds, render_grid
    from ..predictors.appearance.radiance import fit_radiance
    from ..predictors.appearance.views import hemisphere, load_photographs
    from .asset.load import load_asset

    options = with_given(options or FeatureOptions(), given, verb="features").checked()
    output, picture = path_of(output), options.picture
    for path, suffix in ((output, ".npz"), (picture, ".png")):
        if path is not None:
            check_file(path, (suffix,))
    reader = speaking_encoder(options.encoder) if options.words else None
    encoder = reader or load_encoder(options.encoder)
    seen: Asset | None = None
    if isinstance(asset, str | Path) and Path(asset).suffix.lower() == ".json":
        # on the cells of a radiance field fitted to photographs
        photographs = load_photographs(Path(asset))
        field = fit_radiance(photographs, cells=options.cells)
        log.info("radiance field: colour error %.3f", field.error)
        voxels = features_of_views(photographs, field.density, field.grid, encoder=encoder)
    elif isinstance(asset, str | Path) and is_carrier(Path(asset)):
        # by pictures of the cells of splats, points or a density grid
        density, colour, grid = read_coloured_grid(Path(asset), cells=options.cells)
        box = matter_bounds(density, grid)
        cameras = hemisphere(box, count=options.views, lower=options.lower)
        views = render_grid(density, colour, grid, cameras)
        voxels = features_of_views(views, density, grid, encoder=encoder)
    else:
        seen = asset if isinstance(asset, Asset) else load_asset(asset)
        voxels = _remembered(seen, encoder, options)
    parts = None
    if reader is not None:
        sets = [[word.strip() for word in words.split(",")] for words in options.words]
        parts = best_segmentation(voxels.values, voxels.cells, sets, reader)
    if output is not None:
        labels = {} if parts is None else parts.arrays()
        save_npz(output, **voxels.arrays(), **labels)
    if picture is not None:
        from .report.picture import feature_png

        feature_png(picture, voxels, seen)
    files = tuple(path for path in (output, picture) if path is not None)
    return Features(seen, voxels, parts, files)


def _remembered(asset: Asset, encoder: ImageEncoder, options: FeatureOptions) -> VoxelFeatures:
    """Features of an asset, from the cache if they were made before."""
    path = None
    if options.memory is not None and asset.source_hash is not None:
        seen = {
            "asset": asset.source_hash,
            "parts": asset.part_names,
            "placed": [asset.metres_per_unit, asset.up],
            "encoder": encoder.name,
            "options": [options.cells, options.views, options.lower],
        }
        key = digest("features", {"bounds": asset.bounds}, seen, packages=PACKAGES)
        path = options.memory / f"{key}.npz"
    if path is not None and (known := recalled(path)) is not None:
        return VoxelFeatures.of(known)
    made = features_of(
        asset, encoder=encoder, cells=options.cells, views=options.views, lower=options.lower
    ).arrays()
    if path is not None:
        remember(path, made)
    return VoxelFeatures.of(made)  # in half precision, as from the cache


def appearance_of(asset: Asset, voxels: PartVoxels, *, encoder: str | None = None) -> Appearance:
    """Look at an asset: the colours of its surface, and what an image encoder sees if one is named.

    The asset lies where its mesh does, in metres.
    """
    # of every occupied cell, the look of the nearest surface
    occupied = voxels.occupied
    cells = voxels.grid.centers()[occupied]
    looks = np.zeros((*occupied.shape, LOOK), dtype=np.float32)
    shell = np.full(occupied.shape, -1)
    looks[occupied], shell[occupied] = cell_appearance(asset, cells)
    seen = Appearance(looks[..., :3], finish=looks[..., 3:], shell=shell)
    if encoder is None:
        return seen
    from scipy.spatial import KDTree

    words = speaking_encoder(encoder)
    options = FeatureOptions(encoder=encoder, views=VIEWS, cells=CELLS)
    pictured = features(asset, options=options).voxels
    # and the features of the nearest cell that has some
    _, nearest = KDTree(pictured.grid.to_world(pictured.cells)).query(cells)
    out = np.zeros((*occupied.shape, pictured.values.shape[1]), dtype=np.float32)
    out[occupied] = pictured.values[nearest]
    return replace(seen, features=out, words=words)
