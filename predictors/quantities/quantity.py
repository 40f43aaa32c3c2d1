"""What is said in numbers of a material: a value, a second matter in it, a relation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

# Of a material: Young's modulus [Pa], Poisson's ratio [1], density [kg/m^3], hardness on two of
# Shore's scales [1], filled share of a print [1], mass [kg] and thickness [m] of what is spoken of.
Measure = Literal["E", "nu", "rho", "shore_a", "shore_d", "infill", "mass", "thickness"]


@dataclass(frozen=True)
class Quantity:
    """A number that was said, in SI units, and the words that say it.

    ``called`` tells whether a word or symbol says what it measures, and not its unit alone.
    """

    measure: Measure
    value: float
    text: str
    called: bool = True


def wall_said(part: str, numbers: Sequence[Quantity]) -> Quantity | None:
    """The thickness of the wall that numbers give a part: "2 mm walls", not "2 mm thick".

    A part that is called a wall has none around it.
    """
    if "wall" in part.lower():
        return None
    said = (n for n in numbers if n.measure == "thickness" and "wall" in n.text.lower())
    return next(said, None)


@dataclass(frozen=True)
class Blend:
    """A second matter inside the first: 30 % of glass fibre in nylon."""

    material: str
    share: float


@dataclass(frozen=True)
class Comparison:
    """What is said of a part beside another: "twice as stiff as the legs".

    Parameters
    ----------
    measure
        What is compared: E or rho.
    factor
        How many times the other's value; above 1 without a number where it is ``exact`` no more
        than "stiffer", below 1 for "softer".
    exact
        Whether a number was said.
    other
        The words that name the other part; () for all others.
    """

    measure: Literal["E", "rho"]
    factor: float
    exact: bool
    other: tuple[str, ...]
