"""One self-contained, offline HTML page about one mesh and its material cases.

``page`` gives the template its words and numbers, which it escapes; ``payload`` gives the viewer
its arrays, as one JSON text.
"""

from __future__ import annotations

import base64
import hashlib
import json
import logging
import os
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...converters.files import writing
from ...fem.errors import InputError
from ...fem.mesh import TetMesh
from ...fem.note import Note
from ...fem.reduced.model import ReducedModel
from ...fem.table import Span
from ...predictors.asset import UpAxis
from ..verdict.check import (
    MARKS,
    Check,
    mass_words,
    rounded,
    si,
    si_span,
    value_words,
    volume_words,
)
from ..verdict.description import PLACES, Acting, Marks
from .picture import PALETTES, PARTS

if TYPE_CHECKING:
    from jinja2 import Environment

log = logging.getLogger(__name__)

FOLDER = Path(__file__).parent / "templates"
# The viewer, in the order of its parts.
SCRIPTS = (
    "tets", "cut", "scale", "camera", "marks", "view", "tools", "player", "controls", "reduced",
    "touch", "dial", "main",
)  # fmt: skip
ALIKE = 1e-6  # of a value: what differs less is round-off, too little to be cut into bins
HEIGHT, WIDTH, BINS = 110, 360, 36  # of a histogram, in its own pixels
GAP, ROOM = 1.2, 6  # between its bars, and above the highest
# Motion is thinned to this many numbers (frames x points x 3), 4.8 MB as base64 of int16: with 5 MB
# of plotly, a page of 20k tets stays below 12 MB.
MOTION_NUMBERS = 1_800_000
_ADDRESS = re.compile(r"(https?://[^\s;,<>\"']+[^\s;,.<>\"')])")
# What could end the data's element or is a line break to older script engines.
_ESCAPES = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}


Fact = tuple[str, str]  # a label, and words


class Look(NamedTuple):
    """Colours as ``#rrggbb``, at most ``MOST``, and which of them each tet has, shape (tets,)."""

    colors: tuple[str, ...]
    index: Int[np.ndarray, "tets"]


class TouchBody(NamedTuple):
    """A body to pull.

    ``magnification`` and ``slowness`` [1] are how many times larger and slower than it is it is
    shown; ``moved`` [m] is how far ``FINGER`` N move its softest place.
    """

    model: ReducedModel
    magnification: float
    slowness: float
    moved: float

    @property
    def words(self) -> str:
        """How it is shown, in words."""
        size = "as large as it is"
        if self.magnification > 1:
            size = f"magnified {self.magnification:,.0f} times"
        pace = "in its own time" if self.slowness == 1 else f"{self.slowness:,.0f} times slower"
        return f"Its motion is shown {size} and {pace}."


