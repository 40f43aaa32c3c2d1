"""A result in one line, for a prompt, and as a small table, for a notebook."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any, Protocol, runtime_checkable

from .quantities import mass_words, rounded, si, volume_words
from .verdict import MARKS, Verdict

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
        head = "".join(f"<th>{name}</th>" for name in _COLUMNS)
        lines.append(f"<table><tr>{head}</tr>{''.join(map(_row, rows))}</table>")
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


def _row(part: Mapping[str, Any]) -> str:
    cells = (
        part["name"],
        part["material"],
        si(part["E"], "Pa"),
        rounded(part["nu"], 3),
        rounded(part["rho"], 4),
        mass_words(part["mass"]),
        part["why"],
    )
    return f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in cells)}</tr>"
