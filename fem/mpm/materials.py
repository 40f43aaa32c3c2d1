"""The seven classes of matter, and the numbers beside E, nu and rho that each of them needs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..errors import InputError
from ..note import Note
from ..table import Material, load_flows


class MaterialClass(IntEnum):
    """Classes of matter, numbered as in UniPixie and Pixie."""

    JELLY = 0
    METAL = 1
    SAND = 2
    VISPLAS = 3
    FLUID = 4
    SNOW = 5
    STATIONARY = 6


# What yields plastically, what stands as it is built, what slides in grains, what flows; all else
# springs back.
_OF_CATEGORY = {
    "metal": MaterialClass.METAL,
    "stone": MaterialClass.STATIONARY,
    "soil": MaterialClass.SAND,
    "bulk solid": MaterialClass.SAND,
    "liquid": MaterialClass.FLUID,
}
_SNOW = ("snow", "fresh snow", "firn")
# Pastes whose yield stress and viscosity the table of flow does not have.
_PASTES = ("mud", "soft clay", "modelling clay", "butter")


def class_of(material: Material) -> MaterialClass:
    """Return the class of a row: by its name, by how it flows, else by its category."""
    if material.name in _SNOW:
        return MaterialClass.SNOW
    flow = load_flows().get(material.name)
    if material.name in _PASTES or (flow and flow.yield_stress and flow.viscosity):
        return MaterialClass.VISPLAS
    return _OF_CATEGORY.get(material.category, MaterialClass.JELLY)


class Form(IntEnum):
    """Forms of jelly: stable neo-Hookean, the same that tears, or fixed corotated."""

    PLAIN = 0
    TEARING = 1
    COROTATED = 2


FORMS = {
    Form.PLAIN: "neo-Hookean",
    Form.TEARING: "neo-Hookean that tears",
    Form.COROTATED: "fixed corotated",
}
LAWS = {
    MaterialClass.METAL: Note("materials.hencky_elastic"),
    MaterialClass.SAND: Note("materials.hencky_elastic_drucker"),
    MaterialClass.VISPLAS: Note("materials.hencky_elastic_viscoplastic"),
    MaterialClass.FLUID: Note("materials.weakly_compressible"),
    MaterialClass.SNOW: "snow",
    MaterialClass.STATIONARY: "stands still",
}
# Exponent of the equation of state of weakly compressible water (Cole 1948; Batchelor 1967).
GAMMA = 7.0
# Snow after Stomakhin et al. 2013, table 2: E 1.4e5 Pa, nu 0.2, rho 400 kg/m^3.
SNOW_COMPRESSION, SNOW_STRETCH, SNOW_HARDENING = 2.5e-2, 7.5e-3, 10.0


def triaxial_friction(angle: float) -> float:
    """Slope alpha [1] of the cone that fits triaxial tests, of a friction ``angle`` [rad]."""
    sine = np.sin(angle)
    return float(np.sqrt(2 / 3) * 2 * sine / (3 - sine))


def triaxial_angle(slope: float) -> float:
    """Friction angle [rad] whose ``triaxial_friction`` is ``slope`` [1]; steeper: a right one."""
    return float(np.arcsin(min(3 * slope / (np.sqrt(8 / 3) + slope), 1.0)))


def plane_friction(angle: float) -> float:
    """Slope alpha [1] of the cone that fits plane strain, of a friction ``angle`` [rad]."""
    return float(np.sqrt(2) * np.sin(angle) / 3)


@dataclass(frozen=True, kw_only=True)
class Substance:
    """What a class needs beside E, nu and rho.

    Parameters
    ----------
    kind
        Class of the matter.
    yield_stress, hardening
        Uniaxial yield stress sigma_y and hardening modulus H [Pa], of metal and visplas.
    viscosity, exponent
        Viscosity eta [Pa s^exponent] of visplas and fluid; exponent h [1] of Herschel and Bulkley.
    friction
        Slope alpha [1] of the cone of Drucker and Prager, of sand: see ``plane_friction``.
    bulk
        Bulk modulus K [Pa] of a fluid; None: that of E and nu.
    tension, fracture_energy
        Tensile strength f_t [Pa] and fracture energy G_f [J/m^2] of jelly; None: it does not tear.
    seed
        Of the scatter of the tensile strength.
    corotated
        Whether jelly is fixed corotated (Stomakhin et al. 2012), as in PhysGaussian.

    Raises
    ------
    InputError
        Where a number is not finite or has the wrong sign.
    """

    kind: MaterialClass = MaterialClass.JELLY
    yield_stress: float = 0.0
    hardening: float = 0.0
    viscosity: float = 0.0
    exponent: float = 1.0
    friction: float = 0.0
    bulk: float | None = None
    tension: float | None = None
    fracture_energy: float | None = None
    seed: int = 0
    corotated: bool = False

    def __post_init__(self) -> None:
        for name in ("yield_stress", "hardening", "viscosity", "friction"):
            _check(name, getattr(self, name), least=0.0)
        for name in ("exponent", "bulk", "tension", "fracture_energy"):
            value = getattr(self, name)
            if value is not None:
                _check(name, value, least=np.finfo(float).tiny)
        if (self.tension is None) != (self.fracture_energy is None):
            raise InputError("materials.body_tears")
        if self.corotated and self.tension is not None:
            raise InputError("materials.corotated_jelly")

    @property
    def tears(self) -> bool:
        """Whether it breaks under tension."""
        return self.tension is not None and self.kind == MaterialClass.JELLY

    @property
    def law(self) -> str:
        """Its law in words."""
        return LAWS.get(self.kind) or FORMS[self.form]

    @property
    def form(self) -> Form:
        """Form of jelly; other classes have one."""
        if self.kind != MaterialClass.JELLY:
            return Form.PLAIN
        if self.tears:
            return Form.TEARING
        return Form.COROTATED if self.corotated else Form.PLAIN

    def numbers(self, bulk: float) -> tuple[float, float, float]:
        """The three numbers that the kernel of the class is given; ``bulk`` K [Pa] of E and nu."""
        kind = self.kind
        if kind == MaterialClass.METAL:
            return self.yield_stress, self.hardening, 0.0
        if kind == MaterialClass.SAND:
            return self.friction, 0.0, 0.0
        if kind == MaterialClass.VISPLAS:
            return self.yield_stress, self.viscosity, self.exponent
        if kind == MaterialClass.FLUID:
            return (bulk if self.bulk is None else self.bulk), GAMMA, self.viscosity
        if kind == MaterialClass.SNOW:
            return SNOW_COMPRESSION, SNOW_STRETCH, SNOW_HARDENING
        return 0.0, 0.0, 0.0

    @property
    def state(self) -> float:
        """State of the class at rest: plastic strain, volume correction, or J_p of snow."""
        return 1.0 if self.kind == MaterialClass.SNOW else 0.0


def _check(name: str, value: float, *, least: float) -> None:
    if not (np.isfinite(value) and value >= least):
        raise InputError(
            "materials.wanted_finite", name=name, value=value, ending=">" if least else ">="
        )