@dataclass(frozen=True)
class PartRow:
    """One row of the material table; ``words`` of the text decided on ``material``.

    Units: ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], ``volume`` [m^3], ``mass`` [kg].
    """

    name: str
    material: str
    words: str
    E: float
    nu: float
    rho: float
    volume: float
    mass: float
    source: str = ""
    E_span: Span | None = None
    nu_span: Span | None = None
    rho_span: Span | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """One text and what follows from it; several cases are shown side by side.

    text: The sentence that chose the materials.
    mesh: The tets with their material.
    parts: The material table.
    displacement: Static displacement [m], shape (points, 3).
    von_mises: Von Mises stress of the static state [Pa], shape (tets,): the mean of each tet.
    max_von_mises: The largest at the points [Pa], as verdicts judge it; None: the largest of the
        tets.
    motion: Displacement [m] of every frame, shape (frames, points, 3).
    times: Time [s] of every frame, increasing, shape (frames,).
    frequencies: Natural frequencies [Hz].
    vibrations: Shapes that belong to them, of any size, shape (modes, points, 3).
    state, clock: What ``displacement`` is called, and whether ``times`` are seconds or shares of
        the load.
    title, acting: What was simulated, and everything that held and loaded the body, in words.
    marks: Where supports and loads are drawn.
    solved: How it was solved: law, elements, solver ..., label and words.
    answers: What a reader asks first: what moves most, whether it gives way ...
    places: What every support carries and every load does, in the columns of ``PLACES``.
    touch: The body to pull; None: the page has none.
    look: How the asset looks, by tets; None: it has no colours.
    alpha: Place of what is not said between soft (0) and stiff (1), where cases differ by it.
    """

    text: str
    mesh: TetMesh
    parts: tuple[PartRow, ...] = ()
    displacement: Float[np.ndarray, "points 3"] | None = None
    von_mises: Float[np.ndarray, "tets"] | None = None
    motion: Float[np.ndarray, "frames points 3"] | None = None
    times: Float[np.ndarray, "frames"] | None = None
    frequencies: tuple[float, ...] = ()
    verdicts: tuple[Check, ...] = ()
    title: str = ""
    acting: tuple[Acting, ...] = ()
    marks: Marks | None = None
    solved: tuple[Fact, ...] = ()
    answers: tuple[Fact, ...] = ()
    places: tuple[Mapping[str, str], ...] = ()
    touch: TouchBody | None = None
    vibrations: Float[np.ndarray, "modes points 3"] | None = None
    state: str = "Under load"
    clock: Literal["time", "load"] = "time"
    look: Look | None = None
    alpha: float | None = None
    max_von_mises: float | None = None

    def __post_init__(self) -> None:
        points, tets = len(self.mesh.points), len(self.mesh.tets)
        if self.mesh.material is None:
            raise InputError("the report needs a mesh with E, nu and rho: run `assign` first")
        frames = 0 if self.motion is None else len(self.motion)
        wanted = {
            "displacement": (points, 3),
            "von_mises": (tets,),
            "motion": (frames, points, 3),
            "times": (frames,),
            "vibrations": (len(self.frequencies), points, 3),
        }
        for name, shape in wanted.items():
            array = getattr(self, name)
            if array is None:
                continue
            if array.shape != shape:
                raise InputError(f"{name} of the report must have shape {shape}, got {array.shape}")
            if not np.isfinite(array).all():
                bad = int((~np.isfinite(array)).sum())
                raise InputError(f"{name} has {bad} values that are not finite: cannot be drawn")
        if frames and self.times is None:
            raise InputError(f"motion of {frames} frames needs the time [s] of every frame")


@dataclass(frozen=True, eq=False)
class ReportContent:
    """Everything the report shows.

    ``quality`` maps a label to a number or word, or to a 1-D array, which becomes a histogram.
    ``provenance`` maps a label to a value or to a mapping of such (hashes, versions, options).
    ``up`` is the axis of the mesh that points up. ``pictures`` maps a caption to a PNG or GIF's
    bytes. ``made`` says when and by what, ``command`` how to make it again, ``loaded`` what was
    read and meshed.
    """

    title: str
    cases: tuple[Case, ...]
    up: UpAxis = "z"
    quality: Mapping[str, object] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    made: str = ""
    command: str = ""
    loaded: tuple[Fact, ...] = ()

    def __post_init__(self) -> None:
        if not self.cases:
            raise InputError("a report needs at least one case, got none")


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

    style, *parts = (
        (FOLDER / name).read_text(encoding="utf-8")
        for name in ("report.css", *(f"report_{part}.js" for part in SCRIPTS))
    )
    scripts = []
    for script in (get_plotlyjs(), "".join(parts)):
        # a script can not end its own element, and hashes alike here and in a browser
        script = script.replace("\r\n", "\n").replace("\r", "\n").replace("\0", "�")
        scripts.append(script.replace("</script", "<\\/script").replace("<!--", "<\\!--"))
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
        style=Markup(style),
        data=Markup(payload(content)),
        plotly=Markup(scripts[0]),
        viewer=Markup(scripts[1]),
    )


