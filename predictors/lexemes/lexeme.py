"""One token of a text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..vocabulary.lexicon import Phrase


@dataclass(frozen=True)
class Lexeme:
    """One token of a sentence: what it does, what it says, how the model tags it."""

    text: str
    start: int
    end: int
    role: str
    value: Any = None
    words: Phrase = ()
    known: bool = True  # to the dictionary, the table or the part names
    part: bool = False  # whether a part of the asset is called so
    tag: str = ""
    dep: str = ""
    note: str = ""


@dataclass
class Lexed:
    """Lexemes of a text and what was mended on the way."""

    lexemes: list[Lexeme]
    notes: list[str]
