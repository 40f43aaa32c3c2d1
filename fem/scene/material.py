"""Elastic material of every element: E, nu, rho, the moduli that follow from them, and a grain.

Stiffness tensors are 6 x 6 in Mandel's notation: xx, yy, zz, and yz, zx, xy times the root of two,
so that they turn as tensors do and their inverse is the compliance (Mandel 1965).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..errors import InputError
from .material_properties import OrthotropicConstants


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


def mandel_vector(tensor: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n 6"]:
    """Symmetric tensors as vectors of Mandel's notation."""
    i, j = _PAIRS.T
    return tensor[..., i, j] * _FACTORS


def mandel_tensor(vector: Float[np.ndarray, "*n 6"]) -> Float[np.ndarray, "*n 3 3"]:
    """Vectors of Mandel's notation as symmetric tensors."""
    i, j = _PAIRS.T
    tensor = np.empty((*vector.shape[:-1], 3, 3))
    tensor[..., i, j] = tensor[..., j, i] = vector / _FACTORS
    return tensor


def isotropic_tensor(lam, mu) -> Float[np.ndarray, "*n 6 6"]:
    """Stiffness tensors [Pa] of isotropic solids of the Lame parameters [Pa]."""
    lam, mu = np.asarray(lam)[..., None, None], np.asarray(mu)[..., None, None]
    trace = np.array([1.0, 1, 1, 0, 0, 0])
    return lam * np.outer(trace, trace) + 2 * mu * np.eye(6)


def orthotropic_tensor(
    constants: OrthotropicConstants, axes: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "6 6"]:
    """Stiffness tensor [Pa] of a solid of the nine ``constants`` along the rows of ``axes``."""
    c, turn = constants, np.asarray(axes, dtype=float)
    if not (np.isfinite(turn).all() and np.allclose(turn @ turn.T, np.eye(3), atol=1e-9)):
        raise InputError(f"axes of a grain {turn.tolist()}: wanted three unit vectors, square on")
    compliance = np.diag(
        [1 / c.E_L, 1 / c.E_R, 1 / c.E_T, 0.5 / c.G_RT, 0.5 / c.G_LT, 0.5 / c.G_LR]
    )
    cross = ((0, 1, -c.nu_LR / c.E_L), (0, 2, -c.nu_LT / c.E_L), (1, 2, -c.nu_RT / c.E_R))
    for i, j, value in cross:
        compliance[i, j] = compliance[j, i] = value
    if not (np.isfinite(compliance).all() and np.linalg.eigvalsh(compliance)[0] > 0):
        raise InputError(f"no material is like that, it would give energy away: {constants}")
    # Columns: the tensors L L, R R, T T, R T + T R ..., in Mandel's notation along x, y, z.
    basis = mandel_tensor(np.eye(6))
    columns = mandel_vector(np.einsum("ai,nab,bj->nij", turn, basis, turn)).T
    return columns @ np.linalg.inv(compliance) @ columns.T


# Share of a grain's least shear modulus that an isotropic solid below it has, and the share of E by
# which a tensor that is one anyway may differ.
BELOW, ALIKE = 0.9, 1e-12
# Entries of a symmetric tensor in Mandel's order, and what each is multiplied by.
_PAIRS = np.array([[0, 0], [1, 1], [2, 2], [1, 2], [2, 0], [0, 1]])
_FACTORS = np.array([1.0, 1, 1, 2**0.5, 2**0.5, 2**0.5])


@dataclass(frozen=True, eq=False)
class ElementMaterial:
    """Material of every tet: ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], each of shape (tets,).

    ``tensor`` (tets, 6, 6) [Pa] are stiffness tensors where a tet has a grain, made by
    ``with_grain``; without one, all are isotropic.

    The arrays are copies that cannot be written to: what follows from them stays true.

    Raises
    ------
    InputError
        Where a value is not finite, E or rho is not positive, or nu is outside [0, 0.5).
    """

    E: Float[np.ndarray, "tets"]
    nu: Float[np.ndarray, "tets"]
    rho: Float[np.ndarray, "tets"]
    tensor: Float[np.ndarray, "tets 6 6"] | None = None

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

    def with_grain(
        self, tets: np.ndarray, constants: OrthotropicConstants, axes: Float[np.ndarray, "3 3"]
    ) -> ElementMaterial:
        """Return the material with ``tets`` (ids or mask) orthotropic along the rows of ``axes``.

        The rows are the directions of the grain, radial and tangential to the rings. E and nu of
        those tets stay: what knows no grain takes them.

        Raises
        ------
        InputError
            Where no material has these ``constants``, or ``axes`` is no rotation.
        """
        tensor = isotropic_tensor(*self.lame) if self.tensor is None else self.tensor.copy()
        tensor[tets] = orthotropic_tensor(constants, axes)
        tensor.flags.writeable = False
        return replace(self, tensor=tensor)

    @cached_property
    def lame(self) -> LameParameters:
        """Lame parameters (lam, mu) [Pa], each (tets,)."""
        return lame_parameters(self.E, self.nu)


def isotropic_part(material: ElementMaterial) -> LameParameters:
    """Lame parameters [Pa] of isotropic solids that the grain leaves nothing negative beside.

    The shear modulus is ``BELOW`` of the least that the stiffness tensor shows, and lam the largest
    then; where there is no grain they are those of the material.
    """
    if material.tensor is None:
        return material.lame
    tensor, trace = material.tensor, np.array([1.0, 1, 1, 0, 0, 0])
    mu = BELOW * np.linalg.eigvalsh(tensor)[:, 0] / 2
    rest = tensor - 2 * mu[:, None, None] * np.eye(6)
    lam = 1 / (np.linalg.inv(rest) @ trace @ trace)
    apart = np.abs(tensor - isotropic_tensor(*material.lame)).max(axis=(1, 2))
    plain = apart <= ALIKE * material.E
    pairs = zip(material.lame, (lam, mu), strict=True)
    return LameParameters(*(np.where(plain, own, below) for own, below in pairs))


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
