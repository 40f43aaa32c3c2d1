"""Numbers without a word for what they are, told by their neighbours: hardness, grades."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ...fem.scene.materials import Material
from ..quantities.numerals import number
from ..quantities.quantity import Quantity
from ..vocabulary.lexicon import words
from .lexeme import Lexeme

_HARDNESS = re.compile(r"(?:hardness\W*(?:of )?)?([AD])?-?([1-9]\d)([AD])?")
_NUMBER = re.compile(r"(?!\d\.\d{4}$)\d[\d.]*")  # "1.4301" is a grade and nothing else
_YEAR = re.compile(r"(?:19|20)\d\d")
_CLASS = re.compile(r"\d\d?\.\d")  # of bolts: "8.8"
_RUBBERY = re.compile(r"(?i)\b(?:T?PU|TPE|polyurethane|urethane)\b")


def bare_numbers(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Take numbers without a word for what they are where their neighbours tell it.

    Two digits beside a rubber are its hardness, as lists of seals write it ("NBR 70", "rubber
    A-70"); what follows a modulus and lies below 0.5 is Poisson's ratio ("69 GPa / 0.33").
    """
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        said, note = _HARDNESS.fullmatch(lexeme.text), ""
        near = lexemes[max(i - 3, 0) : i + 3]
        rubber = next((x for x in near if _is_rubbery(x)), None)
        bare = said is not None and not (said[1] or said[3] or "hardness" in lexeme.text)
        close = not bare or rubber in [x for x in lexemes[:i][-2:] if x.role != "hyphen"][-1:]
        if said and rubber and close and lexeme.role in ("digits", "word", "told", "material"):
            measure = "shore_d" if "D" in (said[1], said[3]) else "shore_a"
            note = f"{lexeme.text!r} beside {rubber.text!r} is taken as its Shore hardness"
            value = Quantity(measure, float(said[2]), lexeme.text)
        elif lexeme.role == "digits" and 0 < number(lexeme.text) < 0.5 and _after_modulus(out):
            note = f"{lexeme.text!r} after a modulus is taken as Poisson's ratio"
            value = Quantity("nu", number(lexeme.text), lexeme.text)
        out.append(replace(lexeme, role="number", value=value, note=note) if note else lexeme)
    return out


def lone_grades(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Take numbers for grades of a metal only where nothing says that they are another number.

    Where the metal stands beside them they are its grades; alone they are told as a guess. A year
    after "in", a number after "model" and a property class without a fastener are plain numbers.
    """
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        if lexeme.role == "material" and _NUMBER.fullmatch(lexeme.text):
            metal, beside = lexeme.value, lexemes[max(i - 3, 0) : i + 4]
            last = lexemes[i - 1].text.lower() if i else ""
            if not _is_grade(lexeme, last, lexemes[i + 1 : i + 2], beside):
                note = f"{lexeme.text!r} after {last!r} is taken for no grade of a metal"
                told = last in (*words()["lone"]["labels"], *words()["lone"]["dates"])
                lexeme = replace(lexeme, role="digits", value=None, note=note if told else "")
            elif not _is_called(lexeme, lexemes[max(i - 2, 0) : i + 3]):
                note = f"{lexeme.text!r} without its metal is taken as a grade: {metal.name}"
                lexeme = replace(lexeme, note=note)
        out.append(lexeme)
    return out


def _is_grade(lexeme: Lexeme, last: str, after: Sequence[Lexeme], beside: Sequence[Lexeme]) -> bool:
    """Whether a number may be a grade, by the words before it and around it."""
    lone = words()["lone"]
    if last in lone["labels"]:
        return False
    if last in lone["dates"] and _YEAR.fullmatch(lexeme.text):
        return any(_is_metal(x) for x in after)
    fastener = any({*x.words} & {*lone["fasteners"]} for x in beside)
    return not _CLASS.fullmatch(lexeme.text) or fastener or _is_called(lexeme, beside)


def _is_called(lexeme: Lexeme, near: Sequence[Lexeme]) -> bool:
    """Whether a metal, or that it is a grade, is said beside a number."""
    lone = words()["lone"]
    says = {*lone["grades"]} | ({*lone["fasteners"]} if _CLASS.fullmatch(lexeme.text) else set())
    others = [x for x in near if x is not lexeme and not _NUMBER.fullmatch(x.text)]
    return any(_is_metal(x) or {x.text.lower(), *x.words} & says for x in others)


def _is_metal(lexeme: Lexeme) -> bool:
    row = lexeme.value if lexeme.role == "material" else None
    return isinstance(row, Material) and row.category == "metal"


def _is_rubbery(lexeme: Lexeme) -> bool:
    row = lexeme.value if lexeme.role == "material" else None
    named = isinstance(row, Material) and bool(_RUBBERY.search(row.name))
    return named or (isinstance(row, Material) and row.category == "elastomer")


def _after_modulus(before: Sequence[Lexeme]) -> bool:
    """Whether a modulus came last, with no more than a sign after it."""
    last = next((x for x in before[:-3:-1] if x.role == "number"), None)
    return last is not None and isinstance(last.value, Quantity) and last.value.measure == "E"
