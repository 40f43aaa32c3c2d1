"""Checks: what was found, its number beside its limit, and in plain words what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any, Literal

import numpy as np

from ...fem.note import Note, severity_of
from . import template

Outcome = Literal["passed", "failed", "doubtful", "not made"]
Mark = Literal["good", "note", "warning", "unmade"]
# How a mark is drawn where there are letters only.
MARKS: dict[Mark, str] = {"good": "✓", "note": "i", "warning": "!", "unmade": "?"}
# Checks whose failure changes what the body can be used for.
SERIOUS = (
    "holds shape", "buckling", "upright", "strength", "size", "no penetration", "energy",
    "reduced model", "body", "attached",
)  # fmt: skip
# Option that changes the outcome, by the check's name.
PARAMETERS = {
    "holds shape": "size", "buckling": "material", "upright": "fix", "strength": "material",
    "discretisation": "edge_length_rel", "locking": "order", "supports": "fix",
    "first frequency": "material",
    "distinguishable": "scenario", "dial": "set", "energy": "solver", "fast swing": "scenario",
    "size": "size", "mass": "wall", "body": "edge_length", "inside band": "material",
}  # fmt: skip
# What the answer of every check rests on: one that passed is in doubt where any of these is.
BODY = ("body", "size", "materials", "loads")
SOLVED = ("attached", "supports", "discretisation", "locking")
RESTS_ON = {
    "holds shape": (*BODY, *SOLVED, "buckling"),
    "buckling": (*BODY, *SOLVED),
    "upright": (*BODY, "buckling"),
    "strength": (*BODY, *SOLVED, "buckling"),
    "first frequency": (*BODY, *SOLVED),
    "range": (*BODY, *SOLVED),
    "mass": BODY,
    "explicit step": ("size", "materials"),
    "inside band": ("materials",),
    "distinguishable": ("size", *SOLVED),
    "contact": (*BODY, *SOLVED, "impact", "energy", "no penetration"),
    "breakage": (*BODY, "energy", "particles"),
    "energy": ("particles",),
    "reduced model": ("locking",),
}


@dataclass(frozen=True)
class Check:
    """One finding: a number beside its limit, and its outcome.

    Parameters
    ----------
    name
        What was checked: "holds shape", "buckling" ...
    outcome
        "passed", "failed", "doubtful" or "not made".
    sentence
        The finding in words.
    value, limit, unit
        The number and what it is held against, NaN for none, in this SI unit ("1": a ratio).
    part, place
        Name of the part that it is of, and where in the body [m], shape (3,), if it is of one.
    why
        Why it is doubtful, or was not made.

    Examples
    --------
    >>> import autophyx_tet as apx
    >>> found = apx.Check("mass", "failed", "It weighs 9 t.", value=9000.0, limit=23.0, unit="kg")
    >>> found.mark, found.parameter
    ('note', 'wall')
    """

    name: str
    outcome: Outcome
    sentence: str
    value: float = np.nan
    limit: float = np.nan
    unit: str = "1"
    part: str = ""
    place: tuple[float, ...] | None = None
    why: str = ""

    @property
    def parameter(self) -> str:
        """Name of the option that changes the outcome; empty where none does."""
        return PARAMETERS.get(self.name, "")

    @property
    def mark(self) -> Mark:
        """How it is marked for people."""
        if self.outcome == "failed":
            return "warning" if self.name in SERIOUS else "note"
        marks: dict[str, Mark] = {"passed": "good", "doubtful": "note", "not made": "unmade"}
        return marks[self.outcome]

    @property
    def detail(self) -> str:
        """Its name, as JSON calls it."""
        return self.name

    @property
    def advice(self) -> str:
        """What to do about it, where it failed, or is in doubt by itself."""
        wanted = self.outcome == "failed" or (self.outcome == "doubtful" and not self.why)
        return (wanted and template(f"advice.{self.name.replace(' ', '_')}")) or ""

    def document(self) -> dict[str, Any]:
        """Return its row in ``--json``."""
        told = {"mark": self.mark, "sentence": self.sentence, "detail": self.name}
        names = ("advice", "outcome", "value", "limit", "unit", "part", "place", "parameter", "why")
        return told | {name: getattr(self, name) for name in names}


def with_doubts(checks: Sequence[Check]) -> list[Check]:
    """Checks, in doubt where what they rest on did not pass; a line at the end says which and why.

    A check that failed, is doubtful or was not made leaves in doubt what ``RESTS_ON`` it.
    """

    def named(names: Iterable[str]) -> str:
        words = [template(f"named.{name.replace(' ', '_')}") or name for name in names]
        return ", ".join(dict.fromkeys(words))

    unsure, found = {one.name for one in checks if one.outcome != "passed"}, []
    causes: list[str] = []
    doubted: list[str] = []
    for one in checks:
        why = [name for name in RESTS_ON.get(one.name, ()) if name in unsure]
        if why and one.outcome == "passed":
            one = replace(one, outcome="doubtful", why=named(why))
            causes += why
            doubted.append(one.name)
        found.append(one)
    if causes:
        said = Note("checks.in_doubt", causes=named(causes), doubted=named(doubted))
        found.append(Check("doubts", "doubtful", said))
    return found


_COLUMNS = ("part", "material", "E", "nu", "kg/m³", "mass", "because")


def in_a_line(result: Any) -> str:
    """Name of a result that has a document, its size, what was found, and how many warnings."""
    return f"<{type(result).__name__}: {', '.join(_facts(result.document()))}>"


def as_table(result: Any) -> str:
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
    found = [f"{MARKS[v['mark']]} {v['sentence']}" for v in _verdicts(document)]
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
    if failed := sum(verdict["mark"] == "warning" for verdict in _verdicts(document)):
        yield f"{failed} verdict{'s' * (failed > 1)} not met"
    if unmade := sum(verdict["mark"] == "unmade" for verdict in _verdicts(document)):
        yield f"{unmade} not made"
    if count := sum(severity_of(one) != "detail" for one in document.get("warnings", ())):
        yield f"{count} warning{'s' * (count > 1)}"


def _verdicts(document: Mapping[str, Any]) -> list[dict[str, Any]]:
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
