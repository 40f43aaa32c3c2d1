"""Pieces of a body that hang in the air: specks of scans, splats and generated meshes."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from ...fem.errors import UsageError
from ...predictors.asset import Asset
from ..asset.solids import INSIDE
from ..asset.surface import Surface, component_volumes, open_components
from ..asset.triangles import closest, edge_components, winding_numbers

SPECK = 0.005  # of the volume: a loose piece with less is left out if nothing is said
# Of the volume: where specks have more together, as leaves or gravel, they are what the body is.
MANY = 0.025
ALL, LARGEST = "all", "largest"
TOUCHING = 2e-3  # of the diagonal: a nearer piece is no loose one
ASKED = 50  # faces of a piece that are asked how far they are from the others


class Kept(NamedTuple):
    """An asset without its floaters, how many these are and their share of the volume."""

    asset: Asset
    left_out: int = 0
    share: float = 0.0


def without_floaters(asset: Asset, keep: str | None) -> Kept:
    """Leave closed pieces out that touch no other: all smaller than ``SPECK`` by default.

    asset: Surfaces [m].
    keep: "all", "largest", so many of the largest ("3"), or the least share of the volume (".01").
    Raises UsageError: Where ``keep`` is none of these.
    """
    most, least = np.inf, SPECK
    if keep == ALL:
        return Kept(asset)
    if keep is not None:
        try:
            number = 1.0 if keep == LARGEST else float(keep)
        except ValueError:
            number = 0.0
        if not (0 < number < 1 or (number >= 1 and number.is_integer())):
            raise UsageError("floaters.keep", keep=keep)
        most, least = (number, 0.0) if number >= 1 else (np.inf, number)
    meshes = [part.mesh for part in asset.parts]
    start = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    points = np.concatenate([np.asarray(mesh.vertices, np.float64) for mesh in meshes])
    faces = np.concatenate([np.asarray(m.faces) + s for m, s in zip(meshes, start, strict=False)])
    part = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    # Vertices at one place are one: a file may have each triangle's own
    place, of_all = np.unique(points, axis=0, return_inverse=True)
    faces = of_all.reshape(-1)[faces]
    surface = Surface(place, faces, part, edge_components(faces))
    volume = np.abs(component_volumes(surface)) * ~open_components(surface)
    rank = np.argsort(np.argsort(-volume, kind="stable"))
    loose = (volume > 0) & ((volume < least * volume.sum()) | (rank >= most))
    if keep is None and loose.any() and not loose.all():
        loose &= _apart(surface, loose)
        loose &= asset.sampled or bool(volume[loose].sum() <= MANY * volume.sum())
        # A part that is nothing but specks is one by intention
        named = np.ones(len(meshes), dtype=bool)
        named[part[~loose[surface.component]]] = False
        loose[surface.component[named[part]]] = False
    if not loose.any() or loose.all():
        return Kept(asset)
    parts, left = [], ~loose[surface.component]
    for number, one in enumerate(asset.parts):
        mine = left[part == number]
        if mine.any():
            mesh = one.mesh if mine.all() else one.mesh.copy()
            mesh.update_faces(mine)
            mesh.remove_unreferenced_vertices()
            parts.append(replace(one, mesh=mesh))
    share = float(volume[loose].sum() / volume.sum())
    return Kept(replace(asset, parts=tuple(parts)), int(loose.sum()), share)


def _apart(
    surface: Surface, small: Bool[np.ndarray, "components"]
) -> Bool[np.ndarray, "components"]:
    """Which of the small pieces are inside no large one and touch none."""
    points, faces, _, component = surface
    large = faces[~small[component]]
    near = TOUCHING * float(np.linalg.norm(np.ptp(points, axis=0)))
    mine = np.flatnonzero(small[component])
    some = mine[np.argsort(component[mine], kind="stable")]
    # At most so many faces of each, evenly
    first = np.searchsorted(component[some], np.arange(len(small) + 1))
    rank = np.arange(len(some)) - first[component[some]]
    some = some[rank % np.maximum(np.diff(first) // ASKED, 1)[component[some]] == 0]
    where = points[faces[some]].mean(axis=1)
    free = closest(where, points, large).distance > near
    free &= np.abs(winding_numbers(points, large, where)) < INSIDE
    out = small.copy()
    out[component[some[~free]]] = False
    return out
