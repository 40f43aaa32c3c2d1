"""The verb `features`: what an asset looks like, per voxel, in one .npz and one picture."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..converters.grids import DensityGrid, read_density
from ..converters.npz import save_npz
from ..converters.points.gaussians import SH_C0, Gaussians, gaussians
from ..converters.points.table import PointTable, read_points
from ..converters.points.views import opacity_grid
from ..converters.registry import GRID_FORMATS, POINT_FORMATS
from ..converters.transfer import is_density
from ..fem.errors import InputError
from ..predictors.appearance.features import (
    Appearance,
    VoxelFeatures,
    cell_appearance,
    features_of_views,
    matter_bounds,
    render_grid,
)
from ..predictors.appearance.features import features as features_of
from ..predictors.appearance.segmentation import Segmentation, best_segmentation
from ..predictors.appearance.surface import GREY, OPAQUE, density_of_points
from ..predictors.appearance.views import hemisphere, load_photographs
from ..predictors.asset import Asset
from ..predictors.encoders import ImageEncoder, load_encoder, speaking_encoder
from ..predictors.grid import Grid, PartVoxels
from ..predictors.matter import LOOK
from .asset import path_of
from .asset.cache import digest, recalled, remember
from .asset.document import check_file
from .asset.triangles import Places
from .options import FeatureOptions, with_given

FAINT = 0.1  # opacity below which a splat is haze, no part of the object
SOLID = 0.3  # opacity from which a cell is matter, as in a fitted radiance field
GAP = 3.0  # cell over the distance of neighbouring points: 1 in 5,000 of them stays empty then
SPARSE = 95  # percentile of that distance: the rest are strays
_HEAD_BYTES = 1 << 16  # of a PLY header
_TRIANGLES = re.compile(rb"element\s+(face|tristrips)\s+[1-9]")


class ColouredGrid(NamedTuple):
    """Density [1/m] (nx, ny, nz) and colour (nx, ny, nz, 3), sRGB in [0, 1], of cells."""

    density: Float[np.ndarray, "nx ny nz"]
    colour: Float[np.ndarray, "nx ny nz 3"]
    grid: Grid


def is_carrier(path: Path) -> bool:
    """Whether a file holds splats, points without triangles, or a density grid."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        if not path.is_file():
            return True  # its reader says so
        with path.open("rb") as file:
            return not _TRIANGLES.search(file.read(_HEAD_BYTES).partition(b"end_header")[0])
    return suffix in POINT_FORMATS or suffix in GRID_FORMATS


def read_coloured_grid(path: Path, *, cells: int) -> ColouredGrid:
    """Read a carrier onto a grid of at most ``cells`` along its longest side.

    Lengths are taken as metres. Clouds that are sparser than that get larger cells.
    """
    if is_density(path):
        # Cells above the field's threshold that stop light; it has the colour of its own fields
        source = read_density(path)
        grid = Grid.around(source.occupied_box(), cells=cells)
        density = source.on_grid(grid)
        solid = (density > source.threshold) & (-np.expm1(-density * grid.h) >= SOLID)
        fields = [source.fields.get(name) for name in ("red", "green", "blue")]
        colour = np.broadcast_to(GREY[:3].astype(np.float64), (*grid.shape, 3))
        if all(values is not None for values in fields):
            shown = [
                DensityGrid(source.lo, source.hi, np.asarray(v, np.float64)).on_grid(grid)
                for v in fields
            ]
            colour = np.stack(shown, axis=-1).clip(0, 1)
        return _checked(ColouredGrid(np.where(solid, density, 0.0), colour, grid))
    table = read_points(path)
    return _of_splats(table, cells) if table.is_splat else _of_cloud(table, cells)


def _of_splats(table: PointTable, cells: int) -> ColouredGrid:
    """A cell's opacity is the summed one of the splats there, its colour their weighted mean."""
    splats = gaussians(table)
    keep = (splats.opacity > FAINT) & np.isfinite(splats.means).all(axis=1)
    if not keep.any():
        raise InputError(f"none of {len(table)} splats has an opacity above {FAINT:g}")
    splats = Gaussians(*(values[keep] for values in splats))
    base = np.stack([table.columns[f"f_dc_{i}"][keep].astype(np.float64) for i in range(3)], axis=1)
    colours = (0.5 + SH_C0 * base).clip(0, 1)
    grid = Grid.around(_bounds(splats.means), cells=cells)
    cover = opacity_grid(splats, grid)
    sums = [
        opacity_grid(splats._replace(opacity=splats.opacity * channel), grid)
        for channel in colours.T
    ]
    weight = np.maximum(cover, np.finfo(float).tiny)
    colour = np.stack(sums, axis=-1) / np.expand_dims(weight, -1)
    opacity = np.minimum(cover, 1 - np.exp(-OPAQUE))
    depth = np.where(opacity >= SOLID, -np.log1p(-opacity), 0.0)
    return _checked(ColouredGrid(depth / grid.h, colour.clip(0, 1), grid))


def _of_cloud(table: PointTable, cells: int) -> ColouredGrid:
    """Cells that hold a point are opaque and have the mean colour of their points."""
    from scipy.spatial import KDTree

    keep = np.asarray(np.isfinite(table.positions).all(axis=1))
    points = table.positions[keep]
    if len(points) < 2:
        raise InputError(f"a cloud of {len(points)} finite points has no features: 2 are the least")
    bounds = _bounds(points)
    apart = float(np.percentile(KDTree(points).query(points, k=2)[0][:, 1], SPARSE))
    finest = float(np.ptp(bounds, axis=0).max()) / max(GAP * apart, np.finfo(float).tiny)
    grid = Grid.around(bounds, cells=int(np.clip(finest, 1, cells)))
    density = density_of_points(points, grid)
    flat = np.ravel_multi_index(tuple(grid.cell_of(points).T), grid.shape)
    count = np.maximum(np.bincount(flat, minlength=density.size), 1)
    columns = [table.columns.get(name) for name in ("red", "green", "blue")]
    colours = np.tile(GREY[:3].astype(np.float64), (len(points), 1))
    if all(column is not None for column in columns):
        colours = np.stack([np.asarray(column)[keep] for column in columns], axis=1)
        whole = np.iinfo(colours.dtype).max if colours.dtype.kind in "ui" else 1
        colours = (colours / whole).astype(np.float64).clip(0, 1)
    sums = [np.bincount(flat, c, density.size) for c in colours.T]
    colour = (np.stack(sums, axis=-1) / count[:, None]).reshape(*grid.shape, 3)
    return ColouredGrid(density, colour, grid)


def _checked(coloured: ColouredGrid) -> ColouredGrid:
    if not coloured.density.any():
        raise InputError(f"no cell of {coloured.grid.h:g} m stops {SOLID:.0%} of the light")
    return coloured


def _bounds(points: Places) -> Float[np.ndarray, "2 3"]:
    return np.stack([points.min(axis=0), points.max(axis=0)])


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
    from ..predictors.appearance.radiance import fit_radiance
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