def render(name: str, **values: Any) -> str:
    """Fill in the template of that name; a value that it wants and does not get is an error."""
    return _environment().get_template(name).render(values)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,  # every word that is not Markup
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def page(content: ReportContent) -> dict[str, Any]:
    """Values of the report's template by their names in it."""
    warnings = [*content.warnings]
    for case in content.cases:
        shown = frames_shown(case, content).size
        if case.motion is not None and shown < len(case.motion):
            warnings.append(Note("html.frames_shown", shown=shown, frames=len(case.motion)))
    pictures = [
        (caption, "gif" if data.startswith(b"GIF") else "png", base64.b64encode(data).decode())
        for caption, data in content.pictures.items()
    ]
    numbers, histograms = [], []
    for key, value in _flat(content.quality):
        if not isinstance(value, np.ndarray):
            numbers.append((key, value_words(value)))
        elif value.ndim == 1 and np.isfinite(value).any():
            histograms.append(_histogram(key, value[np.isfinite(value)]))
    several = len(content.cases) > 1
    return {
        "title": content.title,
        "columns": PLACES,
        "made": content.made,
        "command": content.command,
        "loaded": content.loaded,
        "warnings": warnings,
        "cases": [_column(c, chr(65 + i) if several else "") for i, c in enumerate(content.cases)],
        "pictures": pictures,
        "quality": numbers,
        "histograms": histograms,
        "provenance": [(key, value_words(value)) for key, value in _flat(content.provenance)],
    }


def _flat(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}, ")
        else:
            yield f"{prefix}{key}", value


def _column(case: Case, letter: str) -> dict[str, Any]:
    """One case on the page; ``letter`` tells it from the others, where there are any.

    A source is its words in pieces, each with the address that it leads to, or none.
    """
    text, alpha = case.text, case.alpha
    if alpha is not None:
        end = "soft" if alpha == 0 else "stiff" if alpha == 1 else "between"
        text += f" ({end}, α = {alpha:g})"
    findings = [
        {
            "mark": verdict.mark,
            "sign": MARKS[verdict.mark],
            "sentence": verdict.sentence,
            "below": verdict.advice or ("" if verdict.mark == "good" else verdict.name),
        }  # what makes the body unfit for its use stands first
        for verdict in sorted(case.verdicts, key=lambda one: one.mark in ("good", "note"))
    ]
    sources = list(dict.fromkeys(part.source for part in case.parts if part.source))
    rows = []
    for part in case.parts:
        E = part.E_span and si_span(part.E_span.min, part.E_span.max, "Pa")
        nu, rho = (
            span and f"{span.min:.4g}" + (f" – {span.max:.4g}" if span.max > span.min else "")
            for span in (part.nu_span, part.rho_span)
        )
        numbers = (
            ("E", si(part.E, "Pa"), E),
            ("ν", f"{part.nu:.3g}", nu),
            ("ρ", f"{rounded(part.rho, 4)} kg/m³", rho),
            ("Volume", volume_words(part.volume), ""),
            ("Mass", mass_words(part.mass), ""),
        )
        source = f"[{sources.index(part.source) + 1}]" if part.source else "–"
        words = {"name": part.name, "material": part.material, "words": part.words or "–"}
        rows.append({**words, "numbers": numbers, "source": source})
    size = f"{len(case.mesh.tets):,} tets, {len(case.mesh.points):,} points"
    return {
        "letter": letter,
        "text": text,
        "title": case.title,
        "answers": case.answers,
        "acting": case.acting,
        "places": case.places,
        "solved": [*case.solved, ("Mesh", size)],
        "findings": findings,
        "facts": [*_facts(case)],
        "touch": case.touch.words if case.touch else "",
        "rows": rows,
        "sources": [
            # every second piece is an address, told by its host alone
            [(p.split("/")[2], p) if i % 2 else (p, "") for i, p in enumerate(pieces) if p]
            for pieces in map(_ADDRESS.split, sources)
        ],
    }


def _facts(case: Case) -> Iterator[Fact]:
    from markupsafe import Markup

    def longest(vectors: np.ndarray) -> str:
        return si(float(np.linalg.norm(vectors, axis=-1).max()), "m")

    mesh, material = case.mesh, case.mesh.material
    assert material is not None  # Case guarantees it
    lo, hi = mesh.bounds
    yield "Size", " × ".join(si(side, "m") for side in hi - lo)
    yield "Mass", mass_words(mesh.mass)
    yield "Volume", volume_words(mesh.volume)
    yield Markup("Stiffness <i>E</i>"), si_span(material.E.min(), material.E.max(), "Pa")
    if case.displacement is not None:
        yield "Largest displacement", longest(case.displacement)
    if case.von_mises is not None:
        largest = case.max_von_mises or float(case.von_mises.max())
        yield "Largest von Mises stress", si(largest, "Pa")
    if case.motion is not None and case.times is not None and case.clock == "time":
        lasts = si(float(np.ptp(case.times)), "s")
        yield "Motion", f"{len(case.times)} frames, {lasts}, up to {longest(case.motion)}"
    if case.frequencies:
        yield "Natural frequencies", ", ".join(si(f, "Hz") for f in case.frequencies)


