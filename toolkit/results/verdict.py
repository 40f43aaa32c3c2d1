"""Verdicts: what was found, in plain words, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from ...fem.verdicts import Check

Mark = Literal["good", "note", "warning", "bad"]
# How a mark is drawn where there are letters only.
MARKS: dict[Mark, str] = {"good": "✓", "note": "i", "warning": "!", "bad": "✕"}
# What to do about a check that failed, by its name.
ADVICE = {
    "holds shape": "If it should stand, say a stiffer material for what gives way, and check the "
    "size: --size is the longest side in metres.",
    "buckling": "Slender parts want a stiffer material, more thickness or a support higher up.",
    "discretisation": "For closer numbers convert to a finer mesh: --edge-length-rel 0.03 or less.",
    "locking": "--order 2 has elements that do not lock; a coarser mesh makes them affordable.",
    "explicit step": "This matters to explicit simulators only; implicit ones, as here, take any.",
    "first frequency": "It will be seen to swing: a stiffer material or thicker parts prevent it.",
    "distinguishable": "Say materials that differ more, or load it more: --scenario wind or drop.",
    "strength": "A stronger material or a thicker part; at a sharp corner a finer mesh says more.",
    "mass": "Say whether it is hollow: --wall METRES, --part-wall NAME=METRES or NAME=solid.",
    "inside band": "--strict makes this an error; --material NAME=MATERIAL takes another row.",
}
# Checks whose failure changes what the body can be used for.
SERIOUS = ("holds shape", "buckling", "strength", "size", "no penetration")


@dataclass(frozen=True)
class Verdict:
    """One finding in plain words; ``detail`` is its short name, ``advice`` what to do about it."""

    mark: Mark
    sentence: str
    detail: str = ""
    advice: str = ""

    @classmethod
    def of(cls, check: Check) -> Verdict:
        """Word a check of the solver."""
        if check.passed:
            return cls("good", check.sentence, check.name)
        mark = "warning" if check.name in SERIOUS else "note"
        return cls(mark, check.sentence, check.name, ADVICE.get(check.name, ""))
