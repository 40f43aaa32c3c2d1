"""The seam of elastic laws: what a law offers, and which there are."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from ..note import Note
from ..registry import Registry


class Law(StrEnum):
    """Names of the package's elastic laws; all answer with exactly (E, nu) at small strain."""

    LINEAR = "linear"
    NEO_HOOKEAN = "neohookean"
    COROTATED = "corotated"


@dataclass(frozen=True, eq=False, kw_only=True)
class ElasticLaw:
    """A density of elastic energy W(H) of the displacement gradient H = F - I, and what follows.

    All are functions of warp, of ``H`` (mat33d) and the Lame parameters ``lam`` and ``mu``
    (float64) [Pa]. Write them without cancellation at small H. The kernels of elements, the stress
    on the host and the gradients are all made of these functions. One of the four second
    derivatives is needed; where only one is there, Newton has no other.

    Parameters
    ----------
    title
        What the law is called in a sentence.
    energy_and_stress
        (H, lam, mu) -> W [J/m^3] and the first Piola stress P = dW/dF [Pa] (mat33d); linear in lam
        and mu.
    stress_change
        (H, dH, lam, mu) -> dP [Pa], the change of P with a change ``dH`` of H: the exact second
        derivative.
    exact_tangent
        (H, lam, mu) -> second derivative [Pa] (mat99d, entries of F column by column), of a law
        that knows it as a whole.
    projected_tangent
        (H, lam, mu) -> the same with its negative eigenvalues set to zero.
    stiffness_block
        (p, q, lam, mu) -> second derivative (mat33d) along the shape gradients p and q, of a law
        that is linear in H: it is the same everywhere, and positive.
    tangent_p1
        Kernel (points, elements, lam, mu, u, slots, values) that adds the exact tangent of P1 tets,
        where one written by hand is faster than the one made of ``stress_change``.
    finite
        Whether the law holds at large rotations: its strain is then Green's, its stress Cauchy's.
    """

    title: str
    energy_and_stress: Any
    stress_change: Any = None
    exact_tangent: Any = None
    projected_tangent: Any = None
    stiffness_block: Any = None
    tangent_p1: Any = None
    finite: bool = True

    def __post_init__(self) -> None:
        exact = self.stress_change or self.exact_tangent
        if not (exact or self.projected_tangent or self.stiffness_block):
            raise TypeError(Note("law.law_second", title=self.title))


LAWS: Registry[ElasticLaw] = Registry(
    "law",
    __package__ or "",
    {
        Law.LINEAR.value: "linear:LINEAR",
        Law.NEO_HOOKEAN.value: "neo_hookean:NEO_HOOKEAN",
        Law.COROTATED.value: "corotated:COROTATED",
    },
)
"""Elastic laws by name; ``LAWS.register("mine", ElasticLaw(...))`` adds one."""
