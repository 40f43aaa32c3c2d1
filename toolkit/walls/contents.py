"""What walls hold as tets of its own: a part for the room inside a wall, and its material."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...fem.errors import UsageError
from ...fem.scene.materials import Material
from ...predictors.asset import Asset, Part
from ...predictors.prediction import PartChoice, Prediction
from ..surfaces.offset import inner_surface
from ..surfaces.repair import repair
from ..surfaces.solids import Shell
from .wall_options import WallOptions

if TYPE_CHECKING:
    from trimesh import Trimesh

SUFFIX = " contents"


class FilledAsset(NamedTuple):
    """An asset with a part for the room in each wall; the material of each, by its name."""

    asset: Asset
    contents: Mapping[str, str]

    @property
    def walls(self) -> tuple[str, ...]:
        """Names of the parts around them."""
        return tuple(name.removesuffix(SUFFIX) for name in self.contents)


def with_rooms(asset: Asset, options: WallOptions, *, thinnest: float) -> FilledAsset:
    """Add a part for what is inside each part with a wall and a filling by options.

    A wall below ``thinnest`` [m], and one that leaves no room, is left to the material.
    ``UsageError`` where the asset has a part of that name.
    """
    rooms, contents = [], {}
    for part in asset.parts:
        wall, filling = options.wall_of(part.name), options.filling_of(part.name)
        if filling is None or wall is None or not thinnest <= wall < np.inf:
            continue
        room = _room(part, wall)
        if room is None:
            continue
        if part.name + SUFFIX in asset.part_names:
            raise UsageError(
                f"what {part.name!r} is filled with would be a part {part.name + SUFFIX!r}, which "
                f"the asset has: --fill only the others, NAME=MATERIAL, or rename that part"
            )
        rooms.append(Part(part.name + SUFFIX, room))
        contents[part.name + SUFFIX] = filling
    return FilledAsset(replace(asset, parts=(*asset.parts, *rooms)), contents)


def _room(part: Part, wall: float) -> Trimesh | None:
    """Closed surface a ``wall`` [m] inside that of a part; None where nothing is that deep."""
    from trimesh import Trimesh

    surface, _ = repair((part,))
    shell = Shell(surface.points, surface.faces, surface.part)
    (points, faces), kept = inner_surface(shell, wall)
    return Trimesh(points, faces[kept], process=False) if kept.any() else None


def with_fillings(found: Prediction, contents: Mapping[str, Material]) -> Prediction:
    """Give the parts that are contents their materials, whatever words say of them."""
    alpha = 0.5 if found.field.alpha is None else found.field.alpha
    chosen = {
        number: PartChoice(name, contents[name], contents[name].value(alpha), 1.0, alpha, "--fill")
        for number, name in enumerate(found.parts.part_names)
        if name in contents
    }
    return found.with_choices(chosen) if chosen else found
