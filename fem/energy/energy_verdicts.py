"""Verdicts on the energy of a motion."""

from __future__ import annotations

from ..result import MotionResult
from ..scene.scene import Scene
from ..verdicts import Check, percent
from .balance import EnergyBalance, energy_balance

# A motion may have this share more energy than it was given. Elements and reduced bodies: 1 % is
# what BDF2 is inexact by in an impact (tests/fem/test_energy.py), twice that the limit.
EXCESS = 0.02
# Springs: explicit steps show their fastest vibrations with too much; falls, spins, bounces and
# wobbles that keep their energy had up to 1.8 % more, steps that are too long 4 to 28 %.
SPRING_EXCESS = 0.03
# Particles: their grid only takes; what keeps its energy had at most .013 % more.
PARTICLE_EXCESS = 0.001
# A frame that loses more than this share has an impact in it that is shorter than the frame.
SUDDEN = 0.25


def keeps_energy(motion: MotionResult, scene: Scene) -> tuple[Check, ...]:
    """Whether no energy is made of nothing, and what is lost; whether its impacts are followed."""
    if (found := energy_balance(motion, scene)) is None:
        return ()
    share, gone, most = found.excess / found.given, found.lost / found.given, _limit(motion)
    passed, limit = share <= most, f"(limit {percent(most)})"
    if passed:
        said = f"It never has more energy than the {found.given:.3g} J that it was given {limit}"
        said += f"; {gone:.1%} of that is lost at the end, to {_takers(motion, scene)}."
    else:
        said = f"It has {found.excess:.3g} J more than the {found.given:.3g} J that it was given: "
        said += f"{percent(share)} too much {limit}. Its steps make energy of nothing."
    check = Check("energy", passed, share, most, said)
    return (check, *_impact(motion, found))


def _limit(motion: MotionResult) -> float:
    """Share of energy made of nothing that is no error of the ``motion``, by its method."""
    if motion.particles is not None:
        return PARTICLE_EXCESS
    return EXCESS if motion.order else SPRING_EXCESS


def _takers(motion: MotionResult, scene: Scene) -> str:
    """What may take energy from a motion, in words."""
    rubs = ["friction"] if scene.friction and scene.obstacles else []
    particles = motion.particles is not None
    flows = ["flow, cracks, damping", "what its grid does not carry"] if particles else []
    return " and ".join([", ".join([*rubs, *flows]), "its time steps"]).removeprefix(" and ")


def _impact(motion: MotionResult, found: EnergyBalance) -> tuple[Check, ...]:
    """That a frame, where it is one step, takes most of the energy; nothing where none does.

    Where nothing is met it is a swing that begins and ends within few frames.
    """
    share = found.dropped / found.given
    if not motion.order or share <= SUDDEN:
        return ()
    lost = (
        f"{found.dropped:.3g} J of {found.given:.3g} J are lost in the one step of "
        f"{motion.dt:.2g} s that ends at {found.time:.3g} s"
    )
    if not motion.contact_forces.any():
        said = f"It swings faster than its steps show: {lost}."
        return (Check("fast swing", False, share, SUDDEN, said),)
    said = f"An impact is not followed: {lost}; it does not rebound as it would."
    return (Check("impact", False, share, SUDDEN, said),)
