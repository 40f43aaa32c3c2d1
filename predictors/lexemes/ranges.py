"""Ranges of parts: "leg_1 to leg_4"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..vocabulary.lexicon import Phrase, part_name_words
from .lexeme import Lexeme

_THROUGH = ("to", ".", "..", "...", "-", "–", "through", "until", "thru")


def spelt_out(lexemes: list[Lexeme], names: Sequence[str]) -> list[Lexeme]:
    """Put the parts of a range where it is said: "leg_1 to leg_4", "blade_1..3", "bodies 1-3"."""
    out: list[Lexeme] = []
    first: Lexeme | None = None  # a part or its number, and nothing but "to" or dots since
    for lexeme in lexemes:
        ends = lexeme.role == "part" or (lexeme.role == "digits" and lexeme.part)
        bare = ends and first is not None and lexeme.role == "digits"
        if bare and first is not None and first.role == "part":  # "rib_01..03"
            lexeme = replace(lexeme, role="part", words=(*first.words[:-1], *lexeme.words))
        if ends and first is not None and first.role == lexeme.role and out[-1] is not first:
            while out[-1] is not first:
                out.pop()
            both = replace(first, role="and", words=(), part=False)
            for words in _between(first.words, lexeme.words, names):
                out += [both, replace(first, words=words)]
            out.append(both)
        if ends or (first is not None and lexeme.text.lower() not in _THROUGH):
            first = lexeme if ends else None
        out.append(lexeme)
    return out


def _between(first: Phrase, last: Phrase, names: Sequence[str]) -> list[Phrase]:
    """Words of the names between two that count on: the same words, with numbers between theirs."""
    if first[:-1] != last[:-1] or not (first[-1].isdigit() and last[-1].isdigit()):
        return []
    told = {int(part_name_words(name)[-1]) for name in names if name[-1:].isdigit()}
    inside = sorted(n for n in told if int(first[-1]) < n < int(last[-1]))
    return [(*first[:-1], str(n).zfill(len(first[-1]))) for n in inside]
