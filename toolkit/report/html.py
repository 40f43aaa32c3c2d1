"""The written part of the report as its template wants it: words and numbers, which it escapes."""

from __future__ import annotations

import base64
import hashlib
import json
import logging
import os
import re
import sys
from base64 import b64encode
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...converters.files import writing
from ...fem.errors import InputError
from ...fem.table import Span
from ..verdict.verdict import (
    MARKS,
    Verdict,
    mass_words,
    rounded,
    si,
    si_span,
    value_words,
    volume_words,
)
from .content import Case, Fact, PartRow, ReportContent
from .picture import PALETTES, PARTS

if TYPE_CHECKING:
    from jinja2 import Environment


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


# The numbers of the report as one JSON text: arrays in base64, safe inside a script element.

# Motion is thinned to this many numbers (frames x points x 3), 4.8 MB as base64 of int16: with 5 MB
# of plotly, a page of 20k tets stays below 12 MB.
MOTION_NUMBERS = 1_800_000
# What could end the element or is a line break to older script engines.
_ESCAPES = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}


def payload(content: ReportContent) -> str:
    """JSON text with the geometry of every case (equal ones once), its values and its motion."""
    geometries: list[dict] = []
    meshes: list = []
    cases = []
    for case in content.cases:
        same = (i for i, mesh in enumerate(meshes) if _same_shape(mesh, case.mesh))
        index = next(same, len(meshes))
        if index == len(meshes):
            meshes.append(case.mesh)
            geometries.append(_geometry(case))
        material = case.mesh.material
        assert material is not None  # Case guarantees it
        values: dict[str, object] = {
            name: _packed(getattr(material, name), "<f4") for name in ("E", "nu", "rho")
        }
        if case.von_mises is not None:
            values["von_mises"] = _packed(case.von_mises, "<f4")
        if case.displacement is not None:
            values["displacement"] = _quantised(case.displacement[None])
        cases.append(
            {
                "geometry": index,
                **values,
                **_motion(case, frames_shown(case, content)),
                **_vibrations(case),
                **_marks(case),
                "state": case.state,
                "clock": case.clock,
                **_touch(case),
                **_dial(case),
            }
        )
    document = {
        "up": content.up,
        "palettes": PALETTES,
        "parts": PARTS,
        "geometries": geometries,
        "cases": cases,
    }
    return json.dumps(document, allow_nan=False).translate(_ESCAPES)


def frames_shown(case: Case, content: ReportContent) -> np.ndarray:
    """Ids of the motion frames that the page has room for, first and last among them."""
    if case.motion is None:
        return np.arange(0)
    frames = len(case.motion)
    room = MOTION_NUMBERS // (len(content.cases) * case.motion[0].size)
    return np.unique(np.linspace(0, frames - 1, min(frames, max(2, room))).round().astype(int))


def _same_shape(a, b) -> bool:
    return (
        np.array_equal(a.points, b.points)
        and np.array_equal(a.tets, b.tets)
        and np.array_equal(a.region, b.region)
        and a.region_names == b.region_names
    )


def _geometry(case: Case) -> dict:
    mesh, look = case.mesh, case.look
    seen = {"colors": look.colors, "index": _packed(look.index, "u1")} if look else None
    return {
        "points": _packed(mesh.points, "<f4"),
        "tets": _packed(mesh.tets, "<u4"),
        "region": _packed(mesh.region, "<u4"),
        "names": list(mesh.region_names),
        "look": seen,
    }


def _motion(case: Case, shown: np.ndarray) -> dict:
    if case.motion is None or case.times is None:
        return {}
    return {"motion": _quantised(case.motion[shown]), "times": case.times[shown].tolist()}


def _vibrations(case: Case) -> dict:
    """Shapes of a largest length of 1 m each, and their frequencies [Hz]."""
    if case.vibrations is None or not case.frequencies:
        return {}
    largest = np.linalg.norm(case.vibrations, axis=2).max(axis=1)
    shapes = case.vibrations / largest[:, None, None]
    return {"vibrations": {**_quantised(shapes), "frequencies": list(case.frequencies)}}


