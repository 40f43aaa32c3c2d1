"""Numbers of a text with their units: what they measure, in SI."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from .clauses import Blend, Quantity

_NUMBER = r"(?<![\d.])\.?\d(?:[\d.,']*\d)?(?:\s?[x×*·]\s?10\s?\^?\s?[-+−]?\d+|[eE][-+−]?\d+)?"
_SPREAD = r"(?:\s?(?:-|–|to|\.\.+|and|bis)\s?(?P<high>{n})|\s?(?:±|\+/-)\s?[\d.,]+\s?%?)?"
_ABOUT = (
    r"\s*(?:(?:of|is|was|=|:|~|≈|about|around|approx\.?|approximately|roughly|ca\.?|at|to"
    r"|in the range of|between)\s*)*"
)
_DATA = tomllib.loads((Path(__file__).parent / "data/quantities.toml").read_text(encoding="utf-8"))
_UNIT_OF = {"pressure": "E", "density": "rho", "length": "thickness", "mass": "mass"}
_DIMENSION = {"E": "Pa", "rho": "kg/m^3", "thickness": "m", "mass": "kg"}
_UNIT = "|".join(f"(?P<unit_{kind}>{pattern})" for kind, pattern in _DATA["units"].items())
_ANY_CUE = "|".join(f"(?P<cue_{measure}>{cue})" for measure, cue in _DATA["cues"].items())
_VALUE = rf"(?P<low>{_NUMBER}){_SPREAD.format(n=_NUMBER)}\s?(?:(?:{_UNIT})(?![\w²³^]))?"
_BEFORE = re.compile(rf"(?<![\w.])(?:{_ANY_CUE}){_ABOUT}{_VALUE}")
_AFTER = re.compile(rf"(?<![\w.,]){_VALUE}\s?-?(?:in )?(?:{_ANY_CUE})(?!\w)")
_ALONE = re.compile(rf"(?<![\w.,]){_VALUE}")
_SHORE = re.compile(
    r"(?i:shore\s?)(?P<low>\d{1,3})\s?-?(?P<scale>[AD])\b|(?<![\w.])(?P<low2>[1-9]\d)\s?-?(?P<scale2>[AD])(?![\w-])"
    r"|(?i:shore\s?-?)(?P<zero>O?OO|000?|o)\s?-?\d*|(?<![\w.])(?P<zero2>00-\d\d)(?!\d)"
)
_FIBRES = r"(?P<fibre>(?i:glass|carbon)|GF|CF)(?:[ -](?i:fib(?:re|er)s?))?"
_BLEND = re.compile(
    rf"(?P<share>\d\d?)\s?%\s?(?i:short )?{_FIBRES}"
    rf"(?:[ -](?i:filled|reinforced|loaded|content))?(?!\w)"
    rf"|(?i:(?:with )?(?P<share3>\d\d?)\s?% glass(?=\W|$))"
    rf"|[- ]?(?P<fibre2>GF|CF)[ -]?(?P<share2>[1-6]\d)(?!\d)"
    rf"|{_FIBRES.replace('fibre>', 'fibre4>')}[ -](?i:filled|reinforced|loaded)(?!\w)(?= (?!with))"
)
USUAL_SHARE = 0.3  # of fibres, by weight, where none is said: the grade most sold (GF30)
_FIBRE_ROWS = {"g": "E-glass fibre", "c": "CFRP (along fibre)"}


class Numeral(NamedTuple):
    """A number at a place of the text: what it says, or None where that is no measure of ours."""

    start: int
    end: int
    value: Quantity | Blend | None
    note: str = ""


def numerals(text: str) -> list[Numeral]:
    """Return the numbers of a text that measure something, none over another."""
    found: list[Numeral] = []
    for finder in (_blends, _shores, _measures):
        for numeral in finder(text):
            if all(numeral.end <= f.start or f.end <= numeral.start for f in found):
                found.append(numeral)
    return sorted(found)


def _blends(text: str) -> Iterator[Numeral]:
    for match in _BLEND.finditer(text):
        group = match.groupdict()
        fibre = group["fibre"] or group["fibre2"] or group["fibre4"] or "glass"
        share = group["share"] or group["share2"] or group["share3"]
        note = "" if share else f"{match[0]!r}: no share is said, {USUAL_SHARE:.0%} is taken"
        blend = Blend(_FIBRE_ROWS[fibre[0].lower()], int(share) / 100 if share else USUAL_SHARE)
        yield Numeral(*match.span(), blend, note)


def _shores(text: str) -> Iterator[Numeral]:
    for match in _SHORE.finditer(text):
        number, scale = match["low"] or match["low2"], match["scale"] or match["scale2"]
        if number is None:
            yield Numeral(*match.span(), None, f"{match[0]!r}: Shore 00 has no relation to E here")
            continue
        measure = "shore_a" if scale.upper() == "A" else "shore_d"
        yield Numeral(*match.span(), Quantity(measure, float(number), match[0]))


def _measures(text: str) -> Iterator[Numeral]:
    """Numbers with the word that says what they measure before them, after them, or with a unit."""
    taken: list[tuple[int, int]] = []
    for pattern in (_BEFORE, _AFTER, _ALONE):
        for match in pattern.finditer(text):
            if any(match.start() < end and start < match.end() for start, end in taken):
                continue
            read = _read(match, cued=pattern is not _ALONE)
            if read:
                taken.append(match.span())
                yield read


def _read(match: re.Match, *, cued: bool) -> Numeral | None:
    group = match.groupdict()
    unit_kind = next((kind for kind in _DATA["units"] if group[f"unit_{kind}"]), None)
    measure: Any = next((m for m in _DATA["cues"] if cued and group[f"cue_{m}"]), None)
    if measure is None:
        if unit_kind is None or unit_kind == "share":
            return None
        measure = _UNIT_OF[unit_kind] if unit_kind != "length" else "size"
    start, end = match.span()
    said = match[0].strip()
    low = number(group["low"])
    value = low if not group["high"] else (low * number(group["high"])) ** 0.5
    note = f"{said!r}: the middle of the range is taken" if group["high"] else ""
    wanted = _DIMENSION.get(measure)
    if measure == "size":
        return Numeral(start, end, None)
    if measure == "other" or not low > 0:
        return Numeral(start, end, None, f"{said!r} is not used")
    if wanted and (unit_kind is None or _UNIT_OF.get(unit_kind) != measure):
        if unit_kind is None and not cued:
            return None
        reason = "has no unit" if unit_kind is None else f"is no measure of {measure}"
        return Numeral(start, end, None, f"{said!r} {reason} and is not used")
    if wanted:
        value = _in_si(value, str(group[f"unit_{unit_kind}"]), wanted)
    elif measure == "infill":
        value = value / 100 if unit_kind == "share" or value > 1 else value
    elif measure == "nu" and not value < 0.5:
        return Numeral(start, end, None, f"{said!r}: Poisson's ratio is below 0.5; it is not used")
    elif unit_kind:
        return Numeral(start, end, None, f"{said!r} is no measure of {measure} and is not used")
    return Numeral(start, end, Quantity(measure, value, said), note)


def number(text: str) -> float:
    """Return a number as it is written: "2.5", "2,5", "29,000", "7e10", "1.2 x 10^9"."""
    text = re.sub(r"\s?[x×*·]\s?10\s?\^?\s?", "e", text).replace("−", "-").replace("'", "")
    text = text.rstrip(".,")
    if re.fullmatch(r"\d{1,3}(?:,\d{3})+(?:\.\d+)?", text):
        text = text.replace(",", "")
    try:
        return float(text.replace(",", "."))
    except ValueError:  # "1.2.3" is no number
        return 0.0


def _in_si(value: float, unit: str, wanted: str) -> float:
    return _units().Quantity(value, _pint_name(unit)).to(wanted).magnitude


def _pint_name(unit: str) -> str:
    """Return the name by which pint knows a unit."""
    name = unit.strip().lower().replace("²", "^2").replace("³", "^3")
    name = re.sub(r"\bcu\.? ?(ft|in)", r"\1^3", re.sub(r"([cdm]?m|ft|in)(\d)", r"\1^\2", name))
    name = name.replace("/cc", "/cm^3").replace("/cbm", "/m^3").replace("lbs", "lb")
    return _DATA["names"].get(name, name)


@lru_cache(maxsize=1)
def _units() -> Any:
    from pint import UnitRegistry

    return UnitRegistry(cache_folder=None)
