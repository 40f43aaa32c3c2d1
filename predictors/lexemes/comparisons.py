"""Comparisons: "twice as stiff", "a bit softer", each one lexeme."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..quantities.numerals import number
from ..quantities.quantity import Comparison
from ..vocabulary.lexicon import words
from .lexeme import Lexeme

PLAIN_FACTOR = 2.0  # "stiffer", without a word for how much
_REACH = 6  # words before a comparative that may say how many times
_PERCENT = ("%", "percent")
_COUNTING = (
    *_PERCENT,
    "a",
    "an",
    "times",
    "x",
    "×",
    "of",
    "about",
    "roughly",
    "only",
    "at",
    "least",
    "as",
)


def join_comparisons(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the lexemes with every comparison as one: "twice as stiff", "a bit softer"."""
    out: list[Lexeme] = []
    for i, lexeme in enumerate(lexemes):
        found = words()["compared"].get(lexeme.text.lower())
        start = _comparison_start(out, lexeme, lexemes[i + 1 : i + 3]) if found else None
        if found is None or start is None:
            out.append(lexeme)
            continue
        measure, way = found
        sign = out[start].text.lower() if start < len(out) else ""
        unlike = sign == "as" and start and out[start - 1].role == "not"
        way = -way if sign == "less" or unlike else way
        factor, exact, start = _factor(out, start - 1 if unlike else start, way)
        if sign == "as" and not (unlike or exact):
            factor, exact = 1.0, True
        factor = 1 / factor if way < 0 and factor > 1 else factor
        began = out[start].start if start < len(out) else lexeme.start
        del out[start:]
        out.append(
            replace(
                lexeme, role="compare", start=began, value=Comparison(measure, factor, exact, ())
            )
        )
    return out


def _comparison_start(before: list[Lexeme], lexeme: Lexeme, after: Sequence[Lexeme]) -> int | None:
    """Index of the word that makes an adjective a comparison, or None where it is none."""
    last = before[-1].text.lower() if before else ""
    if last in ("more", "less"):
        return len(before) - 1
    if last == "as":
        times = len(before) > 1 and (
            before[-2].role == "factors" or before[-2].text.lower() in ("times", "x", "×")
        )
        return len(before) - 1 if times or any(x.role == "as" for x in after) else None
    return len(before) if lexeme.text.lower().endswith("er") else None


def _factor(before: list[Lexeme], start: int, way: int) -> tuple[float, bool, int]:
    """How many times, whether a number says so, and where the comparison starts."""
    factor, exact, first = PLAIN_FACTOR, False, start
    percent = start > 0 and before[start - 1].text.lower() in _PERCENT
    for i in range(start - 1, max(start - 1 - _REACH, -1), -1):
        lexeme = before[i]
        if lexeme.role in ("factors", "vague"):
            factor, exact, first = float(lexeme.value), lexeme.role == "factors", i
        elif lexeme.role == "digits":
            factor, exact, first = number(lexeme.text) or 1.0, True, i
            factor = max(1 + way * factor / 100, 0.01) if percent else factor
        elif lexeme.text.lower() not in _COUNTING:
            break
    return factor, exact, first
