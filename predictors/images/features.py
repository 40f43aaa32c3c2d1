"""The features of an asset: seen, lifted onto voxels, filled inside; and what its names say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..asset import Asset
from ..encoders import ImageEncoder, load_encoder
from ..encoders.protocol import Encoder
from ..grid import Grid
from ..voxels import PartVoxels
from .cameras import PIXELS, hemisphere
from .filling import fill, nearest_known
from .lifting import Method, lift
from .names import name_embeddings
from .surface_voxels import opaque_density, surface_voxels
from .views import Views, render_views

VIEWS, LOWER = 15, 0  # AutoPhyX 3.3: the upper hemisphere


@dataclass(frozen=True, eq=False)
class VoxelFeatures:
    """Features of the occupied cells of a grid.

    ``cells`` (n, 3) are their indices in C order; ``values`` (n, D) the features, of the nearest
    seen cell where a cell is inside or hidden; ``surface`` and ``seen`` (n,) say which cells those
    are not; ``part`` (n,) indexes ``part_names`` and ``names`` (parts, T), the embedding of what
    the asset calls each part, or None if the encoder reads no words. ``residual`` is the relative
    error with which the seen cells explain the pictures, ``encoder`` who made the features.
    """

    grid: Grid
    cells: Int[np.ndarray, "n 3"]
    values: Float[np.ndarray, "n D"]
    surface: Bool[np.ndarray, "n"]
    seen: Bool[np.ndarray, "n"]
    part: Int[np.ndarray, "n"]
    part_names: tuple[str, ...]
    names: Float[np.ndarray, "parts T"] | None
    residual: float
    encoder: str

    @property
    def occupied(self) -> Bool[np.ndarray, "nx ny nz"]:
        """Which cells of the grid have a feature."""
        out = np.zeros(self.grid.shape, dtype=bool)
        out[tuple(self.cells.T)] = True
        return out

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything as named arrays, values and names in half precision; ``of`` reads them."""
        out = {name: getattr(self, name) for name in ("cells", "surface", "seen", "part")}
        if self.names is not None:
            out["names"] = self.names.astype(np.float16)
        return out | {
            "values": self.values.astype(np.float16),
            "part_names": np.array(self.part_names, dtype=str),
            "origin": self.grid.lo,
            "spacing": np.array(self.grid.h),
            "shape": np.array(self.grid.shape),
            "residual": np.array(self.residual),
            "encoder": np.array(self.encoder),
        }

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> VoxelFeatures:
        """Features from their ``arrays``."""
        nx, ny, nz = (int(n) for n in arrays["shape"])
        names = arrays.get("names")
        return cls(
            grid=Grid(arrays["origin"], float(arrays["spacing"]), (nx, ny, nz)),
            values=arrays["values"].astype(np.float32),
            part_names=tuple(str(name) for name in arrays["part_names"]),
            names=None if names is None else names.astype(np.float32),
            residual=float(arrays["residual"]),
            encoder=str(arrays["encoder"]),
            **{name: arrays[name] for name in ("cells", "surface", "seen", "part")},
        )

    def picture(self) -> Float[np.ndarray, "n 3"]:
        """Colours in [0, 1] of the cells: the first three principal components, for the eye."""
        centered = self.values - self.values.mean(axis=0)
        _, axes = np.linalg.eigh(centered.T @ centered)
        shown = centered @ axes[:, ::-1][:, :3]
        if shown.shape[1] < 3:
            shown = np.repeat(shown[:, :1], 3, axis=1)
        low, high = np.percentile(shown, [2, 98], axis=0)
        return np.clip((shown - low) / np.maximum(high - low, 1e-9), 0, 1)


def features(
    asset: Asset,
    *,
    encoder: ImageEncoder | str = "embedded",
    cells: int = 64,
    views: int = VIEWS,
    lower: int = LOWER,
    pixels: int = PIXELS,
    method: Method = "solve",
) -> VoxelFeatures:
    """Return the features of every cell that an asset occupies.

    Parameters
    ----------
    asset
        The asset, in metres.
    encoder
        Encoder of the pictures, or its name.
    cells
        Cells along the asset's longest side.
    views, lower
        Cameras above and below the horizon.
    pixels
        Side of a picture.
    method
        How features are lifted; see ``lifting.lift``.
    """
    encoder = load_encoder(encoder) if isinstance(encoder, str) else encoder
    grid = Grid.around(asset.bounds, cells=cells)
    cameras = hemisphere(asset.bounds, count=views, lower=lower, up=asset.up, pixels=pixels)
    voxels = surface_voxels(asset, grid)
    density = opaque_density(voxels.occupied, grid)
    return features_of_views(
        render_views(asset, cameras), density, grid, encoder=encoder, voxels=voxels, method=method
    )


def features_of_views(
    pictures: Views,
    density: Float[np.ndarray, "nx ny nz"],
    grid: Grid,
    *,
    encoder: ImageEncoder | str = "embedded",
    voxels: PartVoxels | None = None,
    method: Method = "solve",
) -> VoxelFeatures:
    """Return features of a density [1/m] (mesh, cloud, splats, NeRF) seen by given pictures.

    ``voxels`` says which part is in every cell of the surface; None is one part without a name.
    """
    encoder = load_encoder(encoder) if isinstance(encoder, str) else encoder
    lifted = lift(
        encoder.dense(pictures.images()),
        pictures.cameras,
        density,
        grid,
        opacity=pictures.opacity,
        method=method,
    )
    surface = density > 0
    if voxels is None:
        voxels = PartVoxels(grid, np.where(surface, 0, -1), ("object",), ((),))
    cells = np.argwhere(fill(surface).occupied)
    at = tuple(cells.T)
    row, seen = np.full(grid.shape, -1), np.zeros(grid.shape, dtype=bool)
    row[surface] = np.arange(len(lifted.cells))
    seen[surface] = lifted.seen
    outer = surface[at]
    part = voxels.part[at][nearest_known(cells, outer)]
    source = nearest_known(cells, seen[at], label=part)
    says = isinstance(encoder, Encoder)
    return VoxelFeatures(
        grid=grid,
        cells=cells,
        values=lifted.values[row[at][source]],
        surface=outer,
        seen=seen[at],
        part=part,
        part_names=voxels.part_names,
        names=name_embeddings(voxels.labels, encoder) if says else None,
        residual=lifted.residual,
        encoder=encoder.name,
    )
