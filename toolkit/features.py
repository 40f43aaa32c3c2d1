"""The verb `features`: what an asset looks like, per voxel, in one .npz and one picture."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..converters.npz import load_npz, save_npz
from ..fem.errors import InputError
from ..predictors.asset import Asset
from ..predictors.encoders import ImageEncoder, load_encoder
from ..predictors.features import VoxelFeatures, features_of_views
from ..predictors.features import features as features_of
from .options import FeatureOptions
from .outputs import check_file

log = logging.getLogger(__name__)

MAX_FILES = 64  # of the cache, a few megabytes each; what was not used for longest goes first
# The packages that compute the result: another version of one of them is another result.
PACKAGES = ("autophyx-tet", "numpy", "scipy", "torch", "embreex")


@dataclass(frozen=True, eq=False)
class Features:
    """Features of an asset's voxels, and the files they were written to.

    ``asset`` is None where photographs were given.
    """

    asset: Asset | None
    voxels: VoxelFeatures
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
            "warnings": self.asset.warnings if self.asset else (),
        }


def features(
    asset: str | Path | Asset,
    *,
    output: Path | None = None,
    options: FeatureOptions | None = None,
) -> Features:
    """See an asset from a hemisphere of cameras and lift what an encoder sees onto its voxels.

    Parameters
    ----------
    asset
        A surface, or a ``transforms.json`` of photographs with their cameras: then a small radiance
        field is fitted to them for the density.
    output
        The .npz to write.
    options
        How the asset is looked at, what is drawn and what is remembered.

    Raises
    ------
    InputError
        Where the asset cannot be read, an output not written, or the encoder's weights are absent.
    """
    from .load import load_asset

    options = options or FeatureOptions()
    picture = options.picture
    for path, suffix in ((output, ".npz"), (picture, ".png")):
        if path is not None:
            check_file(path, (suffix,))
    encoder = load_encoder(options.encoder)
    if isinstance(asset, str | Path) and Path(asset).suffix.lower() == ".json":
        seen, voxels = None, _photographed(Path(asset), encoder, options)
    else:
        seen = asset if isinstance(asset, Asset) else load_asset(asset)
        voxels = _remembered(seen, encoder, options)
    if output is not None:
        save_npz(output, **voxels.arrays())
    if picture is not None:
        from .feature_picture import feature_png

        feature_png(picture, voxels, seen)
    return Features(seen, voxels, tuple(path for path in (output, picture) if path is not None))


def _photographed(path: Path, encoder: ImageEncoder, options: FeatureOptions) -> VoxelFeatures:
    """Features of photographs, on the cells of a radiance field fitted to them."""
    from ..predictors.radiance import fit_radiance
    from ..predictors.views import load_photographs

    views = load_photographs(path)
    field = fit_radiance(views, cells=options.cells)
    log.info("radiance field: colour error %.3f", field.error)
    return features_of_views(views, field.density, field.grid, encoder=encoder)


def _remembered(asset: Asset, encoder: ImageEncoder, options: FeatureOptions) -> VoxelFeatures:
    """Features of an asset, from the cache if they were made before."""
    folder = options.memory if asset.source_hash is not None else None
    path = None if folder is None else folder / f"{_key(asset, encoder, options)}.npz"
    if path is not None and (known := _recalled(path)) is not None:
        return known
    made = features_of(
        asset, encoder=encoder, cells=options.cells, views=options.views, lower=options.lower
    ).arrays()
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_npz(path, **made)
        _prune(path.parent)
    return VoxelFeatures.of(made)  # in half precision, as from the cache


def _recalled(path: Path) -> VoxelFeatures | None:
    """Remembered features; a file that cannot be read is made again."""
    if not path.exists():
        return None
    try:
        arrays = load_npz(path)
    except InputError as error:
        log.warning("%s is damaged and is made again: %s", path, error)
        return None
    path.touch()
    log.info("from the cache: %s", path.name)
    return VoxelFeatures.of(arrays)


def _key(asset: Asset, encoder: ImageEncoder, options: FeatureOptions) -> str:
    """SHA-256 of all that the features depend on."""
    seen: Mapping[str, Any] = {
        "asset": asset.source_hash,
        "parts": asset.part_names,
        "placed": [asset.metres_per_unit, asset.up, asset.bounds.tolist()],
        "encoder": encoder.name,
        "options": [options.cells, options.views, options.lower],
        "packages": {name: version(name) for name in PACKAGES},
    }
    return hashlib.sha256(json.dumps(seen, sort_keys=True, default=str).encode()).hexdigest()


def _prune(folder: Path) -> None:
    """Forget what has not been used for longest."""
    files = sorted(folder.glob("*.npz"), key=lambda path: path.stat().st_mtime, reverse=True)
    for path in files[MAX_FILES:]:
        path.unlink(missing_ok=True)
