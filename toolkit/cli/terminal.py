"""What a person sees in the terminal: tables and sentences instead of JSON.

Each command names the function here that yields the tables and lines of its document.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from ...fem.note import severity_of
from ..options import EXPECTED

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from ..batch import Outcome

Document = Mapping[str, Any]
Shown = Iterator["Table | Text | str"]  # what `show` prints of a document, in order

MATTER = {"E": "E [Pa]", "nu": "nu", "rho": "kg/m³"}
PARTS = {"name": "part", "material": "material", **MATTER, "mass": "mass [kg]", "why": "because"}
REGIONS = {
    "number": "region", "colour": "colour", "fraction": "of the volume", "middle": "around [m]",
    "part": "part", "material": "material",
}  # fmt: skip
REGIONS_SHOWN = 12
_FRAME = re.compile(r"_(\d{5})(\.\w+)$")  # what frames of a motion are called
_FORMATS = {"rho": ".4g"}  # of numbers that three digits do not hold


def show(document: Document, lines: Callable[[Document], Shown]) -> None:
    """Print what ``lines`` yields of a document, its files, and its warnings on stderr."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    for shown in lines(document):
        if isinstance(shown, Table):
            console.print(shown)
        else:
            console.print(shown, markup=False, soft_wrap=True)
    # every file, but the frames of a motion as one
    files: dict[str, list[str]] = {}
    for path in map(str, document.get("files", ())):
        files.setdefault(_FRAME.sub(r"_*\2", path), []).append(path)
    for first, *others in files.values():
        frames = f" ... {len(others) + 1} frames" if others else ""
        console.print(f"wrote {first}{frames}", markup=False, soft_wrap=True)
    warn(document)


# How a line begins and looks, by how much it matters.
_GRAVITY = {"note": ("note", "dim"), "doubt": ("warning", "yellow"), "error": ("not used", "red")}


def warn(document: Document) -> None:
    """Print a document's warnings on stderr, without details, which need nothing done."""
    from rich.console import Console

    for warning in document.get("warnings", ()):
        if (severity := severity_of(warning)) == "detail":
            continue
        word, style = _GRAVITY[severity]
        Console(stderr=True, highlight=False).print(
            f"{word}:", warning, markup=False, style=style, soft_wrap=True
        )


def nothing(_: Document) -> Shown:
    """Files and warnings alone."""
    yield from ()


def plan(document: Document) -> Shown:
    """The steps of a dry run and what they may cost."""
    yield from (f"would {step}" for step in document["steps"])
    for name, cost in document["estimates"].items():
        unit, scale = {"memory": ("GB", 1e-9), "tets": ("tets", 1)}.get(name, ("s of a core", 1))
        low, likely, high = (f"{scale * cost[key]:,.3g}" for key in ("low", "likely", "high"))
        yield f"estimate, {name}: about {likely} {unit} ({low} to {high})"


def conversion(document: Document) -> Shown:
    """The quality of the tets, where it was asked for, and how many there are."""
    if rows := document.get("quality_rows"):
        yield table(rows, {name: name for name in rows[0]})
    yield _size(document)


def assignment(document: Document) -> Shown:
    """The materials of the parts and of regions, and whether they are usual."""
    yield table(document["parts"], PARTS)
    if rows := document["regions_by_look"]:
        shown = [
            row | {"middle": ", ".join(f"{x:.3g}" for x in row["middle"])}
            for row in rows[:REGIONS_SHOWN]
        ]
        yield table(shown, REGIONS)
        if len(rows) > len(shown):
            yield f"{len(rows) - len(shown)} smaller regions: --json"
    yield _size(document)
    yield from _verdicts(document)


def segmented(document: Document) -> Shown:
    """The parts that a thing was cut into."""
    names = {"name": "part", "fraction": "of the volume", "triangles": "triangles"}
    yield table(document["parts"], names)


def simulation(document: Document) -> Shown:
    """How a body settles, moves or rings, with its verdicts; and what moved with it."""
    yield _size(document)
    yield from _answer(document)
    if "drive" in document:
        yield from driven(document["drive"])


def run(document: Document) -> Shown:
    """Of every sentence the materials and the answer."""
    cases = document["cases"]
    for case in cases:
        if len(cases) > 1:
            from rich.text import Text

            yield Text(f"\n{case['text']!r}", style="bold")
        yield table(case["parts"], PARTS)
        yield _size(case)
        yield from _answer(case)
        yield from _verdicts(case)


