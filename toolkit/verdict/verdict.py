"""Verdicts: what was found, in plain words, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

import numpy as np

if TYPE_CHECKING:
    from .checks import Check


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

    def doubted(why: str) -> list[Verdict]:
        return [
            replace(one, mark="note", sentence=f"{one.sentence} {why}")
            if one.mark == "good" and one.detail in OF_THE_BODY
            else one
            for one in found
        ]

    if any(one.detail == "size" and one.mark != "good" for one in found):
        found = doubted("That is at this size.")
    if not differences:
        return list(found)
    first = f"The mesh differs from the file: {'; '.join(differences)}."
    of_mesh = doubted("That is the mesh's.")
    return [Verdict("warning", first, "body", ADVICE["body"]), *of_mesh]


_COLUMNS = ("part", "material", "E", "nu", "kg/m³", "mass", "because")


@runtime_checkable
class Told(Protocol):
    """What has a document."""

    def document(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        ...


def in_a_line(result: Told) -> str:
    """Name of the result, its size, what was found, and how many warnings there are."""
    return f"<{type(result).__name__}: {', '.join(_facts(result.document()))}>"


def as_table(result: Told) -> str:
    """HTML of the same with a row a part, the verdicts and the warnings."""
    document = result.document()
    lines = [f"<b>{escape(type(result).__name__)}</b>: {escape(', '.join(_facts(document)))}"]
    if rows := document.get("parts"):
        cells = [
            (
                row["name"],
                row["material"],
                si(row["E"], "Pa"),
                rounded(row["nu"], 3),
                rounded(row["rho"], 4),
                mass_words(row["mass"]),
                row["why"],
            )
            for row in rows
        ]
        table = "".join(
            f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in row)}</tr>" for row in cells
        )
        head = "".join(f"<th>{name}</th>" for name in _COLUMNS)
        lines.append(f"<table><tr>{head}</tr>{table}</table>")
    found = [f"{MARKS[v.mark]} {v.sentence}" for v in _verdicts(document)]
    found += [f"⚠ {warning}" for warning in document.get("warnings", ())]
    return "<br>".join([*lines, *map(escape, found)])


def _facts(document: Mapping[str, Any]) -> Iterator[str]:
    if parts := document.get("parts") or document.get("regions"):
        yield f"{len(parts)} part{'s' * (len(parts) > 1)}"
    if document.get("tets"):
        yield f"{document['tets']:,} tets"
    if document.get("mass"):
        yield mass_words(document["mass"])
    elif document.get("volume"):
        yield volume_words(document["volume"])
    if document.get("scenario"):
        yield document["scenario"]
    if failed := sum(verdict.mark in ("warning", "bad") for verdict in _verdicts(document)):
        yield f"{failed} verdict{'s' * (failed > 1)} not met"
    if unmade := sum(verdict.mark == "unmade" for verdict in _verdicts(document)):
        yield f"{unmade} not made"
    if count := len(document.get("warnings", ())):
        yield f"{count} warning{'s' * (count > 1)}"


def _verdicts(document: Mapping[str, Any]) -> list[Verdict]:
    found = list(document.get("verdicts", ()))
    for value in document.values():
        if isinstance(value, Mapping) and value.get("verdicts"):
            found += value["verdicts"]
    return found


_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}


def si(value: float, unit: str) -> str:
    """Value with an SI prefix: ``si(1.2e9, "Pa") gives 1.20 GPa``."""
    power = 0
    if value != 0 and np.isfinite(value):
        power = int(np.clip(3 * np.floor(np.log10(abs(value) * (1 + 1e-9)) / 3), -9, 9))
    return f"{rounded(value / 10**power, 3)}\u00a0{_PREFIXES[power]}{unit}"


def si_span(lo: float, hi: float, unit: str) -> str:
    """Two values with their prefixes, or one where they are close."""
    return si(lo, unit) if np.isclose(lo, hi) else f"{si(lo, unit)} – {si(hi, unit)}"


def mass_words(value: float) -> str:
    """Mass [kg] in the unit a scale would show."""
    if 0 < value < 1:
        return si(value * 1e3, "g")
    return f"{rounded(value, 3)}\u00a0kg" if value < 1e4 else f"{rounded(value / 1e3, 3)}\u00a0t"


def area_words(value: float) -> str:
    """Area [m^2] in mm², cm² or m²: a prefix before a square would be squared with it."""
    for size, unit, most in ((1e6, "mm²", 1e-4), (1e4, "cm²", 1.0)):
        if value < most:
            return f"{rounded(value * size, 3)}\u00a0{unit}"
    return f"{rounded(value, 3)}\u00a0m²"


def volume_words(value: float) -> str:
    """Volume [m^3] in mm³, cm³ or m³."""
    for size, unit, most in ((1e9, "mm³", 1e-6), (1e6, "cm³", 1e-1)):
        if value < most:
            return f"{rounded(value * size, 3)}\u00a0{unit}"
    return f"{rounded(value, 3)}\u00a0m³"


def rounded(value: float, digits: int) -> str:
    """Value to so many digits; a dash where it is not finite."""
    if not np.isfinite(value):
        return "–"
    if value != 0 and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    # 9.9999999999 is ten: it has one decimal less
    decimals = digits - 1 - int(np.floor(np.log10(abs(value) * (1 + 1e-9)))) if value else 0
    return f"{value:,.{max(0, min(decimals, 6))}f}"


def value_words(value: object) -> str:
    """Any value of a document in words: yes and no, numbers to four digits, lists with commas."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return f"{value:,}"
    if isinstance(value, float | np.floating):
        return rounded(float(value), 4)
    if isinstance(value, list | tuple):
        return ", ".join(map(value_words, value))
    return "–" if value is None else str(value)
