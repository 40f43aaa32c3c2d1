"""Walls that texts state: known before there is a mesh, so that it can have them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...predictors.asset import Asset
from ..options import ConvertOptions
from .part_words import main_parts, walls_said
from .wall_options import WallOptions


def with_stated_walls(
    asset: str | Path | Asset,
    texts: Sequence[str],
    walls: WallOptions | None,
    options: ConvertOptions | None,
) -> tuple[str | Path | Asset, WallOptions | None]:
    """Return an asset, and the walls that options and texts say for its conversion.

    It is loaded where every text speaks of walls. Options go first; a wall on which texts do not
    agree, and one that holds something, are left to the material, as are those of a tet mesh.
    """
    from ..io.load import load_asset
    from ..meshing.import_tets import SUFFIXES

    given, options = walls or WallOptions(), options or ConvertOptions()
    spoken = bool(texts) and all("wall" in text.lower() for text in texts)
    if not spoken or given.wall is not None or given.solid or given.fill:
        return asset, walls
    if not isinstance(asset, Asset):
        if Path(asset).suffix.lower() in SUFFIXES:
            return asset, walls
        asset = load_asset(asset, size=options.size, units=options.units, up=options.up)
    said = [_stated(asset, text) for text in texts]
    agreed = {
        name: wall
        for name, wall in said[0].items()
        if name not in given.by_part() and all(other.get(name) == wall for other in said)
    }
    stated = tuple(f"{name}={wall!r}" for name, wall in agreed.items())
    return asset, replace(given, part_wall=(*given.part_wall, *stated))


def _stated(asset: Asset, text: str) -> dict[str, float]:
    """Walls [m] of empty parts, by their names, as the built-in reader reads a text."""
    from ...fem.scene.materials import load_table
    from ...predictors.interpreter import read_sentence

    labels = [(part.name, *part.labels) for part in asset.parts]
    bound = read_sentence(text, labels, load_table())
    main = main_parts(np.array([abs(part.mesh.volume) for part in asset.parts]))
    clauses = bound.sentence.clauses
    return {
        name: wall.value
        for name, wall, part in zip(
            asset.part_names, walls_said(asset.part_names, main, bound), bound.parts, strict=True
        )
        if wall and not any(clauses[k].filling for k in part.clauses)
    }