def film(document: Document) -> Shown:
    """What is seen in a film, what it cost, the materials, and the verdicts of its motions."""
    from rich.text import Text

    made = document["film"]
    yield (
        f"{made['drawn']:,} splats in {made['frames']} frames, {made['floating']:,} float off the "
        f"body and are left out; {made['left']:,} left the grid, {made['needles']} needles; "
        f"foretold {document['foretold']:.0f} CPU s, {document['spent']:.0f} spent"
    )
    for case in document["cases"]:
        if len(document["cases"]) > 1:
            yield Text(f"\n{case['text']!r}", style="bold")
        yield table(case.get("parts", []), PARTS)
        yield from _verdicts(case)


def reduction(document: Document) -> Shown:
    """A reduced body in a line."""
    yield document["reduced"]["summary"]


def match(document: Document) -> Shown:
    """What was fitted in a line."""
    yield document["match"]["summary"]


def transfer(document: Document) -> Shown:
    """How many places got a material."""
    mass = f", opacity-weighted mass {document['mass']:.3g} kg" if document["mass"] else ""
    mass += " (splats overlap: it is not the body's)" if mass else ""
    yield f"{document['values']:,} places got E, nu and rho{mass}"


def driven(document: Document) -> Shown:
    """What moved with the mesh."""
    yield (
        f"{document['moved']:,} moved over {document['frames']} frames; "
        f"{document['outside']:,} outside the mesh follow its nearest tet"
    )


def export(document: Document) -> Shown:
    """What another program gets."""
    yield _size(document)
    if document["bins"]:
        yield f"{document['bins']:,} materials for {document['for']}"


def features(document: Document) -> Shown:
    """Labels of voxels by words, and what was seen."""
    if parts := document["parts"]:
        rows = [{"word": word, "voxels": count} for word, count in parts["voxels"].items()]
        yield table(rows, {"word": "word", "voxels": "voxels"})
    yield (
        f"{document['voxels']:,} voxels, {document['seen']:,} of them seen, "
        f"{document['channels']} channels of {document['encoder']}"
    )


def materials(document: Document) -> Shown:
    """Rows of the material table."""
    rows = document["materials"]
    if rows:
        yield table(rows, {"name": "material", "category": "category"} | MATTER)
        yield f"{len(rows)} materials; --json adds sources, aliases, strength, grain and colour"


def info(document: Document) -> Shown:
    """Regions, size and quality of a mesh file."""
    regions, found = document["regions"], document["quality"]
    columns = {"name": "part", "tets": "tets", "volume": "volume [m³]"}
    yield table(regions, columns | (MATTER if regions and "E" in regions[0] else {}))
    yield _size(document)
    none = "" if document["mass"] else "; no E, nu, rho: `assign` gives them"
    sides = document["bounds"][1] - document["bounds"][0]
    yield f"{' x '.join(f'{side:.3g}' for side in sides)} m{none}"
    yield (
        f"sharpest dihedral angle {found.dihedral_min:.3g}°, smallest altitude "
        f"{found.altitude_min:.3g} m, {found.components} connected pieces"
    )


def doctor(document: Document) -> Shown:
    """What is installed, and what is missing."""

    def versions(packages: Mapping[str, str | None]) -> str:
        return ", ".join(f"{name} {found or 'MISSING'}" for name, found in packages.items())

    yield (
        f"autophyx-tet {document['package']}, Python {document['python']}, {document['platform']}, "
        f"{document['cores']} cores, {document['memory'] / 1e9:.0f} GB"
    )
    yield f"libraries: {versions(document['libraries'])}"
    for extra, packages in document["extras"].items():
        advice = f" (pip install autophyx-tet[{extra}])" if None in packages.values() else ""
        yield f"extra {extra}: {versions(packages)}{advice}"
    for device in document["devices"]:
        yield f"device {device['name']}: {device['what']}"
    for file in document["weights"]:
        yield f"weights {file['name']}: {file['bytes'] / 1e6:.1f} MB"
    for name, place in document["programs"].items():
        yield f"program {name}: {place or 'not found'}"
    for cache in document["caches"]:
        size = f"{cache['files']} files, {cache['bytes'] / 1e6:.1f} MB"
        yield f"cache {cache['name']}: {size} in {cache['path']}"


def batch(document: Document) -> Shown:
    """The counts of a batch."""
    yield (
        f"{document['assets']} assets: {document['done']} done, {document['failed']} failed; "
        f"{document['new']} were run this time"
    )


