"""Isotropic elastic material of every element: E, nu, rho, and the moduli that follow from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..errors import InputError


class LameParameters(NamedTuple):
    """First Lame parameter ``lam`` [Pa] and shear modulus ``mu`` [Pa]."""

    lam: np.ndarray
    mu: np.ndarray


def lame_parameters(E, nu) -> LameParameters:
    """Lame parameters (lam, mu) [Pa] of an isotropic solid from E [Pa] and nu [1]."""
    E, nu = np.asarray(E, dtype=np.float64), np.asarray(nu, dtype=np.float64)
    return LameParameters(E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu)))


def wave_speed(E, nu, rho) -> np.ndarray:
    """Speed [m/s] of pressure waves, sqrt((lam + 2 mu) / rho): E [Pa], nu [1], rho [kg/m^3]."""
    lam, mu = lame_parameters(E, nu)
    return np.sqrt((lam + 2 * mu) / np.asarray(rho))


@dataclass(frozen=True, eq=False)
class ElementMaterial:
    """Material of every tet: ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], each of shape (tets,).

    The arrays are copies that cannot be written to: what follows from them stays true.

    Raises
    ------
    InputError
        Where a value is not finite, E or rho is not positive, or nu is outside [0, 0.5).
    """

    E: Float[np.ndarray, "tets"]
    nu: Float[np.ndarray, "tets"]
    rho: Float[np.ndarray, "tets"]

    def __post_init__(self) -> None:
        for name in ("E", "nu", "rho"):
            object.__setattr__(self, name, _vector(name, getattr(self, name)))
        sizes = {name: getattr(self, name).size for name in ("E", "nu", "rho")}
        if len(set(sizes.values())) > 1:
            raise InputError(f"E, nu and rho must have one value per tet each, got {sizes}")
        _check("E", "Pa", "E > 0", self.E, self.E > 0)
        _check("nu", "1", "0 <= nu < 0.5", self.nu, (self.nu >= 0) & (self.nu < 0.5))
        _check("rho", "kg/m^3", "rho > 0", self.rho, self.rho > 0)

    @classmethod
    def uniform(cls, tets: int, *, E: float, nu: float, rho: float) -> ElementMaterial:
        """Return one material for all ``tets`` elements; E [Pa], nu [1], rho [kg/m^3]."""
        return cls(np.full(tets, float(E)), np.full(tets, float(nu)), np.full(tets, float(rho)))

    @cached_property
    def lame(self) -> LameParameters:
        """Lame parameters (lam, mu) [Pa], each (tets,)."""
        return lame_parameters(self.E, self.nu)


def _vector(name: str, value) -> np.ndarray:
    array = np.array(value, dtype=np.float64)
    if array.ndim != 1:
        raise InputError(f"{name} must have shape (tets,), got {array.shape}")
    array.flags.writeable = False
    return array


def _check(name: str, unit: str, wanted: str, array: np.ndarray, good: np.ndarray) -> None:
    bad = np.flatnonzero(~(good & np.isfinite(array)))
    if bad.size:
        raise InputError(
            f"{name} = {array[bad[0]]:g} [{unit}] at tet {bad[0]} "
            f"({bad.size} of {array.size} bad): wanted {wanted}, SI units"
        )
