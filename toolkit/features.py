"""The verb `features`: what an asset looks like, per voxel, in one .npz."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..predictors.asset import Asset
from ..predictors.features import VoxelFeatures
from ..predictors.features import features as features_of
from .options import FeatureOptions
from .outputs import check_file


@dataclass(frozen=True, eq=False)
class Features:
    """Features of an asset's voxels, and the file they were written to."""

    asset: Asset
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
            "warnings": self.asset.warnings,
        }


def features(
    asset: str | Path | Asset, *, output: Path | None = None, options: FeatureOptions | None = None
) -> Features:
    """See an asset from a hemisphere of cameras and lift what an encoder sees onto its voxels.

    Raises
    ------
    InputError
        Where the asset cannot be read, the output not written, or the encoder's weights are absent.
    """
    from ..converters.npz import save_npz
    from ..predictors.encoders import load_encoder
    from .load import load_asset

    options = options or FeatureOptions()
    if output is not None:
        check_file(output, (".npz",))
    encoder = load_encoder(options.encoder)
    if not isinstance(asset, Asset):
        asset = load_asset(asset)
    voxels = features_of(
        asset, encoder=encoder, cells=options.cells, views=options.views, lower=options.lower
    )
    if output is None:
        return Features(asset, voxels)
    arrays = {name: getattr(voxels, name) for name in ("cells", "surface", "seen", "part")}
    if voxels.names is not None:
        arrays["names"] = voxels.names.astype(np.float16)
    save_npz(
        output,
        **arrays,
        values=voxels.values.astype(np.float16),
        part_names=np.array(voxels.part_names),
        origin=voxels.grid.lo,
        spacing=np.array(voxels.grid.h),
        shape=np.array(voxels.grid.shape),
        encoder=np.array(voxels.encoder),
    )
    return Features(asset, voxels, (output,))
