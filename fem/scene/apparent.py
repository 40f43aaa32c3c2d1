"""Apparent material: a solid that weighs and bends as the wall and the filling that it stands for.

A wall too thin for its own elements is smeared over the solid inside the same surface. With bars
for the wall and its filling side by side, and J = integral of z^2 over the body about its centroid,
z along its shortest principal axis:

    rho = phi rho_wall + (1 - phi) rho_inside      phi  = V_wall / V     mass kept
    E J = E_wall J_wall + E_inside J_inside        beta = J_wall / J     bending stiffness kept

J is that of Euler and Bernoulli's E I = E integral of z^2 dA, taken over the body. For a plate of
height h between skins t it gives the sandwich law beta = 1 - (1 - 2 t / h)^3, for a tube beta =
1 - (r / R)^4 (Roark's Formulas for Stress and Strain, ch. 8). What is not kept: stretching
along the wall is stiffer than it is (by beta / phi <= 3), a dent in a wall is not seen at all.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError
from .materials import MaterialValue


@dataclass(frozen=True)
class WallShare:
    """The wall's share of a body: ``volume`` phi [1] and ``bending`` beta [1], both in (0, 1]."""

    volume: float
    bending: float

    def __post_init__(self) -> None:
        for name in ("volume", "bending"):
            value = getattr(self, name)
            if not 0 < value <= 1:
                raise InputError(f"the wall's share of the {name} must be in (0, 1], got {value:g}")

    def stiffness(self, wall, inside: float):
        """Apparent E [Pa] of a wall and what it holds; ``wall`` may be an array of any shape."""
        return self.bending * wall + (1 - self.bending) * inside

    def density(self, wall, inside: float):
        """Apparent rho [kg/m^3] of a wall and what it holds; ``wall`` may be an array."""
        return self.volume * wall + (1 - self.volume) * inside


def apparent_material(
    wall: MaterialValue, share: WallShare, *, inside_rho: float = 0.0, inside_E: float = 0.0
) -> MaterialValue:
    """Return E [Pa], nu [1], rho [kg/m^3] of the solid that stands for a wall and its filling.

    ``inside_rho`` [kg/m^3] and ``inside_E`` [Pa] are those of what it holds, 0 for air.
    """
    return MaterialValue(
        share.stiffness(wall.E, inside_E), wall.nu, share.density(wall.rho, inside_rho)
    )