def _marks(case: Case) -> dict:
    """Supports and loads to draw: places [m], and ways relative to the largest load."""
    if case.marks is None:
        return {}
    return {"marks": {name: array.tolist() for name, array in case.marks._asdict().items()}}


def _touch(case: Case) -> dict:
    """The reduced body: what it is stepped with exactly, what it is drawn with in 16-bit steps."""
    if case.touch is None:
        return {}
    model = case.touch.model
    used, faces = np.unique(model.faces, return_inverse=True)
    basis = model.basis[used]
    scales = np.abs(basis).max(axis=(0, 1)) / 32767
    lam, mu = model.lame
    gradients = model.gradients.reshape(len(model.cells), 9, -1).swapaxes(1, 2)
    exact = {"gradients": gradients, "weights": model.weights, "lam": lam, "mu": mu}
    region = np.zeros(len(model.points))
    region[case.mesh.tets.ravel()] = np.repeat(case.mesh.region, 4)
    packed = {
        **{name: _packed(array, "<f8") for name, array in exact.items()},
        "springs": _packed(model.springs, "<f8"),
        "basis": _packed(np.rint(basis / scales), "<i2"),
        "points": _packed(model.points[used], "<f4"),
        "faces": _packed(faces, "<u4"),
        "region": _packed(region[used], "<u4"),
    }
    shown = {"magnification": case.touch.magnification, "slowness": case.touch.slowness}
    return {"touch": {**packed, **shown, "dofs": model.dofs, "scales": scales.tolist()}}


def _dial(case: Case) -> dict:
    """Where the case lies between soft and stiff, and E [Pa] of its parts there."""
    if case.alpha is None:
        return {}
    E, parts = ([getattr(row, name) for row in case.parts] for name in ("E", "name"))
    return {"dial": {"alpha": case.alpha, "text": case.text, "parts": parts, "E": E}}


def _quantised(frames: np.ndarray) -> dict:
    """Displacements as 16-bit steps of ``step`` [m]: an error below 2e-5 of the largest."""
    step = float(np.abs(frames).max(initial=0)) / 32767 or 1.0
    return {
        "step": step,
        "frames": len(frames),
        "steps": _packed(np.rint(frames / step), "<i2"),
    }


