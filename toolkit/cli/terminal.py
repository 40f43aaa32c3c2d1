"""What a person sees in the terminal: tables and sentences instead of JSON."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from ..options import EXPECTED

if TYPE_CHECKING:
    from rich.table import Table

    from ..batch import Outcome
    from ..verdict.verdict import Verdict


MATTER = {"E": "E [Pa]", "nu": "nu", "rho": "kg/m³"}
PARTS = {"name": "part", "material": "material", **MATTER, "mass": "mass [kg]", "why": "because"}
WORDS = {"word": "word", "voxels": "voxels"}
REGIONS = {"name": "part", "tets": "tets", "volume": "volume [m³]"}
MATERIALS = {"name": "material", "category": "category"} | MATTER
_FRAME = re.compile(r"_(\d{5})(\.\w+)$")  # what frames of a motion are called
_FORMATS = {"rho": ".4g"}  # of numbers that three digits do not hold


def show(document: Mapping[str, Any]) -> None:
    """Print a result's document: tables, then what was found, the files and the warnings."""
    from rich.console import Console

    console = Console(highlight=False)
    cases = document.get("cases", ())
    for case in cases if len(cases) > 1 else [document]:
        if case is not document:
            console.print(f"\n{case['text']!r}", markup=False, style="bold", soft_wrap=True)
        for table in _tables(case):
            console.print(table)
        for line in _lines(case):
            console.print(line, markup=False, soft_wrap=True)
    for path in _told_once(document.get("files", ())):
        console.print("wrote", path, markup=False, soft_wrap=True)
    warn(document)


def warn(document: Mapping[str, Any]) -> None:
    """Print a document's warnings on stderr."""
    from rich.console import Console

    for warning in document.get("warnings", ()):
        Console(stderr=True, highlight=False).print(
            "warning:", warning, markup=False, style="yellow", soft_wrap=True
        )


def _tables(document: Mapping[str, Any]) -> Iterator[Table]:
    """Parts, materials, regions of a mesh file, quality, or the scores of `evaluate`."""
    parts = document.get("parts")
    if isinstance(parts, Mapping):  # labels of voxels by words
        yield _table([{"word": w, "voxels": n} for w, n in parts["voxels"].items()], WORDS)
    elif parts:
        yield _table(parts, PARTS)
    if document.get("materials"):
        yield _table(document["materials"], MATERIALS)
    if "file" in document:
        known = document["regions"] and "E" in document["regions"][0]
        yield _table(document["regions"], REGIONS | (MATTER if known else {}))
    if rows := document.get("quality_rows"):
        yield _table(rows, {name: name for name in rows[0]})
    if "papers" in document:
        yield _table(document["rows"], _scalars(document["rows"]))
    for key in ("shares", "reasons", "biases"):  # of an audit of ranges
        if rows := document.get(key):
            yield _table(rows, _scalars(rows))


def _lines(document: Mapping[str, Any]) -> Iterator[str]:
    yield from _totals(document)
    yield from _machine(document)
    yield from _batch(document)
    yield from _plan(document)
    yield from _learning(document)
    for verb in ("reduced", "match"):
        if verb in document:
            yield document[verb]["summary"]
    yield from _driven(document.get("drive", document))


def _told_once(files: Iterable[Any]) -> Iterator[str]:
    """Every file, but the frames of a motion as one."""
    groups: dict[str, list[str]] = {}
    for path in map(str, files):
        groups.setdefault(_FRAME.sub(r"_*\2", path), []).append(path)
    for first, *others in groups.values():
        yield f"{first} ... {len(others) + 1} frames" if others else first


def _batch(document: Mapping[str, Any]) -> Iterator[str]:
    """The counts of a batch."""
    if "assets" in document:
        yield (
            f"{document['assets']} assets: {document['done']} done, {document['failed']} failed; "
            f"{document['new']} were run this time"
        )


