"""The written part of the report: every word from outside is escaped here, once."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping
from html import escape

import numpy as np

from ...fem.scene.materials import Span
from ..results.verdict import MARKS, Verdict
from .content import Case, PartRow, ReportContent
from .data import frames_shown

_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}


def si(value: float, unit: str, *, digits: int = 3) -> str:
    """Value with an SI prefix: ``si(1.2e9, "Pa") gives 1.20 GPa``."""
    power, prefix = _prefix(value)
    return f"{_rounded(value / 10**power, digits)}\u00a0{prefix}{unit}"


def mass_words(value: float) -> str:
    """Mass [kg] in the unit a scale would show."""
    if 0 < value < 1:
        return si(value * 1e3, "g")
    return f"{_rounded(value, 3)}\u00a0kg" if value < 1e4 else f"{_rounded(value / 1e3, 3)}\u00a0t"


def volume_words(value: float) -> str:
    """Volume [m^3] in mm³, cm³ or m³."""
    for size, unit in ((1e-6, "mm³"), (1e-1, "cm³")):
        if value < size:
            return f"{_rounded(value * (1e9 if unit == 'mm³' else 1e6), 3)}\u00a0{unit}"
    return f"{_rounded(value, 3)}\u00a0m³"


def sections(content: ReportContent) -> dict[str, str]:
    """Pieces of HTML by their name in the template."""
    return {
        "title": escape(content.title),
        "views": _for_each_case(_view, content),
        "findings": _for_each_case(_findings, content),
        "pictures": _pictures(content.pictures),
        "warnings": _warnings(_all_warnings(content)),
        "materials": _for_each_case(_materials, content),
        "quality": _numbers(content.quality),
        "histograms": "".join(_histograms(content.quality)),
        "provenance": _provenance(content.provenance),
    }


def _for_each_case(write: Callable[[Case, int, ReportContent], str], content) -> str:
    return "".join(write(case, index, content) for index, case in enumerate(content.cases))


def _prefix(value: float) -> tuple[int, str]:
    if value == 0 or not np.isfinite(value):
        return 0, ""
    power = int(np.clip(3 * np.floor(np.log10(abs(value) * (1 + 1e-9)) / 3), -9, 9))
    return power, _PREFIXES[power]


def _rounded(value: float, digits: int) -> str:
    if not np.isfinite(value):
        return "–"
    if value != 0 and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    decimals = digits - 1 - int(np.floor(np.log10(abs(value)))) if value else 0
    return f"{value:,.{max(0, min(decimals, 6))}f}"


def _letter(index: int, content: ReportContent) -> str:
    return f'<span class="letter">{chr(65 + index)}</span> ' if len(content.cases) > 1 else ""


def _pictures(pictures: Mapping[str, bytes]) -> str:
    """PNG files, each above its caption; nothing where there are none."""
    shown = "".join(
        f'<figure><img style="max-width:100%" alt="{escape(caption)}" '
        f'src="data:image/png;base64,{b64encode(png).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for caption, png in pictures.items()
    )
    return f'<section id="pictures"><h2>Pictures</h2>{shown}</section>' if shown else ""


def _view(case: Case, index: int, content: ReportContent) -> str:
    return (
        f'<article class="case"><blockquote>{_letter(index, content)}'
        f"{escape(case.text) or '<em>no text</em>'}</blockquote>"
        f'<div class="plot" id="plot{index}" role="img" tabindex="0" '
        f'aria-label="Interactive 3D view of the mesh"></div>'
        f'<p class="readout" id="readout{index}" aria-live="polite"></p></article>'
    )


def _findings(case: Case, index: int, content: ReportContent) -> str:
    facts = "".join(f"<div><dt>{k}</dt><dd>{v}</dd></div>" for k, v in _facts(case))
    verdicts = "".join(map(_verdict, case.verdicts))
    listed = f'<ul class="verdicts">{verdicts}</ul>' if verdicts else ""
    letter = _letter(index, content)
    return (
        f'<article class="case">{letter and f"<p>{letter}</p>"}{listed}'
        f'<dl class="facts">{facts}</dl></article>'
    )


def _facts(case: Case) -> Iterator[tuple[str, str]]:
    mesh, material = case.mesh, case.mesh.material
    assert material is not None  # Case guarantees it
    lo, hi = mesh.bounds
    yield "Size", " × ".join(si(side, "m") for side in hi - lo)
    yield "Mass", mass_words(mesh.mass)
    yield "Volume", volume_words(mesh.volume)
    yield "Stiffness <i>E</i>", _span(material.E.min(), material.E.max(), "Pa")
    if case.displacement is not None:
        yield "Largest displacement", si(_longest(case.displacement), "m")
    if case.von_mises is not None:
        yield "Largest von Mises stress", si(float(case.von_mises.max()), "Pa")
    if case.motion is not None and case.times is not None:
        lasts, reaches = si(float(np.ptp(case.times)), "s"), si(_longest(case.motion), "m")
        yield "Motion", f"{len(case.times)} frames, {lasts}, up to {reaches}"
    if case.frequencies:
        yield "First frequencies", ", ".join(si(f, "Hz") for f in case.frequencies[:3])
    yield "Mesh", f"{len(mesh.tets):,} tets, {len(mesh.points):,} points"


def _longest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())


def _span(lo: float, hi: float, unit: str) -> str:
    return si(lo, unit) if np.isclose(lo, hi) else f"{si(lo, unit)} – {si(hi, unit)}"


def _verdict(verdict: Verdict) -> str:
    below = verdict.advice or (verdict.detail if verdict.mark != "good" else "")
    detail = f"<small>{escape(below)}</small>" if below else ""
    return (
        f'<li class="{verdict.mark}"><b aria-label="{verdict.mark}">{MARKS[verdict.mark]}</b>'
        f"<span>{escape(verdict.sentence)}{detail}</span></li>"
    )


def _all_warnings(content: ReportContent) -> Iterator[str]:
    yield from content.warnings
    for case in content.cases:
        shown = frames_shown(case, content).size
        if case.motion is not None and shown < len(case.motion):
            yield (
                f"The page shows {shown} of {len(case.motion)} motion frames to stay small; "
                "the motion file has them all."
            )


def _warnings(warnings: Iterable[str]) -> str:
    items = "".join(f"<li>{escape(warning)}</li>" for warning in warnings)
    return f'<ul class="warnings" aria-label="Warnings">{items}</ul>' if items else ""


def _materials(case: Case, index: int, content: ReportContent) -> str:
    if not case.parts:
        return ""
    heads = ("Part", "Material", "Decided by", "<i>E</i>", "<i>ν</i>", "<i>ρ</i>", "Volume", "Mass")
    head = "".join(f'<th scope="col">{h}</th>' for h in (*heads, "Source"))
    sources = list(dict.fromkeys(part.source for part in case.parts if part.source))
    rows = "".join(_row(part, sources) for part in case.parts)
    caption = f"<caption>{_letter(index, content)}{escape(case.text)}</caption>"
    notes = "".join(f"<li>{escape(source)}</li>" for source in sources)
    return (
        '<div class="scroll" tabindex="0" role="region" aria-label="Materials of the parts">'
        f"<table>{caption if len(content.cases) > 1 else ''}"
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        f'<ol class="sources" aria-label="Sources">{notes}</ol>'
    )


def _row(part: PartRow, sources: list[str]) -> str:
    cells = (
        ("", escape(part.material)),
        ("words", escape(part.words) or "–"),
        ("number", si(part.E, "Pa") + _band(part.E_span, "Pa")),
        ("number", f"{part.nu:.3g}" + _band(part.nu_span, "")),
        ("number", f"{_rounded(part.rho, 4)} kg/m³" + _band(part.rho_span, "kg/m³")),
        ("number", volume_words(part.volume)),
        ("number", mass_words(part.mass)),
        ("number", f"[{sources.index(part.source) + 1}]" if part.source else "–"),
    )
    data = "".join(f'<td class="{kind}">{text}</td>' for kind, text in cells)
    return f'<tr><th scope="row">{escape(part.name)}</th>{data}</tr>'


def _band(band: Span | None, unit: str) -> str:
    if band is None:
        return ""
    if unit == "Pa":
        text = _span(band.min, band.max, unit)
    else:
        text = f"{band.min:.4g} – {band.max:.4g}" if band.max > band.min else f"{band.min:.4g}"
    return f"<small>{text}</small>"


def _numbers(values: Mapping[str, object]) -> str:
    shown = {k: v for k, v in _flat(values) if not isinstance(v, np.ndarray)}
    items = "".join(f"<div><dt>{escape(k)}</dt><dd>{_word(v)}</dd></div>" for k, v in shown.items())
    return f'<dl class="facts">{items}</dl>' if items else ""


def _flat(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}, ")
        else:
            yield f"{prefix}{key}", value


def _word(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return f"{value:,}"
    if isinstance(value, float | np.floating):
        return _rounded(float(value), 4)
    if isinstance(value, list | tuple):
        return ", ".join(map(_word, value))
    return escape("–" if value is None else str(value))


def _provenance(values: Mapping[str, object]) -> str:
    rows = "".join(
        f"<tr><th scope='row'>{escape(key)}</th><td>{_word(value)}</td></tr>"
        for key, value in _flat(values)
    )
    return f"<table>{rows}</table>" if rows else ""


def _histograms(values: Mapping[str, object]) -> Iterator[str]:
    for label, array in _flat(values):
        if isinstance(array, np.ndarray) and array.ndim == 1 and array.size:
            yield _histogram(label, array[np.isfinite(array)])


def _histogram(label: str, array: np.ndarray, *, bins: int = 36) -> str:
    """Bars as inline SVG, coloured by the style sheet: readable without any script."""
    if not array.size:
        return ""
    counts, edges = np.histogram(array, bins=bins)
    width, height = 360, 110
    step = width / bins
    bars = "".join(
        f'<rect x="{i * step:.2f}" y="{height - h:.2f}" width="{step - 1.2:.2f}" height="{h:.2f}">'
        f"<title>{edges[i]:.4g} – {edges[i + 1]:.4g}: {counts[i]:,}</title></rect>"
        for i, h in enumerate(counts / counts.max() * (height - 6))
    )
    middle = (edges[0] + edges[-1]) / 2
    ticks = "".join(
        f'<text x="{x}" y="{height + 16}" text-anchor="{anchor}">{value:.4g}</text>'
        for x, anchor, value in (
            (0, "start", edges[0]),
            (width / 2, "middle", middle),
            (width, "end", edges[-1]),
        )
    )
    return (
        f"<figure><figcaption>{escape(label)} <small>{array.size:,} values, "
        f"median {np.median(array):.4g}</small></figcaption>"
        f'<svg viewBox="0 0 {width} {height + 20}" role="img" aria-label="Histogram">'
        f'{bars}<line x1="0" x2="{width}" y1="{height}" y2="{height}"/>{ticks}</svg></figure>'
    )
