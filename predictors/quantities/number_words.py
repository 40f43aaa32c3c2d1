"""Numbers in words as digits: "one point two", "two hundred and five", "10 million"."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

DATA = tomllib.loads((Path(__file__).parent / "data/quantities.toml").read_text(encoding="utf-8"))
_COUNTS: dict[str, int] = DATA["words"]
_WORD = rf"(?i:{'|'.join(sorted(map(re.escape, _COUNTS), key=len, reverse=True))})"
_THEN = r"(?:(?:(?<=hundred)|(?<=thousand)) and |[ -])"
_WORDS = re.compile(
    rf"(?<![\w-])({_WORD}(?:{_THEN}{_WORD})*)"
    rf"(?: point ({_WORD}(?: {_WORD})*)|( and a half))?(?![\w-])"
)
_MULTIPLE = re.compile(r"(?<![\w.,])(\d[\d.,]*)[ -](?i:(thousand|million|billion))(?!\w)")
_FRACTION = re.compile(r"(?<=ratio )((?:of |is )?)(?i:(?:one|a) (third|quarter))(?!\w)")


def counted_by(text: str) -> int | None:
    """Return what digits or a word count, None where they count nothing: "4", "three"."""
    return int(text) if text.isdigit() else _COUNTS.get(text.lower())


def in_digits(text: str) -> tuple[str, dict[int, int]]:
    """Return a text of the same length whose numbers in words are digits.

    Digits stand at the end of the words' place; where such a number begins is told for each place.
    """
    found = [match.span() for pattern in (_WORDS, _MULTIPLE) for match in pattern.finditer(text)]
    starts = {at: start for start, end in found for at in range(start, end)}
    text = _FRACTION.sub(_divided, _MULTIPLE.sub(_multiplied, text))
    return _WORDS.sub(_digits, text), starts


def _digits(match: re.Match) -> str:
    """A number in words as digits, as long as it was: "one point two" -> "          1.2"."""
    whole = _counted(re.findall(_WORD, match[1]))
    after = [_COUNTS[word.lower()] for word in re.findall(_WORD, match[2] or "")]
    after = [5] if match[3] else after
    if whole is None or any(digit > 9 for digit in after):
        return match[0]
    return (f"{whole}." + "".join(map(str, after))).rstrip(".").rjust(len(match[0]))


def _divided(match: re.Match) -> str:
    """A fraction in words with the decimals that fit: "one third" -> "0.3333333"."""
    share = 1 / (3 if match[2].lower() == "third" else 4)
    room = len(match[0]) - len(match[1])
    return match[1] + f"{share:.{room - 2}f}"


def _multiplied(match: re.Match) -> str:
    """A multiple of a number in words, as long as it was: "10 million" -> "      10e6"."""
    power = round(math.log10(_COUNTS[match[2].lower()]))
    return f"{match[1]}e{power}".rjust(len(match[0]))


def _counted(said: list[str]) -> int | None:
    """What words count, "two hundred and five" 205; None where they are no one number."""
    total, run, below = 0, 0, 100
    for word in said:
        n = _COUNTS[word.lower()]
        if n >= 1000:
            total, run, below = total + max(run, 1) * n, 0, 100
        elif n == 100 and run < 100:
            run, below = 100 * max(run, 1), 100
        elif n < below:
            run, below = run + n, 10 if n >= 20 else 0
        else:
            return None
    return total + run
