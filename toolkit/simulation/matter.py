"""Options of the material point method: classes of parts in words, and the method they make."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from ...fem.errors import ConvergenceError, UsageError
from ...fem.mpm.classes import MaterialClass, Substance
from ...fem.mpm.stability import MpmError
from ..options import SimulateOptions

if TYPE_CHECKING:
    from ...fem.mpm.method import MpmMethod


def particle_method(
    options: SimulateOptions, announce: Callable[[str], None] | None = None
) -> MpmMethod:
    """The method that the options ask for; ``announce`` hears what it will cost."""
    from ...fem.mpm.method import MpmMethod
    from ...fem.mpm.stiff import Stiff

    if options.grid < 4:
        raise UsageError(f"--grid {options.grid}: wanted at least 4 cells along the longest side")
    return MpmMethod(
        grid=options.grid,
        stiff=Stiff(options.stiff),
        substances=substances(options.matter),
        threads=options.threads,
        announce=announce,
    )


def substances(entries: Sequence[str]) -> dict[str, Substance]:
    """Matter by name of part, of entries such as 'bread=jelly,tension=5e3,fracture_energy=20'."""
    known = {field.name for field in fields(Substance)} - {"kind"}
    found = {}
    for entry in entries:
        part, equals, said = entry.partition("=")
        name, *numbers = [word.strip() for word in said.split(",")]
        if not equals or name.upper() not in MaterialClass.__members__:
            classes = ", ".join(kind.name.lower() for kind in MaterialClass)
            raise UsageError(f"--matter {entry!r}: wanted PART=CLASS[,name=value] of {classes}")
        values = {}
        for number in numbers:
            key, _, value = number.partition("=")
            values[_known(key.strip(), known, entry)] = _number(value, entry)
        seed = {"seed": int(values.pop("seed"))} if "seed" in values else {}
        found[part.strip()] = Substance(kind=MaterialClass[name.upper()], **values, **seed)
    return found


def _known(name: str, known: set[str], entry: str) -> str:
    if name not in known:
        near = get_close_matches(name, known, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else f": known are {', '.join(sorted(known))}"
        raise UsageError(f"--matter {entry!r}: no number {name!r}{hint}")
    return name


def _number(text: str, entry: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(f"--matter {entry!r}: {text!r} is no number") from error


@contextmanager
def logged(output: Path | None) -> Iterator[None]:
    """Where a run of particles fails, write what is known of it beside ``output``, as JSON.

    Raises
    ------
    ConvergenceError
        The failure, with the name of the log.
    """
    try:
        yield
    except MpmError as error:
        if output is None:
            raise
        log = output.with_suffix(".log")
        log.parent.mkdir(parents=True, exist_ok=True)
        known = {"plan": error.plan, "notes": error.notes, "failure": asdict(error.failure)}
        log.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
        raise ConvergenceError(f"{error}; log: {log}") from error
