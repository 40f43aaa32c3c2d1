"""Real objects in one piece: their cells, how each looks, its shell, and its material slot.

What the parts are called is kept apart: it is the truth that a sentence is scored by, and no
network sees it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ...predictors.appearance.features import cell_appearance
from ...predictors.appearance.surface import SPACING, material_name, surface_samples
from ...predictors.asset import Asset, upright
from .real import CELLS, cube


@dataclass(frozen=True, eq=False)
class OnePiece:
    """Cells of an object on an upright cube of ``CELLS``^3.

    Parameters
    ----------
    name
        What it is ("Kitchen chair").
    cells
        Indices of its cells.
    looks
        Colour, opacity and finish of each, as ``cell_appearance`` has them.
    shell
        The connected surface nearest to each.
    slot
        The material slot of each, an index into ``slots``.
    slots
        Names of the slots as the file has them.
    """

    name: str
    cells: Int[np.ndarray, "n 3"]
    looks: Float[np.ndarray, "n look"]
    shell: Int[np.ndarray, "n"]
    slot: Int[np.ndarray, "n"]
    slots: tuple[str, ...]

    @classmethod
    def of(cls, asset: Asset, name: str) -> OnePiece:
        """Return the object filled with cells; what is inside is as the surface that is nearest."""
        from scipy.ndimage import binary_fill_holes, distance_transform_edt

        lo, h = cube(asset)
        groups: dict[str, list[Any]] = {}
        for part in asset.parts:
            groups.setdefault(material_name(part.mesh) or part.name, []).append(part.mesh)
        # Later slots have a cell that several share: the smaller surface would vanish otherwise.
        slots = sorted(groups, key=lambda slot: -sum(float(mesh.area) for mesh in groups[slot]))
        label = np.full((CELLS,) * 3, -1)
        for number, slot in enumerate(slots):
            for mesh in groups[slot]:
                for points in surface_samples(mesh, SPACING * h):
                    at = np.floor((upright(points, asset.up) - lo) / h).astype(int)
                    label[tuple(at.clip(0, CELLS - 1).T)] = number
        inside = np.asarray(binary_fill_holes(label >= 0))
        nearest: Any = distance_transform_edt(
            label < 0, return_distances=False, return_indices=True
        )
        cells = np.argwhere(inside)
        looks, shell = cell_appearance(asset, lo + (cells + 0.5) * h, turned=True)
        slot = label[tuple(nearest)][inside]
        return cls(name, cells, looks.astype(np.float32), shell, slot, tuple(slots))
