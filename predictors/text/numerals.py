"""Numbers of a text with their units: what they measure, in SI.

A quantity is ``(symbol link?)? number spread? unit?`` or ``number unit symbol``. A unit is any
product of units that pint knows; where no symbol says what is measured, its dimension does.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast

from ...fem.note import Note

# Numbers in words as digits: "one point two", "two hundred and five", "10 million".

DATA = tomllib.loads((Path(__file__).parent / "data/quantities.toml").read_text(encoding="utf-8"))
NUMBERS: dict[str, int] = DATA["words"]
_WORD = rf"(?i:{'|'.join(sorted(map(re.escape, NUMBERS), key=len, reverse=True))})"
_THEN = r"(?:(?:(?<=hundred)|(?<=thousand)) and |[ -])"
_WORDS = re.compile(
    rf"(?<![\w-])({_WORD}(?:{_THEN}{_WORD})*)"
    rf"(?: point ({_WORD}(?: {_WORD})*)|( and a half))?(?![\w-])"
)
_MULTIPLE = re.compile(r"(?<![\w.,])(\d[\d.,]*)[ -](?i:(thousand|million|billion))(?!\w)")
_FRACTION = re.compile(r"(?<=ratio )((?:of |is )?)(?i:(?:one|a) (third|quarter))(?!\w)")


_AIRY = DATA["hollow"]["shared"]
_SHARES = [
    (share, re.compile(rf"(?i)(?<!\w){said}(?=(?: (?:of|d\w+) [\w ]{{2,12}}?)? {_AIRY})"))
    for share, said in DATA["shares"].items()
]


def counted_by(text: str) -> int | None:
    """Return what digits or a word count, None where they count nothing: "4", "three"."""
    return int(text) if text.isdigit() else NUMBERS.get(text.lower())


def in_digits(text: str) -> tuple[str, dict[int, int]]:
    """Return a text of the same length whose numbers in words are digits.

    Digits stand at the end of the words' place; where such a number begins is told for each place.
    """
    shares = [pattern for _, pattern in _SHARES]
    patterns = (_WORDS, _MULTIPLE, *shares)
    found = [match.span() for pattern in patterns for match in pattern.finditer(text)]
    starts = {at: start for start, end in found for at in range(start, end)}

    def power(match: re.Match) -> str:  # "10 million" -> "      10e6"
        of_ten = round(math.log10(NUMBERS[match[2].lower()]))
        return f"{match[1]}e{of_ten}".rjust(len(match[0]))

    def decimals(match: re.Match) -> str:  # as many as fit: "one third" -> "0.3333333"
        value = 1 / (3 if match[2].lower() == "third" else 4)
        return match[1] + f"{value:.{len(match[0]) - len(match[1]) - 2}f}"

    def digits(match: re.Match) -> str:  # "one point two" -> "          1.2"
        whole = _counted(re.findall(_WORD, match[1]))
        after = [NUMBERS[word.lower()] for word in re.findall(_WORD, match[2] or "")]
        after = [5] if match[3] else after
        if whole is None or any(digit > 9 for digit in after):
            return match[0]
        return (f"{whole}." + "".join(map(str, after))).rstrip(".").rjust(len(match[0]))

    for share, pattern in _SHARES:  # "zur Hälfte hohl" -> "      50 % hohl"
        text = pattern.sub(lambda m, share=share: share.rjust(len(m[0])), text)
    return _WORDS.sub(digits, _FRACTION.sub(decimals, _MULTIPLE.sub(power, text))), starts


def _counted(said: list[str]) -> int | None:
    """What words count, "two hundred and five" 205; None where they are no one number."""
    total, run, below = 0, 0, 100
    for word in said:
        n = NUMBERS[word.lower()]
        if n >= 1000:
            total, run, below = total + max(run, 1) * n, 0, 100
        elif n == 100 and run < 100:
            run, below = 100 * max(run, 1), 100
        elif n < below:
            run, below = run + n, 10 if n >= 20 else 0
        else:
            return None
    return total + run


_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−", "0123456789--")
_DIGITS = r"(?:\d{1,3}(?:[   ]\d{3})+(?![\d.])|\.?\d(?:[.,']?\d)*)"
_POWER = r"10(?:\s?\^\s?[-+−]?\d+|[⁻⁰¹²³⁴-⁹]+)"
_NUMBER = (
    rf"(?<!\d)(?<!(?<!\.)\.)(?:{_POWER}"
    rf"|{_DIGITS}(?:\s?[x×*·]\s?(?:{_POWER}|10\s?-?\d+)|[eE][-+−]?\d+)?)"
)
_SPREAD = (
    r"(?:\s?(?:-|–|to|\.\.+|(?<=\d)…(?=\d)|bis|(?(between)and|(?!)))\s?(?P<high>{n})"
    r"|\s?(?:±|\+/-)\s?[\d.,]+\s?%?|\s?(?:and|or|/)\s(?P<also>{n})(?=\s?-?{unit}))?"
)
_BOUND = DATA["units"]["bound"]
_LINK = (
    r"\s*(?:\((?:ISO|DIN|EN|ASTM)[^()]*\)\s*)?(?:(?:of|de|von|is|was|are|=|:|~|≈|about|around"
    r"|approx\.?|approximately|roughly|ca\.?|at|to|taken as|measured|nominal|mean|,mean"
    r"|(?:as )?per (?:the )?(?:data ?sheet|supplier|test|drawing)"
    r"|just|only|exactly|nearly|almost|some|in the range of|(?i:" + _BOUND + r"))\s*)*"
)
_PREFIXES, _PREFIXED, _PLAIN = (DATA["units"][k] for k in ("prefixes", "prefixed", "plain"))


def _any(words: Any) -> str:
    return "|".join(sorted((re.escape(word) for word in words), key=len, reverse=True))


_ATOM = (
    rf"(?i:(?:(?:cubic|cu\.?|square|sq\.?)\s?)?(?:{_any(_PLAIN)}"
    rf"|(?:{_any(_PREFIXES)})?(?:{_any(_PREFIXED)})))"
    r"(?:(?:\^|\*\*)?[-−]?[23](?!\d)|[²³]|⁻[¹²³])?(?![^\W\d_])"
)
_TIMES = r"(?:\s?(?:/|·|\*|per\b)\s?|\s(?=[^\W\d_]+(?:\^?[-−][123]|⁻[¹²³])))"
_UNIT = rf"(?:(?i:{_any(DATA['units']['named'])})(?!\w)|{_ATOM}(?:{_TIMES}{_ATOM})*)"
_ANY_CUE = "|".join(f"(?P<cue_{measure}>{cue})" for measure, cue in DATA["cues"].items())
_VALUE = (
    rf"(?P<between>between\s)?(?P<low>{_NUMBER}){_SPREAD.format(n=_NUMBER, unit=_UNIT)}"
    rf"(?:\s?-?(?P<unit>{_UNIT})|\s?(?P<share>{DATA['units']['share']})"
    r"|\s?(?P<odd>[A-Za-zµ]{1,3}/[A-Za-z(]+[A-Za-z·)]*[²³\d]?)(?!\w))?"
)
_BEFORE = re.compile(rf"(?<![\w.])(?:{_ANY_CUE}){_LINK}{_VALUE}")
_AFTER = re.compile(rf"(?<![\w.,]){_VALUE}\s?-?(?:in )?(?:{_ANY_CUE})(?!\w)")
_ALONE = re.compile(rf"(?<![\w.,]){_VALUE}")

# Hardness: a word for it and a number, in any order, with the scale's letter beside either; or
# the number and the letter in one ("80A").
_HARD = r"(?i:shore|sh\.?|duro(?:meter)?s?|irhd)(?:[ -]?(?i:hardness))?"
_GAP = r"[\s:=,-]*(?:(?:of|is|about|around|approx\.?|~)\s*)*"
_SHORE = re.compile(
    rf"(?<!\w)(?:(?:(?i:hardness)\s*(?:of\s*)?)?{_HARD}[\s-]*(?P<s1>[ADad](?!\w))?"
    rf"(?:[ -]?(?i:hardness))?{_GAP}(?P<n1>\d{{1,3}})\s?°?(?:\s?[-(]?(?P<s2>[ADad])\b\)?)?"
    rf"(?:\s?(?i:shore))?(?![\w%]|\.\d| ?(?:mm|cm|[µμu]m|kg|°))"
    rf"|(?i:hardness){_GAP}(?P<n4>\d{{1,3}})\s?°?\s?(?P<s6>[AD])(?!\w)"
    rf"|(?<!\d-)(?P<n2>\d{{1,3}})(?:\s?(?:±|\+/-)\s?\d+)?\s*°?\s?-?(?P<s3>[ADad])?\s?-?"
    rf"(?:on the )?{_HARD}(?:\s(?i:shore))?(?:[\s-]*(?P<s4>[AD])(?!\w))?(?: scale)?(?!\w)"
    rf"|(?P<n3>(?:10|[1-9])\d)(?:-?(?P<s5>[ADad])| (?P<s7>[AD]))(?![\w-]))"
)
_SHORE_OTHER = re.compile(
    r"(?i:shore\s?-?)(?:O?OO|000?|o|[BCEM](?!\w))\s?-?\d*|(?<![\w.])00-\d\d(?!\d)"
    rf"|\d\d\s?°?\s?{_HARD}\s?(?:O?OO|00|[BCEMO])(?!\w)"
    r"|(?i:asker)\s?-?C?\s?\d\d|\d\d\s?(?i:asker)(?: C)?"
)

_FIBRES = r"(?P<fibre>(?i:glass|carbon)|GF|CF)(?:[ -](?i:fib(?:re|er)s?))?"
_PERCENT = r"(?:%|(?i:per ?cent|pct\.?))"
_BLEND = re.compile(
    rf"(?P<share>\d\d?)\s?{_PERCENT}\s?(?i:short )?{_FIBRES}"
    rf"(?:[ -](?i:filled|reinforced|loaded|content))?(?!\w| ?(?i:beads?|spheres?|flakes?))"
    rf"|(?i:(?:with )?(?P<share3>\d\d?)\s?{_PERCENT}(?: (?:short|long|chopped|milled))?"
    r" glass(?=\W|$)(?! ?(?:beads?|spheres?|flakes?)))"
    rf"|[- ]?(?P<fibre2>GF|CF)[ -]?(?P<share2>[1-6]\d)(?!\d)"
    rf"|(?:(?<=[A-Z0-9])[- ]|(?<= )-)(?P<fibre5>GF|CF)(?![\w-]| ?\d)"
    rf"|{_FIBRES.replace('fibre>', 'fibre4>')}[ -](?i:filled|reinforced|loaded)(?!\w)(?= (?!with))"
    rf"(?:(?=(?: [\w-]+){{1,2}} \(?(?P<behind>\d\d)\s?{_PERCENT}))?"
)
POWDERS: dict[str, dict[str, Any]] = DATA["powders"]
_POWDER = "|".join(rf"(?P<p{k}>(?i:{one['words']}))" for k, one in enumerate(POWDERS.values()))
# "alumina-filled epoxy (60 %)", "epoxy with 60 % of silver powder", "PA12 with 40 % glass beads"
_FILLED = re.compile(
    rf"(?<![\w-])(?:(?i:with )?(?P<share>\d\d)\s?{_PERCENT} ?(?i:of )?)?(?:{_POWDER})"
    r"(?:[ -](?i:filled|loaded)(?= (?!(?i:with|by))\w)"
    rf"(?:(?=(?: [\w-]+){{1,2}} \(?(?P<behind>\d\d)\s?{_PERCENT}))?"
    rf"|(?(share)(?: (?i:powder|filler|particles)|(?<=(?i:eads|talc|halk))|(?<=ATH))|(?!)))(?!\w)"
)
# Walls of a print, beside its infill: "3 walls of 0.4 mm", "4 perimeters", "1.2 mm walls".
_PRINTED, _SKIN = (re.compile(DATA["printed"][kind]) for kind in ("infill", "skin"))
LINE = 0.4e-3  # m: of an extruded line, the width of the usual nozzle
_FOAM_CODE = re.compile(DATA["codes"]["rho"])
_TEMPERATURE = re.compile(
    rf"(?P<sign>[-−])?(?P<n>{_NUMBER})\s?(?:[°º]\s?|(?i:deg(?:rees?)?)\s?)(?P<scale>[CFcf])(?:elsius|ahrenheit)?(?!\w)"
)
# Of gold and of stones, no count: "9 karat gold", "a 2 ct stone".
_FINENESS = re.compile(r"(?<![\w.,])\d{1,2}(?:[.,]\d+)?[ -]?(?i:ct|carats?|karats?)(?!\w)")
# Of a temperature that a thing bears, or is made at, and a text that asks for the usual values.
_LIMIT = re.compile(
    r"(?i)(?:max(?:\.|imum)?|min(?:\.|imum)?|up to|t_?max|design|qualif\w+|rat(?:ed|ing)|service"
    r"|limit|fill|autoclaved?|set|softens|melts|cured?|Tg|Af)(?: temp\w*\.?)?(?: at| to| of)?[ :=]*"
    r"(?:[-−\d/+. ]+)?$"
)
_AT_ROOM = re.compile(r"(?i)(?:room[ -]temp\w*|RT|2[03] ?°? ?C) values|values at (?:RT|room)")
ROOM = (0.0, 50.0)  # degrees Celsius between which handbooks' values of solids hold
USUAL_SHARE = 0.3  # of fibres, by weight, where none is said: the grade most sold (GF30)
GRAVITY = 9.80665  # m/s^2: a weight of a volume [N/m^3] to its density
_FIBRE_ROWS = {"g": "E-glass fibre", "c": "CFRP (along fibre)"}
_LOADED = re.compile(r"(?i)pressure|load|force|torque|snow|wind")
# Numbers without a unit that can be only one thing: an E in Pa, a density in kg/m^3 or in g/cm^3.
_BARE = {
    "E": ((1e4, 2e12, 1.0, "Pa"),),
    "rho": ((25.0, 23e3, 1.0, "kg/m3"), (0.3, 23.0, 1e3, "g/cm3")),
}
_POUNDS = (0.02, 0.9, 27679.9, "lb/in3")  # beside psi
_IMPERIAL = re.compile(r"(?i)(?<![a-z])(?:[km]?psi|[km]si)(?![a-z])")
_STOP = re.compile(r"[;\n]|\.(?=\s|$)")


# As programs write a material: "(7e10, 0.33, 2700)" is E [Pa], nu and rho [kg/m^3].
_TRIPLE = re.compile(rf"\(\s*({_NUMBER})\s*,\s*({_NUMBER})\s*,\s*({_NUMBER})\s*\)")
_DIRECTED = re.compile(r"E_?(?:x|L|1|11|xx)\b")
_MINUS = re.compile(r"[=:]\s*[-−]$")
_NO_STRENGTH = 1e10  # Pa: more than anything but a fibre bears, so a modulus
_MOST = {"E": 2e12, "rho": 25e3}  # beyond, a comma before three digits is a decimal point
_EUROPEAN = re.compile(r"(?<![\d.,])(?:0,\d|\d+,\d{1,2}(?![\d,]))")


class Numeral(NamedTuple):
    """A number at a place of the text: what it says, or None where that is no measure of ours."""

    start: int
    end: int
    value: Quantity | Blend | None
    note: str = ""


def numerals(text: str) -> list[Numeral]:
    """Return the numbers of a text that measure something, none over another."""
    found: list[Numeral] = []
    text, starts = in_digits(text)
    if _EUROPEAN.search(text):  # a comma before decimals: a point before three digits is none
        grouped = r"(?<![\d.,])\d{1,3}(?:\.\d{3})+(?!\d)"
        text = re.sub(grouped, lambda m: m[0].replace(".", ","), text)
    for finder in (_special, _measures):
        for numeral in finder(text):
            if all(numeral.end <= f.start or f.end <= numeral.start for f in found):
                found.append(numeral)
    # A number in words begins where its first word does.
    return sorted(f._replace(start=starts.get(f.start, f.start)) for f in found)


def _special(text: str) -> Iterator[Numeral]:
    """Temperatures, fineness, triples as programs write them, shares of fibres, hardnesses."""
    for match in _TEMPERATURE.finditer(text):
        degrees = number(match["n"]) * (-1 if match["sign"] else 1)
        celsius = degrees if match["scale"] in "Cc" else (degrees - 32) / 1.8
        odd = not ROOM[0] <= celsius <= ROOM[1]
        limit = _LIMIT.search(text[: match.start()]) or _AT_ROOM.search(text)
        note = Note("numerals.used_values", match=match[0]) if odd and not limit else ""
        yield Numeral(*match.span(), None, note)
    for match in _FINENESS.finditer(text):
        yield Numeral(*match.span(), None)
    for match in _SKIN.finditer(text) if _PRINTED.search(text) else ():
        width = 1e-3 * number(match["w"] or match["t"] or "0") or LINE
        skin = Quantity("skin", int(match["n"] or 1) * width, match[0])
        yield Numeral(match.start(), match.end(), skin)
    for match in _TRIPLE.finditer(text):
        E, nu, rho = map(number, match.groups())
        if 1e3 < E < _MOST["E"] and 0 <= nu < 0.5 and 1 < rho < _MOST["rho"]:
            note = Note("numerals.taken_pa", match=match[0])
            for k, (symbol, value) in enumerate({"E": E, "nu": nu, "rho": rho}.items(), 1):
                said = Quantity(cast(Measure, symbol), value, match[k])
                yield Numeral(*match.span(k), said, note if k == 1 else "")
    for match in _BLEND.finditer(text):
        group = match.groupdict()
        fibre = group["fibre"] or group["fibre2"] or group["fibre4"] or group["fibre5"] or "glass"
        share = group["share"] or group["share2"] or group["share3"] or group["behind"]
        row = _FIBRE_ROWS[fibre[0].lower()]
        if fibre.lower() == "carbon" and not re.search(r"(?i)fib|reinforced", match[0]):
            row = "graphite"  # "25 % carbon filled": a powder
        yield _blended(match, row, share)
    for match in _FILLED.finditer(text):
        powder = next(name for k, name in enumerate(POWDERS) if match[f"p{k}"])
        yield _blended(match, powder, match["share"] or match["behind"])
    for match in _FOAM_CODE.finditer(text):
        said = Quantity("rho", float(match["rho"]), match["code"])
        yield Numeral(match.start("code"), match.end("code"), said)
    for match in _SHORE_OTHER.finditer(text):
        yield Numeral(*match.span(), None, Note("numerals.only_shore", match=match[0]))
    for match in _SHORE.finditer(text):
        degree = next(match[g] for g in ("n1", "n2", "n3", "n4") if match[g])
        scale = next((match[g] for g in (f"s{i}" for i in range(1, 8)) if match[g]), "A")
        measure: Measure = "shore_a" if scale in "Aa" else "shore_d"
        value = Quantity(measure, float(degree), match[0]) if 0 < int(degree) <= 100 else None
        note = "" if value else Note("numerals.scale", match=match[0])
        yield Numeral(*match.span(), value, note)


def _blended(found: re.Match, material: str, share: str | None) -> Numeral:
    """So many percent of a second matter, the usual share where none is said."""
    if share:
        return Numeral(*found.span(), Blend(material, int(share) / 100))
    note = Note("numerals.share_said", match=found[0], usual_share=USUAL_SHARE)
    return Numeral(*found.span(), Blend(material, USUAL_SHARE), note)


def _measures(text: str) -> Iterator[Numeral]:
    """Numbers with the word that says what they measure before them, after them, or with a unit."""
    taken: list[tuple[int, int]] = []
    if _PRINTED.search(text):  # "20 % gyroid infill, 3 perimeters": the 3 is of these
        text = _SKIN.sub(lambda m: " " * len(m[0]), text)
    for pattern in (_BEFORE, _AFTER, _ALONE):
        at = 0
        while match := pattern.search(text, at):
            at = max(match.end(), at + 1)
            if match["also"] and number(match["also"]) > 100 * number(match["low"]):
                at = match.start("also")  # too far apart for one measure: "0.3 / 900"
                continue
            if any(match.start() < end and start < match.end() for start, end in taken):
                continue
            read = _read(match, cued=pattern is not _ALONE)
            if read and read.value and _MINUS.search(text[: match.start("low")]):
                note = Note("numerals.below_zero", strip=match[0].strip())
                read = read._replace(value=None, note=note)
            if read:
                taken.append(match.span())
                yield read


_SYMBOL = re.compile(r"(?![EGKR])[A-Za-z](?:_\w+)? ?=")  # "L = 450" speaks of no matter
_RELATIVE = re.compile(r"(?i)\brelative?[rn]?\b|\brelativa\b")  # density: of itself, or of water


def _read(match: re.Match, *, cued: bool) -> Numeral | None:
    """What a match says: by its word, else by its unit; told where the two are at odds."""
    group, said, (start, end) = match.groupdict(), " ".join(match[0].split()), match.span()
    dimension, factor = _si(group["unit"]) if group["unit"] else (None, 1.0)
    words = (m for m in DATA["cues"] if cued and group[f"cue_{m}"])
    measure: Any = next(words, dimension)
    if (measure, dimension) == ("mass", "rho"):
        measure = "rho"  # "it weighs 1.6 kg/l"
    low, high = number(group["low"]), number(group["high"] or "")
    if measure == "infill" and _RELATIVE.search(said) and not group["share"] and low > 1:
        measure, factor = "rho", 1e3
    note = Note("numerals.middle_range", said=said) if high else ""
    value = factor * ((low * high) ** 0.5 if high else low)
    if group["odd"]:
        return Numeral(start, end, None, Note("numerals.used", said=said))
    if group["also"] and measure not in ("size", "other"):
        return Numeral(start, end, None, Note("numerals.numbers_part", said=said))
    if measure is None or (measure in ("size", "other") and not cued):
        return Numeral(start, end, None) if measure == "size" else None  # "316L" is no volume
    if measure == "other" and dimension == "size":
        return Numeral(start, end, None)  # "l = 20 mm"
    if measure == "other" or not value > 0:
        if _LOADED.search(said):
            return Numeral(start, end, None, Note("lexing.load_text", load=said))
        if dimension is None and _SYMBOL.match(said):
            return Numeral(start, end, None, Note("numerals.aside", said=said))
        return Numeral(start, end, None, Note("numerals.used", said=said))
    if re.search(rf"(?i)(?<!\w)(?:{_BOUND})(?!\w)", match[0][: match.start("low") - start]):
        note = Note("numerals.bound_value", said=said)
    if group["unit"] == "mPa":
        note = Note("numerals.read_mpa", said=said, group=group["low"])
    if _DIRECTED.match(said):
        note = Note("numerals.direction_same", said=said)
    bare = _BARE.get(measure, ())
    if dimension is None and not group["share"] and bare:
        if measure == "rho":
            before, after = (_STOP.split(x) for x in (match.string[:start], match.string[start:]))
            bare = (_POUNDS, *bare) if _IMPERIAL.search(before[-1] + after[0]) else bare
        scale, unit = next(((s, u) for a, b, s, u in bare if a <= value <= b), (0.0, ""))
        value, note = value * scale, Note("numerals.unit_taken", said=said, unit=unit)
    if measure == "rho" and value < 10 and re.fullmatch(r"\d{1,3}\.\d{3}", group["low"]):
        value, note = 1e3 * value, Note("numerals.point_taken", said=said)
    if measure == "E" and dimension and 1e3 * value < _MOST["E"] and value < 1e9:
        if re.fullmatch(r"\d{1,3}\.000", group["low"]):  # "210.000 N/mm2"
            value, note = 1e3 * value, Note("numerals.point_taken", said=said)
    if value > _MOST.get(measure, math.inf) and re.fullmatch(r"\d{1,3},\d{3}", group["low"]):
        value, note = value / 1e3, Note("numerals.comma_taken", said=said)
    if measure == "void" and not (group["share"] and value < 100):
        return None
    if measure in ("infill", "void") and dimension is None:
        value = value / 100 if group["share"] or value > 1 else value
    elif dimension != {"thickness": "size", "nu": None}.get(measure, measure) and not (
        dimension is None and bare and value and not group["share"]
    ):
        reason = Note("numerals.measure", measure=measure) if dimension else Note("numerals.unit")
        return Numeral(start, end, None, Note("numerals.used_2", said=said, reason=reason))
    if measure == "nu" and not value < 0.5:
        return Numeral(start, end, None, Note("numerals.poissons_ratio", said=said))
    called = cued or (measure == "E" and value >= _NO_STRENGTH)
    return Numeral(start, end, Quantity(cast(Measure, measure), value, said, called), note)


def number(text: str) -> float:
    """Return a number as it is written: "2.5", "2,5", "29,000", "7e10", "1.2 x 10^9"; else 0."""
    if re.fullmatch(_POWER, text):
        text = f"1x{text}"
    text = re.sub(r"\s?[x×*·]\s?10\s?\^?\s?", "e", text).translate(_RAISED)
    text = re.sub(r"['   ]", "", text).rstrip(".,")
    if re.fullmatch(r"(?!0,)\d{1,3}(?:,\d{3})+(?:\.\d+)?(?:e.*)?", text, re.IGNORECASE):
        text = text.replace(",", "")
    if re.fullmatch(r"\d{1,3}(?:\.\d{3}){2,}", text):
        text = text.replace(".", "")
    try:
        return float(text.replace(",", "."))
    except ValueError:  # "1.2.3" is no number
        return 0.0


@lru_cache(maxsize=256)
def _si(unit: str) -> tuple[str | None, float]:
    """What a unit measures, None for nothing of ours, and how much of SI it is."""
    if unit.strip() == "T":
        return "other", 1.0  # teeth: "50T"
    unit = re.sub(r"^kg(?=\s?/\s?[mc]m(?:\^?2|²))", "kgf", unit)  # as old drawings have it
    unit = re.sub(r"^Mg(?=\W)", "t", unit)  # a megagram; of any other m, careless hands decide
    name = DATA["units"]["named"].get(unit.strip().lower())
    for times, atom in [] if name else re.findall(rf"({_TIMES})?({_ATOM})", unit):
        sign = "/" if "/" in times or "per" in times.lower() else "*"
        name = f"{name}{sign}{_atom(atom)}" if name else _atom(atom)
    quantity = _registry().Quantity(1.0, name)
    for dimension, measure in DATA["measures"].items():
        if quantity.is_compatible_with(dimension):
            size = quantity.to(dimension).magnitude
            return ("rho", size / GRAVITY) if measure == "weight" else (measure, size)
    return "other", 1.0


def _atom(written: str) -> str:
    """How pint calls one unit: "cubic foot" -> ft^3, "mm2" -> mm^2, "Gpa" -> GPa."""
    found = re.fullmatch(
        r"(?i)(?:(cu)(?:bic|\.)?\s?|(sq)(?:uare|\.)?\s?)?(.*?)(?:\^|\*\*)?(-?[23])?",
        written.translate(_RAISED),
    )
    cubed, squared, name, power = found.groups() if found else ("", "", written, "")
    power = power or ("3" if cubed else "2" if squared else "1")
    small = name.lower()
    if small in _PLAIN:
        return f"({_PLAIN[small]})^{power}"
    for stem in sorted(map(str, _PREFIXED), key=len, reverse=True):
        prefix = small.removesuffix(stem)
        if small.endswith(stem) and (prefix in _PREFIXES or not prefix):
            # An m is mega of Pa and psi, as careless hands write it, else milli.
            milli = prefix == "m" and (stem in ("m", "l", "g") or (name[0], stem) == ("m", "n"))
            return f"({'m' if milli else _PREFIXES.get(prefix, '')}{_PREFIXED[stem]})^{power}"
    return name


@lru_cache(maxsize=1)
def _registry() -> Any:
    from pint import UnitRegistry

    # Its own list of units takes longer to read than any text.
    registry = UnitRegistry(None)
    for definition in DATA["definitions"]["units"]:
        registry.define(definition)
    return registry


# What is said in numbers of a material: a value, a second matter in it, a relation.

# Of a material: Young's modulus [Pa], Poisson's ratio [1], density [kg/m^3], hardness on two of
# Shore's scales [1], filled share of a print [1], empty share of anything [1], solid skin [m] of a
# print, mass [kg], thickness [m] of what is spoken of.
Measure = Literal[
    "E", "nu", "rho", "shore_a", "shore_d", "infill", "void", "skin", "mass", "thickness"
]


@dataclass(frozen=True)
class Quantity:
    """A number that was said, in SI units, and the words that say it.

    ``called`` tells whether a word or symbol says what it measures, and not its unit alone.
    """

    measure: Measure
    value: float
    text: str
    called: bool = True


def wall_named(part: str, numbers: Sequence[Quantity]) -> Quantity | None:
    """The thickness of the wall that numbers give a part: "2 mm walls", not "2 mm thick".

    A part that is called a wall has none around it.
    """
    if "wall" in part.lower():
        return None
    said = (n for n in numbers if n.measure == "thickness" and "wall" in n.text.lower())
    return next(said, None)


@dataclass(frozen=True)
class Blend:
    """A second matter inside the first: 30 % of glass fibre in nylon."""

    material: str
    share: float


@dataclass(frozen=True)
class Comparison:
    """What is said of a part beside another: "twice as stiff as the legs".

    measure: What is compared: E or rho.
    factor: How many times the other's value; above 1 without a number where it is ``exact`` no more
        than "stiffer", below 1 for "softer".
    exact: Whether a number was said.
    other: The words that name the other part; () for all others.
    """

    measure: Literal["E", "rho"]
    factor: float
    exact: bool
    other: tuple[str, ...]