def _learning(document: Mapping[str, Any]) -> Iterator[str]:
    """What was built, drawn or trained."""
    if "clauses" in document:
        yield f"{document['clauses']:,} clauses, {document['real_objects']:,} real objects"
    for sample in document.get("samples", ()):
        yield f"{sample['object']}: {'; '.join(sample['clauses'])}"
    if "history" in document:
        yield f"trained for {document['steps']:,} steps"


def _driven(document: Mapping[str, Any]) -> Iterator[str]:
    """What moved with the mesh."""
    if "moved" in document:
        yield (
            f"{document['moved']:,} moved over {document['frames']} frames; "
            f"{document['outside']:,} outside the mesh follow its nearest tet"
        )


def _plan(document: Mapping[str, Any]) -> Iterator[str]:
    """The steps of a dry run and what they may cost."""
    if "dry_run" not in document:
        return
    yield from (f"would {step}" for step in document["steps"])
    for name, found in document["estimates"].items():
        unit, scale = {"memory": ("GB", 1e-9), "tets": ("tets", 1)}.get(name, ("s of a core", 1))
        low, likely, high = (f"{scale * found[key]:,.3g}" for key in ("low", "likely", "high"))
        yield f"estimate, {name}: about {likely} {unit} ({low} to {high})"


def _machine(document: Mapping[str, Any]) -> Iterator[str]:
    """What `doctor` found."""
    if "extras" not in document:
        return
    yield (
        f"autophyx-tet {document['package']}, Python {document['python']}, {document['platform']}, "
        f"{document['cores']} cores, {document['memory'] / 1e9:.0f} GB"
    )
    yield f"libraries: {_versions(document['libraries'])}"
    for extra, packages in document["extras"].items():
        lacking = None in packages.values()
        advice = f" (pip install autophyx-tet[{extra}])" if lacking else ""
        yield f"extra {extra}: {_versions(packages)}{advice}"
    for device in document["devices"]:
        yield f"device {device['name']}: {device['what']}"
    for file in document["weights"]:
        yield f"weights {file['name']}: {file['bytes'] / 1e6:.1f} MB"
    for name, place in document["programs"].items():
        yield f"program {name}: {place or 'not found'}"
    for cache in document["caches"]:
        size = f"{cache['files']} files, {cache['bytes'] / 1e6:.1f} MB"
        yield f"cache {cache['name']}: {size} in {cache['path']}"


def _versions(packages: Mapping[str, str | None]) -> str:
    return ", ".join(f"{name} {found or 'MISSING'}" for name, found in packages.items())


def _table(rows: list[Mapping[str, Any]], columns: Mapping[str, str]) -> Table:
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, header_style="bold", pad_edge=False)
    for key, title in columns.items():
        number = all(isinstance(row[key], int | float | tuple) for row in rows)
        table.add_column(title, justify="right" if number else "left")
    for row in rows:
        table.add_row(*(escape(_cell(key, row[key])) for key in columns))
    return table


def _scalars(rows: list[Mapping[str, Any]]) -> dict[str, str]:
    """The columns of one word or number a row, each under its own name; empty ones are left out."""
    plain = (str, int, float, type(None))
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    return {
        name: name.replace("_", " ")
        for name, cells in columns.items()
        if all(isinstance(cell, plain) for cell in cells) and any(c is not None for c in cells)
    }


def _cell(key: str, value: Any) -> str:
    if isinstance(value, str | int):
        return f"{value:,}" if isinstance(value, int) else value
    numbers = value if isinstance(value, tuple) else (value,)
    form = _FORMATS.get(key, ".3g")
    return " – ".join(dict.fromkeys("" if n is None else format(float(n), form) for n in numbers))


