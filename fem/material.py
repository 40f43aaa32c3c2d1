"""Elastic material of every element: E, nu, rho, the moduli that follow from them, and a grain.

Stiffness tensors are 6 x 6 in Mandel's notation: xx, yy, zz, and yz, zx, xy times the root of two,
so that they turn as tensors do and their inverse is the compliance (Mandel 1965).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from .errors import InputError
from .table import OrthotropicConstants


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
    constants: OrthotropicConstants, axes: Float[np.ndarray, "*one_or_n 3 3"]
) -> Float[np.ndarray, "*n 6 6"]:
    """Stiffness tensors [Pa] of solids of the nine ``constants`` along the rows of ``axes``.

    The constants are numbers, or an array each where there are many solids; the axes may be one.
    """
    c, turn = constants, np.asarray(axes, dtype=float)
    if not (np.isfinite(turn).all() and np.allclose(turn @ turn.mT, np.eye(3), atol=1e-9)):
        raise InputError("material.axes_grain", tolist=turn.tolist())
    diagonal = (1 / c.E_L, 1 / c.E_R, 1 / c.E_T, 0.5 / c.G_RT, 0.5 / c.G_LT, 0.5 / c.G_LR)
    along = np.stack(np.broadcast_arrays(*diagonal), axis=-1)
    compliance = along[..., None] * np.eye(6)
    cross = ((0, 1, -c.nu_LR / c.E_L), (0, 2, -c.nu_LT / c.E_L), (1, 2, -c.nu_RT / c.E_R))
    for i, j, value in cross:
        compliance[..., i, j] = compliance[..., j, i] = value
    if not (np.isfinite(compliance).all() and (np.linalg.eigvalsh(compliance) > 0).all()):
        raise InputError("material.material_like", constants=constants)
    columns = _turning(turn)
    return columns @ np.linalg.inv(compliance) @ columns.mT


def orthotropic_constants(
    tensor: Float[np.ndarray, "*n 6 6"], axes: Float[np.ndarray, "*one_or_n 3 3"]
) -> OrthotropicConstants:
    """The nine constants along the rows of ``axes`` of solids that are symmetric about them.

    The inverse of ``orthotropic_tensor``; each constant has the shape of what is before the axes.
    """
    columns = _turning(np.asarray(axes, dtype=float))
    s = np.moveaxis(columns.mT @ np.linalg.inv(tensor) @ columns, (-2, -1), (0, 1))
    E_L, E_R, E_T = 1 / s[0, 0], 1 / s[1, 1], 1 / s[2, 2]
    shear = (0.5 / s[5, 5], 0.5 / s[4, 4], 0.5 / s[3, 3])
    return OrthotropicConstants(
        E_L, E_R, E_T, *shear, nu_LR=-s[0, 1] * E_L, nu_LT=-s[0, 2] * E_L, nu_RT=-s[1, 2] * E_R
    )


def _turning(axes: np.ndarray) -> np.ndarray:
    """Columns: the tensors L L, R R, T T, R T + T R ..., in Mandel's notation along x, y, z."""
    basis = mandel_tensor(np.eye(6))
    return mandel_vector(np.einsum("...ai,nab,...bj->...nij", axes, basis, axes)).mT


# Arrays of a grain, nine values a tet, 0 where it has none: rows of axes L, R, T; E_L, E_R, E_T,
# G_LR, G_LT, G_RT, nu_LR, nu_LT, nu_RT.
AXES, CONSTANTS = GRAIN = ("grain_axes", "grain_constants")
# Share of a grain's least shear modulus that an isotropic solid below it has, and the share of E by
# which a tensor that is one anyway may differ.
BELOW, ALIKE = 0.9, 1e-12
# Entries of a symmetric tensor in Mandel's order, and what each is multiplied by.
_PAIRS = np.array([[0, 0], [1, 1], [2, 2], [1, 2], [2, 0], [0, 1]])
_FACTORS = np.array([1.0, 1, 1, 2**0.5, 2**0.5, 2**0.5])


