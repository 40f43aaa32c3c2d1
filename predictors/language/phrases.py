"""What words say together: comparisons, treatments and colours, contents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...fem.scene.materials import Material
from .clauses import Comparison
from .lexicon import ReaderLexicon, words
from .lexing import Lexeme
from .quantities import number

PLAIN_FACTOR = 2.0  # "stiffer", without a word for how much
_REACH = 6  # words before a comparative that may say how many times
_COUNTING = ("a", "an", "times", "x", "×", "of", "about", "roughly", "only", "at", "least", "as")


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
        way = -way if start < len(out) and out[start].text.lower() == "less" else way
        factor, exact, start = _factor(out, start)
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
        return len(before) - 1 if any(x.role == "as" for x in after) else None
    return len(before) if lexeme.text.lower().endswith("er") else None


def _factor(before: list[Lexeme], start: int) -> tuple[float, bool, int]:
    """How many times, whether a number says so, and where the comparison starts."""
    factor, exact, first = PLAIN_FACTOR, False, start
    for i in range(start - 1, max(start - 1 - _REACH, -1), -1):
        lexeme = before[i]
        if lexeme.role in ("factors", "vague"):
            factor, exact, first = float(lexeme.value), lexeme.role == "factors", i
        elif lexeme.role == "digits":
            factor, exact, first = number(lexeme.text) or 1.0, True, i
        elif lexeme.text.lower() not in _COUNTING:
            break
    return factor, exact, first


def implied(run: Sequence[Lexeme], lexicon: ReaderLexicon) -> list[tuple[Lexeme, Material]]:
    """The metal that a treatment speaks of: "galvanised" is steel, until another is named."""
    rows = ((x, words()["implied"].get(x.text.lower())) for x in run if x.role == "coat")
    return [
        (replace(x, words=("metal",)), lexicon.table.exact(row))
        for x, row in rows
        if row in lexicon.table.phrases
    ][:1]


def puts_hue(lexeme: Lexeme, before: Sequence[object], after: Sequence[Lexeme]) -> bool:
    """Whether a participle puts the metal after it on the matter before: "wood painted silver"."""
    rows = [*before, *(x.value for x in after)]
    metals = [isinstance(row, Material) and row.category == "metal" for row in rows]
    matter = isinstance(next(iter(before), None), Material)
    return matter and lexeme.text.lower() in words()["hues"]["words"] and metals == [False, True]


def is_hue(after: Sequence[Lexeme]) -> bool:
    """Whether "light" is told of a colour: before another adjective, or a wood."""
    return any(
        x.value.category == "wood" if isinstance(x.value, Material) else x.tag == "JJ"
        for x in after
    )


def contents_called(said: Sequence[str], lexicon: ReaderLexicon) -> str | None:
    """Row of the loose matter or liquid that the last words of ``said`` name."""
    tails = (tuple(said[i:]) for i in range(len(said)))
    return next((lexicon.contents[tail] for tail in tails if tail in lexicon.contents), None)
