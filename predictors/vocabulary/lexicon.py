"""What the reader knows: roles of words, rows of a table by all their names, names of parts."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from ...fem.scene.materials import Material, MaterialTable, load_contents
from .model import LanguageModel, load_model

DATA = Path(__file__).parent / "data"
ATOM = re.compile(
    r"n['’]t\b|['’](?:s|re|ve|ll|d|m)\b|[^\W\d_]+?(?=n['’]t\b)|[^\W\d_]+|\d+(?:[.,]\d+)*|\n|->|=>|\S"
)
NEAREST = 3  # rows that are named beside an unknown material
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
def designations() -> Mapping[str, Any]:
    """Names of standards and of trade: ``data/designations.toml``."""
    return tomllib.loads((DATA / "designations.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=1)
def part_words() -> Mapping[str, Any]:
    """Synonyms and opposites of part names: ``data/parts.toml``."""
    return tomllib.loads((DATA / "parts.toml").read_text(encoding="utf-8"))


def atoms(text: str, model: LanguageModel, known: Collection[str] = ()) -> list[Atom]:
    """Cut a text into words, numbers and signs; a plural is of a ``known`` word if it may be."""
    return [
        Atom(m[0], m.start(), m.end(), model.singular(m[0].lower(), known))
        for m in ATOM.finditer(text.replace("’", "'"))
    ]


class ReaderLexicon:
    """Phrases of a table and of the language, by their first word."""

    def __init__(self, table: MaterialTable, model: LanguageModel) -> None:
        self.table, self.model = table, model
        self.rows: dict[Phrase, Material] = {}
        self._acronyms: set[Phrase] = set()
        self._row_words: dict[str, set[str]] = {}  # of the rows that were asked for
        self.listed: set[Phrase] = set()  # with a comma in them: "oak, willow"
        for row in table:
            # A name may carry what tells it from its kin: "oak, willow (along grain)".
            for name in (re.sub(r"\s*\(.*?\)", "", row.name), row.name, *row.aliases):
                self._add(name, row)

        for means, names in designations()["trade"].items():
            if row := self.rows.get(self.phrase(means)):
                self.rows = {**{self.phrase(name): row for name in names}, **self.rows}

    def _add(self, name: str, row: Material) -> None:
        phrase = self.phrase(name)
        if not phrase or "(contents)" in name:
            return
        self.rows.setdefault(phrase, row)
        if "," in name:
            self.listed.add(phrase)
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
        if more or phrase not in self._acronyms:
            return False
        spoken = re.search(r"[aeiouy]", word) is not None  # WordNet has "pvc" too
        return len(word) <= 2 or (spoken and self.model.is_word(word))

    @cached_property
    def contents(self) -> dict[Phrase, str]:
        """Phrase -> row of what fills a thing: "coffee", "books"."""
        return {self.phrase(name): row.name for name, row in load_contents().phrases.items()}

    def contents_called(self, said: Sequence[str]) -> str | None:
        """Row of the loose matter or liquid that the last words of ``said`` name."""
        tails = (tuple(said[i:]) for i in range(len(said)))
        return next((self.contents[tail] for tail in tails if tail in self.contents), None)

    @cached_property
    def firsts(self) -> dict[str, list[str]]:
        """Second word of a row of two -> the first words of such rows."""
        found: dict[str, list[str]] = {}
        for phrase in self.rows:
            if len(phrase) == 2 and len(phrase[0]) > SHORT and phrase[0].isalpha():
                found.setdefault(phrase[1], []).append(phrase[0])
        return found

    @cached_property
    def turned(self) -> dict[Phrase, Material]:
        """Rows of two words that are materials each, the second first: "plywood birch"."""
        return {
            phrase[::-1]: row for phrase, row in self.rows.items()
            if len(phrase) == 2 and all((word,) in self.rows for word in phrase)
        }  # fmt: skip

    def nearest(self, word: str) -> Phrase:
        """Names of the rows that are written most like a word."""
        from rapidfuzz.process import extract

        names = {" ".join(phrase): row.name for phrase, row in self.rows.items()} if word else {}
        near = extract(word.lower(), list(names), limit=2 * NEAREST)
        return tuple(dict.fromkeys(names[name] for name, *_ in near))[:NEAREST]

    def meant(self, word: str) -> Phrase:
        """The row's name that a strange word is at most one letter off from, where it is one."""
        from rapidfuzz.distance import OSA

        names = (p for p in self.rows if len(p) == 1 and len(p[0]) > SHORT and p[0].isalpha())
        off = {p: OSA.distance(word, p[0], score_cutoff=1) for p in names if p[0][0] == word[:1]}
        near = [p for p, distance in off.items() if distance <= 1]
        return near[0] if len({self.rows[p].name for p in near}) == 1 else ()

    def row_words(self, row: Material) -> set[str]:
        """All words by which a row is called."""
        if row.name not in self._row_words:
            names = (row.name, *row.aliases)
            self._row_words[row.name] = {word for name in names for word in self.phrase(name)}
        return self._row_words[row.name]

    def repeats(self, row: Material, said: Phrase, other: Material) -> bool:
        """Whether what was ``said`` of a row only names the other's family: "St37 steel"."""
        if {*said} < self.row_words(other):
            return True  # "6061-T6 aluminium"
        generic = said[-1] in self.kinds or "(generic)" in row.name
        kin = row.category.split()[-1] == other.category.split()[-1]
        laminate = other.category == "composite" and row.category in ("plastic", "wood")
        return row is other or (generic and kin) or laminate

    def family(self, row: Material, said: str) -> list[str]:
        """Names of a row and of its kin that bear the words said for it too: kinds of "glass"."""
        same = (other for other in self.table if other.category == row.category)
        kin = [other.name for other in same if {*self.phrase(said)} <= self.row_words(other)]
        return [row.name, *(name for name in kin if name != row.name)]

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
        parts = (w for group in [*part_words()["synonyms"], part_words()["objects"]] for w in group)
        said = (p for p, m in self.meanings.items() if m.role in _SPELT)
        known = (w for phrase in [*self.rows, *said] for w in phrase)
        return {w: w for w in [*parts, *known] if w.isalpha() and len(w) > SHORT}

    @cached_property
    def designations(self) -> list[tuple[re.Pattern, Material]]:
        """Patterns of standards, each with the first of its rows that the table has."""
        found = []
        for entry in designations()["designation"]:
            row = self.first_row(entry["rows"])
            if row:
                found.append(
                    (
                        re.compile(rf"(?<![\w.-])(?:{entry['pattern']})(?:\+[A-Z]{{1,3}})?(?!\w)"),
                        row,
                    )
                )
        return found


_KEPT: dict[int, ReaderLexicon] = {}


def lexicon_of(table: MaterialTable) -> ReaderLexicon:
    """Return the lexicon of a table, made once."""
    if id(table) not in _KEPT:
        _KEPT[id(table)] = ReaderLexicon(table, load_model())  # which keeps the table, and its id
    return _KEPT[id(table)]


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


@lru_cache(maxsize=1)
def places() -> frozenset[str]:
    """Words that say where a part is: left, rear, upper, second."""
    data = part_words()
    return frozenset(w for group in data["places"] for w in group) | set(data["same"])


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