@dataclass(frozen=True, eq=False)
class ElementMaterial:
    """Material of every tet: ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], each of shape (tets,).

    ``tensor`` (tets, 6, 6) [Pa] are stiffness tensors where a tet has a grain, and the rows of
    ``axes`` (tets, 3, 3) its directions, zero where it has none; both are made by ``with_grain``.
    Without them, all are isotropic.

    The arrays are copies that cannot be written to: what follows from them stays true.

    Raises
    ------
    InputError
        Where a value is not finite, E or rho is not positive, or nu is outside [0, 0.5).

    Examples
    --------
    >>> from autophyx_tet.fem import ElementMaterial
    >>> steel = ElementMaterial.uniform(2, E=2e11, nu=0.25, rho=7850.0)
    >>> steel.lame.mu / 1e9  # GPa, E / (2 (1 + nu))
    array([80., 80.])
    """

    E: Float[np.ndarray, "tets"]
    nu: Float[np.ndarray, "tets"]
    rho: Float[np.ndarray, "tets"]
    tensor: Float[np.ndarray, "tets 6 6"] | None = None
    axes: Float[np.ndarray, "tets 3 3"] | None = None

    def __post_init__(self) -> None:
        for name in ("E", "nu", "rho"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != 1:
                raise InputError("material.must_shape", name=name, shape=array.shape)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        sizes = {name: getattr(self, name).size for name in ("E", "nu", "rho")}
        if len(set(sizes.values())) > 1:
            raise InputError("material.nu_rho", sizes=sizes)
        if (self.tensor is None) != (self.axes is None):
            raise InputError("material.stiffness_tensors")
        _check("E", "Pa", "E > 0", self.E, self.E > 0)
        _check("nu", "1", "0 <= nu < 0.5", self.nu, (self.nu >= 0) & (self.nu < 0.5))
        _check("rho", "kg/m^3", "rho > 0", self.rho, self.rho > 0)

    @classmethod
    def uniform(cls, tets: int, *, E: float, nu: float, rho: float) -> ElementMaterial:
        """Return one material for all ``tets`` elements; E [Pa], nu [1], rho [kg/m^3]."""
        return cls(np.full(tets, float(E)), np.full(tets, float(nu)), np.full(tets, float(rho)))

    def with_grain(
        self, tets: np.ndarray, constants: OrthotropicConstants, axes: Float[np.ndarray, "*n 3 3"]
    ) -> ElementMaterial:
        """Return the material with ``tets`` (ids or mask) orthotropic along the rows of ``axes``.

        The rows are the directions of the grain, radial and tangential to the rings; constants and
        axes are one for all, or one a tet. E and nu of those tets stay: what knows no grain takes
        them.

        Raises
        ------
        InputError
            Where no material has these ``constants``, or ``axes`` is no rotation.
        """
        tensor = isotropic_tensor(*self.lame) if self.tensor is None else self.tensor.copy()
        ways = np.zeros((len(self.E), 3, 3)) if self.axes is None else self.axes.copy()
        tensor[tets], ways[tets] = orthotropic_tensor(constants, axes), axes
        tensor.flags.writeable = ways.flags.writeable = False
        return replace(self, tensor=tensor, axes=ways)

    def of_tets(self, tets: np.ndarray) -> ElementMaterial:
        """Material of some ``tets``: their ids, or a mask."""
        tensor, axes = (None if a is None else a[tets] for a in (self.tensor, self.axes))
        return ElementMaterial(self.E[tets], self.nu[tets], self.rho[tets], tensor, axes)

    def without_grain(self) -> ElementMaterial:
        """Return the material as stiff across its grain as along it."""
        return self if self.tensor is None else replace(self, tensor=None, axes=None)

    def times(self, factor: float | Float[np.ndarray, "tets"]) -> ElementMaterial:
        """Return the material ``factor`` [1] times as stiff, its grain too."""
        each = np.broadcast_to(factor, self.E.shape)
        tensor = None if self.tensor is None else self.tensor * each[:, None, None]
        return replace(self, E=self.E * each, tensor=tensor)

    @property
    def grained(self) -> Bool[np.ndarray, "tets"]:
        """Which tets have a grain."""
        if self.axes is None:
            return np.zeros(len(self.E), dtype=bool)
        return (self.axes != 0).reshape(len(self.E), -1).any(axis=1)

    @cached_property
    def constants(self) -> Float[np.ndarray, "tets 9"]:
        """Constants of every tet as ``OrthotropicConstants`` orders them; 0 where it has no grain.

        E_L, E_R, E_T, G_LR, G_LT, G_RT [Pa], nu_LR, nu_LT, nu_RT [1].
        """
        constants, grained = np.zeros((len(self.E), 9)), self.grained
        if self.tensor is not None and self.axes is not None:
            nine = orthotropic_constants(self.tensor[grained], self.axes[grained])
            constants[grained] = np.stack(nine, axis=1)
        return constants

    @cached_property
    def lame(self) -> LameParameters:
        """Lame parameters (lam, mu) [Pa], each (tets,)."""
        moduli = lame_parameters(self.E, self.nu)
        for values in moduli:
            values.flags.writeable = False
        return moduli


def material_arrays(material: ElementMaterial | None) -> dict[str, np.ndarray]:
    """E, nu, rho of every tet and, where some have a grain, the arrays of ``GRAIN``."""
    if material is None:
        return {}
    arrays = {name: getattr(material, name) for name in ("E", "nu", "rho")}
    if material.axes is not None:
        arrays |= {AXES: material.axes.reshape(-1, 9), CONSTANTS: material.constants}
    return arrays


def material_from(arrays: Mapping[str, np.ndarray]) -> ElementMaterial | None:
    """The material that ``material_arrays`` gave, None without E, nu and rho."""
    names = ("E", "nu", "rho")
    if not all(name in arrays for name in names):
        return None
    material = ElementMaterial(*(np.ravel(arrays[name]) for name in names))
    if not all(name in arrays for name in GRAIN):
        return material
    axes = np.asarray(arrays[AXES], dtype=float).reshape(-1, 3, 3)
    own = np.flatnonzero((axes != 0).reshape(len(axes), -1).any(axis=1))
    constants = np.asarray(arrays[CONSTANTS], dtype=float).reshape(-1, 9)[own]
    return material.with_grain(own, OrthotropicConstants(*constants.T), axes[own])


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


def _check(name: str, unit: str, wanted: str, array: np.ndarray, good: np.ndarray) -> None:
    bad = np.flatnonzero(~(good & np.isfinite(array)))
    if bad.size:
        raise InputError(
            "material.tet_bad",
            name=name,
            array=array[bad[0]],
            unit=unit,
            bad=bad[0],
            size=bad.size,
            size_2=array.size,
            wanted=wanted,
        )
