"""The words of the material table, found in sentences and in the names of an asset's parts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

from ...fem.scene.materials import MaterialTable
from . import words

TOKEN = re.compile(r"[^\W_]+|[.;,&+=:\n]")
_IRREGULAR = {"leaves": "leaf", "feet": "foot", "shelves": "shelf", "knives": "knife"}


def stem(word: str) -> str:
    """Return the singular, lower-case form of an English word."""
    word = word.lower()
    if word in _IRREGULAR:
        return _IRREGULAR[word]
    if len(word) > 4 and word.endswith("ies"):
        return word[:-3] + "y"
    if len(word) > 4 and word.endswith(("ches", "shes", "sses", "xes")):
        return word[:-2]
    if len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is")):
        return word[:-1]
    return word


def name_words(name: str) -> list[str]:
    """Stems of the words in a part, node or material name: camelCase, digits and _ divide them."""
    spaced = re.sub(r"(?<=[^\W\d_A-Z])(?=[A-Z])", " ", name)
    return [stem(word) for word in re.findall(r"[^\W\d_]+", spaced)]


class Vocabulary:
    """The material phrases to look for; the longest match wins."""

    def __init__(self, phrases: Iterable[str]) -> None:
        self._phrase: dict[tuple[str, ...], str] = {}
        for phrase in phrases:  # of singular and plural, the first
            self._phrase.setdefault(tuple(map(stem, TOKEN.findall(phrase.lower()))), phrase)
        self._foreign = {stem(word): name for word, name in words.FOREIGN.items()}
        self._longest = max(map(len, self._phrase), default=0)

    def match(self, stems: Sequence[str], at: int) -> tuple[str, int] | None:
        """Longest phrase that starts at ``stems[at]``, and its number of tokens."""
        for length in range(min(self._longest, len(stems) - at), 0, -1):
            phrase = self._phrase.get(tuple(stems[at : at + length]))
            if phrase is not None:
                return phrase, length
        return None

    def in_name(self, name: str) -> str | None:
        """The longest material phrase in an asset's name ("Metal_Chrome", "legno_scuro")."""
        stems = name_words(name)
        found = [match for at in range(len(stems)) if (match := self.match(stems, at))]
        if found:
            # "Wood_Oak" is oak: of equals, the word that is no family's.
            return max(found, key=lambda match: (match[1], match[0] not in words.FAMILIES))[0]
        return next((self._foreign[word] for word in stems if word in self._foreign), None)


@lru_cache(maxsize=4)
def vocabulary_of(table: MaterialTable) -> Vocabulary:
    """Return the phrases of a table."""
    return Vocabulary(table.phrases)