def _histogram(label: str, values: np.ndarray) -> dict[str, Any]:
    """Bars for a picture that is readable without any script, and values below its axis."""
    middle, half = (values.max() + values.min()) / 2, (values.max() - values.min()) / 2
    half = max(float(half), ALIKE * abs(float(middle)), np.finfo(float).tiny)
    counts, edges = np.histogram(values, bins=BINS, range=(middle - half, middle + half))
    step = WIDTH / BINS
    bars = [
        {
            "x": f"{i * step:.2f}",
            "y": f"{HEIGHT - high:.2f}",
            "width": f"{step - GAP:.2f}",
            "height": f"{high:.2f}",
            "words": f"{edges[i]:.4g} – {edges[i + 1]:.4g}: {counts[i]:,}",
        }
        for i, high in enumerate(counts / counts.max() * (HEIGHT - ROOM))
    ]
    middle = (edges[0] + edges[-1]) / 2
    ticks = ((0, "start", edges[0]), (WIDTH / 2, "middle", middle), (WIDTH, "end", edges[-1]))
    return {
        "label": label,
        "count": f"{values.size:,}",
        "median": f"{np.median(values):.4g}",
        "bars": bars,
        "ticks": [(f"{x:g}", anchor, f"{value:.4g}") for x, anchor, value in ticks],
        "width": WIDTH,
        "height": HEIGHT,
    }


def payload(content: ReportContent) -> str:
    """JSON text with the geometry of every case (equal ones once), its values and its motion.

    Arrays are in base64; the text is safe inside a script element.
    """
    geometries: list[dict] = []
    meshes: list = []
    cases = []
    for case in content.cases:
        mesh, material = case.mesh, case.mesh.material
        assert material is not None  # Case guarantees it
        index = next((i for i, other in enumerate(meshes) if _same_shape(mesh, other)), len(meshes))
        if index == len(meshes):
            meshes.append(mesh)
            look = case.look
            geometries.append(
                {
                    "points": _packed(mesh.points, "<f4"),
                    "tets": _packed(mesh.tets, "<u4"),
                    "region": _packed(mesh.region, "<u4"),
                    "names": list(mesh.region_names),
                    "look": look and {"colors": look.colors, "index": _packed(look.index, "u1")},
                }
            )
        values: dict[str, object] = {"geometry": index}
        for name in ("E", "nu", "rho"):
            values[name] = _packed(getattr(material, name), "<f4")
        if case.von_mises is not None:
            values["von_mises"] = _packed(case.von_mises, "<f4")
        if case.displacement is not None:
            values["displacement"] = _quantised(case.displacement[None])
        if case.motion is not None and case.times is not None:
            shown = frames_shown(case, content)
            values["motion"] = _quantised(case.motion[shown])
            values["times"] = case.times[shown].tolist()
        if case.vibrations is not None and case.frequencies:
            # shapes of a largest length of 1 m each
            largest = np.linalg.norm(case.vibrations, axis=2).max(axis=1)
            shapes = _quantised(case.vibrations / largest[:, None, None])
            values["vibrations"] = {**shapes, "frequencies": list(case.frequencies)}
        if case.marks is not None:
            values["marks"] = {name: at.tolist() for name, at in case.marks._asdict().items()}
        values |= {"state": case.state, "clock": case.clock}
        if case.touch is not None:
            values["touch"] = _touch(case, case.touch)
        if case.alpha is not None:
            E, parts = ([getattr(row, name) for row in case.parts] for name in ("E", "name"))
            values["dial"] = {"alpha": case.alpha, "text": case.text, "parts": parts, "E": E}
        cases.append(values)
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
    arrays = ("points", "tets", "region")
    same = (np.array_equal(getattr(a, name), getattr(b, name)) for name in arrays)
    return all(same) and a.region_names == b.region_names


