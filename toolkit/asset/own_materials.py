"""A user's own rows beside the table: the same columns in CSV, or tables in TOML."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ...fem.errors import InputError
from ...fem.table import FIELDS, Material, MaterialTable, key, load_table, row_of_record

_UNITS = {"E": "_Pa", "nu": "", "rho": ""}  # as the columns of a CSV name them


def with_own_rows(path: Path) -> MaterialTable:
    """Return the packaged table with the rows of a file; these win where names are the same.

    A CSV has the columns of the packaged table; a TOML file has tables ``[[material]]`` with
    ``name``, ``category``, ``source``, ``E`` [Pa], ``nu`` [1], ``rho`` [kg/m^3], each a number or
    [min, max], and ``aliases``.

    Raises InputError: Where the file cannot be read, a column is missing, or a value leaves its
        category's band.
    """
    table = load_table()
    own = tuple(_rows(path))
    taken = {key(name) for row in own for name in (row.name, *row.aliases)}
    kept = (
        replace(row, aliases=tuple(alias for alias in row.aliases if key(alias) not in taken))
        for row in table
        if key(row.name) not in taken
    )
    return MaterialTable((*own, *kept))


def _rows(path: Path) -> Iterator[Material]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the materials {path}: {error}") from error
    if path.suffix.lower() == ".toml":
        try:
            given = tomllib.loads(text).get("material", [])
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{path} is no TOML: {error}") from error
        if not isinstance(given, list) or not all(isinstance(item, dict) for item in given):
            raise InputError(f"{path}: wanted tables [[material]]")
        records = []  # as lines of a CSV
        for item in given:
            record = {n: str(value) for n, value in item.items() if n not in (*FIELDS, "aliases")}
            for name in FIELDS:
                span = item.get(name)
                low, high = span if isinstance(span, list) and len(span) == 2 else (span, span)
                record[f"{name}_min{_UNITS[name]}"] = str(low)
                record[f"{name}_max{_UNITS[name]}"] = str(high)
            aliases = item.get("aliases", [])
            record["aliases"] = ";".join(aliases if isinstance(aliases, list) else [str(aliases)])
            records.append(record)
    else:
        records = list(csv.DictReader(text.splitlines()))
    if not records:
        raise InputError(f"{path} has no material: wanted a CSV with a header, or [[material]]")
    for number, record in enumerate(records, 1):
        missing = [name for name in ("name", "category", "source") if not record.get(name)]
        if missing:
            raise InputError(f"{path}, material {number}: no {', '.join(missing)}")
        yield row_of_record(record, f"{path}, material {number}")
