"""The density grid of a radiance field.

``density`` is how much light a cell absorbs [1/m], never mass: the mass density of the material is
``rho``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ...fem.errors import InputError
from ...predictors.grid import MAX_CELLS, Grid


@dataclass(frozen=True, eq=False)
class DensityGrid:
    """Density [1/m] in the cells of the box ``lo`` .. ``hi`` [m], cells not always cubes.

    The centre of cell ``i`` is ``lo + (i + 1/2) (hi - lo) / shape``. ``fields`` are further arrays
    of the same shape (E, nu, rho); ``threshold`` is the density of the surface.
    """

    lo: Float[np.ndarray, "3"]
    hi: Float[np.ndarray, "3"]
    density: Float[np.ndarray, "nx ny nz"]
    threshold: float = 0.0
    fields: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lo, self.hi]).all() and (self.hi > self.lo).all()):
            raise InputError(f"a density grid needs a box with hi > lo, got {self.lo} .. {self.hi}")
        if self.density.size == 0 or self.density.size > MAX_CELLS:
            raise InputError(
                f"density of shape {self.density.shape}: 1 to {MAX_CELLS} cells wanted"
            )
        if not np.isfinite(self.density).all():
            raise InputError(f"{(~np.isfinite(self.density)).sum()} densities are not finite")
        for name, values in self.fields.items():
            if values.shape != self.density.shape:
                raise InputError(
                    f"{name} has shape {values.shape}, density {self.density.shape}: one a cell"
                )

    @property
    def spacing(self) -> Float[np.ndarray, "3"]:
        """Edges [m] of a cell."""
        return (self.hi - self.lo) / self.density.shape

    def centers(self) -> Float[np.ndarray, "n 3"]:
        """Centres [m] of all cells, the last axis fastest, shape (nx ny nz, 3)."""
        axes = [
            low + (np.arange(n) + 0.5) * h
            for low, h, n in zip(self.lo, self.spacing, self.density.shape, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def on_grid(self, grid: Grid) -> Float[np.ndarray, "nx ny nz"]:
        """Density at the centres of a grid of cubes, trilinear, 0 outside the box."""
        from scipy.ndimage import map_coordinates

        index = (grid.centers() - self.lo) / self.spacing - 0.5
        coordinates = np.moveaxis(index, -1, 0)
        inside = ((index >= -0.5) & (index <= np.array(self.density.shape) - 0.5)).all(axis=-1)
        values = map_coordinates(self.density, coordinates, order=1, mode="nearest")
        return np.where(inside, values, 0.0)

    def occupied_box(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner [m] of the box around the cells above the threshold."""
        cells = np.argwhere(self.density > self.threshold)
        if not len(cells):
            raise InputError(f"no cell has a density above {self.threshold:g}")
        low, high = cells.min(axis=0), cells.max(axis=0) + 1
        return np.stack([self.lo + low * self.spacing, self.lo + high * self.spacing])
