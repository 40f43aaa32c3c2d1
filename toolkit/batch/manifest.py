"""The manifest of a batch: a CSV file with an asset and a sentence a row.

Columns: ``asset`` (a path, relative to the manifest) and ``text``; then, as wanted, ``id`` (name of
the result's folder, by default the asset's stem, numbered where it comes again) and every option of
``run``: ``size``, ``units``, ``up``, ``scenario``, ``edge_length_rel`` ... An empty cell is the
default; the items of an option that may be repeated (``part``, ``material``) stand between ``;``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path

from ...fem.errors import InputError, UsageError
from ..config import arguments
from ..options import AssignOptions, ConvertOptions, SimulateOptions
from ..walls.wall_options import WallOptions
from .task import Job

OPTIONS = {
    item.name: str(item.type)
    for options in (ConvertOptions, WallOptions, AssignOptions, SimulateOptions)
    for item in fields(options)
}
COLUMNS = ("id", "asset", "text", *OPTIONS)
ID = re.compile(r"[\w][\w.+@ -]{0,99}")  # a folder's name on every system, and never hidden
YES, NO = ("true", "yes", "1"), ("false", "no", "0")


def read_manifest(path: Path, *, common: Sequence[str] = ()) -> list[Job]:
    """Rows of a manifest, or the assets of a folder; ``common`` are arguments of ``run`` for all.

    Raises
    ------
    InputError
        Where the file cannot be read, or has no row or no column ``asset``.
    UsageError
        Where a column is unknown, or a row's id is doubled or no name of a folder.
    """
    if path.is_dir():
        return list(_jobs(path / "manifest", _assets_in(path), list(common)))
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            reader = csv.DictReader(lines, strict=True)
            columns, rows = list(reader.fieldnames or ()), list(reader)
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(f"cannot read the manifest {path}: {error}") from error
    _check_columns(path, columns)
    if not rows:
        raise InputError(f"the manifest {path} has no row: one asset and its text a line")
    return list(_jobs(path, rows, list(common)))


def _assets_in(folder: Path) -> list[dict[str, str]]:
    """A row for every asset of a folder, by name; what they are made of says the configuration."""
    from ..io.readers.asset_formats import ASSET_FORMATS

    found = [p.name for p in sorted(folder.iterdir()) if p.suffix.lower() in ASSET_FORMATS]
    if not found:
        raise InputError(f"the folder {folder} has no asset: {', '.join(ASSET_FORMATS)}")
    return [{"asset": name} for name in found]


def _check_columns(path: Path, columns: list[str]) -> None:
    if "asset" not in columns:
        raise InputError(
            f"the manifest {path} begins with {', '.join(columns) or 'nothing'}: wanted a line of "
            "column names, with asset and text among them"
        )
    for name in columns:
        if _option(name) not in COLUMNS:
            close = get_close_matches(_option(name), COLUMNS, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(COLUMNS)}"
            raise UsageError(f"the manifest {path}: unknown column {name!r}; {hint}")


def _jobs(path: Path, rows: list[dict[str, str]], common: list[str]) -> Iterator[Job]:
    taken = {row["id"].strip() for row in rows if row.get("id")}
    given: set[str] = set()
    for line, row in enumerate(rows, 2):
        if None in row or not (row["asset"] or "").strip():
            what = "more cells than columns" if None in row else "no asset"
            raise InputError(f"the manifest {path}, row {line}: {what}")
        asset = row["asset"].strip()
        name = (row.get("id") or "").strip() or _name(asset, taken | given)
        if name in given or not ID.fullmatch(name):
            why = "comes twice" if name in given else "is no name of a folder"
            raise UsageError(f"the manifest {path}, row {line}: the id {name!r} {why}")
        given.add(name)
        options = {_option(k): v.strip() for k, v in row.items() if v and _option(k) in OPTIONS}
        yield Job(
            name,
            asset,
            (row.get("text") or "").strip(),
            str((path.parent / asset).resolve()),
            (*common, *arguments(_values(options))),
        )


def _name(asset: str, taken: set[str]) -> str:
    """The asset's stem, numbered until it is free."""
    stem = re.sub(r"[^\w.+@ -]", "_", Path(asset).stem).lstrip(".+@ -")[:90] or "asset"
    names = (stem if i == 1 else f"{stem}-{i}" for i in range(1, len(taken) + 2))
    return next(name for name in names if name not in taken)


def _values(options: Mapping[str, str]) -> dict[str, str | bool | list[str]]:
    """Cells as values: flags and repeated options are told by the option's type."""
    found: dict[str, str | bool | list[str]] = {}
    for name, cell in options.items():
        if "bool" in OPTIONS[name] and cell.lower() in YES + NO:
            found[name] = cell.lower() in YES
        elif "tuple" in OPTIONS[name]:
            found[name] = [item.strip() for item in cell.split(";") if item.strip()]
        else:
            found[name] = cell
    return found


def _option(column: str) -> str:
    return column.strip().replace("-", "_")