def _touch(case: Case, touch: TouchBody) -> dict:
    """The reduced body: what it is stepped with exactly, what it is drawn with in 16-bit steps."""
    model = touch.model
    used, faces = np.unique(model.faces, return_inverse=True)
    basis = model.basis[used]
    scales = np.abs(basis).max(axis=(0, 1)) / 32767
    lam, mu = model.lame
    region = np.zeros(len(model.points))
    region[case.mesh.tets.ravel()] = np.repeat(case.mesh.region, 4)
    gradients = model.gradients.reshape(len(model.cells), 9, -1).swapaxes(1, 2)
    return {
        "gradients": _packed(gradients, "<f8"),
        "weights": _packed(model.weights, "<f8"),
        "lam": _packed(lam, "<f8"),
        "mu": _packed(mu, "<f8"),
        "springs": _packed(model.springs, "<f8"),
        "basis": _packed(np.rint(basis / scales), "<i2"),
        "points": _packed(model.points[used], "<f4"),
        "faces": _packed(faces, "<u4"),
        "region": _packed(region[used], "<u4"),
        "magnification": touch.magnification,
        "slowness": touch.slowness,
        "dofs": model.dofs,
        "scales": scales.tolist(),
    }


def _quantised(frames: np.ndarray) -> dict:
    """Displacements as 16-bit steps of ``step`` [m]: an error below 2e-5 of the largest."""
    step = float(np.abs(frames).max(initial=0)) / 32767 or 1.0
    return {"step": step, "frames": len(frames), "steps": _packed(np.rint(frames / step), "<i2")}


def _packed(array: np.ndarray, dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode()


FIRST = ("motion.pvd", "mesh.vtu", "mesh.msh")  # what a window shows of a run's folder


def show_in_window(result: Path, *, colour: str | None = None, picture: Path | None = None) -> None:
    """Open a window on a mesh or a motion, or draw the picture; a slider has the frames.

    ``result`` is a .pvd, .vtu, .vtk or .msh file, or the folder of a run; ``colour`` names the
    array to colour by.

    Raises InputError: Where pyvista or a display is missing, or the file has no such array.
    """
    from ...converters.mesh.meshdata import read_data
    from ...converters.mesh.vtk import read_pvd

    try:
        pyvista: Any = import_module("pyvista")  # typed, it would take a checker longer than us
    except ImportError as error:
        raise InputError("view needs pyvista: pip install 'autophyx-tet[view]'") from error
    path = result
    if result.is_dir():
        path = next((result / name for name in FIRST if (result / name).is_file()), None)
        if path is None:
            raise InputError(f"{result} has none of {', '.join(FIRST)}: give the folder of a run")
    moving = path.suffix.lower() == ".pvd"
    frames = ([data for _, data in read_pvd(path)] if moving else None) or [read_data(path)]
    grids = []
    for frame in frames:
        mesh = frame.mesh
        cells = np.insert(mesh.tets, 0, 4, axis=1).ravel()
        kinds = np.full(len(mesh.tets), 10, np.uint8)  # VTK's number of a tetrahedron
        moved = mesh.points + frame.point_data.get("displacement", 0)
        grid = pyvista.UnstructuredGrid(cells, kinds, moved)
        for name, values in frame.point_data.items():
            grid.point_data[name] = values
        for name, values in frame.cell_data.items():
            grid.cell_data[name] = values
        for name in ("E", "nu", "rho") if mesh.material is not None else ():
            grid.cell_data[name] = getattr(mesh.material, name)
        grids.append(grid)
    known = grids[-1].array_names
    chosen = colour or next((n for n in ("von_mises", "displacement", "E") if n in known), None)
    if colour is not None and colour not in known:
        raise InputError(f"{path} has no {colour!r}: there are {', '.join(known)}")
    # on Linux X or Wayland is named in the environment, where a window can open
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if picture is None and sys.platform.startswith("linux") and not named:
        raise InputError("view: there is no display to open a window on; --picture FILE.png draws")
    plotter: Any = pyvista.Plotter(off_screen=picture is not None, title=str(path))

    def show(frame: float) -> None:
        plotter.add_mesh(grids[round(frame)], scalars=chosen, name="body", show_edges=True)

    show(len(grids) - 1)
    plotter.add_axes()
    if len(grids) > 1 and picture is None:
        plotter.add_slider_widget(show, [0, len(grids) - 1], title="frame", fmt="%.0f")
    plotter.show(screenshot=picture or False)
