"""The written part of the report as its template wants it: words and numbers, which it escapes."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...fem.scene.materials import Span
from ..results.quantities import mass_words, rounded, si, si_span, value_words, volume_words
from ..results.verdict import MARKS, Verdict
from .content import Case, Fact, PartRow, ReportContent
from .data import frames_shown

ALIKE = 1e-6  # of a value: what differs less is round-off, too little to be cut into bins
_ADDRESS = re.compile(r"(https?://[^\s;,<>\"']+[^\s;,.<>\"')])")
HEIGHT, WIDTH, BINS = 110, 360, 36  # of a histogram, in its own pixels
GAP, ROOM = 1.2, 6  # between its bars, and above the highest


class Finding(NamedTuple):
    """A verdict with the sign it is marked by, and what stands below it in small print."""

    mark: str
    sign: str
    sentence: str
    below: str


class Cell(NamedTuple):
    """A number of the material table, and the span that the material allows."""

    value: str
    span: str = ""


class TableRow(NamedTuple):
    """One part in the material table; ``source`` is the number of its source."""

    name: str
    material: str
    words: str
    numbers: tuple[tuple[str, Cell], ...]
    source: str


class Column(NamedTuple):
    """One case on the page; ``letter`` tells it from the others, where there are any.

    ``title`` and ``acting`` say what was simulated, ``answers`` what came of it, ``solved`` how,
    ``touch`` how the body to pull is shown. A source is its words in pieces, each with the address
    it leads to, or none.
    """

    letter: str
    text: str
    title: str
    answers: tuple[Fact, ...]
    acting: list[tuple[str, str]]
    solved: list[Fact]
    findings: list[Finding]
    facts: list[Fact]
    touch: str
    rows: list[TableRow]
    sources: list[list[tuple[str, str]]]


class Bar(NamedTuple):
    """A bar of a histogram in its picture, and its numbers."""

    x: str
    y: str
    width: str
    height: str
    words: str


class Histogram(NamedTuple):
    """How many values lie where; ``ticks`` are values below the axis with their place."""

    label: str
    count: str
    median: str
    bars: list[Bar]
    ticks: list[tuple[str, str, str]]
    width: int = WIDTH
    height: int = HEIGHT


def page(content: ReportContent) -> dict[str, Any]:
    """Values of the report's template by their names in it."""
    return {
        "title": content.title,
        "made": content.made,
        "command": content.command,
        "loaded": content.loaded,
        "warnings": [*_warnings(content)],
        "cases": [_column(case, i, content) for i, case in enumerate(content.cases)],
        "pictures": [
            (caption, "gif" if picture.startswith(b"GIF") else "png", b64encode(picture).decode())
            for caption, picture in content.pictures.items()
        ],
        "quality": [
            (key, value_words(value))
            for key, value in _flat(content.quality)
            if not isinstance(value, np.ndarray)
        ],
        "histograms": [*_histograms(content.quality)],
        "provenance": [(key, value_words(value)) for key, value in _flat(content.provenance)],
    }


def _place_words(alpha: float | None) -> str:
    """Where between soft and stiff a case lies, "" of one that no dial turns."""
    if alpha is None:
        return ""
    return f" ({'soft' if alpha == 0 else 'stiff' if alpha == 1 else 'between'}, α = {alpha:g})"


def _column(case: Case, index: int, content: ReportContent) -> Column:
    sources = list(dict.fromkeys(part.source for part in case.parts if part.source))
    return Column(
        letter=chr(65 + index) if len(content.cases) > 1 else "",
        text=case.text + _place_words(case.alpha),
        title=case.title,
        answers=case.answers,
        acting=[(acting.kind, acting.words) for acting in case.acting],
        solved=[*case.solved, ("Mesh", _mesh_words(case))],
        findings=[_finding(one) for one in sorted(case.verdicts, key=_is_mild)],
        facts=[*_facts(case)],
        touch=case.touch.words if case.touch else "",
        rows=[_row(part, sources) for part in case.parts],
        sources=[_linked(source) for source in sources],
    )


def _linked(words: str) -> list[tuple[str, str]]:
    """Words in pieces; an address is told by its host alone, and leads where it says."""
    pieces = _ADDRESS.split(words)
    texts, addresses = pieces[::2], pieces[1::2]
    links = [(address.split("/")[2], address) for address in addresses]
    return [piece for pair in zip(((t, "") for t in texts), [*links, ("", "")], strict=True)
            for piece in pair if piece[0]]  # fmt: skip


