"""Tokens of a text: its words and the material phrases in it, each with its role and its place."""

from __future__ import annotations

import re
from typing import Literal, NamedTuple

from . import words
from .vocabulary import TOKEN, Vocabulary, stem

Role = Literal["material", "break", "joint", "link", "start", "level", "not", "noun", "filler"]

_UNITS = "mm cm dm km m kg g mg lb oz ft inches inch litres litre l % degrees percent metres metre"
_NUMBER = r"\d+(?:[.,]\d+)?"
_DASH = re.compile(r"\s[-–—]\s|→|->")
_SIZE = re.compile(
    rf"(?<![\w.])(?:{_NUMBER}(?:\s*(?:x|×|by)\s*{_NUMBER})*\s*(?:"
    + "|".join(map(re.escape, _UNITS.split()))
    + rf")|{_NUMBER}(?:\s*[x×]\s*{_NUMBER})+|\d+[.,]\d+)(?!\w)"
)


class Token(NamedTuple):
    """A word, or a material's phrase."""

    word: str  # of a material: its phrase in the table
    role: Role
    stems: tuple[str, ...]  # of a material: all words of its phrase
    said: str
    span: tuple[int, int] | None  # characters of the text; None for a word that is not there


def tokenise(text: str, vocabulary: Vocabulary) -> list[Token]:
    """Return the tokens of a text in order; sizes ("30 cm") are none, grades ("316L") are."""
    found = list(TOKEN.finditer(_plain(text, vocabulary)))
    raw = [match[0] for match in found]
    stems = [stem(word) for word in raw]
    tokens: list[Token] = []
    at = 0
    while at < len(raw):
        phrase, length = vocabulary.match(stems, at) or (None, 1)
        end = at + length
        span = found[at].start(), found[end - 1].end()
        if phrase is not None:
            said = " ".join(raw[at:end])
            tokens.append(Token(phrase, "material", tuple(stems[at:end]), said, span))
        else:
            follows_participle = bool(tokens) and tokens[-1].stems[0] in words.PARTICIPLES
            role = _role(raw[at], stems[at], follows_participle)
            tokens.append(Token(raw[at], role, (stems[at],), raw[at], span))
        at = end
    return tokens


def _plain(text: str, vocabulary: Vocabulary) -> str:
    """Lower case without sizes and genitives, dashes as "=": every word stays at its place."""

    def without_size(size: re.Match[str]) -> str:
        words = [stem(word) for word in TOKEN.findall(size[0])]
        named = vocabulary.match(words, 0)
        return size[0] if named and named[1] == len(words) else " " * len(size[0])

    lower = "".join(c.lower() if len(c.lower()) == 1 else c for c in text)
    blank = _SIZE.sub(without_size, lower)
    return _DASH.sub(lambda dash: "=".center(len(dash[0])), blank).replace("'s", "  ")


def _role(word: str, stem: str, follows_participle: bool) -> Role:
    if word == "with" and follows_participle:
        return "link"
    if word == "\n" or stem in words.BREAKS:
        return "break"
    if word == ":" or stem in words.LINKS or word in words.LINKS:
        return "link"
    if stem in words.JOINTS or word in words.JOINTS:
        return "joint"
    if stem in words.DETERMINERS:
        return "start"
    if word in words.LEVEL_OF:
        return "level"
    if word in words.NEGATIONS:
        return "not"
    return "filler" if stem in words.FILLERS or word.isdigit() else "noun"