def _size(document: Document) -> str:
    mass = f", mass {document['mass']:.3g} kg" if document["mass"] else ""
    return f"{document['tets']:,} tets, volume {document['volume']:.4g} m³{mass}"


def _verdicts(document: Document) -> Iterator[str]:
    """What was found, and what to do about it."""
    from ..verdict.check import MARKS

    for found in document["verdicts"]:
        yield " ".join(filter(None, (MARKS[found["mark"]], found["sentence"], found["advice"])))


def _answer(document: Document) -> Shown:
    """The numbers of a body at rest, in motion or ringing, and their verdicts."""
    from ..verdict.checks import percent
    from ..verdict.description import PLACES, place_rows

    if answer := document.get("sag"):
        yield (
            f"largest displacement {answer['max_displacement']:.3g} m "
            f"({percent(answer['sag_ratio'])} of its longest side), "
            f"largest von Mises stress {answer['max_von_mises']:.3g} Pa"
        )
        yield "; ".join(f"{label}: {words}" for label, words in answer["solution"].items())
        yield table(place_rows(answer), PLACES)
    elif answer := document.get("motion"):
        yield (
            f"{answer['frames']} frames of {answer['dt']:.3g} s, "
            f"a point moves by at most {answer['max_displacement']:.3g} m"
        )
        for number, force in enumerate(answer["max_obstacle_forces"] or (), 1):
            yield f"obstacle {number}: at most {force:.3g} N"
    else:
        answer = document["modal"]
        found = ", ".join(f"{frequency:.4g}" for frequency in answer["frequencies"])
        yield f"natural frequencies [Hz]: {found}"
    yield from _verdicts(answer)


def table(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> Table:
    """Rows under the titles of ``columns``: numbers to three digits, of a range both ends."""
    from rich.markup import escape
    from rich.table import Table

    def cell(key: str, value: Any) -> str:
        if isinstance(value, str | int):
            return f"{value:,}" if isinstance(value, int) else value
        numbers, form = value if isinstance(value, tuple) else (value,), _FORMATS.get(key, ".3g")
        ends = ("" if n is None else format(float(n), form) for n in numbers)
        return " – ".join(dict.fromkeys(ends))

    made = Table(box=None, header_style="bold", pad_edge=False)
    for key, title in columns.items():
        number = all(isinstance(row[key], int | float | tuple) for row in rows)
        made.add_column(title, justify="right" if number else "left")
    for row in rows:
        made.add_row(*(escape(cell(key, row[key])) for key in columns))
    return made


# Seconds of work before the first line of a log, and between two.
FIRST, AGAIN = 30.0, 30.0


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Callable[[str, float], None] | None]:
    """Give a callback for (stage, seconds), or None where nobody would see it.

    On a terminal it is a live line on stderr; a log hears of the last stage now and then, however
    rarely there is a new one.
    """
    if quiet:
        yield None
        return
    if sys.stderr.isatty():
        from rich.console import Console

        console = Console(stderr=True)
        with console.status("loading") as status:

            def show(stage: str, seconds: float, /) -> None:
                if stage.startswith(EXPECTED):
                    console.print(stage, markup=False, highlight=False)
                status.update(f"{stage} … {seconds:.0f} s")

            yield show
        return
    began, done, last = time.monotonic(), Event(), "loading"

    def write(line: str) -> None:
        sys.stderr.write(line + "\n")
        sys.stderr.flush()

    def note(stage: str, _: float) -> None:
        nonlocal last
        last = stage
        if stage.startswith(EXPECTED):
            write(stage)

    def repeat() -> None:
        pause = FIRST
        while not done.wait(pause):
            write(f"{last} ... {time.monotonic() - began:.0f} s")
            pause = AGAIN

    writer = Thread(target=repeat, daemon=True)
    writer.start()
    try:
        yield note
    finally:
        done.set()
        writer.join()


@contextmanager
def counted(*, quiet: bool = False) -> Iterator[Callable[[Outcome, int, int], None] | None]:
    """Give a callback for (outcome, rows done, rows in all): a bar with the time left."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        row = bar.add_task("assets", total=None)

        def tell(outcome: Outcome, done: int, total: int) -> None:
            if outcome.code:
                bar.console.print(f"{outcome.id}: {outcome.reason}", style="yellow", markup=False)
            bar.update(row, completed=done, total=total)

        yield tell
