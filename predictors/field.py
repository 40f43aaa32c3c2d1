"""The material field: E, nu, rho on the occupied cells of a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..fem.errors import InputError
from .grid import Grid


class Ranges(NamedTuple):
    """[min, max] of E [Pa], nu [1] and rho [kg/m^3] in every cell, each (nx, ny, nz, 2)."""

    E: np.ndarray
    nu: np.ndarray
    rho: np.ndarray


@dataclass(frozen=True, eq=False)
class MaterialField:
    """E [Pa], nu [1], rho [kg/m^3] on the occupied cells of a grid; other cells are ignored.

    ``part`` labels cells with an index into ``part_names`` (-1 outside), ``material`` with an index
    into ``material_names``. ``ranges`` are the [min, max] the values were chosen from, and
    ``alpha`` in [0, 1] where between them (soft to stiff), if the predictor knows.
    """

    grid: Grid
    occupied: Bool[np.ndarray, "nx ny nz"]
    E: Float[np.ndarray, "nx ny nz"]
    nu: Float[np.ndarray, "nx ny nz"]
    rho: Float[np.ndarray, "nx ny nz"]
    part: Int[np.ndarray, "nx ny nz"] | None = None
    part_names: tuple[str, ...] = ()
    material: Int[np.ndarray, "nx ny nz"] | None = None
    material_names: tuple[str, ...] = ()
    ranges: Ranges | None = None
    alpha: float | None = None

    def __post_init__(self) -> None:
        for name in ("occupied", "E", "nu", "rho", "part", "material"):
            array = getattr(self, name)
            if array is not None and array.shape != self.grid.shape:
                raise InputError(f"{name} has shape {array.shape}, the grid {self.grid.shape}")
        if not self.occupied.any():
            raise InputError("a material field needs at least one occupied cell, got none")
        E, nu, rho = (getattr(self, name)[self.occupied] for name in ("E", "nu", "rho"))
        good = (E > 0) & (nu >= 0) & (nu < 0.5) & (rho > 0) & np.isfinite(E * rho)
        if not good.all():
            cell = np.argwhere(self.occupied)[np.flatnonzero(~good)[0]]
            raise InputError(
                f"{(~good).sum()} of {good.size} occupied cells have values out of range, first at "
                f"cell {tuple(cell)}: wanted E > 0 Pa, 0 <= nu < 0.5, rho > 0 kg/m^3"
            )
        if self.part is not None and (self.part[self.occupied] < 0).any():
            raise InputError("a field with part labels needs one on every occupied cell")
