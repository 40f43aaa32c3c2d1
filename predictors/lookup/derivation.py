"""E, nu and rho from what is said in place of them: hardness, infill, a second matter.

Every relation is a published one; each says how it was used, in words for the user.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...fem.scene.materials import MaterialValue

GENT_RANGE = (20.0, 80.0)  # Shore A: where Gent's relation was measured
QI_RANGE_D = (30.0, 85.0)  # Shore D, the same of Qi, Joyce and Boyce
RUBBER_NU = 0.49  # of solid elastomers: nearly incompressible
# Orientation efficiency of injection-moulded bars along the flow: .6 to .7 in Thomason and Vlug,
# Composites A 27 (1996).
ALONG = 0.65


class Derived(NamedTuple):
    """A value that was computed, and the sentence that says how."""

    value: float
    how: str


class Fibre(NamedTuple):
    """E [Pa], rho [kg/m^3] and length over diameter [1] of a reinforcement."""

    E: float
    rho: float
    aspect: float


# Hull and Clyne, An Introduction to Composite Materials, table 2.1; the aspect ratio of short
# fibres after moulding, 0.2-0.4 mm over 10-14 um, is that of Thomason, Composites A 33 (2002).
FIBRES = {
    "glass": Fibre(72e9, 2550.0, 20.0),
    "carbon": Fibre(230e9, 1780.0, 25.0),
    "aramid": Fibre(130e9, 1450.0, 25.0),
}


def modulus_of_shore_a(hardness: float) -> Derived:
    """E [Pa] of an elastomer of a hardness on Shore's scale A: Gent, Rubber Chem. Tech. 31 (1958).

    E = .0981 (56 + 7.62336 S) / (.137505 (254 - 2.54 S)) MPa.
    """
    E = 1e6 * 0.0981 * (56 + 7.62336 * hardness) / (0.137505 * (254 - 2.54 * min(hardness, 99.0)))
    low, high = GENT_RANGE
    inside = "" if low <= hardness <= high else f", outside its {low:g} to {high:g}"
    return Derived(E, f"E = {E / 1e6:.3g} MPa from Shore A {hardness:g} by Gent's relation{inside}")


def modulus_of_shore_d(hardness: float) -> Derived:
    """E [Pa] of a hardness on Shore's scale D: Qi, Joyce, Boyce, Rubber Chem. Tech. 76 (2003).

    log10 E = .0235 (S + 50) - .6403, E in MPa.
    """
    E = 1e6 * 10 ** (0.0235 * (hardness + 50) - 0.6403)
    low, high = QI_RANGE_D
    inside = "" if low <= hardness <= high else f", outside its {low:g} to {high:g}"
    return Derived(E, f"E = {E / 1e6:.3g} MPa from Shore D {hardness:g} by Qi's relation{inside}")


def of_infill(solid: MaterialValue, share: float) -> tuple[MaterialValue, str]:
    """Value of a print filled to ``share`` (0, 1]: Gibson and Ashby's open cells, E ~ share^2."""
    value = solid._replace(E=solid.E * share**2, rho=solid.rho * share)
    how = (
        f"{share:.0%} infill: E = {value.E:.3g} Pa, rho = {value.rho:.3g} kg/m3 as open cells "
        "(Gibson and Ashby); solid walls are not counted"
    )
    return value, how


def with_fibres(matrix: MaterialValue, fibre: str, share: float) -> tuple[MaterialValue, str]:
    """Value of a moulded matter with short fibres of a ``share`` of its mass; nu stays.

    Cox and Krenchel: E = orientation length V E_f + (1 - V) E_m with the efficiencies of
    Thomason's moulded bars and of Cox's shear lag; volumes for the density.
    """
    kind = FIBRES[fibre]
    if share <= 0:
        return matrix, ""
    volume = share / kind.rho / (share / kind.rho + (1 - share) / matrix.rho)
    length = _length_efficiency(matrix, kind, volume)
    E = ALONG * length * volume * kind.E + (1 - volume) * matrix.E
    value = matrix._replace(E=E, rho=volume * kind.rho + (1 - volume) * matrix.rho)
    how = (
        f"{share:.0%} of short {fibre} fibres by mass: E = {value.E:.3g} Pa, "
        f"rho = {value.rho:.4g} kg/m3 by Cox and Krenchel, along the flow of the mould"
    )
    return value, how


def _length_efficiency(matrix: MaterialValue, fibre: Fibre, volume: float) -> float:
    """Cox's share of its stress that a short fibre takes, Br. J. Appl. Phys. 3 (1952)."""
    lag = 2 * matrix.E / (fibre.E * (1 + matrix.nu) * math.log(1 / volume))
    x = math.sqrt(lag) * fibre.aspect
    return 1 - math.tanh(x) / x