def _totals(document: Mapping[str, Any]) -> Iterator[str]:
    if found := document.get("materials"):
        yield f"{len(found)} materials; --json adds sources, aliases, strength, grain and colour"
    if "tets" in document:
        mass = f", mass {document['mass']:.3g} kg" if document.get("mass") else ""
        yield f"{document['tets']:,} tets, volume {document['volume']:.4g} m³{mass}"
    if "file" in document:
        found, sides = document["quality"], np.ptp(document["bounds"], axis=0)
        none = "" if document["mass"] else "; no E, nu, rho: `assign` gives them"
        yield f"{' x '.join(f'{side:.3g}' for side in sides)} m{none}"
        yield (
            f"sharpest dihedral angle {found.dihedral_min:.3g}°, smallest altitude "
            f"{found.altitude_min:.3g} m, {found.components} connected pieces"
        )
    if "voxels" in document:
        yield (
            f"{document['voxels']:,} voxels, {document['seen']:,} of them seen, "
            f"{document['channels']} channels of {document['encoder']}"
        )
    if "values" in document:
        mass = f", opacity-weighted mass {document['mass']:.3g} kg" if document["mass"] else ""
        mass += " (splats overlap: it is not the body's)" if mass else ""
        yield f"{document['values']:,} places got E, nu and rho{mass}"
    if document.get("bins"):
        yield f"{document['bins']:,} materials for {document['for']}"
    for kind in ("sag", "motion", "modal"):
        if answer := document.get(kind):
            yield from _answer(kind, answer)
            yield from map(_verdict, answer["verdicts"])
    yield from map(_verdict, document.get("verdicts", ()))


def _verdict(verdict: Verdict) -> str:
    """What was found, and what to do about it."""
    from ..verdict.verdict import MARKS

    advice = f" {verdict.advice}" if verdict.advice else ""
    return f"{MARKS[verdict.mark]} {verdict.sentence}{advice}"


def _answer(kind: str, answer: Mapping[str, Any]) -> Iterator[str]:
    from ...fem.verdicts import percent

    if kind == "sag":
        yield (
            f"largest displacement {answer['max_displacement']:.3g} m "
            f"({percent(answer['sag_ratio'])} of its longest side), "
            f"largest von Mises stress {answer['max_von_mises']:.3g} Pa"
        )
    elif kind == "motion":
        yield (
            f"{answer['frames']} frames of {answer['dt']:.3g} s, "
            f"a point moves by at most {answer['max_displacement']:.3g} m, "
            f"largest contact force {answer['max_contact_force']:.3g} N"
        )
        for number, force in enumerate(answer["max_obstacle_forces"], 1):
            yield f"obstacle {number}: at most {force:.3g} N"
    else:
        found = ", ".join(f"{frequency:.4g}" for frequency in answer["frequencies"])
        yield f"natural frequencies [Hz]: {found}"


# Progress on stderr while the engine works: a live line, or now and then one for a log.


# Seconds before the first line of a log, and between two.
FIRST, AGAIN = 30.0, 30.0


@contextmanager
def progress(*, quiet: bool = False) -> Iterator[Callable[[str, float], None] | None]:
    """Give a callback for (stage, seconds), or None where nobody would see it."""
    if quiet:
        yield None
        return
    if not sys.stderr.isatty():
        with _logged() as tell:
            yield tell
        return
    from rich.console import Console

    console = Console(stderr=True)
    with console.status("loading") as status:

        def show(stage: str, seconds: float, /) -> None:
            if stage.startswith(EXPECTED):
                console.print(stage, markup=False, highlight=False)
            status.update(f"{stage} … {seconds:.0f} s")

        yield show


@contextmanager
def _logged() -> Iterator[Callable[[str, float], None]]:
    """Write the stage that was heard of last, however rarely one is."""
    began, done, stage = time.monotonic(), Event(), "loading"

    def tell(heard: str, _: float) -> None:
        nonlocal stage
        stage = heard
        if heard.startswith(EXPECTED):
            sys.stderr.write(f"{heard}\n")
            sys.stderr.flush()

    def write() -> None:
        pause = FIRST
        while not done.wait(pause):
            sys.stderr.write(f"{stage} ... {time.monotonic() - began:.0f} s\n")
            sys.stderr.flush()
            pause = AGAIN

    writer = Thread(target=write, daemon=True)
    writer.start()
    try:
        yield tell
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
