"""Notations of engineers as sentences: tables, decks of solvers, numbers under a heading of units.

"part;material;price" and its rows become "bush: bronze;", the cards of a deck "bush: E = 7.17e+10
Pa, nu = 0.33, rho = 2810 kg/m3;". What is in no such notation stays as it is.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

from .english import words

_SPACED = r"\s{2,}"  # columns that are aligned
_WORDS = r"\s+(?![\[(])"  # columns of one word each but the last: "Part E [GPa] Material"
_UNIT = re.compile(
    r"(?i)(?<![a-z])([kmg]?pa|(?:k|da)?N/mm(?:\^?2|²)|[km]?psi|ksi|msi)(?![a-z])"
    r"|(?<![a-z])(k?g|t)[ /]?([cd]?m)[³3]|(?<![a-z])(lbs?|pcf)(?:/(?:cu\.? ?)?(in|ft)\^?[³3]?)?"
)
_MEASURES = ("E", "nu", "rho")
_ITEM = r"(?:pos(?:ition)?|item|no|nr|teil|rep(?:ère)?)\.? ?(\d+)"


def in_sentences(text: str, names: Collection[str] = ()) -> str:
    """Return a text whose tables and decks have become sentences, a row or a card each.

    A table begins with a line that names its columns, one of them of parts and another of what
    these are of; columns of prices, numbers and the like are left out. Of numbers the unit may
    stand in the name of their column. A row without such a line begins with one of the parts'
    ``names``.
    """
    known = {name.lower() for name in names}
    text = _under_units(_decks(_with_positions(text, names)))
    lines, out = text.splitlines(), list[str]()
    while lines:
        head, *lines = lines
        for sign in (";", "\t", "|", ",", _SPACED, _WORDS):
            columns = [_column(name) for name in _cells(head, sign)]
            if "name" not in columns or len({*columns} - {""}) < 2:
                continue
            if sign == _WORDS and not (all(columns[1:]) and len(columns) > 3 and len(lines) > 1):
                continue
            rows = [_cells(line, sign, len(columns)) for line in lines]
            count = next((i for i, row in enumerate(rows) if len(row) < 2), len(rows))
            units = [_UNIT.search(name.replace("_", " ")) for name in _cells(head, sign)]
            for row in rows[:count]:
                said = [
                    (column, f"{column} = {cell} {_unit(unit)}" if column in _MEASURES else cell)
                    for column, cell, unit in zip(columns, row, units, strict=False)
                    if column not in _MEASURES or any(c.isdigit() for c in cell)
                ]
                names = [cell for column, cell in said if column == "name"]
                matter = [cell for column, cell in said if column not in ("", "name")]
                out.append(f"{names[0]}: {', '.join(filter(str.strip, matter))};")
            lines = lines[count:]
            break
        else:
            cut = [_cells(head, sign) for sign in ";\t|" if "\n" in text]
            row = next((r for r in cut if len(r) > 1 and known & {r[0].lower()}), [])
            plain = row and not known & {cell.lower() for cell in row[1:]}
            out.append(f"{row[0]}: {', '.join(row[1:])};" if plain else head)
    return "\n".join(out)


def _with_positions(text: str, names: Collection[str]) -> str:
    """The text with parts in place of their numbers in a list: "cover same as pos 1"."""
    items: dict[str, str] = {}
    for name in sorted(names, key=len):  # the longest last: "casing cover" before "casing"
        spelt = r"[\s_-]".join(map(re.escape, re.split(r"[\s_-]+", name)))
        found = re.finditer(rf"(?i)(?<!\w){_ITEM}:? +{spelt}(?!\w)", text)
        items |= {m[1]: name for m in found}
    same = rf"(?i),?(?<!\w)(?: ?)(?<!\w)(as|like|wie|comme|como) ({_ITEM})(?!\w)"
    return re.sub(same, lambda m: f" {m[1]} {items.get(m[3], m[2])}", text)


def _unit(found: re.Match | None) -> str:
    """A unit as it is written behind a number: "kgm3" is kg/m3."""
    if found is None:
        return ""
    if found[4]:
        return "pcf" if found[4].lower() == "pcf" else f"lb/{found[5]}3"
    return found[1] or f"{found[2]}/{found[3]}3"


def _column(name: str) -> str:
    """What a column of this name holds, "" where that is no matter."""
    bare = re.sub(r"[\[(].*|_(?=[A-Za-z]*/?[a-z]*\d?$).*", "", name).strip(" .:").lower()
    return next((kind for kind, names in words()["columns"].items() if bare in names), "")


def _cells(line: str, sign: str, most: int = 0) -> Sequence[str]:
    if sign in (_SPACED, _WORDS):
        most = max(most - 1, 0) if sign == _WORDS else 0
        return [cell.strip() for cell in re.split(sign, line.strip(), maxsplit=most)]
    return [cell.strip(' "') for cell in next(csv.reader([line], delimiter=sign), [])]


# Numbers whose units stand once, before them: "mat card (GPa / kg/m3): pin 210 / 7850; tray ...".

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_PRESSURE, _DENSITY = r"[kMG]?Pa|N/mm[²2]|[kM]?psi|[kM]si", r"k?g/[cd]?m[³3]|t/m[³3]|g/cc|pcf"
_HEADING = re.compile(
    rf"[(\[](?:E ?(?:in)? ?)?({_PRESSURE}) ?([/,;|]) ?"
    rf"(?:(?:rho|ρ|density) ?(?:in)? ?)?({_DENSITY})[)\]]"
)


def _under_units(text: str) -> str:
    """The text with the units of a heading behind each of its pairs of numbers."""
    head = _HEADING.search(text)
    if head is None:
        return text
    E, sign, rho = head.groups()
    rest = re.sub(
        rf"(?<![\w.,])({_NUMBER}) ?{re.escape(sign)} ?({_NUMBER})(?![\w%]|[.,]\d)",
        lambda m: f"E = {m[1]} {E}, rho = {m[2]} {rho}",
        text[head.end() :],
    )
    return text[: head.start()] + rest


# Decks: what a solver's cards say of E, nu and the density, in the units that the density tells.


class _Card(NamedTuple):
    """Numbers of a material in a deck, with its number or name there."""

    key: str
    numbers: dict[str, float]


# A density tells the units of a deck: Pa, kg/m3 and then of an E and of a density.
_SYSTEMS = (
    ((1e-12, 3e-8), 1e6, 1e12),  # mm, t, s, MPa
    ((3e-8, 3e-5), 1e9, 1e9),  # mm, kg, ms, GPa; in MPa where that is more than there is
    ((3e-5, 3e-3), 6894.757, 10686895.0),  # in, lbf s2/in, s, psi
    ((1.0, 3e4), 1.0, 1.0),  # SI
)
_STIFFEST = 2e12  # Pa
_COMMENT = re.compile(r"^\s*(?:\*\*|\$|!|#|//|C )\s*(.*)$")
_NASTRAN = re.compile(r"(?i)^MAT1\b")
_ANSYS = re.compile(rf"(?i)^MP,\s*(EX|PRXY|NUXY|DENS),\s*(\d+),\s*({_NUMBER})")
_LS_DYNA = re.compile(r"(?i)^\*MAT_(?!ADD)\w+")
_ABAQUS = re.compile(r"(?i)^\*MATERIAL\b.*?NAME\s*=\s*[\"']?([^\"',]+)")
_KEYWORD = re.compile(r"(?i)^\*(ELASTIC|DENSITY)\b")
_ASTER = re.compile(r"(?i)^(\w+)\s*=\s*DEFI_MATERIAU\s*\((.*)\)")
_GIVEN = re.compile(rf"(?i)\b(E|NU|RHO)\s*=\s*({_NUMBER})")
_CALLED = re.compile(
    r"(?i)\bmat(?:erial)?\s*(\d+)\s*=\s*([^,;=]+)|([^,;=]+?)\s*=\s*mat(?:erial)?\s*(\d+)"
)
_UNITS = re.compile(
    r"(?i)\b(?:N[-, /]+mm[-, /]+t(?:on(?:ne)?s?)?|t(?:on(?:ne)?s?)?[-, /]+mm[-, /]+[Ns]"
    r"|mm[-, /]+(?:t(?:on(?:ne)?s?)?|N)[-, /]+(?:s|t|MPa|N))\b"
)


_SILENT = re.compile(
    rf"{_CALLED.pattern}|{_UNITS.pattern[4:]}|\bunits?\b|\bro\s+e\b", re.IGNORECASE
)


def _decks(text: str) -> str:
    """The text with a sentence in place of each material's cards; bare numbers in their units."""
    if not re.search(r"(?im)^(?:\*MAT|MAT1|MP,|\w+\s*=\s*DEFI_MATERIAU)", text):
        return _in_units(text)
    cards, called, said = [*_cards(text.splitlines())], dict[str, list[str]](), list[str]()
    for comment in filter(None, map(_COMMENT.match, text.splitlines())):
        for m in _CALLED.finditer(comment[1]):
            called.setdefault(m[1] or m[4], []).append(
                (m[2] or m[3]).strip().replace(" + ", " and ")
            )
    for comment in filter(None, map(_COMMENT.match, text.splitlines())):
        if not _SILENT.search(comment[1]) and all(comment[1] != card.key for card in cards):
            said.append(f"{comment[1]};")
    out = []
    for key, numbers in cards:
        system = next((s for s in _SYSTEMS if s[0][0] <= numbers.get("rho", 0) < s[0][1]), None)
        if system is None and "E" in numbers:
            system = (0, 0), 1.0 if numbers["E"] > 1e8 else 1e6 if _UNITS.search(text) else 0.0, 0.0
        E = numbers.get("E", 0.0) * system[1] if system else 0.0
        if system is None or not E:
            continue
        E = E / 1e3 if E > _STIFFEST else E
        values = [f"E = {E:.10g} Pa"] * (E > 0)
        values += [f"nu = {numbers['nu']:.10g}"] * ("nu" in numbers)
        values += [f"rho = {numbers['rho'] * system[2]:.10g} kg/m3"] * ("rho" in numbers)
        out += [f"{name}: {', '.join(values)};" for name in called.get(key, [key])]
    return "\n".join([*out, *said])


