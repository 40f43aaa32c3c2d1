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
    names: Phrase = ()  # those words of a row's phrase that a part is called too
    tag: str = ""
    dep: str = ""
    note: str = ""

    @property
    def is_name(self) -> bool:
        """Whether it may be a name that no dictionary has, by its place alone."""
        return self.role == "word" and self.tag in ("NN", "NNP", "FW", "XX", "UH")

    @property
    def is_code(self) -> bool:
        """Whether it is strange, or a number that measures nothing: "xq", "QT-500"."""
        return not self.part and (not self.known or self.role in ("digits", "told"))

    @property
    def is_measure(self) -> bool:
        """Whether it is a bare number that counts nothing: "0.33"."""
        return self.role == "digits" and not self.part and not self.text.isdigit()


@dataclass
class Lexed:
    """Lexemes of a text and what was mended on the way."""

    lexemes: list[Lexeme]
    notes: list[str]