def _packed(array: np.ndarray, dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode()


# The report: one self-contained, offline HTML page about one mesh and its material cases.

log = logging.getLogger(__name__)

# The viewer, in the order of its parts.
SCRIPTS = tuple(
    f"report_{part}.js"
    for part in (
        "tets", "cut", "scale", "camera", "marks", "view", "tools", "player", "controls", "reduced",
        "touch", "dial", "main",
    )
)  # fmt: skip


def write_report(path: str | os.PathLike[str], content: ReportContent) -> Path:
    """Write the page to ``path`` in one step and return it."""
    path = Path(path)
    page = report_page(content)
    path.parent.mkdir(parents=True, exist_ok=True)
    with writing(path) as partial:
        partial.write_text(page, encoding="utf-8", newline="\n")
    log.info("wrote %s (%.1f MB)", path, path.stat().st_size / 1e6)
    return path


def report_page(content: ReportContent) -> str:
    """The page as text: template, style, data, plotly and the viewer, no reference to outside."""
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    scripts = [_inline(get_plotlyjs()), _inline("".join(map(_text, SCRIPTS)))]
    # Content security policy: only these scripts run, and nothing is fetched from anywhere
    digests = (hashlib.sha256(text.encode()).digest() for text in scripts)
    allowed = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
    return render(
        "report.html",
        **page(content),
        policy=(
            f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
            "img-src data: blob:; base-uri 'none'; form-action 'none'"
        ),
        # Ours, or made so that they cannot end their elements: not escaped again.
        style=Markup(_text("report.css")),
        data=Markup(payload(content)),
        plotly=Markup(scripts[0]),
        viewer=Markup(scripts[1]),
    )


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _inline(script: str) -> str:
    """Script text that cannot end its own element and hashes alike here and in a browser."""
    script = script.replace("\r\n", "\n").replace("\r", "\n").replace("\0", "�")
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


# Templates of pages: Jinja fills them in, and escapes every word that is not ``Markup``.

FOLDER = Path(__file__).parent / "templates"


def render(name: str, **values: Any) -> str:
    """Fill in the template of that name; a value that it wants and does not get is an error."""
    return _environment().get_template(name).render(values)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


# A window on a result that lies in a file: a mesh, or a motion with a slider for its frames.

FIRST = ("motion.pvd", "mesh.vtu", "mesh.msh")  # of a run's folder


def show_in_window(result: Path, *, colour: str | None = None, picture: Path | None = None) -> None:
    """Open a window on a mesh or a motion, or draw the picture; a slider has the frames.

    ``result`` is a .pvd, .vtu, .vtk or .msh file, or the folder of a run; ``colour`` names the
    array to colour by.

    Raises
    ------
    InputError
        Where pyvista or a display is missing, or the file has no such array.
    """
    try:
        pyvista: Any = import_module("pyvista")  # typed, it would take a checker longer than us
    except ImportError as error:
        raise InputError("view needs pyvista: pip install 'autophyx-tet[view]'") from error
    path = _file(result)
    frames = _frames(path)
    grids = [pyvista.UnstructuredGrid(*grid) for grid, _ in frames]
    for grid, (_, arrays) in zip(grids, frames, strict=True):
        for name, (kind, values) in arrays.items():
            (grid.point_data if kind == "point" else grid.cell_data)[name] = values
    known = grids[-1].array_names
    chosen = colour or next((n for n in ("von_mises", "displacement", "E") if n in known), None)
    if colour is not None and colour not in known:
        raise InputError(f"{path} has no {colour!r}: there are {', '.join(known)}")
    if picture is None and not _has_display():
        raise InputError("view: there is no display to open a window on; --picture FILE.png draws")
    plotter: Any = pyvista.Plotter(off_screen=picture is not None, title=str(path))

    def show(frame: float) -> None:
        plotter.add_mesh(grids[round(frame)], scalars=chosen, name="body", show_edges=True)

    show(len(grids) - 1)
    plotter.add_axes()
    if len(grids) > 1 and picture is None:
        plotter.add_slider_widget(show, [0, len(grids) - 1], title="frame", fmt="%.0f")
    plotter.show(screenshot=picture or False)


def _has_display() -> bool:
    """Whether a window can open: on Linux X or Wayland is named in the environment."""
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return not sys.platform.startswith("linux") or bool(named)


def _file(result: Path) -> Path:
    """The file to look at: of a folder, its motion or its mesh."""
    if not result.is_dir():
        return result
    found = next((result / name for name in FIRST if (result / name).is_file()), None)
    if found is None:
        raise InputError(f"{result} has none of {', '.join(FIRST)}: give the folder of a run")
    return found


def _frames(path: Path) -> list[tuple[tuple[Any, ...], dict[str, tuple[str, Any]]]]:
    """Of every frame the cells, their types and the moved points, and the arrays by name."""
    import numpy as np

    from ...converters.mesh.meshdata import read_data
    from ...converters.mesh.vtk import read_pvd

    series = [data for _, data in read_pvd(path)] if path.suffix.lower() == ".pvd" else None
    found = []
    for data in series or [read_data(path)]:
        mesh = data.mesh
        cells = np.insert(mesh.tets, 0, 4, axis=1).ravel()
        moved = mesh.points + data.point_data.get("displacement", 0)
        arrays = {name: ("point", values) for name, values in data.point_data.items()}
        arrays |= {name: ("cell", values) for name, values in data.cell_data.items()}
        if mesh.material is not None:
            names = ("E", "nu", "rho")
            arrays |= {name: ("cell", getattr(mesh.material, name)) for name in names}
        kinds = np.full(len(mesh.tets), 10, np.uint8)  # VTK's number of a tetrahedron
        found.append(((cells, kinds, moved), arrays))
    return found
