"""Verdicts: what was found, in plain words, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from ...fem.verdicts import Check

Mark = Literal["good", "note", "warning", "bad", "unmade"]
# How a mark is drawn where there are letters only.
MARKS: dict[Mark, str] = {"good": "✓", "note": "i", "warning": "!", "bad": "✕", "unmade": "?"}
# What to do about a check that failed, by its name.
ADVICE = {
    "holds shape": "If it should stand, say a stiffer material for what gives way, and check the "
    "size: --size is the longest side in metres.",
    "buckling": "Slender parts want a stiffer material, more thickness or a support higher up.",
    "upright": "The other answers are of a base that is held: --fix tells by what; else a wider "
    "base, more weight low down or less load.",
    "discretisation": "For closer numbers convert to a finer mesh: --edge-length-rel of half that, "
    "or of half of what it was made with.",
    "locking": "--order 2 has elements that do not lock; --solver lbs wants a finer mesh.",
    "explicit step": "This matters to explicit simulators only; implicit ones, as here, take any.",
    "first frequency": "It will be seen to swing: a stiffer material or thicker parts prevent it.",
    "distinguishable": "Say materials that differ more, or load it more: --scenario wind or drop.",
    "strength": "A stronger material or a thicker part; at a sharp corner a finer mesh says more.",
    "dial": "Density moves too: what is stiffer may be heavier; --set PART:rho=... holds it.",
    "energy": "Do not rely on this motion; --solver fem has steps that only lose energy.",
    "impact": "That it settles is right, how it rebounds is not; in Python motions take "
    "frames=... and scheme=Scheme.BDF2, for steps far shorter than the impact.",
    "fast swing": "Where it comes to rest is right; --scenario modal tells how fast it swings.",
    "size": "Weight, stress and motion all follow from its size: none is right before it is.",
    "mass": "Say whether it is hollow: --wall METRES, --part-wall NAME=METRES or NAME=solid.",
    "body": "Convert it again as the sentence says, before the answer is relied on.",
    "inside band": "--strict makes this an error; --material NAME=MATERIAL takes another row.",
}
# Checks whose failure changes what the body can be used for.
SERIOUS = (
    "holds shape",
    "buckling",
    "upright",
    "strength",
    "size",
    "no penetration",
    "energy",
    "reduced model",
)
# Checks whose answer is another one where the mesh is another body than the file.
OF_THE_BODY = (
    "holds shape", "buckling", "upright", "strength", "first frequency", "range", "mass",
)  # fmt: skip


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
        if check.outcome == "passed":
            return cls("good", check.sentence, check.name)
        if check.outcome == "doubtful":
            return cls("note", f"{check.sentence} {check.doubt}", check.name)
        if check.outcome == "not made":
            return cls("unmade", check.sentence, check.name)
        mark = "warning" if check.name in SERIOUS else "note"
        return cls(mark, check.sentence, check.name, ADVICE.get(check.name, ""))


def with_doubts(found: Sequence[Verdict], differences: Sequence[str]) -> list[Verdict]:
    """Verdicts without a sure good where another one, or the mesh, puts them in doubt.

    That is where the size is that of another unit, and where the mesh has ``differences`` from its
    file, which come first.
    """
    if any(one.detail == "size" and one.mark != "good" for one in found):
        found = _doubted(found, "That is at this size.")
    if not differences:
        return list(found)
    first = f"The mesh differs from the file: {'; '.join(differences)}."
    of_mesh = _doubted(found, "That is the mesh's.")
    return [Verdict("warning", first, "body", ADVICE["body"]), *of_mesh]


def _doubted(found: Sequence[Verdict], why: str) -> list[Verdict]:
    return [
        replace(one, mark="note", sentence=f"{one.sentence} {why}")
        if one.mark == "good" and one.detail in OF_THE_BODY
        else one
        for one in found
    ]