def _mesh_words(case: Case) -> str:
    return f"{len(case.mesh.tets):,} tets, {len(case.mesh.points):,} points"


def _is_mild(verdict: Verdict) -> bool:
    """Whether it may stand below what makes the body unfit for its use."""
    return verdict.mark in ("good", "note")


def _finding(verdict: Verdict) -> Finding:
    below = verdict.advice or (verdict.detail if verdict.mark != "good" else "")
    return Finding(verdict.mark, MARKS[verdict.mark], verdict.sentence, below)


def _facts(case: Case) -> Iterator[Fact]:
    from markupsafe import Markup

    mesh, material = case.mesh, case.mesh.material
    assert material is not None  # Case guarantees it
    lo, hi = mesh.bounds
    yield "Size", " × ".join(si(side, "m") for side in hi - lo)
    yield "Mass", mass_words(mesh.mass)
    yield "Volume", volume_words(mesh.volume)
    yield Markup("Stiffness <i>E</i>"), si_span(material.E.min(), material.E.max(), "Pa")
    if case.displacement is not None:
        yield "Largest displacement", si(_longest(case.displacement), "m")
    if case.von_mises is not None:
        largest = case.max_von_mises or float(case.von_mises.max())
        yield "Largest von Mises stress", si(largest, "Pa")
    if case.motion is not None and case.times is not None and case.clock == "time":
        lasts, reaches = si(float(np.ptp(case.times)), "s"), si(_longest(case.motion), "m")
        yield "Motion", f"{len(case.times)} frames, {lasts}, up to {reaches}"
    if case.frequencies:
        yield "Natural frequencies", ", ".join(si(f, "Hz") for f in case.frequencies)


def _longest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())


def _warnings(content: ReportContent) -> Iterator[str]:
    yield from content.warnings
    for case in content.cases:
        shown = frames_shown(case, content).size
        if case.motion is not None and shown < len(case.motion):
            yield (
                f"The page shows {shown} of {len(case.motion)} motion frames to stay small; "
                "the motion file has them all."
            )


def _row(part: PartRow, sources: list[str]) -> TableRow:
    numbers = (
        ("E", Cell(si(part.E, "Pa"), _stiffness_span(part.E_span))),
        ("ν", Cell(f"{part.nu:.3g}", _span(part.nu_span))),
        ("ρ", Cell(f"{rounded(part.rho, 4)} kg/m³", _span(part.rho_span))),
        ("Volume", Cell(volume_words(part.volume))),
        ("Mass", Cell(mass_words(part.mass))),
    )
    source = f"[{sources.index(part.source) + 1}]" if part.source else "–"
    return TableRow(part.name, part.material, part.words or "–", numbers, source)


def _stiffness_span(span: Span | None) -> str:
    return "" if span is None else si_span(span.min, span.max, "Pa")


def _span(span: Span | None) -> str:
    if span is None:
        return ""
    return f"{span.min:.4g} – {span.max:.4g}" if span.max > span.min else f"{span.min:.4g}"


def _flat(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}, ")
        else:
            yield f"{prefix}{key}", value


def _histograms(values: Mapping[str, object]) -> Iterator[Histogram]:
    for label, array in _flat(values):
        if isinstance(array, np.ndarray) and array.ndim == 1 and np.isfinite(array).any():
            yield _histogram(label, array[np.isfinite(array)])


def _histogram(label: str, array: np.ndarray) -> Histogram:
    """Bars for a picture that is readable without any script."""
    middle, half = (array.max() + array.min()) / 2, (array.max() - array.min()) / 2
    half = max(float(half), ALIKE * abs(float(middle)), np.finfo(float).tiny)
    counts, edges = np.histogram(array, bins=BINS, range=(middle - half, middle + half))
    step = WIDTH / BINS
    bars = [
        Bar(
            x=f"{i * step:.2f}",
            y=f"{HEIGHT - high:.2f}",
            width=f"{step - GAP:.2f}",
            height=f"{high:.2f}",
            words=f"{edges[i]:.4g} – {edges[i + 1]:.4g}: {counts[i]:,}",
        )
        for i, high in enumerate(counts / counts.max() * (HEIGHT - ROOM))
    ]
    places = (0, "start", edges[0]), (WIDTH / 2, "middle", (edges[0] + edges[-1]) / 2)
    ticks = [(f"{x:g}", to, f"{v:.4g}") for x, to, v in (*places, (WIDTH, "end", edges[-1]))]
    return Histogram(label, f"{array.size:,}", f"{np.median(array):.4g}", bars, ticks)
