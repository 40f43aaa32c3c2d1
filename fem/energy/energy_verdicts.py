"""Verdicts on the energy of a motion."""

from __future__ import annotations

from ..result import MotionResult
from ..scene.scene import Scene
from ..verdicts import Check, percent
from .balance import EnergyBalance, energy_balance

# A motion may have this share more energy than it was given: what its steps are inexact by.
EXCESS = 0.02
# A frame that loses more than this share has an impact in it that is shorter than the frame.
SUDDEN = 0.25


def keeps_energy(motion: MotionResult, scene: Scene) -> tuple[Check, ...]:
    """Whether no energy is made of nothing, and what is lost; whether its impacts are followed."""
    if (found := energy_balance(motion, scene)) is None:
        return ()
    share, gone = found.excess / found.given, found.lost / found.given
    passed, limit = share <= EXCESS, f"(limit {percent(EXCESS)})"
    if passed:
        said = f"It never has more energy than the {found.given:.3g} J that it was given {limit}"
        said += f"; {gone:.1%} of that is lost at the end, to {_takers(motion, scene)}."
    else:
        said = f"It has {found.excess:.3g} J more than the {found.given:.3g} J that it was given: "
        said += f"{percent(share)} too much {limit}. Its steps make energy of nothing."
    check = Check("energy", passed, share, EXCESS, said)
    return (check, *_impact(motion, found))


def _takers(motion: MotionResult, scene: Scene) -> str:
    """What may take energy from a motion, in words."""
    rubs = ["friction"] if scene.friction and scene.obstacles else []
    flows = ["flow, cracks and damping"] if motion.particles is not None else []
    return " and ".join([*rubs, *flows, "its time steps"])


def _impact(motion: MotionResult, found: EnergyBalance) -> tuple[Check, ...]:
    """That a frame, where it is one step, takes most of the energy; nothing where none does."""
    share = found.dropped / found.given
    if not motion.order or share <= SUDDEN:
        return ()
    return (
        Check(
            "impact", False, share, SUDDEN,
            f"An impact is not followed: {found.dropped:.3g} J of {found.given:.3g} J are lost in "
            f"the one step of {motion.dt:.2g} s that ends at {found.time:.3g} s; it does not "
            "rebound as it would.",
        ),
    )  # fmt: skip
