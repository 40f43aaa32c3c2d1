"""How an asset looks, carried to the tets of its mesh: one of a few colours each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, UInt8

from ...fem.scene.mesh import TetMesh
from ...predictors.asset import Asset
from ...predictors.images.surface_colour import skin_of

SAMPLES = 40_000  # coloured points of the surface: one a pixel of a picture of 200 x 200
MOST = 64  # colours: what one map of the page tells apart


class Look(NamedTuple):
    """Colours as ``#rrggbb``, at most ``MOST``, and which of them each tet has, shape (tets,)."""

    colors: tuple[str, ...]
    index: Int[np.ndarray, "tets"]


def look_of(asset: Asset, mesh: TetMesh) -> Look | None:
    """The colour of the asset's surface where it is nearest to each tet; None where it has one.

    A tet on the surface has the colour of its face, which lies nearer than its centroid.
    """
    from PIL import Image
    from scipy.spatial import KDTree

    where, colour = _coloured_points(asset)
    if len(np.unique(colour, axis=0)) < 2:
        return None
    at = mesh.centroids.copy()
    at[mesh.boundary.tet] = mesh.points[mesh.boundary.faces].mean(axis=1)
    seen = colour[KDTree(where).query(at)[1]]
    image = Image.fromarray(seen[None]).quantize(MOST, method=Image.Quantize.MEDIANCUT)
    table = np.array(image.getpalette()).reshape(-1, 3)
    used, index = np.unique(np.asarray(image)[0], return_inverse=True)
    return Look(tuple("#{:02x}{:02x}{:02x}".format(*table[k]) for k in used), index)


def _coloured_points(
    asset: Asset,
) -> tuple[Float[np.ndarray, "n 3"], UInt8[np.ndarray, "n 3"]]:
    """Points of even density on all parts, and their colours, sRGB bytes."""
    rng = np.random.default_rng(0)
    areas = np.array([part.mesh.area for part in asset.parts])
    where, colours = [], []
    for part, share in zip(asset.parts, areas / (areas.sum() or 1), strict=True):
        corners, area = part.mesh.triangles, part.mesh.area_faces
        if not area.sum() > 0:
            continue
        face = rng.choice(len(area), size=int(np.ceil(SAMPLES * share)), p=area / area.sum())
        u, v = np.sort(rng.random((2, len(face))), axis=0)
        weight = np.stack([u, v - u, 1 - v], axis=1).astype(np.float32)
        where.append(np.einsum("nk,nki->ni", weight, corners[face]))
        colours.append(skin_of(part.mesh)(face, weight)[:, :3])
    if not where:
        return np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
    bytes_ = (255 * np.concatenate(colours).clip(0, 1) + 0.5).astype(np.uint8)
    return np.concatenate(where), bytes_
