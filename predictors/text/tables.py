"""Tables of a text as sentences: "part;material;price" and its rows become "bush: bronze"."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

from .english import words

_SPACED = r"\s{2,}"  # columns that are aligned
_UNIT = re.compile(r"(?i)(?<![a-z])([kmg]?pa)(?![a-z])|(?<![a-z])(k?g)[ /]?([cd]?m)[³3]")


def without_tables(text: str) -> str:
    """Return a text whose tables have become sentences, a row each.

    A table begins with a line that names its columns, one of them of parts and another of what
    these are of; columns of prices, numbers and the like are left out. Of numbers the unit may
    stand in the name of their column.
    """
    lines, out = text.splitlines(), list[str]()
    while lines:
        head, *lines = lines
        for sign in (";", "\t", "|", ",", _SPACED):
            columns = [_column(name) for name in _cells(head, sign)]
            if "name" not in columns or len({*columns} - {""}) < 2:
                continue
            rows = [_cells(line, sign) for line in lines]
            count = next((i for i, row in enumerate(rows) if len(row) < 2), len(rows))
            units = [_UNIT.search(name.replace("_", " ")) for name in _cells(head, sign)]
            for row in rows[:count]:
                cells = [
                    f"{column} = {cell} {_unit(unit)}" if column in _MEASURES else cell
                    for column, cell, unit in zip(columns, row, units, strict=False)
                ]
                said = list(zip(columns, cells, strict=False))
                names = [cell for column, cell in said if column == "name"]
                matter = [cell for column, cell in said if column not in ("", "name")]
                out.append(f"{names[0]}: {', '.join(filter(str.strip, matter))};")
            lines = lines[count:]
            break
        else:
            out.append(head)
    return "\n".join(out)


_MEASURES = ("E", "nu", "rho")


def _unit(found: re.Match | None) -> str:
    """A unit as it is written behind a number: "kgm3" is kg/m3."""
    if found is None:
        return ""
    return found[1] or f"{found[2]}/{found[3]}3"


def _column(name: str) -> str:
    """What a column of this name holds, "" where that is no matter."""
    bare = re.sub(r"[\[(].*|_(?=[A-Za-z]*/?[a-z]*\d?$).*", "", name).strip(" .:").lower()
    return next((kind for kind, names in words()["columns"].items() if bare in names), "")


def _cells(line: str, sign: str) -> Sequence[str]:
    if sign == _SPACED:
        return [cell.strip() for cell in re.split(sign, line.strip())]
    return [cell.strip(' "') for cell in next(csv.reader([line], delimiter=sign), [])]