def _cards(lines: Sequence[str]) -> Iterator[_Card]:
    """The materials of a deck, in their order."""
    title, ansys, at = "", dict[str, dict[str, float]](), 0
    while at < len(lines):
        line, at = lines[at].strip(), at + 1
        comment = _COMMENT.match(line)
        if found := _ANSYS.match(line):
            kind = {"EX": "E", "DENS": "rho"}.get(found[1].upper(), "nu")
            ansys.setdefault(found[2], {})[kind] = float(found[3])
        elif _NASTRAN.match(line):
            free = "," in line
            cells = line.split(",") if free else line.split()
            numbers = [_real(cell) for cell in cells[2:]]
            if not free and len(numbers) == 3:  # the empty field of G
                numbers.insert(1, None)
            kinds = zip(("E", "G", "nu", "rho"), numbers, strict=False)
            yield _Card(title or cells[1].strip(), {k: n for k, n in kinds if n and k != "G"})
            title = ""
        elif found := _ABAQUS.match(line):
            numbers, kind = {}, ""
            while at < len(lines) and not _ABAQUS.match(lines[at]):
                row = lines[at].strip()
                at += 1
                if row.startswith("**"):
                    continue
                if row.startswith("*"):
                    kind = (_KEYWORD.match(row) or ["", ""])[1].upper()
                    continue
                values = [_real(cell) for cell in row.split(",")]
                kinds = ("E", "nu") if kind == "ELASTIC" else ("rho",) if kind == "DENSITY" else ()
                numbers |= {k: n for k, n in zip(kinds, values, strict=False) if n}
                kind = ""
            yield _Card(re.sub(r"[_-]+", " ", found[1].strip()), numbers)
        elif _LS_DYNA.match(line):
            rows = [row.strip() for row in lines[at:] if not row.startswith("$")]
            titled = "_TITLE" in line.upper()
            cells = re.split(r"[,\s]+", rows[titled].strip(" ,")) if len(rows) > titled else []
            kinds = zip(("rho", "E", "nu"), map(_real, cells[1:4]), strict=False)
            yield _Card(rows[0] if titled and rows else title, {k: n for k, n in kinds if n})
        elif found := _ASTER.match(line):
            given = {m[1]: float(m[2]) for m in _GIVEN.finditer(found[2])}
            kinds = {"E": "E", "NU": "nu", "RHO": "rho"}
            yield _Card(found[1], {kinds[k.upper()]: n for k, n in given.items()})
        elif comment:
            title = "" if _SILENT.search(line) else comment[1]
    yield from (_Card(key, numbers) for key, numbers in ansys.items())


def _real(cell: str) -> float | None:
    """A number as decks write it, "2.81-9" for 2.81e-9; None for an empty field."""
    cell = re.sub(r"(?<=[\d.])([-+]\d+)$", r"e\1", cell.strip())
    try:
        return float(cell)
    except ValueError:
        return None


def _in_units(text: str) -> str:
    """The text with the units that it says once, as input of solvers does: "units N-mm-t"."""
    if not _UNITS.search(text):
        return text
    text = re.sub(
        rf"(?<!\w)E ?(?:=|:)? ?({_NUMBER})(?![\w.]| ?[kMG]?Pa)", lambda m: f"E = {m[1]} MPa", text
    )
    return re.sub(
        r"(?<!\w)(?:rho|ρ|density) ?(?:=|:)? ?(\d[\d.]*[eE]-\d+)(?!\w|\.\d| ?k?[gt]/)",
        lambda m: f"rho = {float(m[1]) * 1e12:.10g} kg/m3",
        text,
    )
